"""What happened in a farm: one line for every change of a connection, a state, a fault.

The log keeps the last entries of the whole farm and of each drive, notifies subscribers (the API's event stream)
and writes structlog events.  Only the log renders events as text.
"""

from __future__ import annotations

import time
from collections import deque
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeVar

import structlog

from pnfarm.station.events import ConnectionEstablished
from pnfarm.station.paces import Paces
from pnfarm.wire.value import value_class

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.station.event import Event

__all__ = ["EventLog", "LogEntry", "listening"]

_T = TypeVar("_T")

#: Entries kept for the whole farm, and for each drive.
FARM_ENTRIES = 4096
DRIVE_ENTRIES = 64

logger = structlog.get_logger("pnfarm")


@value_class
class LogEntry:
    """``now_ns`` is the farm's clock, monotonic or virtual; ``wall`` seconds since the epoch; ``drive`` "" the farm.

    ``stands_for``: events of this kind on this drive since its last entry (:mod:`pnfarm.station.paces`).
    """

    sequence: int
    now_ns: int
    wall: float
    drive: str
    what: Event
    stands_for: int = 1

    @property
    def event(self) -> str:
        """What happened, in a few lower-case words."""
        return self.what.text

    @property
    def data(self) -> dict[str, Any]:
        """Its values, plain JSON."""
        return self.what.details() | self.repeated

    @property
    def repeated(self) -> dict[str, int]:
        """The number of events, where there are several."""
        return {"repeated": self.stands_for} if self.stands_for > 1 else {}

    def __str__(self) -> str:
        values = ", ".join(f"{key} {value}" for key, value in self.data.items())
        who = f"{self.drive}: " if self.drive else ""
        return f"{self.now_ns / 1e9:.3f} s {who}{self.event}" + (f" ({values})" if values else "")

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "sequence": self.sequence,
            "time": self.wall,
            "farm_seconds": self.now_ns / 1e9,
            "drive": self.drive,
            "event": self.event,
            **self.data,
        }


class EventLog:
    """``quiet`` keeps structlog out, for tests and for the demo's live table."""

    def __init__(self, *, quiet: bool = False) -> None:
        self.quiet = quiet
        self._sequence = 0
        self._paces: Paces[LogEntry] = Paces()
        self._farm: deque[LogEntry] = deque(maxlen=FARM_ENTRIES)
        self._drives: dict[str, list[LogEntry]] = {}
        self._subscribers: list[Callable[[LogEntry], None]] = []
        self._followers: list[Callable[[], None]] = []

    def record(self, now: int, drive: str, event: Event) -> LogEntry:
        """Append one entry, or count the event where peers cause too many, and notify the subscribers."""
        entry = LogEntry(self._sequence, now, time.time(), drive, event)
        count = 1 if event.PACE is None else self._paces.take(now, drive, event, event.PACE, entry)
        if count:
            if isinstance(event, ConnectionEstablished):
                for before, of in self._paces.succeeded(drive, now):
                    self._append(before, of)
            entry = self._append(entry, count)
        for subscriber in list(self._subscribers):
            subscriber(entry)
        return entry

    def next_deadline(self) -> int | None:
        """When :meth:`service` is due."""
        return self._paces.next_deadline()

    def service(self, now: int) -> None:
        """Write the entries of what was only counted."""
        for entry, count in self._paces.overdue(now):
            self._append(entry, count)

    def _append(self, event: LogEntry, count: int) -> LogEntry:
        self._sequence += 1
        entry = LogEntry(self._sequence, event.now_ns, event.wall, event.drive, event.what, count)
        drive, what = entry.drive, entry.what
        self._farm.append(entry)
        if drive:
            entries = self._drives.setdefault(drive, [])
            entries.append(entry)
            del entries[:-DRIVE_ENTRIES]
        if not self.quiet:
            told = what.logged() | entry.repeated
            getattr(logger, what.level)(what.text, **({"drive": drive} if drive else {}), **told)
        for follower in list(self._followers):
            follower()
        return entry

    @property
    def newest(self) -> int:
        """The sequence number of the last entry, 0 before there is one."""
        return self._sequence

    def entries(self, drive: str | None = None, *, after: int = 0, most: int | None = None) -> list[LogEntry]:
        """Oldest first; of one drive or all, with a sequence number above ``after``, not more than ``most``."""
        if drive is not None:
            return [entry for entry in self._drives.get(drive, ()) if entry.sequence > after][:most]
        # the farm's numbers have no gaps: what is new is counted from the end
        start = max(0, len(self._farm) - max(0, self._sequence - after))
        end = len(self._farm) if most is None else min(len(self._farm), start + most)
        if start < len(self._farm) // 2:
            return list(islice(self._farm, start, end))
        return [self._farm[place] for place in range(start, end)]

    def subscribe(self, subscriber: Callable[[LogEntry], None]) -> Callable[[], None]:
        """Call ``subscriber`` for each event, one that is only counted as well; the returned function ends that."""
        return listening(self._subscribers, subscriber)

    def follow(self, follower: Callable[[], None]) -> Callable[[], None]:
        """Call ``follower`` for each new entry; the returned function ends that."""
        return listening(self._followers, follower)


def listening(listeners: list[_T], listener: _T) -> Callable[[], None]:
    """Put one into a list; the returned function takes it out again."""
    listeners.append(listener)

    def end() -> None:
        if listener in listeners:
            listeners.remove(listener)

    return end
