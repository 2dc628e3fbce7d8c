"""Faults of the drive: raised by commands or by the firmware itself, acknowledged, kept.

AKD PROFINET manual 5.14: a fault situation has up to eight faults; acknowledging moves it down by eight
places in the fault buffer (PNU 947) and every new situation counts PNU 944 up.  A drive with other numbers of places
(Moog MSD manual 10.9: one fault, twenty situations) says so in ``faults.places``, and in ``faults.stays`` that its
latest situation has the first places until another one begins.
"""

from __future__ import annotations

from math import floor, inf
from typing import Any

from pnfarm.firmware.causes import NUMBER_MASK, ignored
from pnfarm.firmware.supply import mains
from pnfarm.table.axis_codes import (
    CMD_ACKNOWLEDGE,
    CMD_CLEAR_HISTORY,
    CMD_CLEAR_WARNING,
    CMD_CONTINUE,
    CMD_DISABLE,
    CMD_HOLD_FAULT,
    CMD_HOME,
    CMD_POWER_ON,
    CMD_RAISE_FAULT,
    CMD_RAISE_WARNING,
    CMD_RELEASE_FAULT,
    CMD_SERVICE,
    CMD_SET_POSITION,
    CMD_START_TASK,
    CMD_STOP,
    COMMANDS,
    FAULT_SITUATIONS,
    FAULT_SLOTS,
    STOP_DROP,
    WARNING_SLOTS,
)
from pnfarm.table.compiled import compiled

__all__ = ["acknowledge", "raise_fault", "take_commands"]


@compiled
def _places(axis: Any) -> int:
    """Faults of one situation in the fault buffer."""
    return int(axis.faults.settings.places) or FAULT_SLOTS


@compiled
def _situations(axis: Any) -> int:
    """How many situations the fault buffer holds."""
    count = 0
    for i in range(0, FAULT_SLOTS * FAULT_SITUATIONS, _places(axis)):
        if axis.faults.buffer[i] != 0:
            count += 1
    return count


@compiled
def _changed(axis: Any) -> None:
    axis.faults.changes = (int(axis.faults.changes) + 1) & 0xFFFF


@compiled
def _move_down(axis: Any) -> None:
    """Every situation moves down by its places, the first ones are free."""
    places = _places(axis)
    for i in range(FAULT_SLOTS * FAULT_SITUATIONS - 1, places - 1, -1):
        axis.faults.buffer[i] = axis.faults.buffer[i - places]
    for i in range(places):
        axis.faults.buffer[i] = 0


@compiled
def raise_fault(axis: Any, code: int, now: int) -> None:
    """Add ``code`` (number | reaction << 24) to the active situation; twice the same is once, an ignored one none."""
    number = code & NUMBER_MASK
    if number == 0 or ignored(axis, number):
        return
    for i in range(FAULT_SLOTS):
        present = axis.faults.code[i]
        if (present & NUMBER_MASK) == number:
            return
        if present == 0:
            if i == 0:
                axis.faults.counter = (axis.faults.counter + 1) & 0xFFFF
                axis.faults.since_ns = now
                axis.faults.reacted = 0
                if axis.faults.settings.stays and axis.faults.buffer[0] != 0:
                    _move_down(axis)
            axis.faults.code[i] = code
            if i < _places(axis):
                axis.faults.buffer[i] = number
            _changed(axis)
            return


@compiled
def _hold(axis: Any, code: int) -> None:
    free = -1
    for i in range(FAULT_SLOTS):
        if (axis.faults.held[i] & NUMBER_MASK) == (code & NUMBER_MASK):
            return
        if axis.faults.held[i] == 0 and free < 0:
            free = i
    if free >= 0:
        axis.faults.held[free] = code


@compiled
def _release(axis: Any, number: int) -> None:
    for i in range(FAULT_SLOTS):
        if (axis.faults.held[i] & NUMBER_MASK) == number:
            axis.faults.held[i] = 0


@compiled
def _raise_held(axis: Any, now: int) -> None:
    """Causes that are there are faults, also when the drive was off or ignored them."""
    for i in range(FAULT_SLOTS):
        if axis.faults.held[i] != 0:
            raise_fault(axis, int(axis.faults.held[i]), now)


@compiled
def _into_history(axis: Any) -> None:
    """The active situation becomes the newest acknowledged one."""
    if not axis.faults.settings.stays:
        _move_down(axis)
    axis.faults.ends = (int(axis.faults.ends) + 1) & 0xFFFF
    for i in range(FAULT_SLOTS):
        axis.faults.code[i] = 0
    axis.faults.since_ns = 0
    _changed(axis)


@compiled
def _clear_history(axis: Any) -> None:
    """Forget what was acknowledged; a situation that is still active stays, as the only one."""
    active = axis.faults.code[0] != 0
    forgotten = False
    for i in range(_places(axis) if active else 0, FAULT_SLOTS * FAULT_SITUATIONS):
        forgotten = forgotten or axis.faults.buffer[i] != 0
        axis.faults.buffer[i] = 0
    axis.faults.counter = 1 if active else 0
    axis.faults.kept = 0
    if forgotten:
        _changed(axis)


@compiled
def acknowledge(axis: Any) -> bool:
    """Clear the situation unless a cause is still there; true when it was cleared."""
    axis.positioning.error = 0
    if axis.faults.code[0] == 0:
        return False
    for i in range(FAULT_SLOTS):
        if axis.faults.held[i] != 0 and not ignored(axis, int(axis.faults.held[i])):
            return False
    _into_history(axis)
    return True


