"""User units of positions, speeds, accelerations and torques, from factors in parameters (Moog MSD manual 13).

One position unit is numerator / denominator revolutions, one speed unit the speed factor in rev/min, one acceleration
unit the acceleration factor in rev/s2, one torque unit the torque factor in N m (assumed).  These factors are floats,
kept as the bits of a float32.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.parts import FactorGroup
from pnfarm.drives.parameters.parameter import Backing

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.drives.description.sections import Section
    from pnfarm.drives.parameters.parameter import Parameter
    from pnfarm.drives.parameters.stored_values import StoredValues

__all__ = ["apply_factor_group", "float_bits", "float_of", "read_factor_group"]

#: rpm/s of one rev/s2.
RPM_PER_SECOND = 60.0


def float_of(bits: int) -> float:
    """The number whose float32 has these bits."""
    (value,) = struct.unpack(">f", (bits & 0xFFFFFFFF).to_bytes(4, "big"))
    return float(value)


def float_bits(value: float) -> int:
    """The bits of the nearest float32; infinite beyond its range."""
    try:
        return int.from_bytes(struct.pack(">f", value), "big")
    except OverflowError:
        return 0x7F800000 if value > 0.0 else 0xFF800000


def read_factor_group(section: Section, parameters: Mapping[int, Parameter]) -> FactorGroup | None:
    """The section ``factor_group``: stored parameters above zero (they are divisors); raises :class:`ConfigError`."""
    if not section:
        return None
    group: FactorGroup = section.build(FactorGroup)
    for key, pnu in section.values_by_key().items():
        parameter = parameters.get(pnu)
        if parameter is None or parameter.backing is not Backing.STORED or parameter.minimum < 1:
            raise section.wrong(key, f"{pnu} is not a parameter that is stored and above zero")
    return group


def apply_factor_group(group: FactorGroup, values: StoredValues, axis: Any) -> None:
    """Write the size of each unit into the axis record."""
    axis.travel.settings.position_step = values.raw(group.numerator) / values.raw(group.denominator)
    axis.profidrive.settings.velocity_step = axis.profidrive.settings.task_velocity_step = float_of(
        values.raw(group.speed)
    )
    axis.profidrive.settings.acceleration_step = float_of(values.raw(group.acceleration)) * RPM_PER_SECOND
    axis.profidrive.settings.torque_step = float_of(values.raw(group.torque))
