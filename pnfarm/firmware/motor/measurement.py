"""Measured values of the motor: the true value plus noise.

In each step noise is drawn for the shaft's speed, its position and the current, from an approximately normal
distribution (the sum of four uniform ones) that ends at 3.5 times its effective value.  It is in what the drive
reports: actual values, parameters that show them, and bits that compare them with a window.  Controllers, stops, and
limits that raise faults use the true values, so that noise moves nothing and trips nothing.

Each axis record has its own sequence, started by ``measurement.seed``; a seed of 0 is a drive without noise.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = [
    "measure",
    "measured_current",
    "measured_position",
    "measured_torque",
    "measured_velocity",
]


#: The linear congruential generator of 48 bits of POSIX's drand48.
MULTIPLIER = 0x5DEECE66D
INCREMENT = 0xB
MASK = 0xFFFF_FFFF_FFFF
#: Two 16-bit numbers are taken from the upper bits of each state, which are the most random.
UPPER = 32
LOWER = 16
HALF = 0xFFFF
#: The sum of four of them: its mean, and the factor that scales it to variance 1 (one has (2^32 - 1) / 12).
MEAN = 131070.0
SCALE = 2.642899792e-05


@compiled
def _next(measurement: Any) -> int:
    """The sum of two uniform 16-bit numbers; advances the sequence."""
    state = (int(measurement.noise) * MULTIPLIER + INCREMENT) & MASK
    measurement.noise = state
    return (state >> UPPER & HALF) + (state >> LOWER & HALF)


@inlined
def _normal(measurement: Any) -> float:
    """A number of mean 0 and variance 1."""
    return (_next(measurement) + _next(measurement) - MEAN) * SCALE


@compiled
def measure(measurement: Any) -> None:
    """Once in each step, after the motor: draw the noise of each value until the next step."""
    if measurement.settings.seed == 0:
        return
    if measurement.noise == 0:
        # a state of 0 has not begun: the sequence starts from the seed
        measurement.noise = measurement.settings.seed & MASK
    measurement.velocity_deviation = measurement.settings.velocity_noise * _normal(measurement)
    measurement.current_deviation = measurement.settings.current_noise * _normal(measurement)
    measurement.position_deviation = measurement.settings.position_noise * _normal(measurement)


@inlined
def measured_velocity(motor: Any, measurement: Any) -> float:
    """The shaft's speed as the drive measures it, rpm."""
    return motor.velocity + measurement.velocity_deviation


@inlined
def measured_current(motor: Any, measurement: Any) -> float:
    """The torque-building current as the drive measures it, A."""
    return motor.current + measurement.current_deviation


@inlined
def measured_torque(motor: Any, measurement: Any) -> float:
    """The torque, which the drive computes from the current, N m."""
    return motor.torque + motor.settings.torque_constant * measurement.current_deviation


@inlined
def measured_position(motor: Any, measurement: Any) -> float:
    """The shaft's position as the encoder reports it, rev."""
    return motor.measured_position + measurement.position_deviation
