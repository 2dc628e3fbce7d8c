"""Which front leads an axis: the words of its bus, in and out.  Here alone it is chosen, by ``front`` of the axis.

A front has three functions: what it forgets when the drive is switched on, its way in (the controller's words become
orders, set points and tasks of the axis: :mod:`pnfarm.firmware.records.orders`, ``ramp``, ``torque``, ``asked``), and
its way out (state and measured values become words).
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.profidrive import front as profidrive
from pnfarm.table.axis_codes import FIRMWARE_PROFIDRIVE
from pnfarm.table.compiled import compiled

__all__ = ["show_state", "take_orders"]


@compiled
def take_orders(axis: Any, image: Any, now: int, switched_on: bool) -> None:
    """The way in, before the drive acts; ``switched_on``: the drive was, since the last step."""
    if axis.front == FIRMWARE_PROFIDRIVE:
        if switched_on:
            profidrive.forget_words(axis)
        profidrive.take_words(axis, image, now)


@compiled
def show_state(axis: Any, image: Any) -> None:
    """The way out, behind motor and load."""
    if axis.front == FIRMWARE_PROFIDRIVE:
        profidrive.show_words(axis, image)
