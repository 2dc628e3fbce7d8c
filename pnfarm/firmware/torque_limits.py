"""How much torque the motor may give: the drive's peak current, and the limits that parameters set for each direction.

HIWIN E1 manual 6.3 and 3.16 (MELDW.1).
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiled import compiled

__all__ = ["limited_torque", "torque_limited"]

#: A torque nearer to its limit than this share of it is limited.
ROUNDING = 1e-9


@compiled
def _most(axis: Any, limit: float) -> float:
    """The least of a direction's limit and what the peak current gives, N m."""
    return min(limit, axis.torque_constant * axis.peak_current)


@compiled
def limited_torque(axis: Any, torque: float) -> float:
    """``torque`` within the limits of its direction, N m."""
    return max(-_most(axis, axis.torque_limit_negative), min(_most(axis, axis.torque_limit_positive), torque))


@compiled
def torque_limited(axis: Any) -> bool:
    """Whether the motor gives all that it may; never with the power stage off."""
    if axis.state < 4:
        return False
    forwards = _most(axis, axis.torque_limit_positive) * (1.0 - ROUNDING)
    backwards = _most(axis, axis.torque_limit_negative) * (1.0 - ROUNDING)
    return axis.torque >= forwards or axis.torque <= -backwards
