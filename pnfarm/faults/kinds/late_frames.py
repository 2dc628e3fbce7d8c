"""late-frames: the drive sends late."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind, ParamSpec
from pnfarm.table.impairment import LATE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.faults.gate.gate import FrameClasses
    from pnfarm.wire.direction import Direction

__all__ = ["KINDS"]


class LateFrames(FramesEffect):
    """What is due in the meantime is left out."""

    cyclic: ClassVar[int | None] = LATE
    acyclic: ClassVar[FrameClasses | None] = None

    def settings(self, direction: Direction) -> Mapping[str, float]:
        del direction
        return {"delay_ns": self.values["by"]}


KINDS = (
    InjectionKind(
        "late-frames",
        "cyclic",
        "The drive sends its cyclic frame late, as one that is too busy: what is due in the meantime is not sent.",
        "a cyclic frame that is late",
        LateFrames,
        {"by": ParamSpec("duration", "How late.", default="2ms")},
        directions=("out",),
        takes=FRAMES,
        wire="An interval longer by `by`; the late frame has the data and the cycle counter of its own cycle.",
        reports="Nothing below the watchdog time; beyond it IO device failure (S7-1500); CODESYS the same (assumed).",
        place=95,
    ),
)
