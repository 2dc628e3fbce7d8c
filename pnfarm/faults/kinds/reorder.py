"""reorder: frames arrive behind later ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.shaped import MOST_NS, ShapedEffect
from pnfarm.faults.gate.frame_words import FRAMES_PARAM
from pnfarm.faults.gate.shaping import Shape
from pnfarm.faults.kind import EVERY_DIRECTION, FRAMES, InjectionKind, ParamSpec
from pnfarm.table.impairment import REORDER
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.wire.direction import Direction

__all__ = ["KINDS"]


class Reorder(ShapedEffect):
    """Cyclic frames by the engine, acyclic ones by the gate."""

    cyclic: ClassVar[int | None] = REORDER
    no_streams = "a stream's octets keep their order: TCP puts them in order"

    def settings(self, direction: Direction) -> Mapping[str, float]:
        del direction
        return {"amount": self.values["distance"]}

    def shape(self, seed: int) -> Shape:
        return Shape(seed, delay_ns=self.values["wait"], overtakes=True)


def _check(spec: InjectionFields) -> Iterable[tuple[str, Problem]]:
    try:
        wait = spec.values()["wait"]
    except Problem:
        return
    if not 0 < wait <= MOST_NS:
        yield "params.wait", Problem("is out of range", "a duration above 0 and of at most 10s")


KINDS = (
    InjectionKind(
        "reorder",
        "frames",
        "Frames arrive after later ones: a cyclic one half a cycle after the `distance`-th frame that "
        "follows, an acyclic one after `wait`.",
        "a frame that is held back",
        Reorder,
        {
            "frames": FRAMES_PARAM,
            "distance": ParamSpec("whole number", "Cyclic frames that overtake.", default=1, low=1, high=1000),
            "wait": ParamSpec("duration", "Time for which an acyclic frame is held back, up to 10 s.", default="20ms"),
        },
        directions=EVERY_DIRECTION,
        takes=FRAMES,
        wire="Cyclic frames with an older cycle counter after newer ones.",
        reports="A cyclic frame that was overtaken is discarded for its cycle counter: as one that is lost.",
        misfits=_check,
        place=40,
    ),
)
