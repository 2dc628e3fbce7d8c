"""Fields of the axis record: clock."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["CLOCK_RECORD"]

CLOCK_RECORD = subject(
    "clock",
    "The drive's own clock.",
    settings=[
        Field("drift", "f8", "", "station", "how much faster the drive's clock runs: 1e-6 = 1 ppm, 0 = no drift"),
        Field("start_ns", "i8", "ns", "station", "when it showed the true time"),
    ],
)
