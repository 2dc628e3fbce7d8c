"""Plain data: the octets of a station's submodules that belong to no axis, a row for each station and direction.

A row's octets are two halves in the memory that all rows of a direction share (:class:`PlainRows`): a device with few
octets takes no more of it.  The row's writer fills one half while readers use the other, and then counts ``sequence``,
whose lowest bit says which half is in force.  A reader that finds another number after its copy than before it copies
again, so that nobody sees half of a change.  After the octets of data each half has one provider status for each
submodule.

A channel copies *pieces*: the data of one submodule, from or to its place in the frame.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pnfarm.table.layout import Field, Layout

__all__ = ["CONSUMED", "NOT_TAKEN", "NO_STATUS", "PIECE", "PLAIN_OCTETS", "PROVIDED", "PlainRows", "allocate_plain"]

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
            Field("begin", "u4", "octets", "station", "where its two halves begin"),
            Field("length", "u4", "octets", "station", "of a half: data, then a status for each submodule"),
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


class PlainRows(NamedTuple):
    """The plain data of one direction: a row for each station, and the octets of all rows."""

    rows: Any
    octets: Any


def allocate_plain(layout: Layout, rows: int) -> PlainRows:
    """``rows`` empty rows of ``PROVIDED`` or ``CONSUMED``, with room for PLAIN_OCTETS each."""
    # memory that nobody writes is none of the process's
    return PlainRows(layout.allocate(rows), np.zeros(rows * 2 * PLAIN_OCTETS, np.uint8))
