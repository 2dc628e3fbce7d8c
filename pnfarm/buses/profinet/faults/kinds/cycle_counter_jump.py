"""cycle-counter-jump: the cycle counter is off."""

from __future__ import annotations

from typing import ClassVar

from pnfarm.buses.profinet.faults.frames import ProfinetFramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind, ParamSpec
from pnfarm.table.impairment import COUNTER_JUMP

__all__ = ["KIND"]


class CounterJump(ProfinetFramesEffect):
    """By a constant number of steps."""

    cyclic = COUNTER_JUMP
    row: ClassVar = {"amount": "by"}


KIND = InjectionKind(
    "cycle-counter-jump",
    "cyclic",
    "The cycle counter is off by `by`. Without `count` it jumps at the start and back at the end; with `count: 1` a "
    "single frame is off. A controller discards a frame whose counter is up to 4096 behind the last one.",
    "a cyclic frame whose counter is off",
    CounterJump,
    {"by": ParamSpec("whole number", "Steps of 31.25 us.", default=-1024, low=-65535, high=65535)},
    directions=("out",),
    takes=FRAMES,
    wire="The cycle counter differs from the true one by `by` steps of 31.25 us, modulo 65536.",
    reports="Forward jumps of up to 61440: nothing. After a jump back, frames are discarded until the counter has "
    "caught up: device failure when that takes longer than the watchdog (S7-1500, CODESYS assumed).",
    place=70,
)
