"""The process image: what a station exchanges with its peer each cycle.

Row *i* belongs to axis *i* on a farm and to program *i* on a controller.  For a drive ``received`` holds
set points and ``sent`` actual values; for a controller it is the other way round.
"""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout
from pnfarm.table.signals import SLOTS

__all__ = ["IMAGE"]

# Why set points are not valid (``lost``).
LOST_NOT = 0  # they are valid
LOST_NEVER = 1  # no controller yet
LOST_EXPIRED = 2  # the data hold timer ran out
LOST_STOP = 3  # the provider is in STOP, or its IOPS is BAD
LOST_CLOSED = 4  # the connection was taken down

IMAGE = Layout(
    "image",
    "Signals of one station by slot (:mod:`pnfarm.table.signals`); a 16-bit signal is unsigned in its 32 bits.",
    [
        Field("received", "i4", "", "receive", "signals that the peer sends", (SLOTS,)),
        Field("frames", "u4", "", "receive", "set point frames taken so far"),
        Field("filled", "u4", "", "transmit", "frames filled so far"),
        Field("frame_ns", "i8", "ns", "receive", "arrival of the last frame with set points, 0 = none yet"),
        Field("interval_ns", "i8", "ns", "receive", "time between the last two of one connection, 0 = only one yet"),
        Field("injected", "u2", "", "fault", "injections in force on the station"),
        Field("valid", "u1", "", "receive", "1 while a peer in RUN sends them with good status"),
        Field("lost", "u1", "", "receive", "why they are not valid: LOST_* below"),
        Field(
            "sent",
            "i4",
            "",
            "firmware",
            "signals that this station sends (a controller's are written by its program)",
            (SLOTS,),
        ),
        Field("good", "u1", "", "station", "1 = own IOPS is GOOD"),
        Field("port", "u4", "", "station", "the station's port, as frames that come in name it; 0 = none"),
        Field("mac", "i8", "", "station", "the station's address: MAC as a 48-bit number"),
        Field(
            "strays", "i8", "frames", "receive", "cyclic frames to this station or a group that belong to no channel"
        ),
        # the parameter channel: eight octets as one number, so that neither side reads a half-written value
        Field("parameter_task", "i8", "", "firmware", "the task reported last"),
        Field("parameter_told_ns", "i8", "ns", "firmware", "when it was reported"),
        Field("parameter_answered", "i8", "", "station", "the task that parameter_answer answers"),
        Field("parameter_answer", "i8", "", "station", "the answer that is sent"),
        Field("parameter_repeats", "u1", "", "station", "1 = the answer is a value that is to be kept up to date"),
    ],
    cache_lines=True,
)
