"""Calls people's code in the main thread, which waits for it anyway: in virtual time, without a handover to a thread.

A thread beside it looks whether a call lasts too long, and then has :class:`Interrupted` raised in it by a signal,
which also ends a wait in the kernel.  In code that catches even that, it is raised again and again, so also
where the code does not catch.
"""

from __future__ import annotations

import ctypes
import random
import signal
import sys
import threading
import time
from functools import partial
from typing import TYPE_CHECKING

from pnfarm.user_code.calling_thread import Interrupted
from pnfarm.user_code.watch import Watch

if TYPE_CHECKING:
    from types import FrameType

    from pnfarm.user_code.calling_thread import Call

__all__ = ["SIGNAL", "in_place"]

#: Of the real-time signals, which nothing sends by itself; its default is to end the process.
SIGNAL = signal.SIGRTMAX - 1
#: Of the pending calls that raise: the interpreter makes up to 32 at one step.
SHARE = 1 / 32


class InPlace:
    """The calls of one process: one at a time, as there is one main thread.  The watch is started by the first."""

    def __init__(self) -> None:
        self._watch: Watch | None = None
        #: The call that exceeded the limit last.
        self._ending: Call | None = None

    @staticmethod
    def is_possible() -> bool:
        """Whether this is the main thread, in which alone a signal can raise something."""
        return threading.get_ident() == threading.main_thread().ident

    def run(self, call: Call, limit_ns: int) -> None:
        """Make the call."""
        watch = self._watch
        if watch is None or not watch.is_alive:
            # not alive after a fork
            signal.signal(SIGNAL, _take_signal)
            watch = self._watch = Watch(partial(self._end, threading.get_ident()), "pnfarm calls")
        watch.limit_ns = limit_ns
        self._make(call, watch)

    def is_to_end(self, frame: FrameType) -> bool:
        """Whether a call runs that lasts too long, and ``frame`` is of people's code."""
        watch, ending = self._watch, self._ending
        return (
            watch is not None
            and ending is not None
            and watch.running is ending
            and frame.f_code is not InPlace._make.__code__
        )

    def _make(self, call: Call, watch: Watch) -> None:
        call.began_ns = time.perf_counter_ns()
        watch.running = call
        try:
            call.action()
        except KeyboardInterrupt:
            # the user's, at the terminal
            raise
        except BaseException as exc:  # noqa: BLE001 - people's code may raise anything; it is reported
            call.error = exc
        finally:
            watch.running = None
        if self._ending is call:
            # however it ended then
            call.error = None
            return
        call.duration_ns = time.perf_counter_ns() - call.began_ns

    def _end(self, caller: int, call: Call) -> None:
        """In the thread of the watch."""
        self._ending = call
        signal.pthread_kill(caller, SIGNAL)


in_place = InPlace()


class _Insistence:
    """Raises :class:`Interrupted` in a call that is to end, at most steps of the interpreter from now on.

    Not at each: where a step ends a handler, some versions take the exception for one of the code that it handles.
    The interpreter makes a pending call between two instructions, never within another pending one, so that this can
    ask for the next before it raises.  ``PyObject_IsTrue`` is a function as such a call needs it: it takes a pointer,
    and gives 0, or -1 with an exception.
    """

    def __init__(self) -> None:
        ask = ctypes.pythonapi.Py_AddPendingCall
        ask.argtypes, ask.restype = (ctypes.c_void_p, ctypes.py_object), ctypes.c_int
        self._ask, self._function = ask, ctypes.cast(ctypes.pythonapi.PyObject_IsTrue, ctypes.c_void_p)

    def begin(self) -> None:
        self._ask(self._function, self)

    def __bool__(self) -> bool:
        if in_place.is_to_end(sys._getframe(1)):  # noqa: SLF001 - where the interpreter was
            self.begin()
            if random.random() < SHARE:
                raise Interrupted
        return False


_insistence = _Insistence()


def _take_signal(signal_number: int, frame: FrameType | None) -> None:
    """The signal's handler, in the main thread."""
    del signal_number
    if frame is not None and in_place.is_to_end(frame):
        _insistence.begin()
        raise Interrupted
