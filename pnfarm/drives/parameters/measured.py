"""Measured values of the motor for parameters that read them: the true value plus noise.

The firmware draws the noise (:mod:`pnfarm.firmware.motor.measurement`); here it is only added.
"""

from __future__ import annotations

from typing import Any

__all__ = ["deviation"]


def deviation(axis: Any, field: str) -> float:
    """Measured value minus true value of a field, in the field's unit; 0 for a field that is not measured."""
    match field:
        case "motor.velocity":
            return float(axis.measurement.velocity_deviation)
        case "motor.current":
            return float(axis.measurement.current_deviation)
        case "motor.position":
            return float(axis.measurement.position_deviation)
        case "motor.torque":
            return float(axis.motor.settings.torque_constant) * float(axis.measurement.current_deviation)
        case "positioning.following_error":
            return -float(axis.measurement.position_deviation)
        case _:
            return 0.0
