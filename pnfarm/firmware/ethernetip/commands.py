"""Input: the loaded command (AKD EtherNet/IP manual 6.2.2, 6.2.4), motion tasks and moves by attribute.

A command is taken over with the rising edge of Load/Start.  Then Load Complete is set, or an error: a general status of
CIP and an additional code.  Codes by case are those of the position controller device profile, as far as the manual
names them; which one a case has is assumed where the manual gives only the list (6.2.3.5).
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.ethernetip.control_word import DIRECTION, LOAD, RELATIVE, START_BLOCK
from pnfarm.firmware.ethernetip.message_types import (
    ACCELERATION,
    AXIS,
    DECELERATION,
    JOG_MOVE,
    NO_AXIS,
    NO_COMMAND_TYPE,
    NO_RESPONSE_AXIS,
    NOT_READY,
    OUT_OF_RANGE,
    PARAMETER,
    POSITION_MOVE,
    SET_ATTRIBUTE,
    TARGET_POSITION,
    TARGET_VELOCITY,
    TORQUE,
    WRONG_MODE,
)
from pnfarm.firmware.ethernetip.octets import received, received_long, received_octet
from pnfarm.firmware.ethernetip.tasks import TASK_ATTRIBUTE, TASK_MOVE, TASK_PARAMETER, idle, post
from pnfarm.firmware.faults import raise_fault
from pnfarm.firmware.motion.motion_tasks import select_task
from pnfarm.firmware.motion.positioning import BRAKING, HOMING, OUT, asked_target
from pnfarm.firmware.motion.travel import at_limit_switch, within_limits
from pnfarm.table.axis_codes import JOG_NONE, TASK_MDI
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["TORQUE_FULL", "forget_commands", "take_commands", "target_velocity"]

#: Peak torque in attribute 0x19 (7.1).
TORQUE_FULL = 3280.0
# ``drive.opmode``.
TORQUE_MODE = 0
VELOCITY_MODE = 1
POSITION_MODE = 2
# ``ethernetip.loading``.
NOTHING = 0
ANSWER = 1  # its task is posted
TURN = 2  # its task waits for another one


@inlined
def target_velocity(axis: Any) -> float:
    """Attribute 7 in rpm; before one was set, HOME.V, as attributes 8 and 9 are HOME.ACC and HOME.DEC (assumed)."""
    units = int(axis.ethernetip.velocity_units)
    return units * axis.ethernetip.settings.profile_step if units > 0 else axis.homing.settings.velocity


@inlined
def _barred(axis: Any, mode: int) -> int:
    """Why no motion of this mode can begin, 0 for nothing."""
    if axis.drive.settings.opmode != mode:
        return WRONG_MODE
    if axis.drive.state != 4 or axis.faults.code[0] != 0 or axis.drive.settings.setpoint_ignored:
        return NOT_READY
    return WRONG_MODE if axis.orders.halt else 0


@inlined
def _homed(axis: Any, now: int) -> bool:
    """Whether the axis may move in position mode; one that is not homed gets its fault (6.2.2)."""
    if axis.homing.homed or not axis.homing.settings.required:
        return True
    raise_fault(axis.faults, axis.ethernetip.settings.unhomed_fault, now)
    return False


@compiled
def _ask(axis: Any, velocity: float, up: float, down: float) -> None:
    """A motion with the controller's own data begins in this step."""
    asked = axis.asked
    asked.number = TASK_MDI
    asked.velocity = velocity
    asked.acceleration = up
    asked.deceleration = down
    asked.endless = 0
    asked.still = 0
    asked.relative = 0
    asked.backwards = 0
    asked.counts_from = asked.settings.relative_base
    asked.begins = 1


@compiled
def _move(axis: Any, now: int, units: int, relative: bool, velocity: float, up: float, down: float) -> int:
    """Begin a move to a target or by a distance; 0 or an error."""
    error = _barred(axis, POSITION_MODE)
    if error != 0:
        return error
    if axis.positioning.state in (OUT, HOMING, BRAKING):
        return NOT_READY
    if velocity <= 0.0 or up <= 0.0 or down <= 0.0:
        return OUT_OF_RANGE
    if not _homed(axis, now):
        return 0
    _ask(axis, velocity, up, down)
    axis.asked.position = units * axis.travel.settings.position_step
    axis.asked.relative = 1 if relative else 0
    target = asked_target(axis)
    error = 0 if within_limits(axis.travel, axis.homing, target) else OUT_OF_RANGE
    if error == 0 and at_limit_switch(axis.machine, target - axis.profile.position):
        error = NOT_READY
    if error != 0:
        axis.asked.begins = 0
        return error
    axis.ethernetip.target_units = units
    axis.ethernetip.move = 1
    return 0


