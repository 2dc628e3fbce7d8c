"""A thread that is handed calls of people's code by one that waits for them."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from pnfarm.errors import InternalError
from pnfarm.user_code.calling_thread import CallingThread

if TYPE_CHECKING:
    from pnfarm.user_code.calling_thread import Call

__all__ = ["Worker"]


class Worker:
    """One thread, started by the first :meth:`run`."""

    def __init__(self) -> None:
        # plain locks, held until there is something: a semaphore of Python's costs a third more per call
        self._begin, self._done = threading.Lock(), threading.Lock()
        self._begin.acquire()
        self._done.acquire()
        self._call: Call | None = None
        self._thread: CallingThread | None = None

    def run(self, call: Call, limit_ns: int) -> bool:
        """Make the call and wait.  False if it exceeded the limit; the worker is of no use then."""
        if self._thread is None:
            self._thread = CallingThread(self._work, "pnfarm axis program")
            self._thread.start()
        if not self._thread.is_alive:
            raise InternalError("calls of users' code were asked for after their thread ended")
        self._call = call
        self._begin.release()
        wait_ns = limit_ns
        while not self._done.acquire(timeout=wait_ns / 1e9):
            lasted = time.perf_counter_ns() - call.began_ns if call.began_ns else 0
            if lasted >= limit_ns and self._thread.give_up(call):
                return False
            wait_ns = max(1_000_000, limit_ns - lasted)
        return True

    def close(self) -> None:
        """End the thread if it is at rest."""
        self._call = None
        if self._begin.locked():
            self._begin.release()
        if self._thread is not None:
            self._thread.join()

    def _work(self) -> None:
        assert self._thread is not None
        while True:
            self._begin.acquire()
            if self._call is None:
                return
            self._thread.make(self._call)
            self._done.release()
