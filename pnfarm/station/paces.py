"""How often the log has what peers may do without end: a master that is refused tries again for hours.

An event whose class has a :class:`~pnfarm.station.event.Pace` has an entry while it keeps to that; what comes faster,
of the same class on the same drive, is counted, and the last one has an entry with their number as soon as the pace
permits it.  What was counted of attempts to connect has its entry also when a connection comes to data.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

from pnfarm.station.event import ATTEMPT
from pnfarm.station.events import ConnectionEstablished

if TYPE_CHECKING:
    from pnfarm.station.event import Event, Pace

__all__ = ["Paces"]

_Entry = TypeVar("_Entry")


class _Kind(Generic[_Entry]):
    """One class of events on one drive: when its next entry would keep exactly to the pace, and what was counted."""

    __slots__ = ("counted", "due_ns", "last", "pace")

    def __init__(self, pace: Pace) -> None:
        self.pace = pace
        self.due_ns = 0
        self.counted = 0
        #: The last one that has no entry, and when it was.
        self.last: tuple[int, _Entry] | None = None

    @property
    def free_ns(self) -> int:
        """From when on an entry is permitted."""
        return self.due_ns - (self.pace.at_once - 1) * self.pace.every_ns

    def told(self, now: int) -> int:
        """The number of events that an entry counts that is written now."""
        self.due_ns = max(self.due_ns, now) + self.pace.every_ns
        counted, self.counted, self.last = self.counted, 0, None
        return counted


class Paces(Generic[_Entry]):
    """See the module's docstring."""

    def __init__(self) -> None:
        self._drives: dict[str, dict[type[Event], _Kind[_Entry]]] = {}
        #: Those with an event that has no entry.
        self._waiting: dict[tuple[str, type[Event]], _Kind[_Entry]] = {}

    def take(self, now: int, drive: str, event: Event, pace: Pace, entry: _Entry) -> int:
        """The number of events that the entry of this one counts, 0 where it is only counted."""
        what = type(event)
        kind = self._drives.setdefault(drive, {}).setdefault(what, _Kind(pace))
        kind.counted += 1
        # not beyond what the entries at once make of it: a clock may be put back
        kind.due_ns = min(kind.due_ns, now + pace.at_once * pace.every_ns)
        if kind.free_ns > now:
            kind.last = now, entry
            self._waiting[drive, what] = kind
            return 0
        self._waiting.pop((drive, what), None)
        return kind.told(now)

    def next_deadline(self) -> int | None:
        """When :meth:`overdue` has something."""
        return min((kind.free_ns for kind in self._waiting.values()), default=None)

    def overdue(self, now: int) -> list[tuple[_Entry, int]]:
        """Counted events that have their entries now, with their numbers."""
        found = []
        for (drive, what), kind in list(self._waiting.items()):
            if kind.last is not None and kind.free_ns <= now:
                found += self._told(drive, what, now)
                if issubclass(what, ConnectionEstablished):
                    found += self._attempts(drive, now)
        return _in_order(found)

    def succeeded(self, drive: str, now: int) -> list[tuple[_Entry, int]]:
        """A connection came to data: entries of attempts that were only counted.

        The end of this connection, and the next attempt, have entries in any case.
        """
        return _in_order(self._attempts(drive, now))

    def _attempts(self, drive: str, now: int) -> list[tuple[int, _Entry, int]]:
        found = []
        for what, kind in self._drives.get(drive, {}).items():
            if what.PACE is ATTEMPT:
                found += self._told(drive, what, now)
                kind.due_ns = min(kind.due_ns, now + (ATTEMPT.at_once - 1) * ATTEMPT.every_ns)
        return found

    def _told(self, drive: str, what: type[Event], now: int) -> list[tuple[int, _Entry, int]]:
        kind = self._drives[drive][what]
        self._waiting.pop((drive, what), None)
        return [] if kind.last is None else [(*kind.last, kind.told(now))]


def _in_order(found: list[tuple[int, _Entry, int]]) -> list[tuple[_Entry, int]]:
    return [(entry, count) for _, entry, count in sorted(found, key=lambda one: one[0])]
