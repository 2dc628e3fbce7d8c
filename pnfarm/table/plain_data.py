"""Plain data: the octets of a station's submodules that belong to no axis, a row for each station and direction.

A row has two halves: its writer fills one while readers use the other, and then counts ``sequence``, whose lowest bit
says which half is in force.  A reader that finds another number behind its copy than before it copies again, so that
nobody sees half of a change.  Behind the octets of data each half has one provider status for each submodule.

A channel copies *pieces*: the data of one submodule, from or to its place in the frame.
"""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout

__all__ = ["CONSUMED", "NOT_TAKEN", "NO_STATUS", "PIECE", "PLAIN_OCTETS", "PROVIDED"]

#: Octets of data and statuses of one station and direction.
PLAIN_OCTETS = 4096
#: A piece whose status no frame carries.
NO_STATUS = 0xFFFF
#: A piece that a consumer does not take: its data stay, with status BAD.
NOT_TAKEN = 0xFFFE


def _plain(name: str, doc: str, writer: str) -> Layout:
    return Layout(
        name,
        doc,
        [
            Field("sequence", "u4", "", writer, "counts the changes; its lowest bit is the half in force"),
            Field("length", "u2", "octets", "station", "data and statuses in use"),
            Field("octets", "u1", "", writer, "two halves: data, then a status for each submodule", (2, PLAIN_OCTETS)),
        ],
    )


PROVIDED = _plain("provided", "Plain data that a station sends.", "station")
CONSUMED = _plain("consumed", "Plain data that a station receives: of each submodule the last good ones.", "receive")

PIECE = Layout(
    "piece",
    "The plain data of one submodule in the frames of a channel; a channel's pieces are rows in sequence.",
    [
        Field("frame", "u2", "octets", "station", "its place in the frame, as the words of its channel count"),
        Field("place", "u2", "octets", "station", "its place in a half of the station's row"),
        Field("length", "u2", "octets", "station", "octets of data"),
        Field(
            "status_frame",
            "u2",
            "octets",
            "station",
            "place of its provider status in the frame, NO_STATUS: none, or NOT_TAKEN",
        ),
        Field("status_place", "u2", "octets", "station", "place of its provider status in the half"),
    ],
)
