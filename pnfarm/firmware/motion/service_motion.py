"""Service motion: a drive turns by itself in velocity mode, for a time or to and fro (AKD parameter reference).

It needs operation enabled and set points of the telegram ignored; it ends with either of these, or by a command.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.axis_codes import SERVICE_ALTERNATING
from pnfarm.table.compiling.compiled import inlined

__all__ = ["service_setpoint", "step_service"]


VELOCITY_MODE = 1


@inlined
def step_service(drive: Any, commands: Any, service: Any, now: int) -> None:
    """Begin, change legs and end; consumes ``commands.stop`` in velocity mode only."""
    if drive.state != 4 or drive.settings.opmode != VELOCITY_MODE or not drive.settings.setpoint_ignored:
        service.leg = 0
    elif commands.stop:
        service.leg = 0
        commands.stop = 0
    elif commands.service:
        service.leg = 1
        service.leg_ns = now
    elif service.leg:
        time = service.settings.time[int(service.leg) - 1]
        if time > 0.0 and now - service.leg_ns >= time * 1e9:
            service.leg = 3 - service.leg if service.settings.mode == SERVICE_ALTERNATING else 0
            service.leg_ns = now
    commands.service = 0


@inlined
def service_setpoint(service: Any) -> float:
    """The velocity of the running leg, rpm."""
    return service.settings.velocity[int(service.leg) - 1]
