"""Fields of the axis record: foldback."""

from __future__ import annotations

from math import inf

from pnfarm.table.layout import Field, subject

__all__ = ["FOLDBACK_RECORD"]

FOLDBACK_RECORD = subject(
    "foldback",
    "Foldback of motor and drive, in this order.",
    settings=[
        Field("delay", "f8", "s", "station", "how long the peak current is available before its limit falls", (2,)),
        Field("time", "f8", "s", "station", "time constant with which the limit falls, 0 = it does not", (2,)),
        Field("fault_level", "f8", "A", "parameter", "limit below which it is a fault (IL.FOLDFTHRESHU)"),
        Field("warning_level", "f8", "A", "parameter", "limit below which it is a warning, 0 = none"),
        Field("warning", "u4", "", "parameter", "warning of each limit, 0 = none", (2,)),
        Field("drive_fault", "u4", "", "parameter", "fault of the drive's limit, number | reaction << 24"),
    ],
    state=[
        Field("used", "f8", "A", "firmware", "how far each limit is below its initial value", (2,)),
        Field("limit", "f8", "A", "firmware", "each limit, inf = none", (2,), default=inf),
        Field("current", "f8", "A", "firmware", "the lower limit (IL.IFOLD)", default=inf),
    ],
)
