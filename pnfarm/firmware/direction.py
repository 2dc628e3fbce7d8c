"""Direction of counting, relative to the shaft (AKD parameter reference, DRV.DIR).

Positions, speeds and torques of the axis record are the drive's; the positions of the machine's parts and the load's
torque on the shaft are the shaft's.  Reversing the direction changes the sign of the position, wherever it counts from,
and loses the home.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import inlined

__all__ = ["shaft_sign", "take_direction"]


@inlined
def shaft_sign(direction: Any) -> float:
    """1, or -1 for a drive that counts against its shaft's direction."""
    return -1.0 if direction.turned else 1.0


@inlined
def take_direction(axis: Any) -> None:
    """Apply the direction that a parameter requests, only while the power stage is off."""
    if axis.direction.turned == axis.direction.settings.reversed or axis.drive.state >= 4:
        return
    axis.direction.turned = axis.direction.settings.reversed
    axis.motor.position = -axis.motor.position
    axis.motor.measured_position = -axis.motor.measured_position
    axis.motor.encoder_low = -axis.motor.encoder_low
    axis.motor.velocity = -axis.motor.velocity
    axis.homing.origin = -axis.homing.origin
    axis.sensor.zero = -axis.sensor.zero
    axis.sensor_2.zero = -axis.sensor_2.zero
    axis.homing.homed = 0
    axis.positioning.target_reached = 0
