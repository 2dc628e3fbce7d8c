"""cycle-counter-freeze: the cycle counter does not change."""

from __future__ import annotations

from pnfarm.buses.profinet.faults.frames import ProfinetFramesEffect
from pnfarm.faults.kind import FRAMES, InjectionKind
from pnfarm.table.impairment import COUNTER_FREEZE

__all__ = ["KIND"]


class CounterFreeze(ProfinetFramesEffect):
    """At the count of the first frame that was hit."""

    cyclic = COUNTER_FREEZE


KIND = InjectionKind(
    "cycle-counter-freeze",
    "cyclic",
    "The cycle counter freezes, so that controllers take the frames for old ones and discard them; the watchdog "
    "expires.",
    "a cyclic frame whose counter is frozen",
    CounterFreeze,
    directions=("out",),
    takes=FRAMES,
    wire="Frames in their cycle with new data and the cycle counter of the first frame that is hit.",
    reports="S7-1500: IO device failure (station failure) when the watchdog expires. CODESYS: the device goes to its "
    "error state, with the connection's watchdog as the cause (assumed).",
    place=60,
)
