"""A thread that is handed calls of people's code by one that waits for them."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from pnfarm.errors import InternalError
from pnfarm.user_code.calling_thread import CallingThread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.user_code.calling_thread import Call

__all__ = ["Worker"]

#: How long :meth:`Worker.close` waits.
_CLOSE_SECONDS = 1.0


class Worker:
    """One thread, started by the first :meth:`run`."""

    def __init__(self) -> None:
        # plain locks, held until there is something: a semaphore of Python's costs a third more per call
        self._begin, self._done = threading.Lock(), threading.Lock()
        self._begin.acquire()
        self._done.acquire()
        self._calls: Sequence[Call] = ()
        self._thread: CallingThread | None = None

    def run(self, calls: Sequence[Call], limit_ns: int) -> Call | None:
        """Make the calls in turn and wait.  Returns the one that exceeded the limit; the worker is of no use then."""
        if self._thread is None:
            self._thread = CallingThread(self._work, "pnfarm axis program")
            self._thread.start()
        if not self._thread.is_alive:
            raise InternalError("calls of users' code were asked for after their thread ended")
        self._calls = calls
        self._begin.release()
        wait_ns = limit_ns
        while not self._done.acquire(timeout=wait_ns / 1e9):
            running = next((call for call in calls if call.began_ns and call.duration_ns is None), None)
            lasted = 0 if running is None else time.perf_counter_ns() - running.began_ns
            if running is not None and lasted >= limit_ns and self._thread.give_up(running):
                return running
            wait_ns = max(1_000_000, limit_ns - lasted)
        return None

    def close(self) -> None:
        """End the thread if it is at rest."""
        self._calls = ()
        if self._begin.locked():
            self._begin.release()
        if self._thread is not None:
            self._thread.join(_CLOSE_SECONDS)

    def _work(self) -> None:
        assert self._thread is not None
        while True:
            self._begin.acquire()
            if not self._calls:
                return
            for call in self._calls:
                self._thread.make(call)
            self._done.release()
