"""Faults of the drive: raised by commands or by the firmware itself, acknowledged, stored.

AKD PROFINET manual 5.14: a fault situation has up to eight faults; acknowledging moves it down by eight
places in the fault buffer (PNU 947), and every new situation increments PNU 944.  ``faults.places`` is set for a drive
with another number of places (Moog MSD manual 10.9: one fault, twenty situations); ``faults.stays`` where the latest
situation keeps the first places until another one begins.
"""

from __future__ import annotations

from math import floor, inf
from typing import Any

from pnfarm.firmware.causes import ignored
from pnfarm.firmware.motor.supply import mains
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
    NUMBER_MASK,
    STOP_DROP,
    WARNING_SLOTS,
)
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["acknowledge", "raise_fault", "take_commands"]


@compiled
def _places(faults: Any) -> int:
    """Faults of one situation in the fault buffer."""
    return int(faults.settings.places) or FAULT_SLOTS


@inlined
def _situations(faults: Any) -> int:
    """Number of situations that the fault buffer holds."""
    count = 0
    for i in range(0, FAULT_SLOTS * FAULT_SITUATIONS, _places(faults)):
        if faults.buffer[i] != 0:
            count += 1
    return count


@inlined
def _changed(faults: Any) -> None:
    faults.changes = (int(faults.changes) + 1) & 0xFFFF


@inlined
def _move_down(faults: Any) -> None:
    """Move every situation down by its places, which frees the first ones."""
    places = _places(faults)
    for i in range(FAULT_SLOTS * FAULT_SITUATIONS - 1, places - 1, -1):
        faults.buffer[i] = faults.buffer[i - places]
    for i in range(places):
        faults.buffer[i] = 0


@compiled
def raise_fault(faults: Any, code: int, now: int) -> None:
    """Add ``code`` (number | reaction << 24) to the active situation, unless it is there already or is ignored."""
    number = code & NUMBER_MASK
    if number == 0 or ignored(faults, number):
        return
    for i in range(FAULT_SLOTS):
        present = faults.code[i]
        if (present & NUMBER_MASK) == number:
            return
        if present == 0:
            if i == 0:
                faults.counter = (faults.counter + 1) & 0xFFFF
                faults.since_ns = now
                faults.reacted = 0
                if faults.settings.stays and faults.buffer[0] != 0:
                    _move_down(faults)
            faults.code[i] = code
            if i < _places(faults):
                faults.buffer[i] = number
            _changed(faults)
            return


@inlined
def _hold(faults: Any, code: int) -> None:
    free = -1
    for i in range(FAULT_SLOTS):
        if (faults.held[i] & NUMBER_MASK) == (code & NUMBER_MASK):
            return
        if faults.held[i] == 0 and free < 0:
            free = i
    if free >= 0:
        faults.held[free] = code
        faults.causes += 1


@inlined
def _release(faults: Any, number: int) -> None:
    for i in range(FAULT_SLOTS):
        if faults.held[i] != 0 and (faults.held[i] & NUMBER_MASK) == number:
            faults.held[i] = 0
            faults.causes -= 1


@inlined
def _raise_held(faults: Any, now: int) -> None:
    """Raise the fault of each cause that is present, also if it began while the drive was off or ignored it."""
    if faults.causes == 0:
        return
    for i in range(FAULT_SLOTS):
        if faults.held[i] != 0:
            raise_fault(faults, int(faults.held[i]), now)


@inlined
def _into_history(faults: Any) -> None:
    """Turn the active situation into the newest acknowledged one."""
    if not faults.settings.stays:
        _move_down(faults)
    faults.ends = (int(faults.ends) + 1) & 0xFFFF
    for i in range(FAULT_SLOTS):
        faults.code[i] = 0
    faults.since_ns = 0
    _changed(faults)


@inlined
def _clear_history(faults: Any) -> None:
    """Clear the acknowledged situations; one that is still active stays, as the only one."""
    active = faults.code[0] != 0
    forgotten = False
    for i in range(_places(faults) if active else 0, FAULT_SLOTS * FAULT_SITUATIONS):
        forgotten = forgotten or faults.buffer[i] != 0
        faults.buffer[i] = 0
    faults.counter = 1 if active else 0
    faults.kept = 0
    if forgotten:
        _changed(faults)


@inlined
def _refuses(faults: Any, positioning: Any, begins: bool) -> bool:
    """Whether an injection has the drive ignore this request; each is counted once, however long it lasts."""
    if begins:
        faults.refusing = 0
    if faults.refused < faults.settings.refuse_until and not faults.refusing:
        if faults.code[0] == 0 and positioning.error == 0:
            # there is nothing to acknowledge
            return False
        faults.refused += 1
        faults.refusing = 1
    return faults.refusing != 0


