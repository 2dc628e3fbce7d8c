"""The active warnings of a drive: those raised by command, and those that it raises itself.

Its own are the motor's heat, I2t (HIWIN E1 manual 3.16, MELDW.7), foldback and DC link (AKD parameter reference,
IL.FOLDWTHRESH, VBUS.UVWTHRESH, VBUS.OVWTHRESH), limit switches, software limits that the axis reached (AKD PROFINET
manual 5.8.1 and 5.6, SWLS.STATE), and tasks that could not begin (AKD parameter reference, DRV.MOTIONSTAT).  Several
are active at a time (AKD PROFINET manual 5.6, DRV.WARNING1 to 3; HIWIN E1 manual 3.16, two bits of MELDW); those raised
by command come first, the newest in front.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.motion.travel import limits_reached
from pnfarm.firmware.motor.supply import bus_below
from pnfarm.table.axis_codes import WARNING_SLOTS
from pnfarm.table.compiling.compiled import inlined

__all__ = ["warned", "watch_warnings"]


@inlined
def warned(warnings: Any, number: int) -> bool:
    """Whether this warning is active."""
    at = 0
    while at < WARNING_SLOTS and warnings.active[at] != number:
        at += 1
    return number != 0 and at < WARNING_SLOTS


@inlined
def _append(warnings: Any, count: int, number: int) -> int:
    """Append a warning to the first ``count``, unless it is among them; returns the new count."""
    if number == 0 or count == WARNING_SLOTS:
        return count
    for i in range(count):
        if warnings.active[i] == number:
            return count
    warnings.active[count] = number
    return count + 1


@inlined
def _append_own(axis: Any, count: int) -> int:
    """Append the drive's own warnings to the first ``count``; returns the new count."""
    if axis.warnings.settings.thermal_level > 0.0 and axis.motor.thermal_load > axis.warnings.settings.thermal_level:
        count = _append(axis.warnings, count, int(axis.warnings.settings.thermal[1]))
    for i in range(2):
        if axis.foldback.limit[i] < axis.foldback.settings.warning_level:
            count = _append(axis.warnings, count, int(axis.foldback.settings.warning[i]))
    if bus_below(axis.drive, axis.faults, axis.supply, axis.supply.settings.levels[0]):
        count = _append(axis.warnings, count, int(axis.supply.settings.warning[0]))
    elif 0.0 < axis.supply.settings.levels[1] < axis.supply.voltage:
        count = _append(axis.warnings, count, int(axis.supply.settings.warning[1]))
    for i in range(2):
        if axis.machine.limit_switch >> i & 1:
            count = _append(axis.warnings, count, int(axis.warnings.settings.switch[i]))
    if axis.drive.settings.opmode == 2 and (
        axis.warnings.settings.limit[0] != 0 or axis.warnings.settings.limit[1] != 0
    ):
        reached = limits_reached(axis)
        for i in range(2):
            if reached >> i & 1:
                count = _append(axis.warnings, count, int(axis.warnings.settings.limit[i]))
    return (
        _append(axis.warnings, count, int(axis.warnings.settings.task[axis.positioning.error - 1]))
        if axis.positioning.error
        else count
    )


@inlined
def watch_warnings(axis: Any) -> None:
    """Collect the warnings of this step."""
    count = 0
    while count < WARNING_SLOTS and axis.warnings.raised[count] != 0:
        axis.warnings.active[count] = axis.warnings.raised[count]
        count += 1
    count = _append_own(axis, count)
    while count < WARNING_SLOTS and axis.warnings.active[count] != 0:
        axis.warnings.active[count] = 0
        count += 1
    axis.warnings.code = axis.warnings.active[0]
