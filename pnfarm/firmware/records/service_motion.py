"""Of the axis record: service."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["SERVICE_RECORD"]

SERVICE_RECORD = subject(
    "service",
    "Service motion.",
    settings=[
        Field("velocity", "f8", "rpm", "parameter", "of its first and its second leg", (2,)),
        Field("time", "f8", "s", "parameter", "of these, 0 = the first one never ends", (2,)),
        Field("mode", "u1", "", "parameter", "course of service motion: SERVICE_*"),
    ],
    state=[
        Field("leg_ns", "i8", "ns", "firmware", "when its leg began"),
        Field("leg", "u1", "", "firmware", "leg of the service motion that runs, 0 = none"),
    ],
)
