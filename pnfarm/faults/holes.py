"""Free parts of a table, from which parts of any length are taken and to which they return."""

from __future__ import annotations

from bisect import bisect_left

__all__ = ["Holes"]


class Holes:
    """Free rows among ``size``; neighbours that are free become one part again, so nothing is lost to fragments."""

    def __init__(self, size: int) -> None:
        #: (first row, number of rows), in order; no two touch.
        self._free: list[tuple[int, int]] = [(0, size)] if size else []

    @property
    def parts(self) -> list[tuple[int, int]]:
        """(first row, number of rows) of each free part."""
        return list(self._free)

    def take(self, length: int) -> int | None:
        """First row of the first free part that is long enough; None without one."""
        for number, (first, free) in enumerate(self._free):
            if free > length:
                self._free[number] = first + length, free - length
                return first
            if free == length:
                del self._free[number]
                return first
        return None

    def give(self, first: int, length: int) -> None:
        """Return what :meth:`take` gave."""
        number = bisect_left(self._free, (first, 0))
        if number < len(self._free) and self._free[number][0] == first + length:
            length += self._free.pop(number)[1]
        if number and sum(self._free[number - 1]) == first:
            before, free = self._free.pop(number - 1)
            first, length, number = before, free + length, number - 1
        self._free.insert(number, (first, length))
