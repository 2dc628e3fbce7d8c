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
from typing import TYPE_CHECKING

from pnfarm.user_code.worker import Call, Interrupted

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import FrameType

__all__ = ["SIGNAL", "in_place"]

#: Of the real-time signals, which nothing sends by itself; its default is to end the process.
SIGNAL = signal.SIGRTMAX - 1
#: Shortest and longest time between two looks.
LEAST_SECONDS, MOST_SECONDS = 0.001, 0.05
#: Of the pending calls that raise: the interpreter makes up to 32 at one step.
SHARE = 1 / 32


class InPlace:
    """The calls of one process: one at a time, as there is one main thread.  Its thread is started by the first."""

    def __init__(self) -> None:
        self._runs = False
        #: Number of the call that runs or ran last, and of the one that is to end.
        self._number = self._ending = 0
        self._limit_ns = 0
        self._never = threading.Event()
        self._thread: threading.Thread | None = None

    @staticmethod
    def is_possible() -> bool:
        """Whether this is the main thread, in which alone a signal can raise something."""
        return threading.get_ident() == threading.main_thread().ident

    def run(self, calls: Sequence[Call], limit_ns: int) -> list[Call]:
        """Make the calls in turn; those that exceeded the limit."""
        self._limit_ns = limit_ns
        if self._thread is None or not self._thread.is_alive():
            # not alive behind a fork
            signal.signal(SIGNAL, _take_signal)
            self._thread = threading.Thread(target=self._look, args=(threading.get_ident(),), name="pnfarm calls")
            self._thread.daemon = True
            self._thread.start()
        return [call for call in calls if not self._one(call)]

    def is_to_end(self, frame: FrameType) -> bool:
        """Whether a call runs that lasts too long, and ``frame`` is of people's code."""
        return self._runs and self._ending == self._number and frame.f_code is not InPlace._one.__code__

    def _one(self, call: Call) -> bool:
        """False if the call took too long, however it ended then."""
        self._number += 1
        call.began_ns = time.perf_counter_ns()
        self._runs = True
        try:
            call.action()
        except KeyboardInterrupt:
            # the user's, at the terminal
            raise
        except BaseException as exc:  # noqa: BLE001 - people's code may raise anything; it is reported
            call.error = exc
        finally:
            self._runs = False
        if self._ending == self._number:
            call.error = None
            return False
        call.duration_ns = time.perf_counter_ns() - call.began_ns
        return True

    def _look(self, caller: int) -> None:
        """The thread: counts its looks at one call, so that a machine that stands for a while counts as one."""
        seen, looks = 0, 0
        while True:
            pause = max(LEAST_SECONDS, min(MOST_SECONDS, self._limit_ns / 4e9))
            self._never.wait(pause)
            if self._number != seen or not self._runs:
                seen, looks = self._number, 0
                continue
            looks += 1
            if looks * pause * 1e9 >= self._limit_ns:
                self._ending = seen
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
