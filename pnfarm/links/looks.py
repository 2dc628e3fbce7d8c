"""When an event loop looked for what came: a terminal does not stamp its octets.

Octets that a loop finds came after its look before, unless it waited for them: then they came just now.
"""

from __future__ import annotations

import asyncio
import selectors
import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["LOOKING", "LookingLoop"]


class _Selector(selectors.EpollSelector):
    """One that keeps the time."""

    def __init__(self, clock: Callable[[], int]) -> None:
        super().__init__()
        self._clock = clock
        self._looked_ns = clock()
        #: What the last look found came at this time at the earliest, ns.
        self.earliest_ns = self._looked_ns

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        found = super().select(0)
        if found or timeout == 0:
            # it was there already
            self.earliest_ns, self._looked_ns = self._looked_ns, self._clock()
            return found
        found = super().select(timeout)
        self.earliest_ns = self._looked_ns = self._clock()
        return found


class LookingLoop(asyncio.SelectorEventLoop):
    """The usual event loop of this system, which knows how long what it found may have waited."""

    def __init__(self, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self._looks = _Selector(clock)
        super().__init__(self._looks)

    @property
    def earliest_ns(self) -> int:
        """What the present turn of the loop handles came at this time at the earliest, ns."""
        return self._looks.earliest_ns


#: For the options of ``anyio.run``.
LOOKING: dict[str, Any] = {"loop_factory": LookingLoop}