@compiled
def _clear_warning(axis: Any, number: int) -> None:
    kept = 0
    for i in range(WARNING_SLOTS):
        raised = axis.warnings.raised[i]
        axis.warnings.raised[i] = 0
        if raised != number:
            axis.warnings.raised[kept] = raised
            kept += 1


@compiled
def _raise_warning(axis: Any, number: int) -> None:
    """The newest of those raised; where no place is left, the oldest goes."""
    _clear_warning(axis, number)
    for i in range(WARNING_SLOTS - 1, 0, -1):
        axis.warnings.raised[i] = axis.warnings.raised[i - 1]
    axis.warnings.raised[0] = number


@compiled
def _count_from_here(axis: Any) -> None:
    """What an encoder that is not absolute over all revolutions counts when it is switched on (PROFIdrive 4.2, 6.3.6).

    One that knows its angle counts on from that, an incremental one from 0; positions count as it does.
    """
    known = axis.sensor.settings.revolutions
    if known == inf or axis.homing.settings.stays:
        return
    if known > 0.0:
        axis.sensor.zero = floor(axis.motor.position / known) * known
    else:
        axis.sensor.zero = axis.motor.position
    axis.homing.origin = axis.sensor.zero


@compiled
def _power_on(axis: Any, now: int) -> None:
    axis.drive.state = 0
    axis.drive.stop = 0
    axis.boot_ns = now
    axis.ramp.setpoint = 0.0
    axis.ramp.command = axis.motor.velocity
    axis.motor.speed_integral = 0.0
    axis.brake.asked = 0
    axis.brake.open = 0
    axis.brake.left = 0.0
    axis.supply.voltage = max(float(axis.supply.voltage), mains(axis))
    axis.foldback.used[:] = 0.0
    axis.positioning.following_error = 0.0
    axis.profile.velocity = 0.0
    axis.positioning.state = 0
    axis.positioning.home_before = 0
    axis.positioning.free_before = 0
    axis.positioning.acknowledged = 0
    if not axis.homing.settings.stays:
        axis.homing.homed = 0
    axis.ramp.generator_left = 0
    _count_from_here(axis)
    axis.positioning.target_reached = 0
    axis.commands.task = 0
    axis.asked.renewed = 0
    axis.commands.home = 0
    axis.positioning.over_ns = 0
    axis.ramp.jogging = 0
    axis.homing.seen = 0
    axis.homing.error = 0
    axis.positioning.error = 0
    axis.commands.disable = 0
    axis.commands.stop = 0
    axis.commands.resume = 0
    axis.service.leg = 0
    axis.commands.service = 0
    axis.warnings.code = 0
    axis.warnings.raised[:] = 0
    axis.warnings.active[:] = 0
    # an active situation becomes history, as if it had been acknowledged; held causes come back at once
    if axis.faults.code[0] != 0:
        _into_history(axis)
    if axis.faults.settings.history_lost:
        axis.faults.buffer[:] = 0
    axis.faults.counter = 0
    axis.faults.kept = _situations(axis)
    axis.faults.changes = 0


@compiled
def _take_motion_command(axis: Any, code: int, argument: int) -> None:
    """What parameters start and end; the step of this moment carries it out."""
    if code == CMD_SET_POSITION:
        axis.homing.origin = axis.motor.position - argument / 1e6
        axis.homing.homed = 1
        axis.homing.error = 0
        axis.commands.stop = STOP_DROP
    elif code == CMD_START_TASK:
        axis.commands.task = (argument & 0x7FFF) + 1
    elif code == CMD_HOME:
        axis.commands.home = 1
    elif code == CMD_DISABLE:
        axis.commands.disable = 1
    elif code == CMD_STOP:
        axis.commands.stop = argument & 0xFF
    elif code == CMD_CONTINUE:
        axis.commands.resume = 1
    elif code == CMD_SERVICE:
        axis.commands.service = 1


@compiled
def take_commands(axis: Any, now: int) -> bool:
    """Carry out what the event loop wrote into the command ring since the last step; true when it switched on."""
    switched_on = False
    while axis.commands.tail != axis.commands.settings.head:
        entry = axis.commands.settings.ring[axis.commands.tail % COMMANDS]
        code = entry & 0xFF
        argument = entry >> 8
        if code == CMD_RAISE_FAULT:
            raise_fault(axis, argument, now)
        elif code == CMD_HOLD_FAULT:
            _hold(axis, argument)
            raise_fault(axis, argument, now)
        elif code == CMD_RELEASE_FAULT:
            _release(axis, argument & NUMBER_MASK)
        elif code == CMD_ACKNOWLEDGE:
            acknowledge(axis)
        elif code == CMD_POWER_ON:
            _power_on(axis, now)
            switched_on = True
        elif code == CMD_RAISE_WARNING:
            _raise_warning(axis, argument & NUMBER_MASK)
        elif code == CMD_CLEAR_HISTORY:
            _clear_history(axis)
        elif code == CMD_CLEAR_WARNING:
            _clear_warning(axis, argument & NUMBER_MASK)
        else:
            _take_motion_command(axis, code, argument)
        axis.commands.tail = (axis.commands.tail + 1) & 0xFFFFFFFF
    _raise_held(axis, now)
    return switched_on
