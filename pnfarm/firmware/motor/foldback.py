"""Foldback: current limits that fall while more than the continuous current flows (AKD parameter reference, IL.IFOLD).

Two of them run at once, that of the motor (0) and that of the drive (1); the lower one counts.  Each is an artificial
current m, which may be above the peak current::

    dm/dt = (I_continuous - |i|) / T,    m <= I_peak + D (I_peak - I_continuous) / T

With the current at its limit the peak current is available for D, then the limit falls to the continuous current with
the time constant T; without current, all of it recovers in (D + T) (I_peak / I_continuous - 1).  The reference states
these two times; the equation is assumed, as the simplest one that has them.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.faults import raise_fault
from pnfarm.table.compiling.compiled import inlined

__all__ = ["foldback_constants", "folds", "step_limit", "watch_foldback"]


@inlined
def folds(motor: Any, foldback: Any) -> bool:
    """Whether the drive folds back; it does not with a motor that is modelled as always cool."""
    return (
        foldback.settings.time[0] > 0.0
        and motor.settings.continuous_current > 0.0
        and motor.settings.thermal_time > 0.0
    )


@inlined
def foldback_constants(motor: Any, foldback: Any, number: int, seconds: float) -> tuple[float, float]:
    """Of limit ``number``: initial value, A, and its fall in ``seconds`` per A above the continuous current."""
    above = motor.settings.peak_current - motor.settings.continuous_current
    per_time = 1.0 / foldback.settings.time[number]
    return motor.settings.peak_current + foldback.settings.delay[number] * above * per_time, seconds * per_time


@inlined
def step_limit(foldback: Any, number: int, initial: float, change: float) -> None:
    """Lower limit ``number`` by ``change``, A."""
    foldback.used[number] = max(0.0, foldback.used[number] + change)
    foldback.limit[number] = initial - foldback.used[number]


@inlined
def watch_foldback(faults: Any, motor: Any, foldback: Any, now: int) -> None:
    """Raise the fault of motor or drive while its limit is below the fault level, at most the peak current."""
    level = min(motor.settings.peak_current, foldback.settings.fault_level)
    if foldback.limit[0] < level:
        raise_fault(faults, motor.settings.overload_fault, now)
    if foldback.limit[1] < level:
        raise_fault(faults, foldback.settings.drive_fault, now)