@compiled
def _jog(axis: Any, now: int, velocity: float, up: float, down: float, word: int) -> int:
    """Begin a jog, or change the running motion into one; 0 or an error."""
    mode = int(axis.drive.settings.opmode)
    error = _barred(axis, VELOCITY_MODE if mode == TORQUE_MODE else mode)
    if error != 0:
        return error
    own = axis.ethernetip
    forwards = word & DIRECTION != 0
    if mode == VELOCITY_MODE:
        own.up = up
        own.down = down
        own.speed_command = velocity if forwards else -velocity
        return 0
    if axis.positioning.state in (OUT, HOMING, BRAKING):
        return NOT_READY
    if not _homed(axis, now):
        return 0
    if velocity > 0.0 and at_limit_switch(axis.machine, 1.0 if forwards else -1.0):
        return NOT_READY
    _ask(axis, velocity, up, down)
    axis.asked.endless = 1
    axis.asked.still = 1
    axis.asked.backwards = 0 if forwards else 1
    return 0


@inlined
def _torque(axis: Any, torque: float) -> int:
    """A torque set point, N m; 0 or an error."""
    error = _barred(axis, TORQUE_MODE)
    if error != 0:
        return error
    peak = axis.motor.settings.torque_constant * axis.motor.settings.peak_current
    if abs(torque) > peak:
        return OUT_OF_RANGE
    axis.ethernetip.torque_command = torque
    return 0


@inlined
def _load_one(axis: Any, command: int, data: int, word: int, now: int) -> int:
    """Types 1 to 5: one datum in octets 4 to 7, which begins a motion if the mode is its own (6.2.2.2)."""
    own = axis.ethernetip
    step = own.settings.profile_step
    mode = int(axis.drive.settings.opmode)
    if command == TORQUE:
        return _torque(axis, data * 0.001 * axis.motor.settings.torque_constant)
    if command == TARGET_POSITION:
        own.target_units = data
        if mode != POSITION_MODE:
            return 0
        up = axis.homing.settings.acceleration
        down = axis.homing.settings.deceleration
        return _move(
            axis,
            now,
            data,
            word & RELATIVE != 0,
            target_velocity(axis),
            own.up if own.up > 0.0 else up,
            own.down if own.down > 0.0 else down,
        )
    if data < 0 or (data == 0 and command != TARGET_VELOCITY):
        return OUT_OF_RANGE
    if command == ACCELERATION:
        own.up = data * step
    elif command == DECELERATION:
        own.down = data * step
    else:
        own.velocity_units = data
        if mode == VELOCITY_MODE:
            return _jog(axis, now, data * step, own.up, own.down, word)
    return 0


@inlined
def _load(axis: Any, image: Any, word: int, now: int) -> int:
    """Take over the command; 0 or an error."""
    own = axis.ethernetip
    second = received_octet(image, 2)
    if second >> 5 != AXIS:
        return NO_AXIS
    if received_octet(image, 3) >> 5 != AXIS:
        return NO_RESPONSE_AXIS
    command = second & 0x1F
    if word & START_BLOCK:
        # one of the two begins at a time (6.2.2.2)
        return WRONG_MODE
    if TARGET_POSITION <= command <= TORQUE:
        return _load_one(axis, command, received(image, 4), word, now)
    step = own.settings.profile_step
    if command in (POSITION_MOVE, JOG_MOVE):
        velocity = received(image, 12)
        up = received(image, 16)
        down = received(image, 20)
        if velocity < 0 or up <= 0 or down <= 0:
            return OUT_OF_RANGE
        if command == JOG_MOVE:
            return _jog(axis, now, velocity * step, up * step, down * step, word)
        return _move(axis, now, received(image, 8), word & RELATIVE != 0, velocity * step, up * step, down * step)
    if command in (SET_ATTRIBUTE, PARAMETER):
        own.loading = TURN
        own.load_kind = TASK_ATTRIBUTE if command == SET_ATTRIBUTE else TASK_PARAMETER
        own.load_number = received(image, 4) & 0xFFFF
        own.load_write = 1 if command == SET_ATTRIBUTE or received_octet(image, 6) == 1 else 0
        own.load_value = received_long(image, 24)
        own.read = 0
        return 0
    return NO_COMMAND_TYPE


@inlined
def _await(own: Any, image: Any) -> None:
    """The answer to a command that the event loop carries out."""
    if own.loading == TURN and idle(image):
        own.loading = ANSWER
        post(own, image, int(own.load_kind), int(own.load_number), int(own.load_write), int(own.load_value))
    elif own.loading == ANSWER and idle(image):
        own.loading = NOTHING
        own.error = own.settings.answer_status
        if own.error == 0:
            own.loaded = 1
            own.read = 1 if own.load_kind == TASK_PARAMETER and not own.load_write else 0
            own.read_value = image.parameter_answer


@compiled
def _block(axis: Any, number: int, now: int) -> None:
    """Start a motion task of the drive."""
    if not _homed(axis, now):
        return
    _ask(axis, 0.0, 0.0, 0.0)
    select_task(axis.asked, axis.motion_tasks, number)


