"""Limits of speed and torque in percent of the motor's nominal values (Moog MSD manual, tables 10.12 and 10.13).

How they combine is assumed: in each direction the lower of the common and the direction's own limit applies, that of
the torque times a scale.  A nominal value of zero means the maximum of motor and drive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.parts import ControlLimits
from pnfarm.drives.parameters.factor_group import float_of
from pnfarm.drives.parameters.parameter import Backing, Form

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.drives.description.sections import Section
    from pnfarm.drives.parameters.parameter import Parameter
    from pnfarm.drives.parameters.stored_values import StoredValues

__all__ = ["apply_control_limits", "read_control_limits"]

PERCENT = 0.01
#: Bits of the largest finite float32.
FINITE = 0x7F7FFFFF


def read_control_limits(section: Section, parameters: Mapping[int, Parameter]) -> ControlLimits | None:
    """The section ``control_limits``: stored numbers, zero or more; raises :class:`ConfigError`."""
    if not section:
        return None
    limits: ControlLimits = section.build(ControlLimits)
    for key, pnu in section.values_by_key().items():
        parameter = parameters.get(pnu)
        stored = parameter is not None and parameter.backing is Backing.STORED and parameter.form is Form.FLOAT
        if parameter is None or not stored or parameter.maximum > FINITE:
            raise section.wrong(key, f"{pnu} is not a Float that is stored, finite and not below zero")
    return limits


def apply_control_limits(limits: ControlLimits, values: StoredValues, axis: Any) -> None:
    """Write the limits of each direction into the axis record, rpm and N m."""

    def number(pnu: int) -> float:
        return float_of(values.raw(pnu))

    speed = number(limits.nominal_speed) or float(axis.motor.settings.max_velocity)
    torque = number(limits.nominal_torque) or float(axis.torque.settings.rated)
    torque = torque or float(axis.motor.settings.torque_constant * axis.motor.settings.peak_current)
    torque *= PERCENT * number(limits.torque_scale)
    axis.travel.settings.velocity_limit_positive = (
        speed * PERCENT * min(number(limits.speed), number(limits.speed_positive))
    )
    axis.travel.settings.velocity_limit_negative = (
        speed * PERCENT * min(number(limits.speed), number(limits.speed_negative))
    )
    axis.torque.settings.limit_positive = torque * PERCENT * min(number(limits.torque), number(limits.torque_positive))
    axis.torque.settings.limit_negative = torque * PERCENT * min(number(limits.torque), number(limits.torque_negative))
