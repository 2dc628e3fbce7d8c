"""A thread that calls people's code, so that a call that does not return stops only its own axis or model.

:class:`Worker` is handed a list of calls and reports back; a call that takes longer than the limit is left to itself:
its thread is asked to end by an exception (which cannot end a call that waits in the kernel).
"""

from __future__ import annotations

import ctypes
import threading
import time
from typing import TYPE_CHECKING

from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["Call", "Interrupted", "Worker"]

#: How long an abandoned thread waits for the exception that ends it.
_PATIENCE_SECONDS = 1.0


def _set_exception(thread: int, kind: type[BaseException] | None) -> None:
    """Have a thread raise an exception at its next step; None: it need not any more."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(kind) if kind else None)


def _forget_exceptions() -> None:
    """No thread is to raise anything: have the interpreter see that, by an exception in this thread.

    It looks for one at each step of each thread until one is raised; beneath a profiler or a debugger CPython 3.11 does
    nothing else then.
    """
    try:
        _set_exception(threading.get_ident(), Interrupted)
        while True:
            pass
    except Interrupted:
        return


class Interrupted(BaseException):
    """Raised in a program that took too long; not an Exception, so that an ordinary `except` lets it pass."""


class Call:
    """One call: ``error`` what it raised, ``duration_ns`` how long it took; None while it runs."""

    __slots__ = ("action", "began_ns", "duration_ns", "error")

    def __init__(self, action: Callable[[], None]) -> None:
        self.action = action
        self.began_ns = 0
        self.duration_ns: int | None = None
        self.error: BaseException | None = None


class Worker:
    """One thread, started by the first :meth:`run`."""

    def __init__(self) -> None:
        # plain locks, held until there is something: a semaphore of Python's costs a third more per call
        self._begin, self._done = threading.Lock(), threading.Lock()
        self._begin.acquire()
        self._done.acquire()
        self._calls: Sequence[Call] = ()
        self._lock = threading.Lock()
        self._is_abandoned = False
        self._thread: threading.Thread | None = None

    def run(self, calls: Sequence[Call], limit_ns: int) -> Call | None:
        """Make the calls in turn and wait.  Returns the one that exceeded the limit; the worker is of no use then."""
        if self._thread is not None and not self._thread.is_alive():
            raise InternalError("calls of users' code were asked for after their thread ended")
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="pnfarm axis program", daemon=True)
            self._thread.start()
        self._calls = calls
        self._begin.release()
        wait_ns = limit_ns
        while not self._done.acquire(timeout=wait_ns / 1e9):
            with self._lock:
                running = next((call for call in calls if call.began_ns and call.duration_ns is None), None)
                lasted = 0 if running is None else time.perf_counter_ns() - running.began_ns
                if running is not None and lasted >= limit_ns:
                    self._is_abandoned = True
                    break
            wait_ns = max(1_000_000, limit_ns - lasted)
        else:
            return None
        self.interrupt()
        return running

    def interrupt(self) -> None:
        """Raise :class:`Interrupted` in the abandoned thread."""
        thread = self._thread
        if self._is_abandoned and thread is not None and thread.is_alive() and thread.ident is not None:
            _set_exception(thread.ident, Interrupted)

    @property
    def is_alive(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def close(self, seconds: float = 1.0) -> None:
        """End the thread if it is at rest."""
        self._calls = ()
        if self._thread is None:
            return
        if self._is_abandoned:
            self.interrupt()
        elif self._thread.is_alive():
            self._begin.release()
        self._thread.join(seconds)
        if self._is_abandoned and self._thread.is_alive() and self._thread.ident is not None:
            # it waits in the kernel
            _set_exception(self._thread.ident, None)
            _forget_exceptions()

    def _work(self) -> None:
        try:
            while True:
                self._begin.acquire()
                if not self._calls:
                    return
                for call in self._calls:
                    if not self._one(call):
                        # the exception that ends this thread is on its way
                        time.sleep(_PATIENCE_SECONDS)
                        return
                self._done.release()
        except Interrupted:
            return

    def _one(self, call: Call) -> bool:
        """False if the call took too long, so that nobody waits for its end."""
        call.began_ns = time.perf_counter_ns()
        try:
            call.action()
        except BaseException as exc:  # noqa: BLE001 - people's code may raise anything; it is reported
            error: BaseException | None = exc
        else:
            error = None
        with self._lock:
            if self._is_abandoned:
                return False
            call.error = error
            call.duration_ns = time.perf_counter_ns() - call.began_ns
            return True
