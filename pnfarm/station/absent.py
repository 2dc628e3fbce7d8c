"""What controllers ask for on one bus and no station of the farm has: names, addresses."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.station.visits import Caller

__all__ = ["FRESH_NS", "Absent", "Wanted"]

#: Entries kept; the one that was asked for longest ago goes first.
MOST_WANTED = 64
#: What was not asked for in this time is not missed any more: controllers repeat a search each few seconds.
FORGOTTEN_NS = 60_000_000_000
#: A repetition this soon changes nothing: each port may get a copy of one frame.
FRESH_NS = 100_000_000


@dataclass(slots=True)
class Wanted:
    """``name``: a name of station, or an address as text; times in ns."""

    name: str
    caller: Caller
    first_ns: int
    last_ns: int


class Absent:
    """See the module's docstring."""

    def __init__(self) -> None:
        self._wanted: OrderedDict[tuple[str, Caller], Wanted] = OrderedDict()

    def note(self, name: str, caller: Caller, now: int) -> None:
        """A controller asks for a station that does not exist."""
        key = name, caller
        found = self._wanted.get(key)
        if found is None:
            if len(self._wanted) >= MOST_WANTED:
                self._wanted.popitem(last=False)
            self._wanted[key] = Wanted(name, caller, now, now)
        elif now - found.last_ns >= FRESH_NS:
            found.last_ns = now
            self._wanted.move_to_end(key)

    def listed(self, now: int) -> list[Wanted]:
        """What is missed now, the oldest wish first."""
        while self._wanted and now - next(iter(self._wanted.values())).last_ns > FORGOTTEN_NS:
            self._wanted.popitem(last=False)
        return sorted(self._wanted.values(), key=lambda one: one.first_ns)
