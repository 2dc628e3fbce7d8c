"""Scaling between signals (integers on the wire) and physical values (the axis record)."""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiled import compiled
from pnfarm.table.signals import DRV_ACC, DRV_DEC, ITIST_GLATT, NIST_A, NSOLL_A, XIST_A, XIST_ERROR, ZSW1

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
def from_setpoints(axis: Any, image: Any) -> None:
    """The velocity set point out of NSOLL_A (AKD PROFINET manual 6.5), ramps out of DRV_ACC and DRV_DEC (6.1).

    A telegram without those two, or one that leaves them zero, keeps the drive's own ramps.
    """
    axis.setpoint = signed16(image.received[NSOLL_A]) * axis.velocity_step
    up = image.received[DRV_ACC] & 0xFFFF
    down = image.received[DRV_DEC] & 0xFFFF
    axis.ramp_up = up * axis.acceleration_step if up else axis.acceleration
    axis.ramp_down = down * axis.acceleration_step if down else axis.deceleration


@compiled
def to_actuals(axis: Any, image: Any) -> None:
    """ZSW1, NIST_A, ITIST_GLATT and the position signals."""
    image.sent[ZSW1] = axis.zsw1
    image.sent[NIST_A] = _clamp16(axis.velocity / axis.velocity_step)
    image.sent[ITIST_GLATT] = _clamp16(axis.current / axis.peak_current * N2_FULL)
    image.sent[XIST_A] = signed32(int(round(axis.position / axis.position_step)))  # noqa: RUF046 - as above
    image.sent[XIST_ERROR] = signed32(int(round(axis.following_error / axis.position_step)))  # noqa: RUF046 - as above
