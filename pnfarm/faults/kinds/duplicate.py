"""duplicate: frames arrive more than once."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.shaped import ShapedEffect
from pnfarm.faults.gate.frame_words import FRAMES_PARAM
from pnfarm.faults.gate.shaping import Shape
from pnfarm.faults.kind import EVERY_DIRECTION, FRAMES, InjectionKind, ParamSpec
from pnfarm.table.impairment import DUPLICATE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.wire.direction import Direction

__all__ = ["KINDS"]


class Duplicate(ShapedEffect):
    """Cyclic frames by the engine, acyclic ones by the gate."""

    cyclic: ClassVar[int | None] = DUPLICATE
    no_streams = "a stream never delivers an octet twice: TCP discards repeated ones"

    def settings(self, direction: Direction) -> Mapping[str, float]:
        del direction
        return {"amount": self.values["copies"]}

    def shape(self, seed: int) -> Shape:
        return Shape(seed, copies=self.values["copies"])


KINDS = (
    InjectionKind(
        "duplicate",
        "frames",
        "Frames arrive more than once, one after the other.",
        "a frame that is repeated",
        Duplicate,
        {
            "frames": FRAMES_PARAM,
            "copies": ParamSpec("whole number", "Copies after the frame.", default=1, low=1, high=8),
        },
        directions=EVERY_DIRECTION,
        takes=FRAMES,
        wire="The same octets again at once, with the same cycle counter.",
        reports=(
            "Nothing: a cyclic copy is discarded for its cycle counter, a repeated request of RPC is answered again."
        ),
        place=30,
    ),
)
