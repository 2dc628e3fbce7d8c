"""How much torque the motor may give: peak current, foldback, and the limits that parameters set for each direction.

HIWIN E1 manual 6.3 and 3.16 (MELDW.1).  Moog MSD manual 15 and 14.3: parts of the highest torque in 1/1000 by P-1286 to
P-1288, the last two of which a telegram may bring.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiled import compiled

__all__ = ["gives_all", "limited_torque", "torque_limited"]


#: A torque within this part of its limit counts as limited.
ROUNDING = 1e-9


@compiled
def _most(motor: Any, foldback: Any, torque: Any, homing: Any, direction: int) -> float:
    """The lower of a direction's limit and what peak current and foldback allow, N m; direction 0 is forwards."""
    limit = torque.settings.limit_negative if direction else torque.settings.limit_positive
    share = min(1.0, torque.settings.scale * torque.shares_in_force[direction])
    current = min(motor.settings.peak_current * share, foldback.current)
    if homing.current_limit > 0.0:
        current = min(current, homing.current_limit)
    return min(limit, motor.settings.torque_constant * current)


@compiled
def limited_torque(motor: Any, foldback: Any, torque: Any, homing: Any, wanted: float) -> float:
    """``wanted`` within the limits of its direction, N m."""
    return max(-_most(motor, foldback, torque, homing, 1), min(_most(motor, foldback, torque, homing, 0), wanted))


@compiled
def gives_all(axis: Any, direction: int, near: float) -> bool:
    """Whether the torque in this direction has reached its limit, or is within the part ``near`` of it."""
    if axis.drive.state < 4:
        return False
    torque = -axis.motor.torque if direction else axis.motor.torque
    return torque >= _most(axis.motor, axis.foldback, axis.torque, axis.homing, direction) * (1.0 - near)


@compiled
def torque_limited(axis: Any) -> bool:
    """Whether the torque has reached its limit; never with the power stage off."""
    return gives_all(axis, 0, ROUNDING) or gives_all(axis, 1, ROUNDING)
