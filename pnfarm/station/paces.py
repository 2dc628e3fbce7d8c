"""How often the log has what peers may do without end: a master that is refused tries again for hours.

An event whose class has a :class:`~pnfarm.station.event.Pace` has an entry while it keeps to that; what comes faster,
of the same class on the same drive, is only counted.  The next entry gives the number of events for which it stands.
What was counted of attempts to connect has an entry, that of the last one, when a connection comes to data.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

from pnfarm.station.event import ATTEMPT

if TYPE_CHECKING:
    from pnfarm.station.event import Event, Pace

__all__ = ["Paces"]

_Entry = TypeVar("_Entry")


class _Kind(Generic[_Entry]):
    """One class of events on one drive: when its next entry would keep exactly to the pace, and what was counted."""

    __slots__ = ("counted", "due_ns", "last")

    def __init__(self) -> None:
        self.due_ns = 0
        self.counted = 0
        #: The last one that has no entry, and when it was.
        self.last: tuple[int, _Entry] | None = None

    def told(self) -> int:
        """The number of events for which an entry stands that is written now."""
        counted, self.counted, self.last = self.counted, 0, None
        return counted


class Paces(Generic[_Entry]):
    """See the module's docstring."""

    def __init__(self) -> None:
        self._drives: dict[str, dict[type[Event], _Kind[_Entry]]] = {}

    def take(self, now: int, drive: str, event: Event, pace: Pace, entry: _Entry) -> int:
        """The number of events for which the entry of this one stands, 0 where it is only counted."""
        kind = self._drives.setdefault(drive, {}).setdefault(type(event), _Kind())
        kind.counted += 1
        # not beyond what the entries at once make of it: a clock may be put back
        due = min(max(kind.due_ns, now), now + pace.at_once * pace.every_ns)
        if due > now + (pace.at_once - 1) * pace.every_ns:
            kind.due_ns, kind.last = due, (now, entry)
            return 0
        kind.due_ns = due + pace.every_ns
        return kind.told()

    def succeeded(self, drive: str, now: int) -> list[tuple[_Entry, int]]:
        """A connection came to data: the last of the attempts that were only counted, and the number of each kind.

        The end of this connection, and the next attempt, have entries in any case.
        """
        found = []
        for event, kind in self._drives.get(drive, {}).items():
            if event.PACE is not ATTEMPT:
                continue
            kind.due_ns = min(kind.due_ns, now + (ATTEMPT.at_once - 1) * ATTEMPT.every_ns)
            if kind.last is not None:
                when, entry = kind.last
                found.append((when, entry, kind.told()))
        return [(entry, count) for _, entry, count in sorted(found, key=lambda one: one[0])]
