"""Fields of the axis record: direction."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["DIRECTION_RECORD"]

DIRECTION_RECORD = subject(
    "direction",
    "Direction of counting.",
    settings=[
        Field("reversed", "u1", "", "parameter", "1 = the drive counts against the shaft's direction (DRV.DIR)"),
    ],
    state=[
        Field("turned", "u1", "", "firmware", "reversed, as it is in force"),
    ],
)
