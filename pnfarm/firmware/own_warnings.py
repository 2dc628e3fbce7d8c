"""Warnings that the drive shows by itself, beside those that are raised by command.

The motor's heat, I2t (HIWIN E1 manual 3.16, MELDW.7), foldback and DC link (AKD parameter reference, IL.FOLDWTHRESH,
VBUS.UVWTHRESH, VBUS.OVWTHRESH), limit switches, software limits that the axis reached (AKD PROFINET manual 5.8.1 and
5.6, SWLS.STATE), and tasks that could not begin (AKD parameter reference, DRV.MOTIONSTAT).  A warning that was raised
by command stays in front.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.position_status import limits_reached
from pnfarm.table.compiled import compiled

__all__ = ["watch_warnings"]


@compiled
def _bus(axis: Any) -> int:
    """The warning of the DC link, 0 for none."""
    if 0.0 < axis.bus_voltage < axis.bus_levels[0]:
        return int(axis.bus_warning[0])
    if 0.0 < axis.bus_levels[1] < axis.bus_voltage:
        return int(axis.bus_warning[1])
    return 0


@compiled
def _own(axis: Any) -> int:
    """The warning that the drive has to tell of, 0 for none."""
    if axis.thermal_warning > 0.0 and axis.thermal_load > axis.thermal_warning:
        return int(axis.message_warnings[1])
    for i in range(2):
        if axis.foldback_limit[i] < axis.foldback_warning_level:
            return int(axis.foldback_warning[i])
    bus = _bus(axis)
    if bus != 0:
        return bus
    for i in range(2):
        if axis.limit_switch >> i & 1 and axis.switch_warnings[i] != 0:
            return int(axis.switch_warnings[i])
    if axis.opmode == 2 and (axis.limit_warning[0] != 0 or axis.limit_warning[1] != 0):
        reached = limits_reached(axis)
        for i in range(2):
            if reached >> i & 1:
                return int(axis.limit_warning[i])
    return int(axis.task_warning[axis.task_error - 1]) if axis.task_error else 0


@compiled
def watch_warnings(axis: Any) -> None:
    """Show the drive's own warning while it stands, unless a command raised another one."""
    own = _own(axis)
    if not axis.warning_code or axis.warning_code == axis.own_warning:
        axis.warning_code = own
    axis.own_warning = own
