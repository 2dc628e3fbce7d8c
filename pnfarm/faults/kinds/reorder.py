"""reorder: frames arrive after later ones."""

from __future__ import annotations

from typing import ClassVar

from pnfarm.faults.effects.shaped import MOST_NS, ShapedEffect
from pnfarm.faults.gate.frame_words import FRAMES_PARAM
from pnfarm.faults.gate.shaping import Shape
from pnfarm.faults.kind import EVERY_DIRECTION, FRAMES, InjectionKind, ParamSpec
from pnfarm.table.impairment import REORDER

__all__ = ["KIND"]


class Reorder(ShapedEffect):
    """Held back until later ones have passed."""

    cyclic = REORDER
    no_streams = "a stream's octets keep their order: TCP puts them in order"
    row: ClassVar = {"amount": "distance"}

    def shape(self, seed: int) -> Shape:
        return Shape(seed, delay_ns=self.values["wait"], overtakes=True)


KIND = InjectionKind(
    "reorder",
    "frames",
    "Frames arrive after later ones: a cyclic one half a cycle after the `distance`-th frame that follows, an "
    "acyclic one after `wait`.",
    "a frame that is held back",
    Reorder,
    {
        "frames": FRAMES_PARAM,
        "distance": ParamSpec("whole number", "Cyclic frames that overtake.", default=1, low=1, high=1000),
        "wait": ParamSpec(
            "duration", "Time for which an acyclic frame is held back.", default="20ms", low=1, high=MOST_NS
        ),
    },
    directions=EVERY_DIRECTION,
    takes=FRAMES,
    wire="Cyclic frames with an older cycle counter after newer ones.",
    reports="A cyclic frame that was overtaken is discarded for its cycle counter: as one that is lost.",
    place=40,
)
