"""Server-sent events; those of log entries are made once for all streams."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.station.event_log import LogEntry

__all__ = ["Messages", "message"]

#: Messages kept for other streams.
MESSAGES = 256


def message(event: str, data: object) -> bytes:
    """``data``: JSON octets, or what becomes JSON."""
    text = data if isinstance(data, bytes) else json.dumps(data, separators=(",", ":"), default=str).encode()
    return b"event: %b\ndata: %b\n\n" % (event.encode(), text)


class Messages:
    """Log entries of one run as events, each made once for all streams; the last of them are kept."""

    def __init__(self, run: str) -> None:
        self._run = run
        self._kept: dict[int, str] = {}

    def of(self, entry: LogEntry) -> str:
        """The event of an entry of the farm's one log."""
        found = self._kept.get(entry.sequence)
        if found is None:
            found = f"id: {self._run}-{entry.sequence}\ndata: {json.dumps(entry.as_dict(), default=str)}\n\n"
            self._kept[entry.sequence] = found
            if len(self._kept) > MESSAGES:
                del self._kept[next(iter(self._kept))]
        return found
