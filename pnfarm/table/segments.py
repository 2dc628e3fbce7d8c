"""Parts of a fixed room: places in a row are allocated and freed, the lowest gap that fits first."""

from __future__ import annotations

__all__ = ["Segments"]


class Segments:
    """``size`` places from 0 on."""

    def __init__(self, size: int) -> None:
        self.size = size
        #: Start -> length of the parts in use.
        self._used: dict[int, int] = {}

    @property
    def free(self) -> int:
        """Places that are not in use; they may be in several gaps."""
        return self.size - sum(self._used.values())

    def allocate(self, length: int) -> int | None:
        """The first place of ``length`` free ones, at least one; None if no gap is that long."""
        length = max(1, length)
        start = 0
        for used in sorted(self._used):
            if used - start >= length:
                break
            start = used + self._used[used]
        if length > self.size - start:
            return None
        self._used[start] = length
        return start

    def release(self, start: int) -> None:
        """Free what :meth:`allocate` returned."""
        del self._used[start]
