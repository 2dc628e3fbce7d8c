"""When the engine was late: a ring of times in which it should have run and did not.

Ticks that are late one after the other share a row, so that the ring reaches back far enough even on a machine that
is late all the time.
"""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout

__all__ = ["LATE", "LATE_ROWS"]

#: Rows of the ring.
LATE_ROWS = 4096

LATE = Layout(
    "late",
    "The ring of times in which the engine was late; ``engine.late_head`` counts the rows written so far.",
    [
        Field("begin_ns", "i8", "ns", "engine", "when the first late tick was due"),
        Field("end_ns", "i8", "ns", "engine", "when the last late tick began"),
        Field("late_ns", "i8", "ns", "engine", "lateness of all its ticks together"),
        Field("waited_ns", "i8", "ns", "engine", "longest time that a received frame waited for its tick"),
    ],
)
