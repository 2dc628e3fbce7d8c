"""A thread that makes calls of people's code, and can be given up where one of them does not return."""

from __future__ import annotations

import ctypes
import threading
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Call", "CallingThread", "Interrupted"]

#: How long a thread that was given up waits for the exception that ends it, and how long its end is awaited.
_PATIENCE_SECONDS = 1.0


class Interrupted(BaseException):
    """Raised in a program that took too long; not an Exception, so that an ordinary `except` lets it pass."""


class Call:
    """One call: ``error`` what it raised, ``duration_ns`` how long it took.

    None while it runs, and for good if it exceeded the limit.
    """

    __slots__ = ("action", "began_ns", "duration_ns", "error")

    def __init__(self, action: Callable[[], None]) -> None:
        self.action = action
        self.began_ns = 0
        self.duration_ns: int | None = None
        self.error: BaseException | None = None


class CallingThread:
    """``work`` runs in the thread, and makes its calls by :meth:`make`."""

    def __init__(self, work: Callable[[], None], name: str) -> None:
        self._work = work
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._lock = threading.Lock()
        self._is_given_up = False

    def start(self) -> None:
        self._thread.start()

    @property
    def is_alive(self) -> bool:
        return self._thread.is_alive()

    def make(self, call: Call) -> None:
        """In the thread: make one call.  Raises :class:`Interrupted` if it was given up, so that the thread ends."""
        call.began_ns = time.perf_counter_ns()
        error: BaseException | None = None
        try:
            call.action()
        except BaseException as exc:  # noqa: BLE001 - people's code may raise anything; it is reported
            error = exc
        with self._lock:
            if not self._is_given_up:
                call.error = error
                call.duration_ns = time.perf_counter_ns() - call.began_ns
                return
        if not isinstance(error, Interrupted):
            # the exception is on its way: it comes here, and not in the thread's end
            time.sleep(_PATIENCE_SECONDS)
        raise Interrupted

    def give_up(self, call: Call) -> bool:
        """From another thread: let no caller wait for the end of a call, and ask its thread to end by an exception.

        That cannot end a call that waits in the kernel.  False if the call has ended.
        """
        with self._lock:
            if call.duration_ns is not None:
                return False
            self._is_given_up = True
        self._interrupt()
        return True

    def join(self) -> None:
        """Wait for the end of the thread; one that was given up is asked again."""
        if self._thread.ident is None:
            return
        if self._is_given_up:
            self._interrupt()
        self._thread.join(_PATIENCE_SECONDS)
        if self._is_given_up and self._thread.is_alive():
            # it waits in the kernel
            _set_exception(self._thread.ident, None)
            _forget_exceptions()

    def _interrupt(self) -> None:
        if self._thread.ident is not None and self._thread.is_alive():
            _set_exception(self._thread.ident, Interrupted)

    def _run(self) -> None:
        try:
            self._work()
        except Interrupted:
            return


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