@inlined
def _by_attribute(axis: Any, now: int) -> None:
    """What attributes 6, 7, 10, 11 and 25 of the position controller ask for."""
    own = axis.ethernetip
    if own.targets_seen != own.settings.targets_set:
        own.targets_seen = own.settings.targets_set
        own.target_units = own.settings.target
        own.velocity_units = own.settings.velocity
    if own.starts_seen == own.settings.starts:
        return
    own.starts_seen = own.settings.starts
    mode = int(axis.drive.settings.opmode)
    if mode == POSITION_MODE:
        _move(
            axis,
            now,
            int(own.target_units),
            own.settings.incremental != 0,
            target_velocity(axis),
            axis.homing.settings.acceleration,
            axis.homing.settings.deceleration,
        )
    elif mode == VELOCITY_MODE:
        # the attribute has no direction: forwards (assumed)
        _jog(axis, now, own.velocity_units * own.settings.profile_step, 0.0, 0.0, DIRECTION)
    else:
        peak = axis.motor.settings.torque_constant * axis.motor.settings.peak_current
        _torque(axis, own.settings.torque / TORQUE_FULL * peak)


@compiled
def _prepare(axis: Any) -> None:
    """What holds unless this step says otherwise."""
    axis.asked.begins = 0
    axis.asked.mdi = 1
    axis.asked.feed_free = 0
    axis.asked.renewed = 0
    axis.asked.override = axis.ramp.settings.speed_override
    axis.jog.asked = JOG_NONE
    if axis.positioning.state != HOMING:
        axis.homing.method_in_force = axis.homing.settings.method
        axis.homing.distance_in_force = axis.homing.settings.distance
    axis.homing.brought = 0
    for direction in range(2):
        axis.torque.shares_in_force[direction] = axis.torque.settings.shares[direction]


@compiled
def _drop(axis: Any) -> None:
    """Set points end with operation, the mode, or a stop, until new commands bring others; ramps end with the mode."""
    own = axis.ethernetip
    changed = own.mode != axis.drive.settings.opmode
    own.mode = axis.drive.settings.opmode
    if changed or axis.drive.state != 4 or axis.orders.halt:
        own.speed_command = 0.0
        own.torque_command = 0.0
    if changed:
        own.up = 0.0
        own.down = 0.0


@inlined
def _set_points(axis: Any) -> None:
    own = axis.ethernetip
    axis.ramp.up = own.up if own.up > 0.0 else axis.ramp.settings.acceleration
    axis.ramp.down = own.down if own.down > 0.0 else axis.ramp.settings.deceleration
    axis.ramp.setpoint = own.speed_command * axis.ramp.settings.speed_override
    axis.torque.setpoint = own.torque_command
    if axis.drive.settings.setpoint_ignored:
        axis.ramp.setpoint = 0.0
        axis.torque.setpoint = axis.torque.settings.command if axis.drive.settings.setpoint_ignored == 1 else 0.0


@inlined
def take_commands(axis: Any, image: Any, word: int, now: int) -> None:
    """Once in each step, after the control word."""
    own = axis.ethernetip
    _prepare(axis)
    _drop(axis)
    _by_attribute(axis, now)
    if not word & LOAD:
        own.loaded = 0
        own.error = 0
        own.loading = NOTHING
    elif not own.word & LOAD:
        own.error = _load(axis, image, word, now)
        own.loaded = 1 if own.error == 0 and own.loading == NOTHING else 0
    if own.loading != NOTHING:
        _await(own, image)
    if own.error != 0 and own.echo == 0:
        own.echo = received_octet(image, 2) | received_octet(image, 3) << 8
    elif own.error == 0:
        own.echo = 0
    if word & START_BLOCK and not own.word & (START_BLOCK | LOAD) and not word & LOAD:
        if _barred(axis, POSITION_MODE) == 0:
            _block(axis, received_octet(image, 1), now)
    elif axis.commands.task != 0 and not axis.asked.begins:
        _block(axis, int(axis.commands.task) - 1, now)
    axis.commands.task = 0
    _set_points(axis)
    if own.move and own.loading != TURN and idle(image):
        own.move = 0
        post(own, image, TASK_MOVE, 0, 1, 0)
    own.word = word


@inlined
def forget_commands(own: Any) -> None:
    """The drive was switched on."""
    own.loaded = 0
    own.error = 0
    own.echo = 0
    own.loading = NOTHING
    own.read = 0
    own.move = 0
    own.posted = 0
    own.speed_command = 0.0
    own.torque_command = 0.0
    own.up = 0.0
    own.down = 0.0
    own.target_units = 0
    own.velocity_units = 0
    own.map_seen = 0
    own.targets_seen = own.settings.targets_set
    own.starts_seen = own.settings.starts
