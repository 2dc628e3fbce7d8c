"""An event loop that answers a line before anything else, and knows how long what came may have waited.

A terminal does not stamp its octets.  Those that a loop finds came after its look before, unless it waited for them:
then they came just now.

An *eager* reader is called while the loop waits, between two of its turns: for the few things that come thousands of
times a second, concern nothing else and must be answered at once.
"""

from __future__ import annotations

import asyncio
import os
import select
import selectors
import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    _Found = list[tuple[selectors.SelectorKey, int]]

__all__ = ["LOOKING", "EagerLoop"]


class _Selector(selectors.EpollSelector):
    def __init__(self) -> None:
        super().__init__()
        self.eager: dict[int, Callable[[], bool]] = {}
        #: Whether what had waited is to be measured: that costs one more check in each turn.
        self.is_asked = False
        self._looked_ns = time.monotonic_ns()
        #: What the last check found came at this time at the earliest, ns.
        self.earliest_ns = self._looked_ns
        # the same set of descriptors: what is found there and not taken, the usual check finds again
        self._glance = select.epoll.fromfd(os.dup(self.fileno()))

    def close(self) -> None:
        self._glance.close()
        super().close()

    def select(self, timeout: float | None = None) -> _Found:
        if not self.eager:
            return super().select(timeout)
        until = None if timeout is None else time.monotonic() + timeout
        while True:
            found = self._look(timeout)
            if len(found) != 1:
                break
            fd = found[0][0]
            reader = self.eager.get(fd)
            if reader is None:
                break
            if not reader():
                # it may have read all there was
                return [(self.get_key(fd), selectors.EVENT_READ)] if fd in self.get_map() else []
            if until is not None:
                timeout = until - time.monotonic()
                if timeout <= 0:
                    return []
        return super().select(0) if found else []

    def _look(self, timeout: float | None) -> list[tuple[int, int]]:
        """One descriptor alone, or two of several."""
        if not self.is_asked:
            return self._glance.poll(timeout, 2)
        found = self._glance.poll(0, 2)
        if found or (timeout is not None and timeout <= 0):
            # it was there already
            self.earliest_ns, self._looked_ns = self._looked_ns, time.monotonic_ns()
            return found
        found = self._glance.poll(timeout, 2)
        self.earliest_ns = self._looked_ns = time.monotonic_ns()
        return found


class EagerLoop(asyncio.SelectorEventLoop):
    """The usual event loop of this system, with the selector of this module."""

    def __init__(self) -> None:
        self._looks = _Selector()
        super().__init__(self._looks)

    @property
    def earliest_ns(self) -> int:
        """What is handled now came at this time at the earliest, ns.

        Known only if it was asked for, and there is an eager reader; else it is the present.
        """
        return self._looks.earliest_ns if self._looks.is_asked and self._looks.eager else time.monotonic_ns()

    def ask_for_age(self) -> None:
        """:attr:`earliest_ns` has from now on also what waited while the loop was busy."""
        self._looks.is_asked = True

    def set_eager(self, fd: int, reader: Callable[[], bool] | None) -> None:
        """Have ``reader`` called as soon as a descriptor that has a reader can be read; None: no more.

        It says whether it has done all: if not, the reader is called as usual.  It must not raise, not wait, and call
        nothing of the loop's.
        """
        if reader is None:
            self._looks.eager.pop(fd, None)
        else:
            self._looks.eager[fd] = reader


#: For the options of ``anyio.run``.
LOOKING: dict[str, Any] = {"loop_factory": EagerLoop}
