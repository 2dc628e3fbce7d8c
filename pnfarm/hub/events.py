"""The merged log as server-sent events: the farm's stream, with a position as id (:mod:`pnfarm.hub.log`)."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from pnfarm.api.events import gap, log_stream, start_of
from pnfarm.hub.log import format_position, parse_position

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Sequence

    from pnfarm.hub.hub import Hub
    from pnfarm.hub.log import HubEntry, MergedLog

__all__ = ["event_stream"]


class _Reader:
    """``begin``: a position, a sequence number of this hub, or None: from now on."""

    def __init__(self, log: MergedLog, begin: str | None, drive: str | None) -> None:
        self._log = log
        self._drive = drive
        self._known = parse_position(begin) if begin is not None else None
        self.after = 0 if self._known is not None else start_of(log, begin)
        self._position = log.position(self.after)
        self._newest = log.newest

    def first(self) -> str:
        lost = 0 if self._known is None else self._log.lost(self._known)
        return gap(lost) if lost else ""

    def text(self, entries: Sequence[HubEntry], lost: int) -> str:
        known, text = self._known, ""
        if lost > 0 and known is None:
            text += gap(lost)
        for entry in entries:
            if entry.lost and known is None:
                text += gap(entry.lost)
            self._position[entry.origin] = entry.number
            if known is not None and entry.number <= known.get(entry.origin, 0):
                continue
            if self._drive is None or entry.drive == self._drive:
                data = json.dumps(entry.as_dict(), default=str)
                text += f"id: {format_position(self._position)}\ndata: {data}\n\n"
        if entries[-1].sequence >= self._newest:
            # from here on everything is new to this client
            self._known = None
        return text


def event_stream(hub: Hub, begin: str | None, drive: str | None, *, follow: bool = True) -> AsyncIterator[str]:
    """Messages for every entry behind ``begin``, of one drive or of all."""
    return log_stream(hub, hub.log, _Reader(hub.log, begin, drive), follow=follow)
