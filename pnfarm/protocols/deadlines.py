"""The earliest of many deadlines, each under a key, at the cost of a heap instead of a scan."""

from __future__ import annotations

import heapq
from typing import Final, Protocol

__all__ = ["Deadlines", "Timed", "earliest"]

_SLACK: Final = 64


class Timed(Protocol):
    """What has something to do at a time of its own."""

    def next_deadline(self) -> int | None:
        """When, nanoseconds; None while it waits for nothing."""


def earliest(*machines: Timed) -> int | None:
    """The earliest deadline of some machines."""
    # a plain loop: this is asked of each drive after each frame
    first = None
    for machine in machines:
        due = machine.next_deadline()
        if due is not None and (first is None or due < first):
            first = due
    return first


class Deadlines:
    """One deadline for each key; integer times, nanoseconds.

    A key that is set again leaves its former entry in the heap.  Such entries are skipped, and removed once they
    are more than the live ones, so that the memory is in proportion to the keys however often they are set.
    """

    __slots__ = ("_due", "_heap")

    def __init__(self) -> None:
        self._due: dict[int, int] = {}
        self._heap: list[tuple[int, int]] = []

    def __len__(self) -> int:
        return len(self._due)

    def set(self, key: int, due: int | None) -> None:
        """Write a key's deadline; None forgets it."""
        if due is None:
            self._due.pop(key, None)
        elif self._due.get(key) != due:
            self._due[key] = due
            heapq.heappush(self._heap, (due, key))
            if len(self._heap) > 2 * len(self._due) + _SLACK:
                self._heap = [(at, known) for known, at in self._due.items()]
                heapq.heapify(self._heap)

    def first(self) -> int | None:
        """The earliest deadline."""
        while self._heap and self._due.get(self._heap[0][1]) != self._heap[0][0]:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    def take(self, now: int) -> list[int]:
        """Keys that are due, each once, the earliest first; they are forgotten until set again."""
        keys = []
        while (due := self.first()) is not None and due <= now:
            _, key = heapq.heappop(self._heap)
            del self._due[key]
            keys.append(key)
        return keys
