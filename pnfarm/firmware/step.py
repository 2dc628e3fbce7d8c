"""One step of a PROFIdrive axis: control word, faults, state machine, ramp, motor, status word."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.direction import take_direction
from pnfarm.firmware.faults import acknowledge, raise_fault, take_commands
from pnfarm.firmware.hindrances import take_hindrances, with_hindrances
from pnfarm.firmware.interpolation import take_cyclic
from pnfarm.firmware.jog import take_jog, take_jog_bits
from pnfarm.firmware.machine import take_switches
from pnfarm.firmware.measurement import measure, measured_velocity
from pnfarm.firmware.motor import brake_holds, motor_step_ns, step_motor, watch_motor
from pnfarm.firmware.own_warnings import watch_warnings
from pnfarm.firmware.positioning import take_motion
from pnfarm.firmware.profidrive.position_status import position_bits
from pnfarm.firmware.profidrive.sensor_interface import step_sensor
from pnfarm.firmware.profidrive.sign_of_life import check_life
from pnfarm.firmware.profidrive.status_forms import control_requested, moog_word, speed_reached, take_generator
from pnfarm.firmware.profidrive.tasks import take_task
from pnfarm.firmware.profidrive.telegram import from_setpoints, no_setpoints, to_actuals
from pnfarm.firmware.ramp import velocity_command
from pnfarm.firmware.service_motion import step_service
from pnfarm.firmware.state_machine import advance, conditions
from pnfarm.firmware.torque_limits import take_torque_limits
from pnfarm.table.axis_codes import CONTROL_BY_PLC, DISABLE_AT_ONCE, FAULT_SLOTS, REACTION_QUICK_STOP, STATUS_MOOG
from pnfarm.table.axis_readings import (
    SETPOINTS_HELD,
    SETPOINTS_NONE,
    SETPOINTS_TAKEN,
    SPEED_BIT_ZERO,
    SPEED_ERROR_OF_RAMP,
    SPEED_REACHED_OR_EXCEEDED,
    SPEED_REACHED_WINDOW,
    WITHOUT_CONTROL_HOLD,
    WITHOUT_CONTROL_TAKEN,
    WITHOUT_RUN_HOLD,
    WITHOUT_RUN_OFF,
)
from pnfarm.table.compiled import compiled, compiled_apart
from pnfarm.table.image import LOST_EXPIRED, LOST_STOP
from pnfarm.table.signals import STW1

__all__ = ["step"]


ON = 0x0001
FAULT_ACKNOWLEDGE = 0x0080
#: What a step covers at most, ns: the loop may have been held up.
LONGEST_NS = 1_000_000_000


@compiled
def _speed_bits(axis: Any) -> int:
    """Bits 8 and 10 of ZSW1 in speed control."""
    word = 0
    velocity = measured_velocity(axis)
    wanted = (
        axis.ramp.reference if axis.profidrive.settings.speed_error_bit == SPEED_ERROR_OF_RAMP else axis.ramp.setpoint
    )
    if (
        axis.profidrive.settings.speed_error_bit != SPEED_BIT_ZERO
        and abs(wanted - velocity) <= axis.ramp.settings.velocity_window
    ):
        word |= 0x0100  # velocity error within range
    reached = axis.profidrive.settings.speed_reached_bit == SPEED_REACHED_OR_EXCEEDED and speed_reached(axis)
    if axis.profidrive.settings.speed_reached_bit == SPEED_REACHED_WINDOW:
        reached = abs(axis.ramp.setpoint - velocity) <= axis.ramp.settings.velocity_window
    if reached:
        word |= 0x0400  # target velocity reached
    return word


@compiled
def _status_word(axis: Any) -> int:
    """ZSW1, bit by bit (AKD PROFINET manual 5.5)."""
    state = axis.drive.state
    stw1 = axis.profidrive.stw1
    word = 0
    if state >= 2:
        word |= 0x0001  # ready to switch on
    if state >= 3:
        word |= 0x0002  # ready to operate
    if state == 4:
        word |= 0x0004  # operation enabled
    if axis.faults.code[0] != 0:
        word |= 0x0008
    if stw1 & 0x0002:
        word |= 0x0010  # coast stop not activated
    if stw1 & 0x0004:
        word |= 0x0020  # quick stop not activated
    if state <= 1:
        word |= 0x0040  # switching on inhibited
    if axis.warnings.code != 0:
        word |= 0x0080
    if control_requested(axis):
        word |= 0x0200
    if axis.drive.settings.opmode == 2:
        word |= position_bits(axis)
    elif axis.drive.settings.opmode == 1:
        word |= _speed_bits(axis)
    return moog_word(axis, word) if axis.profidrive.settings.status_form == STATUS_MOOG else word


@compiled
def _setpoints(axis: Any, image: Any, word: int) -> int:
    """What the set points of this step are, STW1 being ``word``."""
    if not image.valid:
        held = image.lost == LOST_STOP and axis.profidrive.settings.without_run == WITHOUT_RUN_HOLD
        return SETPOINTS_HELD if held else SETPOINTS_NONE
    if word & CONTROL_BY_PLC or axis.profidrive.settings.without_control == WITHOUT_CONTROL_TAKEN:
        return SETPOINTS_TAKEN
    return SETPOINTS_HELD if axis.profidrive.settings.without_control == WITHOUT_CONTROL_HOLD else SETPOINTS_NONE


@compiled
def _control_word(axis: Any, image: Any, now: int) -> None:
    """Take STW1 over, or hold what was taken over last, as the drive's readings have it."""
    valid = image.valid
    if axis.profidrive.image_valid and not valid:
        if image.lost == LOST_EXPIRED and axis.faults.settings.loss_delay_ns == 0:
            raise_fault(axis, axis.faults.settings.loss_fault, now)
        elif image.lost == LOST_STOP:
            raise_fault(axis, axis.faults.settings.stop_fault, now)
    if (
        image.frames != axis.profidrive.telegram_frames
        or (valid and not axis.profidrive.image_valid)
        or image.lost == LOST_STOP
    ):
        # telegrams come, be their data good or not
        axis.profidrive.telegram_frames = image.frames
        axis.profidrive.telegram_ns = now
    elif (
        axis.faults.settings.loss_delay_ns > 0
        and axis.profidrive.telegram_ns != 0
        and now - axis.profidrive.telegram_ns >= axis.faults.settings.loss_delay_ns
    ):
        axis.profidrive.telegram_ns = 0
        raise_fault(axis, axis.faults.settings.loss_fault, now)
    axis.profidrive.image_valid = valid
    word = image.received[STW1] & 0xFFFF
    axis.profidrive.setpoints = _setpoints(axis, image, word)
    if axis.profidrive.setpoints == SETPOINTS_NONE:
        # nobody leads the axis: it coasts, or stops as with STW1.0 = 0
        off = image.lost == LOST_STOP and axis.profidrive.settings.without_run == WITHOUT_RUN_OFF
        word = int(axis.profidrive.stw1) & ~ON if off else 0
    elif axis.profidrive.settings.control_location != axis.profidrive.settings.bus_location:
        # a drive that another one controls does not hear its controller
        word = 0
    elif axis.profidrive.setpoints == SETPOINTS_HELD:
        # the other bits are not taken over; an edge of one of them is none, not even when bit 10 returns
        if valid:
            axis.profidrive.stw1_seen = word
        axis.profidrive.stw1_changed = 0
        return
    axis.profidrive.stw1_changed = word ^ axis.profidrive.stw1_seen
    if word & FAULT_ACKNOWLEDGE and (
        axis.profidrive.settings.acknowledges_by_level or axis.profidrive.stw1_changed & FAULT_ACKNOWLEDGE
    ):
        acknowledge(axis)
    axis.profidrive.stw1_seen = word
    axis.profidrive.stw1 = word
    if (
        axis.profidrive.setpoints != SETPOINTS_NONE
        and axis.profidrive.settings.reference_source == axis.profidrive.settings.bus_source
    ):
        from_setpoints(axis, image)
    else:
        no_setpoints(axis)
    if valid and axis.faults.code[0] != 0 and not axis.faults.reacted and (word & 0x0009) != 0x0009:
        axis.faults.reacted = 1


