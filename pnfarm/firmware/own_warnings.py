"""The warnings that a drive has at hand: those that were raised by command, and those that it shows by itself.

Its own are the motor's heat, I2t (HIWIN E1 manual 3.16, MELDW.7), foldback and DC link (AKD parameter reference,
IL.FOLDWTHRESH, VBUS.UVWTHRESH, VBUS.OVWTHRESH), limit switches, software limits that the axis reached (AKD PROFINET
manual 5.8.1 and 5.6, SWLS.STATE), and tasks that could not begin (AKD parameter reference, DRV.MOTIONSTAT).  Several
stand at a time (AKD PROFINET manual 5.6, DRV.WARNING1 to 3; HIWIN E1 manual 3.16, two bits of MELDW); what was raised
by command stays in front, the newest first.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.position_status import limits_reached
from pnfarm.firmware.supply import bus_below
from pnfarm.table.axis import WARNING_SLOTS
from pnfarm.table.compiled import compiled

__all__ = ["warned", "watch_warnings"]


@compiled
def warned(axis: Any, number: int) -> bool:
    """Whether this warning is at hand."""
    at = 0
    while at < WARNING_SLOTS and axis.warnings[at] != number:
        at += 1
    return number != 0 and at < WARNING_SLOTS


@compiled
def _tell(axis: Any, count: int, number: int) -> int:
    """One more behind the first ``count`` warnings, unless it is among them; how many there are now."""
    if number == 0 or count == WARNING_SLOTS:
        return count
    for i in range(count):
        if axis.warnings[i] == number:
            return count
    axis.warnings[count] = number
    return count + 1


@compiled
def _tell_own(axis: Any, told: int) -> int:
    """Put what the drive itself has to tell of behind the first ``told`` warnings; how many there are now."""
    count = told
    if axis.thermal_warning > 0.0 and axis.thermal_load > axis.thermal_warning:
        count = _tell(axis, count, int(axis.message_warnings[1]))
    for i in range(2):
        if axis.foldback_limit[i] < axis.foldback_warning_level:
            count = _tell(axis, count, int(axis.foldback_warning[i]))
    if bus_below(axis, axis.bus_levels[0]):
        count = _tell(axis, count, int(axis.bus_warning[0]))
    elif 0.0 < axis.bus_levels[1] < axis.bus_voltage:
        count = _tell(axis, count, int(axis.bus_warning[1]))
    for i in range(2):
        if axis.limit_switch >> i & 1:
            count = _tell(axis, count, int(axis.switch_warnings[i]))
    if axis.opmode == 2 and (axis.limit_warning[0] != 0 or axis.limit_warning[1] != 0):
        reached = limits_reached(axis)
        for i in range(2):
            if reached >> i & 1:
                count = _tell(axis, count, int(axis.limit_warning[i]))
    return _tell(axis, count, int(axis.task_warning[axis.task_error - 1])) if axis.task_error else count


@compiled
def watch_warnings(axis: Any) -> None:
    """Put together what the drive warns of in this step."""
    count = 0
    while count < WARNING_SLOTS and axis.warning_raised[count] != 0:
        axis.warnings[count] = axis.warning_raised[count]
        count += 1
    count = _tell_own(axis, count)
    while count < WARNING_SLOTS and axis.warnings[count] != 0:
        axis.warnings[count] = 0
        count += 1
    axis.warning_code = axis.warnings[0]
