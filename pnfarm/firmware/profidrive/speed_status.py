"""Speed bits of ZSW1: 8 and 10 in speed control."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.motor.measurement import measured_velocity
from pnfarm.table.axis_readings import (
    SPEED_BIT_ZERO,
    SPEED_ERROR_OF_RAMP,
    SPEED_REACHED_OR_EXCEEDED,
    SPEED_REACHED_WINDOW,
)
from pnfarm.table.compiling.compiled import inlined

__all__ = ["speed_bits", "speed_reached"]


@inlined
def speed_reached(motor: Any, ramp: Any, jog: Any, measurement: Any) -> bool:
    """ZSW1.10 in speed control: the speed is reached or exceeded."""
    wanted = jog.speed if jog.sequence else ramp.setpoint
    velocity = measured_velocity(motor, measurement)
    if wanted < 0.0:
        return velocity <= wanted + ramp.settings.velocity_window
    if wanted > 0.0:
        return velocity >= wanted - ramp.settings.velocity_window
    return abs(velocity) <= ramp.settings.velocity_window


@inlined
def speed_bits(axis: Any) -> int:
    """Bits 8 and 10 of ZSW1 in speed control."""
    word = 0
    velocity = measured_velocity(axis.motor, axis.measurement)
    wanted = (
        axis.ramp.reference if axis.profidrive.settings.speed_error_bit == SPEED_ERROR_OF_RAMP else axis.ramp.setpoint
    )
    if (
        axis.profidrive.settings.speed_error_bit != SPEED_BIT_ZERO
        and abs(wanted - velocity) <= axis.ramp.settings.velocity_window
    ):
        word |= 0x0100  # velocity error within range
    reached = axis.profidrive.settings.speed_reached_bit == SPEED_REACHED_OR_EXCEEDED and speed_reached(
        axis.motor, axis.ramp, axis.jog, axis.measurement
    )
    if axis.profidrive.settings.speed_reached_bit == SPEED_REACHED_WINDOW:
        reached = abs(axis.ramp.setpoint - velocity) <= axis.ramp.settings.velocity_window
    if reached:
        word |= 0x0400  # target velocity reached
    return word
