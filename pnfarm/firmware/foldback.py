"""Foldback: current limits that fall while more than the continuous current flows (AKD parameter reference, IL.IFOLD).

Two of them run at once, that of the motor (0) and that of the drive (1); the lower one counts.  Each is an artificial
current m, which may be above the peak current::

    dm/dt = (I_continuous - |i|) / T,    m <= I_peak + D (I_peak - I_continuous) / T

With the current at its limit the peak is there for D and then falls to the continuous current with the time constant T;
no current for (D + T) (I_peak / I_continuous - 1) gives all of that back.  The reference says so much of both; the
equation is assumed, as the simplest one that does it.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.faults import raise_fault
from pnfarm.table.compiled import compiled

__all__ = ["folds", "step_foldback", "watch_foldback"]


@compiled
def folds(motor: Any, foldback: Any) -> bool:
    """Whether the drive folds back; one whose motor stays cool does not."""
    return (
        foldback.settings.time[0] > 0.0
        and motor.settings.continuous_current > 0.0
        and motor.settings.thermal_time > 0.0
    )


@compiled
def step_foldback(motor: Any, foldback: Any, seconds: float) -> None:
    """Advance both limits by ``seconds`` of the current that flows."""
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
    """Raise the fault of motor or drive while its limit is below the level, which is the peak current at most."""
    level = min(motor.settings.peak_current, foldback.settings.fault_level)
    if foldback.limit[0] < level:
        raise_fault(faults, motor.settings.overload_fault, now)
    if foldback.limit[1] < level:
        raise_fault(faults, foldback.settings.drive_fault, now)
