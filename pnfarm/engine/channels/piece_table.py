"""Allocates rows of the piece table: the plain data in the frames of each open channel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pnfarm.engine.channels.parts import Piece
from pnfarm.engine.columns import Columns
from pnfarm.errors import InternalError
from pnfarm.table.plain_data import NO_STATUS, NOT_TAKEN
from pnfarm.table.segments import Segments

__all__ = ["PieceTable"]


class PieceTable:
    """The pieces of a channel are rows in sequence; those of a closed one are free when a whole tick has passed."""

    def __init__(self, columns: Columns) -> None:
        self._columns = columns
        self._segments = Segments(columns.piece.shape[0])
        #: First rows that the engine may still use, and its cycles when they were left.
        self._left: list[tuple[int, int]] = []

    def leave(self, row: Any) -> None:
        """A channel's row no longer needs its pieces; the engine may be using them."""
        if row["pieces"]:
            self._left.append((int(row["piece"]), int(self._columns.engine[0]["cycles"])))

    def put(self, row: Any, pieces: Sequence[Piece], plain: int, start: int) -> None:
        """Give a channel's row other pieces, of row ``plain``; ``start``: of the IO data, as its words count."""
        cycles = int(self._columns.engine[0]["cycles"])
        # the tick in which they were left may have looked at the channel before
        self._release([entry for entry in self._left if cycles - entry[1] > 1])
        self.leave(row)
        # also of a channel without pieces yet: the station lays its frames out again
        row["pieces"], row["plain"] = 0, plain
        if not pieces:
            return
        first = self._segments.allocate(len(pieces))
        if first is None:
            # so many changes since the last tick: a frame that is being filled at this moment may have some of each
            self._release(list(self._left))
            first = self._segments.allocate(len(pieces))
        if first is None:
            raise InternalError(f"all {self._segments.size} rows of the piece table are in use")
        for number, piece in enumerate(pieces, start=first):
            one = self._columns.piece[number]
            one["frame"], one["place"], one["length"] = start + piece.frame, piece.place, piece.length
            one["status_frame"] = NO_STATUS if piece.status_frame is None else start + piece.status_frame
            if not piece.taken:
                one["status_frame"] = NOT_TAKEN
            one["status_place"] = piece.status_place
        row["piece"] = first
        row["pieces"] = len(pieces)

    def _release(self, entries: Sequence[tuple[int, int]]) -> None:
        for entry in entries:
            self._left.remove(entry)
            self._segments.release(entry[0])