@compiled
def acknowledge(faults: Any, positioning: Any, begins: bool) -> bool:
    """Clear the situation unless a cause is still present; true when it was cleared.

    ``begins``: the request is new, not one that lasts.
    """
    if _refuses(faults, positioning, begins):
        return False
    positioning.error = 0
    if faults.code[0] == 0:
        return False
    for i in range(FAULT_SLOTS):
        if faults.held[i] != 0 and not ignored(faults, int(faults.held[i])):
            return False
    _into_history(faults)
    return True


@inlined
def _clear_warning(warnings: Any, number: int) -> None:
    kept = 0
    for i in range(WARNING_SLOTS):
        raised = warnings.raised[i]
        warnings.raised[i] = 0
        if raised != number:
            warnings.raised[kept] = raised
            kept += 1


@inlined
def _raise_warning(warnings: Any, number: int) -> None:
    """Add it as the newest raised warning; where no place is left, the oldest is dropped."""
    _clear_warning(warnings, number)
    for i in range(WARNING_SLOTS - 1, 0, -1):
        warnings.raised[i] = warnings.raised[i - 1]
    warnings.raised[0] = number


@inlined
def _begin_count(motor: Any, sensor: Any) -> bool:
    """Count of an encoder at power-on, unless it is absolute over all revolutions (PROFIdrive 4.2, 6.3.6).

    A singleturn encoder starts from its angle, an incremental one from 0.
    """
    known = sensor.settings.revolutions
    if known == inf:
        return False
    sensor.zero = floor(motor.position / known) * known if known > 0.0 else motor.position
    return True


@inlined
def _count_from_here(motor: Any, homing: Any, sensor: Any, sensor_2: Any) -> None:
    """The encoders' counts at power-on; positions count from where encoder 1 does."""
    if homing.settings.stays:
        return
    _begin_count(motor, sensor_2)
    if _begin_count(motor, sensor):
        homing.origin = sensor.zero


@inlined
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
    axis.supply.voltage = max(float(axis.supply.voltage), mains(axis.drive, axis.faults, axis.supply))
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
    _count_from_here(axis.motor, axis.homing, axis.sensor, axis.sensor_2)
    axis.positioning.target_reached = 0
    axis.positioning.task = 0
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
    # an active situation becomes history, as if acknowledged; faults whose causes remain come back at once
    if axis.faults.code[0] != 0:
        _into_history(axis.faults)
    if axis.faults.settings.history_lost:
        axis.faults.buffer[:] = 0
    axis.faults.counter = 0
    axis.faults.kept = _situations(axis.faults)
    axis.faults.changes = 0
    axis.faults.refusing = 0


@inlined
def _take_motion_command(commands: Any, motor: Any, homing: Any, code: int, argument: int) -> None:
    """Motion that parameters start and end; the current step carries it out."""
    if code == CMD_SET_POSITION:
        homing.origin = motor.position - homing.settings.position
        homing.homed = 1
        homing.error = 0
        commands.stop = STOP_DROP
    elif code == CMD_START_TASK:
        commands.task = (argument & 0x7FFF) + 1
    elif code == CMD_HOME:
        commands.home = 1
    elif code == CMD_DISABLE:
        commands.disable = 1
    elif code == CMD_STOP:
        commands.stop = argument & 0xFF
    elif code == CMD_CONTINUE:
        commands.resume = 1
    elif code == CMD_SERVICE:
        commands.service = 1


@inlined
def take_commands(axis: Any, now: int) -> bool:
    """Carry out the commands that the event loop wrote since the last step; true when one of them was power-on."""
    switched_on = False
    while axis.commands.tail != axis.commands.settings.head:
        entry = axis.commands.settings.ring[axis.commands.tail % COMMANDS]
        code = entry & 0xFF
        argument = entry >> 8
        if code == CMD_RAISE_FAULT:
            raise_fault(axis.faults, argument, now)
        elif code == CMD_HOLD_FAULT:
            _hold(axis.faults, argument)
            raise_fault(axis.faults, argument, now)
        elif code == CMD_RELEASE_FAULT:
            _release(axis.faults, argument & NUMBER_MASK)
        elif code == CMD_ACKNOWLEDGE:
            acknowledge(axis.faults, axis.positioning, True)
            axis.faults.asked_ns = now
        elif code == CMD_POWER_ON:
            _power_on(axis, now)
            switched_on = True
        elif code == CMD_RAISE_WARNING:
            _raise_warning(axis.warnings, argument & NUMBER_MASK)
        elif code == CMD_CLEAR_HISTORY:
            _clear_history(axis.faults)
        elif code == CMD_CLEAR_WARNING:
            _clear_warning(axis.warnings, argument & NUMBER_MASK)
        else:
            _take_motion_command(axis.commands, axis.motor, axis.homing, code, argument)
        axis.commands.tail = (axis.commands.tail + 1) & 0xFFFFFFFF
    _raise_held(axis.faults, now)
    return switched_on
