"""Warnings that the drive shows by itself, beside those that are raised by command.

The motor's heat (I2t; HIWIN E1 manual 3.16, MELDW.7), and software limits (AKD PROFINET manual 5.10.1: ZSW1.7).  One
that was raised by command stays in front.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.position_status import limits_reached
from pnfarm.table.compiled import compiled

__all__ = ["watch_warnings"]


@compiled
def _watch_heat(axis: Any) -> None:
    """Show the model's I2t warning as long as the motor is hotter than its threshold."""
    number = axis.message_warnings[1]
    if number == 0 or axis.thermal_warning <= 0.0:
        return
    if axis.thermal_load > axis.thermal_warning:
        if axis.warning_code == 0:
            axis.warning_code = number
            axis.warns_itself = 1
    elif axis.warns_itself:
        axis.warns_itself = 0
        if axis.warning_code == number:
            axis.warning_code = 0


@compiled
def _watch_limits(axis: Any) -> None:
    """A software limit that is reached is a warning of the drive's own, until it is left."""
    if axis.limit_warning[0] == 0 and axis.limit_warning[1] == 0:
        return
    reached = limits_reached(axis) if axis.opmode == 2 else 0
    changed = reached ^ int(axis.limits_seen)
    for i in range(2):
        if not changed >> i & 1:
            continue
        if reached >> i & 1:
            if axis.warning_code == 0:
                axis.warning_code = axis.limit_warning[i]
        elif axis.warning_code == axis.limit_warning[i]:
            axis.warning_code = 0
    axis.limits_seen = reached


@compiled
def watch_warnings(axis: Any) -> None:
    """Show and take away what the drive warns of by itself."""
    _watch_heat(axis)
    _watch_limits(axis)
