"""Service motion: a drive turns by itself in velocity mode, for a time or to and fro (AKD parameter reference).

It needs operation enabled and no set points from the telegram; the end of these ends it, and so does a command.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.axis_codes import SERVICE_ALTERNATING
from pnfarm.table.compiled import compiled

__all__ = ["service_setpoint", "step_service"]

VELOCITY_MODE = 1


@compiled
def step_service(axis: Any, now: int) -> None:
    """Begin, change legs and end; a step takes ``stop_command`` for itself in velocity mode only."""
    if axis.state != 4 or axis.opmode != VELOCITY_MODE or not axis.setpoint_ignored:
        axis.service = 0
    elif axis.stop_command:
        axis.service = 0
        axis.stop_command = 0
    elif axis.service_command:
        axis.service = 1
        axis.service_ns = now
    elif axis.service:
        time = axis.service_time[int(axis.service) - 1]
        if time > 0.0 and now - axis.service_ns >= time * 1e9:
            axis.service = 3 - axis.service if axis.service_mode == SERVICE_ALTERNATING else 0
            axis.service_ns = now
    axis.service_command = 0


@compiled
def service_setpoint(axis: Any) -> float:
    """The velocity of the leg that runs, rpm."""
    return axis.service_velocity[int(axis.service) - 1]
