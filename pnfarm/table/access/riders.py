"""The rows of a channel's further axes (``rider`` of :mod:`pnfarm.table.channel`)."""

from __future__ import annotations

from typing import Any

__all__ = ["row_of_axis"]


def row_of_axis(table: Any, row: Any, axis: int) -> Any | None:
    """The row with the words of an axis, counted from 0, in the frames of the channel ``row``; None: it has none."""
    for _ in range(axis):
        if not int(row.rider):
            return None
        row = table[int(row.rider) - 1]
    return row
