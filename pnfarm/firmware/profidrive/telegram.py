"""Scaling between signals (integers on the wire) and physical values (the axis record)."""

from __future__ import annotations

from typing import Any

import numpy as np

from pnfarm.firmware.motion.travel import position_number
from pnfarm.firmware.motor.measurement import measured_current, measured_position, measured_torque, measured_velocity
from pnfarm.firmware.profidrive.messages import message_word
from pnfarm.firmware.profidrive.position_status import (
    actual_task,
    first_position_word,
    second_position_word,
)
from pnfarm.firmware.profidrive.real_words import DEGREES, DEGREES_A_SECOND, bits_of
from pnfarm.firmware.profidrive.status_word import second_status_word
from pnfarm.firmware.reported import drive_inputs, motion_status
from pnfarm.firmware.whole_numbers import clamp32, signed32
from pnfarm.table.axis_codes import FAULT_WORDS, NUMBER_MASK, VELOCITY_NSOLL_B, VELOCITY_REF_SPEED
from pnfarm.table.compiling.compiled import compiled, inlined
from pnfarm.table.signals import (
    ACT_CURRENT,
    ACT_SPEED,
    ACT_TORQUE,
    AKTSATZ,
    DRIVE_INPUTS,
    DRIVE_MOTION_STATUS,
    DRV_ACC,
    DRV_DEC,
    E_DIGITAL,
    FAULT_CODE,
    FIRST_SENT_BACK,
    FIRST_SHOWN,
    ITIST_GLATT,
    MELDW,
    NIST_A,
    NIST_B,
    NSOLL_A,
    NSOLL_B,
    POS_ZSW1,
    POS_ZSW2,
    REF_SPEED,
    SENT_BACK,
    SHOWN,
    TORQUE_SETPOINT,
    VIST_F,
    WARN_CODE,
    XIST_A,
    XIST_ERROR,
    XIST_F,
    ZSW1,
    ZSW2,
)

__all__ = [
    "clamp16",
    "clamp_unsigned",
    "current_step",
    "from_setpoints",
    "long_step",
    "no_setpoints",
    "signed16",
    "to_actuals",
    "torque_step",
]


#: 100 % of a signal in N2 normalisation (AKD PROFINET manual 5.12.4).
N2_FULL = 16384.0
#: Increments of NSOLL_B and NIST_B per increment of NSOLL_A and NIST_A (HIWIN E1 manual 6.1: 0x40000000 for 0x4000).
B_STEPS = 65536.0
#: ``drive.setpoint_ignored``: the torque set point comes from a parameter.
TORQUE_COMMAND_COUNTS = 1
#: STW1.11, where the drive has it.
INVERT = 0x0800
#: An array, because indexing a tuple in compiled code copies it.
_SENT_BACK = np.array(SENT_BACK, np.int64)


@inlined
def signed16(word: int) -> int:
    """A 16-bit signal as a signed number."""
    word &= 0xFFFF
    return word - 0x10000 if word & 0x8000 else word


@inlined
def clamp16(value: float) -> int:
    """The nearest signed 16-bit number, as the unsigned word that carries it."""
    if value >= 32767.0:
        return 0x7FFF
    if value <= -32768.0:
        return 0x8000
    return round(value) & 0xFFFF


@inlined
def clamp_unsigned(value: float) -> int:
    """The nearest unsigned 16-bit number."""
    return min(0xFFFF, max(0, round(value)))


@compiled
def long_step(short: float, own: float) -> float:
    """rpm of one increment of NSOLL_B and NIST_B, where one of NSOLL_A is ``short``.

    Its ``own`` (Moog MSD manual 10.7), or a part of that of NSOLL_A (HIWIN E1 manual 6.1).
    """
    return own if own > 0.0 else short / B_STEPS


@inlined
def torque_step(profidrive: Any, motor: Any) -> float:
    """N m of one increment of torque signals: its own, or that of currents (AKD PROFINET manual 5.12.4)."""
    return (
        profidrive.settings.torque_step
        if profidrive.settings.torque_step > 0.0
        else motor.settings.torque_constant * motor.settings.peak_current / N2_FULL
    )


@inlined
def current_step(profidrive: Any, motor: Any) -> float:
    """A of one increment of current signals: its own, or by the peak current (AKD PROFINET manual 5.12.4)."""
    own = profidrive.settings.current_step
    return own if own > 0.0 else motor.settings.peak_current / N2_FULL


@inlined
def no_setpoints(torque: Any, ramp: Any) -> None:
    """Without a controller: speed and torque are zero, the ramps are the drive's own."""
    ramp.setpoint = 0.0
    torque.setpoint = 0.0
    ramp.up = ramp.settings.acceleration
    ramp.down = ramp.settings.deceleration


