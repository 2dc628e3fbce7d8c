"""Fields of the axis record: warnings."""

from __future__ import annotations

from pnfarm.table.axis_codes import WARNING_SLOTS
from pnfarm.table.layout import Field, subject

__all__ = ["WARNINGS_RECORD"]

WARNINGS_RECORD = subject(
    "warnings",
    "Warnings: those raised by command, and the drive's own.",
    settings=[
        Field("thermal", "u4", "", "station", "warnings of motor overload and of I2t, 0 = none", (2,)),
        Field("thermal_level", "f8", "", "station", "thermal_load above which the I2t warning shows, 0 = none"),
        Field("limit", "u4", "", "parameter", "warning at the low and the high software limit, 0 = none", (2,)),
        Field("task", "u4", "", "parameter", "warning of each error of positioning.error, 0 = none", (2,)),
        Field("switch", "u4", "", "station", "warning at the low and the high limit switch, 0 = none", (2,)),
    ],
    state=[
        Field("code", "u4", "", "firmware", "the first active warning, 0 = none"),
        Field("active", "u4", "", "firmware", "active warnings: raised ones, then its own; 0 = none", (WARNING_SLOTS,)),
        Field("raised", "u4", "", "firmware", "warnings by command, newest first, 0 = none", (WARNING_SLOTS,)),
    ],
)
