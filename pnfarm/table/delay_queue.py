"""The store of cyclic frames that impairments hold: delayed ones, copies, changed ones.

The octets of slot *i* are in the row of the frame store after the providers' rows: ``channels + i``.  The first half
of the slots is for frames on their way out, the second for those on their way in.
"""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout

__all__ = ["HELD", "INWARD", "OUTWARD"]

#: Rows of ``held_order``.
OUTWARD = 0
INWARD = 1

HELD = Layout(
    "held",
    "A cyclic frame that an impairment holds.",
    [
        Field("due_ns", "i8", "ns", "engine", "when it goes on"),
        Field("number", "i8", "", "engine", "frames held so far: those due at one time keep their order"),
        Field("row", "i4", "", "engine", "its provider, or the consumer that it is for; -1 = it is to be dropped"),
        Field("generation", "u4", "", "engine", "use of the consumer's row"),
        Field("impairment", "i4", "", "engine", "impairment row + 1 that holds it"),
        Field("uses", "u4", "", "engine", "use of that row"),
        Field("length", "i4", "octets", "engine", "whole frame"),
        Field("place", "i4", "octets", "engine", "offset of the frame id of a frame on its way in"),
        Field("port", "i4", "", "engine", "where it goes out"),
    ],
)
