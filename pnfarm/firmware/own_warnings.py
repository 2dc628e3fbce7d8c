"""Warnings that the drive shows by itself, beside those that are raised by command: the motor's heat (I2t).

HIWIN E1 manual 3.16, MELDW.7.  A warning that was raised by command stays in front.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiled import compiled

__all__ = ["watch_warnings"]


@compiled
def watch_warnings(axis: Any) -> None:
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
