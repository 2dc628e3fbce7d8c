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
from pnfarm.table.compiled import compiled

__all__ = ["folds", "step_foldback", "watch_foldback"]


@compiled
def folds(motor: Any, foldback: Any) -> bool:
    """Whether the drive folds back; it does not with a motor that is modelled as always cool."""
    return (
        foldback.settings.time[0] > 0.0
        and motor.settings.continuous_current > 0.0
        and motor.settings.thermal_time > 0.0
    )


@compiled
def step_foldback(motor: Any, foldback: Any, seconds: float) -> None:
    """Advance both limits by ``seconds`` at the present current."""
    if not folds(motor, foldback):
        return
    above = motor.settings.peak_current - motor.settings.continuous_current
    change = (abs(motor.current) - motor.settings.continuous_current) * seconds
    for i in range(2):
        time = foldback.settings.time[i]
        foldback.used[i] = max(0.0, foldback.used[i] + change / time)
        foldback.limit[i] = motor.settings.peak_current + foldback.settings.delay[i] * above / time - foldback.used[i]
    foldback.current = min(foldback.limit[0], foldback.limit[1])


@compiled
def watch_foldback(faults: Any, motor: Any, foldback: Any, now: int) -> None:
    """Raise the fault of motor or drive while its limit is below the fault level, at most the peak current."""
    level = min(motor.settings.peak_current, foldback.settings.fault_level)
    if foldback.limit[0] < level:
        raise_fault(faults, motor.settings.overload_fault, now)
    if foldback.limit[1] < level:
        raise_fault(faults, foldback.settings.drive_fault, now)
