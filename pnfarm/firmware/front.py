"""The front of an axis, which translates the words of its bus.  It is chosen here only, by ``front`` of the axis.

A front has three functions: resetting its state when the drive is switched on, input (the controller's words become
orders, set points and tasks of the axis: :mod:`pnfarm.firmware.records.orders`, ``ramp``, ``torque``, ``asked``), and
output (state and measured values become words).
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.profidrive import front as profidrive
from pnfarm.table.axis_codes import FIRMWARE_PROFIDRIVE
from pnfarm.table.compiled import compiled

__all__ = ["show_state", "take_orders"]


@compiled
def take_orders(axis: Any, image: Any, now: int, switched_on: bool) -> None:
    """Input, before the drive acts; ``switched_on``: the drive was switched on since the last step."""
    if axis.front == FIRMWARE_PROFIDRIVE:
        if switched_on:
            profidrive.forget_words(axis)
        profidrive.take_words(axis, image, now)


@compiled
def show_state(axis: Any, image: Any) -> None:
    """Output, after motor and load."""
    if axis.front == FIRMWARE_PROFIDRIVE:
        profidrive.show_words(axis, image)
