"""Status words of the Moog MSD: manual 10.2.3, 10.2.4 and 10.7."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.interlocks import enabled_by_hardware
from pnfarm.firmware.motion.interpolation import generator_in_force
from pnfarm.firmware.motor.measurement import measured_velocity
from pnfarm.firmware.motor.motor import torque_controlled
from pnfarm.firmware.motor.torque_limits import gives_all
from pnfarm.firmware.profidrive.speed_status import speed_reached
from pnfarm.table.axis_codes import RAMP_GENERATED
from pnfarm.table.compiling.compiled import inlined

__all__ = ["second_status_msd", "status_msd", "take_generator"]

# Bits of ZSW1.
PROFILE_BITS = 0x01FF  # 0 to 8 are as in the profile
CONTROL = 0x0200
REACHED = 0x0400
POSITION_BITS = 0x1C00  # 10 to 12
STATIONARY = 0x2000
ENABLED = 0x4000
# Bits of ZSW2.
POSITIVE_LIMIT = 0x0004
NEGATIVE_LIMIT = 0x0008
INPUT_SHIFT = 4
INPUTS = 0x0F

#: The profile's signal number of ZSW2, and the bits that may show enabled pulses (P-0924).
SIGNAL_ZSW2 = 4
LOWEST_PULSES = 8
HIGHEST_PULSES = 11

# The profile generator (``profidrive.generator``).
AT_REST = 0
UP = 1
CONSTANT = 2
DOWN = 3
#: Speeds that differ by less count as equal, rpm.
SAME = 1e-9
#: A torque within this part of its limit counts as limited: the current loop approaches it gradually.
NEAR = 0.01


@inlined
def _as_in_the_profile(profidrive: Any) -> bool:
    """P-1258: 1 is control word and set points of the profile, 3 the control word."""
    return profidrive.settings.profile_mode in (1, 3)


@inlined
def status_msd(axis: Any, word: int) -> int:
    """ZSW1 by tables 10.8 and 10.16, from the profile's ``word``."""
    velocity = measured_velocity(axis.motor, axis.measurement)
    stationary = abs(velocity) <= axis.ramp.settings.standstill
    moog = word & PROFILE_BITS
    if _as_in_the_profile(axis.profidrive):
        moog |= CONTROL
        # in position control, too: the telegrams of this mode bring a speed
        if not stationary and abs(axis.ramp.setpoint - velocity) <= axis.ramp.settings.velocity_window:
            moog |= REACHED
        return moog
    if axis.profidrive.settings.control_location == axis.profidrive.settings.bus_location:
        moog |= word & CONTROL
    if axis.drive.settings.opmode == 2:
        moog |= word & POSITION_BITS
    elif axis.drive.settings.opmode == 1 and speed_reached(axis.motor, axis.ramp, axis.jog, axis.measurement):
        moog |= REACHED
    if stationary:
        moog |= STATIONARY
    if enabled_by_hardware(axis.drive, axis.faults):
        moog |= ENABLED
    return moog


@inlined
def second_status_msd(axis: Any) -> int:
    """ZSW2 by tables 10.9 and 10.17, without the sign of life."""
    word = int(axis.profidrive.generator)
    if _as_in_the_profile(axis.profidrive):
        bit = int(axis.profidrive.settings.pulses_choice[1])
        if (
            axis.drive.state >= 4
            and axis.profidrive.settings.pulses_choice[0] == SIGNAL_ZSW2
            and LOWEST_PULSES <= bit <= HIGHEST_PULSES
        ):
            word |= 1 << bit
        return word
    if gives_all(axis, 0, NEAR):
        word |= POSITIVE_LIMIT
    if gives_all(axis, 1, NEAR):
        word |= NEGATIVE_LIMIT
    return word | (int(axis.machine.inputs) & INPUTS) << INPUT_SHIFT


@inlined
def take_generator(axis: Any) -> None:
    """Once in each step, after the motor: update the state of the profile generator."""
    speed = axis.profile.velocity if axis.drive.settings.opmode == 2 else axis.ramp.command
    working = (
        axis.drive.state >= 4
        and generator_in_force(axis.ramp) == RAMP_GENERATED
        and not torque_controlled(axis.orders, axis.drive, axis.brake)
    )
    before = abs(axis.profidrive.generator_speed)
    axis.profidrive.generator_speed = speed
    change = abs(speed) - before
    if not working or (speed == 0.0 and change == 0.0):
        axis.profidrive.generator = AT_REST
    elif change > SAME:
        axis.profidrive.generator = UP
    else:
        axis.profidrive.generator = DOWN if change < -SAME else CONSTANT
