"""late-frames: the drive sends late."""

from __future__ import annotations

from typing import ClassVar

from pnfarm.faults.effects.frames import FramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind, ParamSpec
from pnfarm.table.impairment import LATE

__all__ = ["KIND"]


class LateFrames(FramesEffect):
    """What is due in the meantime is left out."""

    cyclic = LATE
    acyclic = None
    row: ClassVar = {"delay_ns": "by"}


KIND = InjectionKind(
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
)
