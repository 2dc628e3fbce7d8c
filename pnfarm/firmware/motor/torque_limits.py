"""How much torque the motor may give: peak current, foldback, and the limits that parameters set for each direction.

HIWIN E1 manual 6.3 and 3.16 (MELDW.1).  Moog MSD manual 15 and 14.3: parts of the highest torque in 1/1000 by P-1286 to
P-1288, the last two of which a telegram may bring.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import inlined

__all__ = ["gives_all", "most_torque", "torque_limited"]


#: A torque within this part of its limit counts as limited.
ROUNDING = 1e-9


@inlined
def most_torque(motor: Any, torque: Any, homing: Any, direction: int) -> float:
    """The lower of a direction's limit and what the peak current allows, N m; direction 0 is forwards."""
    limit = torque.settings.limit_negative if direction else torque.settings.limit_positive
    share = min(1.0, torque.settings.scale * torque.shares_in_force[direction])
    current = motor.settings.peak_current * share
    if homing.current_limit > 0.0:
        current = min(current, homing.current_limit)
    return float(min(limit, motor.settings.torque_constant * current))


@inlined
def gives_all(axis: Any, direction: int, near: float) -> bool:
    """Whether the torque in this direction has reached its limit, or is within the part ``near`` of it."""
    if axis.drive.state < 4:
        return False
    torque = -axis.motor.torque if direction else axis.motor.torque
    most = most_torque(axis.motor, axis.torque, axis.homing, direction)
    return torque >= min(most, axis.motor.settings.torque_constant * axis.foldback.current) * (1.0 - near)


@inlined
def torque_limited(axis: Any) -> bool:
    """Whether the torque has reached its limit; never with the power stage off."""
    return gives_all(axis, 0, ROUNDING) or gives_all(axis, 1, ROUNDING)
