"""Of the axis record: direction."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["DIRECTION_RECORD"]

DIRECTION_RECORD = subject(
    "direction",
    "Sense of direction.",
    settings=[
        Field("reversed", "u1", "", "parameter", "1 = the drive counts the other way than the shaft (DRV.DIR)"),
    ],
    state=[
        Field("turned", "u1", "", "firmware", "1 = it does"),
    ],
)
