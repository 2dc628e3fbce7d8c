"""Fields of the axis record: service."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["SERVICE_RECORD"]

SERVICE_RECORD = subject(
    "service",
    "Service motion.",
    settings=[
        Field("velocity", "f8", "rpm", "parameter", "of the first and the second leg", (2,)),
        Field("time", "f8", "s", "parameter", "duration of each leg, 0 = the first one never ends", (2,)),
        Field("mode", "u1", "", "parameter", "course of service motion: SERVICE_*"),
    ],
    state=[
        Field("leg_ns", "i8", "ns", "firmware", "when the present leg began"),
        Field("leg", "u1", "", "firmware", "present leg, 0 = no service motion"),
    ],
)
