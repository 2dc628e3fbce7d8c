"""loss: frames are lost at random."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.gate.choice import CHOICE_PARAMS, Choice, choice_misfits, choice_of
from pnfarm.faults.gate.frame_words import FRAMES_PARAM, classes_of
from pnfarm.faults.kind import EVERY_DIRECTION, FRAMES, InjectionKind

if TYPE_CHECKING:
    from pnfarm.faults.gate.gate import FrameClasses

__all__ = ["KIND"]


class Loss(FramesEffect):
    """All frames, or those of one class."""

    def acts_on(self) -> tuple[int | None, FrameClasses | None]:
        cyclic, acyclic = classes_of(self.values["frames"])
        return self.cyclic if cyclic else None, acyclic

    def choice(self) -> Choice:
        return choice_of(self.spec)


KIND = InjectionKind(
    "loss",
    "frames",
    "Frames are lost at random: independently, in bursts, or by a Gilbert-Elliott model.",
    "a frame that is lost; `count` holds for each direction",
    Loss,
    {"frames": FRAMES_PARAM, **CHOICE_PARAMS},
    directions=EVERY_DIRECTION,
    takes=FRAMES,
    wire="Frames are missing; the others are unchanged, with the cycle counters of their own cycles.",
    reports="Cyclic frames: nothing below the watchdog, then IO device failure (S7-1500; CODESYS assumed). Acyclic "
    "ones are repeated.",
    misfits=choice_misfits,
    place=10,
)
