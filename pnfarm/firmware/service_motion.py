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
    """Begin, change legs and end; a step takes ``commands.stop`` for itself in velocity mode only."""
    if axis.drive.state != 4 or axis.drive.settings.opmode != VELOCITY_MODE or not axis.drive.settings.setpoint_ignored:
        axis.service.leg = 0
    elif axis.commands.stop:
        axis.service.leg = 0
        axis.commands.stop = 0
    elif axis.commands.service:
        axis.service.leg = 1
        axis.service.leg_ns = now
    elif axis.service.leg:
        time = axis.service.settings.time[int(axis.service.leg) - 1]
        if time > 0.0 and now - axis.service.leg_ns >= time * 1e9:
            axis.service.leg = 3 - axis.service.leg if axis.service.settings.mode == SERVICE_ALTERNATING else 0
            axis.service.leg_ns = now
    axis.commands.service = 0


@compiled
def service_setpoint(axis: Any) -> float:
    """The velocity of the leg that runs, rpm."""
    return axis.service.settings.velocity[int(axis.service.leg) - 1]