@inlined
def from_setpoints(axis: Any, image: Any) -> None:
    """Velocity and torque from their signals; ramps from DRV_ACC and DRV_DEC.

    NSOLL_A: AKD PROFINET manual 6.5; NSOLL_B: HIWIN E1 manual 6.1, Moog MSD manual 10.7; in two words and the drive's
    own units: Moog MSD manual 14.2; ramps: AKD PROFINET manual 6.1.  A telegram without those two, or one
    that leaves them zero, keeps the drive's own ramps.
    """
    if axis.profidrive.settings.velocity_signal == VELOCITY_NSOLL_B:
        axis.ramp.setpoint = image.received[NSOLL_B] * long_step(
            axis.profidrive.settings.velocity_step, axis.profidrive.settings.velocity_step_b
        )
    elif axis.profidrive.settings.velocity_signal == VELOCITY_REF_SPEED:
        axis.ramp.setpoint = image.received[REF_SPEED] * axis.profidrive.settings.velocity_step
    else:
        axis.ramp.setpoint = signed16(image.received[NSOLL_A]) * axis.profidrive.settings.velocity_step
    axis.ramp.setpoint *= axis.ramp.settings.speed_override
    if axis.profidrive.settings.inverts and axis.profidrive.stw1 & INVERT:
        axis.ramp.setpoint = -axis.ramp.setpoint
    axis.torque.setpoint = signed16(image.received[TORQUE_SETPOINT]) * torque_step(axis.profidrive, axis.motor)
    if axis.drive.settings.setpoint_ignored:
        axis.ramp.setpoint = 0.0
        axis.torque.setpoint = (
            axis.torque.settings.command if axis.drive.settings.setpoint_ignored == TORQUE_COMMAND_COUNTS else 0.0
        )
    up = image.received[DRV_ACC] & 0xFFFF
    down = image.received[DRV_DEC] & 0xFFFF
    axis.ramp.up = up * axis.profidrive.settings.acceleration_step if up else axis.ramp.settings.acceleration
    axis.ramp.down = down * axis.profidrive.settings.acceleration_step if down else axis.ramp.settings.deceleration


@compiled
def _beside(profidrive: Any, image: Any) -> None:
    """What a free mapping shows besides actual values (Moog MSD manual 8.2.3; 14.3, table 14.5)."""
    if int(profidrive.settings.shows) & 1:
        for place in range(len(_SENT_BACK)):
            image.sent[FIRST_SENT_BACK + place] = image.received[_SENT_BACK[place]]
    if int(profidrive.settings.shows) & 2:
        for place in range(SHOWN):
            image.sent[FIRST_SHOWN + place] = profidrive.settings.shown[place]


@inlined
def to_actuals(axis: Any, image: Any) -> None:
    """Status words, actual velocity, current, messages and the position signals."""
    image.sent[ZSW1] = axis.profidrive.zsw1
    velocity = measured_velocity(axis.motor, axis.measurement)
    steps = velocity / axis.profidrive.settings.velocity_step
    image.sent[NIST_A] = clamp16(steps)
    image.sent[NIST_B] = clamp32(
        velocity / long_step(axis.profidrive.settings.velocity_step, axis.profidrive.settings.velocity_step_b)
    )
    image.sent[ACT_SPEED] = clamp32(steps)
    if axis.life.settings.watched:
        image.sent[ZSW2] = second_status_word(axis)
    image.sent[MELDW] = message_word(axis)
    number = int(axis.faults.code[0]) & NUMBER_MASK
    image.sent[FAULT_CODE] = (
        int(axis.profidrive.settings.fault_words[number]) if number < FAULT_WORDS else number & 0xFFFF
    )
    image.sent[WARN_CODE] = int(axis.warnings.code) & 0xFFFF
    current = measured_current(axis.motor, axis.measurement)
    image.sent[ITIST_GLATT] = clamp16(current / current_step(axis.profidrive, axis.motor))
    if axis.profidrive.settings.torque_step > 0.0:
        image.sent[ACT_TORQUE] = clamp16(
            measured_torque(axis.motor, axis.measurement) / axis.profidrive.settings.torque_step
        )
    image.sent[XIST_A] = signed32(
        position_number(axis.travel, axis.homing, measured_position(axis.motor, axis.measurement))
    )
    if axis.profidrive.settings.real_tasks:
        place = measured_position(axis.motor, axis.measurement) - axis.homing.origin
        image.sent[XIST_F] = bits_of(place * DEGREES)
        image.sent[VIST_F] = bits_of(velocity * DEGREES_A_SECOND)
    axis.profidrive.motion_status = motion_status(axis)
    image.sent[DRIVE_MOTION_STATUS] = axis.profidrive.motion_status
    image.sent[AKTSATZ] = actual_task(axis.profidrive, axis.asked, axis.positioning)
    image.sent[ACT_CURRENT] = bits_of(current)
    image.sent[E_DIGITAL] = int(axis.machine.inputs) & 0xFFFF
    image.sent[DRIVE_INPUTS] = drive_inputs(axis)
    image.sent[POS_ZSW1] = first_position_word(axis)
    image.sent[POS_ZSW2] = second_position_word(axis)
    image.sent[XIST_ERROR] = signed32(
        round(
            (axis.positioning.following_error - axis.measurement.position_deviation)
            / axis.travel.settings.position_step
        )
    )
    if axis.profidrive.settings.shows:
        _beside(axis.profidrive, image)
