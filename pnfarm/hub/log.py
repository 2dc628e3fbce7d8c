"""The event logs of all shards as one, in the order in which things happened by the hub's clock.

An entry waits for :data:`HOLD_NS` before it is given out, so that one of another shard that happened earlier, and comes
later, is before it.  One that comes later still is given out at once, out of order.

Two numbers mark a place in the log.  ``sequence`` counts the hub's own entries, as a farm's does; it starts again with
the hub.  The *position* (:mod:`pnfarm.api.events`) has the last number of each shard's run: with it a client goes on
after the hub was restarted, because the shards still have their entries.
"""

from __future__ import annotations

import heapq
from collections import deque
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any

from pnfarm.station.event_log import listening

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

__all__ = ["HOLD_NS", "HubEntry", "MergedLog"]

#: How long an entry waits for earlier ones of other shards.
HOLD_NS = 250_000_000
#: Entries that are kept, and those that wait: beyond it the oldest do not wait any longer.
KEPT = 16_384
MOST_WAITING = 8_192


@dataclass(frozen=True, slots=True)
class HubEntry:
    """``origin`` is a run of a shard, ``number`` its own number there; ``at_ns`` by the hub's clock."""

    sequence: int
    origin: str
    number: int
    at_ns: int
    data: Mapping[str, Any]

    @property
    def drive(self) -> str:
        return str(self.data.get("drive", ""))

    def as_dict(self) -> dict[str, Any]:
        """As a farm's entry, with the hub's number."""
        return {**self.data, "sequence": self.sequence}


class MergedLog:
    """``now`` is the hub's clock, ns."""

    def __init__(self) -> None:
        self._kept: deque[HubEntry] = deque()
        self._waiting: list[tuple[int, int, str, int, int, Mapping[str, Any]]] = []
        #: The time after which the next entry of each origin comes.
        self._behind: dict[str, int] = {}
        self._order = count()
        self._sequence = 0
        #: The last number of each origin: taken, given out, and no longer kept.
        self._taken: dict[str, int] = {}
        self._dropped: dict[str, int] = {}
        self._subscribers: list[Callable[[HubEntry], None]] = []

    def taken(self, origin: str) -> int:
        """The last number that came of a shard's run."""
        return self._taken.get(origin, 0)

    def take(self, origin: str, number: int, at_ns: int, data: Mapping[str, Any]) -> None:
        """An entry of a shard's run; one that was taken before is left out.

        A run's entries stay in their own order, also where their times do not rise: a position has one number of each.
        """
        known = self._taken.get(origin, 0)
        if number <= known:
            return
        if number > known + 1:
            # the shard itself does not hold them any more
            self._dropped[origin] = number - 1
        self._taken[origin] = number
        behind = self._behind[origin] = max(at_ns, self._behind.get(origin, at_ns))
        heapq.heappush(self._waiting, (behind, next(self._order), origin, number, at_ns, data))

    def forget_but(self, live: Collection[str]) -> None:
        """Forget what is known of runs that are over, once none of their entries is kept."""
        for origin in [one for one in self._taken if one not in live]:
            if self._dropped.get(origin, 0) >= self._taken[origin]:
                del self._taken[origin], self._behind[origin], self._dropped[origin]

    def next_deadline(self) -> int | None:
        """When :meth:`release` is due."""
        return self._waiting[0][0] + HOLD_NS if self._waiting else None

    def release(self, now: int) -> None:
        """Give out what has waited long enough."""
        while self._waiting and (self._waiting[0][0] + HOLD_NS <= now or len(self._waiting) > MOST_WAITING):
            _, _, origin, number, at_ns, data = heapq.heappop(self._waiting)
            self._sequence += 1
            entry = HubEntry(self._sequence, origin, number, at_ns, data)
            self._kept.append(entry)
            while len(self._kept) > KEPT:
                old = self._kept.popleft()
                self._dropped[old.origin] = max(old.number, self._dropped.get(old.origin, 0))
            for subscriber in list(self._subscribers):
                subscriber(entry)

    @property
    def newest(self) -> int:
        return self._sequence

    def entries(self, *, after: int = 0, most: int | None = None) -> list[HubEntry]:
        """Oldest first, after this sequence number."""
        if not self._kept:
            return []
        start = max(0, after - self._kept[0].sequence + 1)
        stop = len(self._kept) if most is None else min(len(self._kept), start + most)
        return [self._kept[place] for place in range(start, stop)]

    def position(self, sequence: int) -> dict[str, int]:
        """The position after this entry."""
        found = dict(self._dropped)
        for entry in self._kept:
            if entry.sequence > sequence:
                break
            found[entry.origin] = entry.number
        return found

    def lost(self, position: Mapping[str, int]) -> int:
        """How many entries after a position are no longer kept."""
        return sum(
            max(0, self._dropped[origin] - number) for origin, number in position.items() if origin in self._dropped
        )

    def subscribe(self, subscriber: Callable[[HubEntry], None]) -> Callable[[], None]:
        """Call ``subscriber`` for each new entry; the returned function ends that."""
        return listening(self._subscribers, subscriber)

    def follow(self, follower: Callable[[], None]) -> Callable[[], None]:
        """The same without the entry."""
        return self.subscribe(lambda _: follower())
