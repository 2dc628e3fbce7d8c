"""The front of an axis, which translates the words of its bus.  It is chosen here only, by ``front`` of the axis.

A front has three functions: resetting its state when the drive is switched on, input (the controller's words become
orders, set points and tasks of the axis: :mod:`pnfarm.firmware.records.orders`, ``ramp``, ``torque``, ``asked``), and
output (state and measured values become words).  It may also tell the event loop of a task that it cannot do itself.

The other end speaks the same words: the program of an axis in the built-in controller is chosen here, too.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.ethernetip import axis_program as ethernetip_program
from pnfarm.firmware.ethernetip import front as ethernetip
from pnfarm.firmware.ethernetip.tasks import tells as tells_task
from pnfarm.firmware.profidrive import axis_program as profidrive_program
from pnfarm.firmware.profidrive import front as profidrive
from pnfarm.firmware.profidrive.parameter_words import exchange
from pnfarm.table.axis_codes import FIRMWARE_ETHERNETIP, FIRMWARE_PROFIDRIVE
from pnfarm.table.compiling.compiled import inlined

__all__ = ["has_parameter_channel", "show_state", "step_program", "take_orders", "tells"]


@inlined
def take_orders(axis: Any, image: Any, now: int, switched_on: bool) -> None:
    """Input, before the drive acts; ``switched_on``: the drive was switched on since the last step."""
    if axis.front == FIRMWARE_PROFIDRIVE:
        if switched_on:
            profidrive.forget_words(axis, image)
        profidrive.take_words(axis, image, now)
    elif axis.front == FIRMWARE_ETHERNETIP:
        if switched_on:
            ethernetip.forget_assembly(axis)
        ethernetip.take_assembly(axis, image, now)


@inlined
def show_state(axis: Any, image: Any) -> None:
    """Output, after motor and load."""
    if axis.front == FIRMWARE_PROFIDRIVE:
        profidrive.show_words(axis, image)
    elif axis.front == FIRMWARE_ETHERNETIP:
        ethernetip.show_assembly(axis, image)


@inlined
def has_parameter_channel(axis: Any) -> bool:
    """Whether :func:`tells` may ever be true."""
    return bool(axis.front == FIRMWARE_ETHERNETIP or axis.profidrive.settings.parameter_channel != 0)


@inlined
def tells(axis: Any, image: Any, now: int) -> bool:
    """Whether ``image.parameter_task``, which the event loop is to carry out, is to be reported now."""
    if axis.front == FIRMWARE_ETHERNETIP:
        return tells_task(axis.ethernetip, image, now)
    return axis.profidrive.settings.parameter_channel != 0 and exchange(image, now)


@inlined
def step_program(program: Any, image: Any, now: int) -> None:
    """One step of a controller's program: the drive's status in, control word and set points out."""
    if program.front == FIRMWARE_ETHERNETIP:
        ethernetip_program.step_program(program, image, now)
    else:
        profidrive_program.step_program(program, image, now)
