"""Values of the position controller's attributes: what Get Attribute puts into each response (6.2.2.8, 7.1)."""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.ethernetip.commands import TORQUE_FULL, target_velocity
from pnfarm.firmware.whole_numbers import clamp32
from pnfarm.table.compiling.compiled import compiled, inlined

__all__ = ["ATTRIBUTES", "attribute_value", "readable"]

#: In the order of attribute 2.
ATTRIBUTES = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 17, 25, 58, 100, 101)
COUNT = len(ATTRIBUTES)
#: The first eight octets of attribute 2.
FIRST = int.from_bytes(bytes(ATTRIBUTES[:8]), "little")
START_HOME = 101
#: Feedback counts of a revolution.
COUNTS = 4294967296.0
VELOCITY_MODE = 1
POSITION_MODE = 2


@inlined
def readable(number: int) -> bool:
    """Whether the attribute can be read."""
    return 1 <= number <= 11 or number in (17, 25, 58, 100)


@inlined
def _ramp_units(axis: Any, up: bool) -> int:
    """Attributes 8 and 9: HOME.ACC and HOME.DEC in position mode, DRV.ACC and DRV.DEC else."""
    if axis.drive.settings.opmode == POSITION_MODE:
        ramp = axis.homing.settings.acceleration if up else axis.homing.settings.deceleration
    else:
        ramp = axis.ramp.settings.acceleration if up else axis.ramp.settings.deceleration
    return clamp32(ramp / axis.ethernetip.settings.profile_step)


@compiled
def attribute_value(axis: Any, number: int) -> int:
    """The value, with its sign; 0 for an attribute that cannot be read.

    The position controller numbers its modes otherwise than DRV.OPMODE: 0 position, 1 velocity, 2 torque.
    """
    own = axis.ethernetip
    value = 0
    if number == 1:
        value = COUNT
    elif number == 2:
        value = FIRST
    elif number == 3:
        value = 2 - int(axis.drive.settings.opmode)
    elif number == 4:
        value = round(axis.travel.settings.position_step * COUNTS)
    elif number == 5:
        value = round(own.settings.profile_step / 60.0 * COUNTS)
    elif number == 6:
        value = int(own.target_units)
    elif number == 7:
        value = clamp32(target_velocity(axis) / own.settings.profile_step)
    elif number in (8, 9):
        value = _ramp_units(axis, number == 8)
    elif number == 10:
        value = int(own.settings.incremental)
    elif number == 11:
        value = int(own.moving)
    elif number == 17:
        value = 1 if axis.drive.state >= 4 else 0
    elif number == 25:
        peak = axis.motor.settings.torque_constant * axis.motor.settings.peak_current
        value = clamp32(own.torque_command / peak * TORQUE_FULL) if peak > 0.0 else 0
    elif number == 58:
        value = int(own.loaded)
    elif number == 100:
        value = int(axis.homing.settings.method)
    return value