@compiled
def _word_in_force(axis: Any, reaction: int) -> int:
    """What the state machine sees of STW1: a fault reaction runs to its end, and a parameter may disable the axis."""
    stw1 = int(axis.profidrive.stw1)
    if axis.drive.state == 5 and axis.drive.stop == 3 and stw1 == 0:
        # losing the controller meanwhile does not turn it into coasting; its own coast stop does
        stw1 |= 0x0006
    elif axis.drive.state == 4 and reaction:
        stw1 |= 0x000F
    if axis.commands.disable != 0 and axis.drive.state >= 4:
        # as a coast stop or a quick stop of the control word would, once: the controller walks the states anew
        stw1 &= ~0x0002 if axis.drive.settings.disable_method == DISABLE_AT_ONCE else ~0x0004
    axis.commands.disable = 0
    return stw1


@compiled
def _turn(axis: Any, elapsed: int) -> None:
    """Set point, controllers, motor and load, in steps that are short enough."""
    longest = motor_step_ns(axis)
    while elapsed > 0:
        part = min(elapsed, longest)
        elapsed -= part
        seconds = part * 1e-9
        velocity_command(axis, seconds)
        step_motor(axis, axis.drive.state >= 4, seconds)


@compiled_apart
def step(axis: Any, image: Any, now: int) -> None:
    """Advance one drive to ``now``; without control supply its shaft coasts, and nothing else happens."""
    elapsed = min(now - axis.last_ns, LONGEST_NS)
    axis.last_ns = now
    if not axis.powered:
        axis.drive.state = 0
        _turn(axis, elapsed)
        return
    take_commands(axis, now)
    _control_word(axis, image, now)
    check_life(axis, now)
    take_direction(axis)
    take_switches(axis)

    faulty = axis.faults.code[0] != 0
    reaction = 0
    if faulty:
        reaction = 1
        for i in range(FAULT_SLOTS):
            code = axis.faults.code[i]
            if code != 0 and (code >> 24) != REACTION_QUICK_STOP:
                reaction = 0
    stw1 = _word_in_force(axis, reaction)
    standing = abs(axis.motor.velocity) <= axis.ramp.settings.standstill and axis.ramp.command == 0.0
    if axis.brake.settings.torque > 0.0 and axis.drive.state == 5 and not brake_holds(axis):
        # the power stage holds the axis until the brake does
        standing = False
    take_hindrances(axis)
    take_torque_limits(axis, image)
    take_jog_bits(axis)
    take_task(axis, image)
    held = conditions(stw1, faulty, reaction, standing, now - axis.boot_ns >= axis.boot_time_ns)
    advance(axis, with_hindrances(axis, held, stw1, faulty))
    take_jog(axis, image)
    take_cyclic(axis, image, now)
    step_service(axis, now)
    take_motion(axis, now)
    if axis.drive.state >= 4:
        axis.motor.rested = 0
    elif abs(axis.motor.velocity) <= axis.ramp.settings.standstill:
        axis.motor.rested = 1

    _turn(axis, elapsed)
    watch_motor(axis, now)
    measure(axis)
    watch_warnings(axis)
    take_generator(axis)
    axis.profidrive.zsw1 = _status_word(axis)
    to_actuals(axis, image)
    step_sensor(axis, image)
