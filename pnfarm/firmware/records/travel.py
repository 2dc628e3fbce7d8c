"""Fields of the axis record: travel."""

from __future__ import annotations

from math import inf

from pnfarm.table.layout import Field, subject

__all__ = ["TRAVEL_RECORD"]

TRAVEL_RECORD = subject(
    "travel",
    "How fast and how far the axis may go.",
    settings=[
        Field("position_step", "f8", "rev", "parameter", "one increment of positions as numbers"),
        Field(
            "velocity_limit", "f8", "rpm", "parameter", "limit of the velocity command besides the motor's, 0 = none"
        ),
        Field(
            "velocity_limit_positive", "f8", "rpm", "parameter", "highest speed forwards, inf = no limit", default=inf
        ),
        Field(
            "velocity_limit_negative", "f8", "rpm", "parameter", "highest speed backwards, inf = no limit", default=inf
        ),
        Field("low", "f8", "rev", "parameter", "lowest position"),
        Field("high", "f8", "rev", "parameter", "highest position"),
        Field(
            "software_limits", "u1", "", "parameter", "limits that apply once the axis is homed: bit 0 low, bit 1 high"
        ),
    ],
    state=[
        Field("switched", "u1", "", "firmware", "software limits by the telegram: SWITCHED_*"),
    ],
)
