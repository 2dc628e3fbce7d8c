"""Scaling between signals (integers on the wire) and physical values (the axis record)."""

from __future__ import annotations

from typing import Any

from pnfarm.table.axis import VELOCITY_NSOLL_B, VELOCITY_REF_SPEED
from pnfarm.table.compiled import compiled
from pnfarm.table.signals import (
    ACT_SPEED,
    DRV_ACC,
    DRV_DEC,
    G1_XIST1,
    G1_XIST2,
    ITIST_GLATT,
    NIST_A,
    NIST_B,
    NSOLL_A,
    NSOLL_B,
    REF_SPEED,
    XIST_A,
    XIST_ERROR,
    ZSW1,
)

__all__ = ["from_setpoints", "signed16", "signed32", "to_actuals"]

#: 100 % of a signal in N2 normalisation (AKD PROFINET manual 5.12.4).
N2_FULL = 16384.0


@compiled
def signed16(word: int) -> int:
    """A 16-bit signal as a signed number."""
    word &= 0xFFFF
    return word - 0x10000 if word & 0x8000 else word


@compiled
def signed32(value: int) -> int:
    """Wrap to a signed 32-bit number."""
    value &= 0xFFFFFFFF
    return value - 0x100000000 if value & 0x80000000 else value


@compiled
def _clamp16(value: float) -> int:
    if value >= 32767.0:
        return 0x7FFF
    if value <= -32768.0:
        return 0x8000
    return int(round(value)) & 0xFFFF  # noqa: RUF046 - round() of a compiled float stays a float


@compiled
def _clamp32(value: float) -> int:
    if value >= 2147483647.0:
        return 0x7FFFFFFF
    if value <= -2147483648.0:
        return -0x80000000
    return int(round(value))  # noqa: RUF046 - as above


@compiled
def from_setpoints(axis: Any, image: Any) -> None:
    """The velocity set point out of the signal that brings it, ramps out of DRV_ACC and DRV_DEC.

    NSOLL_A: AKD PROFINET manual 6.5; NSOLL_B: Moog MSD manual 10.7; ramps: AKD 6.1.  A telegram without those two, or
    one that leaves them zero, keeps the drive's own ramps.
    """
    if axis.velocity_signal == VELOCITY_NSOLL_B:
        axis.setpoint = image.received[NSOLL_B] * axis.velocity_step_b
    elif axis.velocity_signal == VELOCITY_REF_SPEED:
        axis.setpoint = image.received[REF_SPEED] * axis.velocity_step
    else:
        axis.setpoint = signed16(image.received[NSOLL_A]) * axis.velocity_step
    up = image.received[DRV_ACC] & 0xFFFF
    down = image.received[DRV_DEC] & 0xFFFF
    axis.ramp_up = up * axis.acceleration_step if up else axis.acceleration
    axis.ramp_down = down * axis.acceleration_step if down else axis.deceleration


@compiled
def to_actuals(axis: Any, image: Any) -> None:
    """ZSW1, the actual velocities, ITIST_GLATT and the position signals."""
    image.sent[ZSW1] = axis.zsw1
    image.sent[NIST_A] = _clamp16(axis.velocity / axis.velocity_step)
    image.sent[ITIST_GLATT] = _clamp16(axis.current / axis.peak_current * N2_FULL)
    image.sent[XIST_A] = signed32(int(round(axis.position / axis.position_step)))  # noqa: RUF046 - as above
    image.sent[ACT_SPEED] = signed32(int(round(axis.velocity / axis.velocity_step)))  # noqa: RUF046 - as above
    if axis.velocity_step_b > 0.0:
        image.sent[NIST_B] = _clamp32(axis.velocity / axis.velocity_step_b)
    if axis.sensor_step > 0.0:
        # both positions of the sensor are the same (Moog MSD manual 11.3)
        image.sent[G1_XIST1] = signed32(int(round(axis.position / axis.sensor_step)))  # noqa: RUF046 - as above
        image.sent[G1_XIST2] = image.sent[G1_XIST1]
    image.sent[XIST_ERROR] = signed32(int(round(axis.following_error / axis.position_step)))  # noqa: RUF046 - as above
