"""The merged log as server-sent events: the farm's stream, with a position over all shards as id."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from pnfarm.api.events import format_position, gap, log_stream, parse_position, start_of

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Sequence

    from pnfarm.hub.hub import Hub
    from pnfarm.hub.log import HubEntry, MergedLog

__all__ = ["Reader", "event_stream"]

#: Origins in the position of a client: more are those of shards' runs that ended long ago.
MOST_ORIGINS = 300


class Reader:
    """The messages of one client's stream.  ``begin``: a position, a sequence number of this hub, or None: from now on.

    A hub that has just begun may hear of a shard later than the client did: what the client has is left out whenever it
    comes, and the position never goes back.
    """

    def __init__(self, log: MergedLog, begin: str | None, drive: str | None) -> None:
        self._log = log
        self._drive = drive
        position = parse_position(begin) if begin is not None else None
        self._known = position or {}
        self.after = 0 if position is not None else start_of(log, "", begin)
        self._position = dict([*log.position(self.after).items()][-MOST_ORIGINS:])
        for origin, number in self._known.items():
            if origin in self._position or len(self._position) < MOST_ORIGINS:
                self._position[origin] = max(number, self._position.get(origin, 0))

    def first(self) -> str:
        lost = self._log.lost(self._known)
        return gap(lost) if lost else ""

    def text(self, entries: Sequence[HubEntry], lost: int) -> str:
        # how many entries lie between says nothing: the client may have some of them
        del lost
        text = ""
        for entry in entries:
            if entry.number <= self._known.get(entry.origin, 0):
                continue
            if (missed := entry.number - 1 - self._position.get(entry.origin, entry.number)) > 0:
                text += gap(missed)
            if entry.origin not in self._position and len(self._position) >= MOST_ORIGINS:
                there = [(one, number) for one, number in self._position.items() if self._log.taken(one)]
                self._position = dict(there[-(MOST_ORIGINS - 1) :])
            self._position[entry.origin] = entry.number
            if self._drive is None or entry.drive == self._drive:
                data = json.dumps(entry.as_dict(), default=str)
                text += f"id: {format_position(self._position)}\ndata: {data}\n\n"
        return text


def event_stream(hub: Hub, begin: str | None, drive: str | None, *, follow: bool = True) -> AsyncIterator[str]:
    """Messages for every entry after ``begin``, of one drive or of all."""
    return log_stream(hub, hub.log, Reader(hub.log, begin, drive), follow=follow)
