"""Users' code in real time: a thread that waits for each of its deadlines and makes the calls itself.

Where a call does not return, another thread goes on with what is left of the work, which is a generator: it does not
run while a call does.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Protocol, TypeAlias

from pnfarm.user_code.calling_thread import Call, CallingThread
from pnfarm.user_code.watch import Watch

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["CodeThread", "Work"]

#: Yields calls that are to be made, one by one; what became of it is in each.
Work: TypeAlias = Iterator[Call]
#: Longest time between two checks of a call, and for something that is due: each is a wake-up of its own.
LOOK_SECONDS = 0.25


class _Runner(Protocol):
    """What knows which of the users' code is due."""

    @property
    def limit_ns(self) -> int:
        """The longest call."""

    def work(self, now: int) -> Work:
        """What is due."""

    def next_deadline(self) -> int | None: ...

    def close(self) -> None: ...


class CodeThread:
    """``failed`` is called, in a thread of this, with an exception of the runner itself, which ends the work."""

    def __init__(self, runner: _Runner, failed: Callable[[Exception], None], name: str) -> None:
        self._runner = runner
        self._failed = failed
        self._name = name
        # held until the work is to end
        self._stop = threading.Lock()
        self._stop.acquire()
        self._ended = threading.Event()
        self._thread = CallingThread(self._run, name)
        self._given_up: list[CallingThread] = []
        self._watch: Watch | None = None
        self._work: Work = iter(())

    def start(self) -> None:
        self._watch = Watch(self._take_over, f"{self._name}: watch", self._runner.limit_ns, LOOK_SECONDS)
        self._thread.start()

    def close(self) -> None:
        """Stop between two calls."""
        if self._stop.locked():
            self._stop.release()
        if self._watch is not None:
            self._ended.wait()
            self._watch.close()
        for thread in (self._thread, *self._given_up):
            thread.join()
        self._runner.close()

    def _run(self) -> None:
        """In the thread; one that takes over has work that is left."""
        thread, watch = self._thread, self._watch
        assert watch is not None
        try:
            while True:
                for call in self._work:
                    watch.running = call
                    thread.make(call)
                watch.running = None
                due = self._runner.next_deadline()
                # code that failed may be made to go on, by a restored state
                pause = LOOK_SECONDS if due is None else max(0.0, (due - time.monotonic_ns()) / 1e9)
                if self._stop.acquire(timeout=pause):
                    break
                self._work = self._runner.work(time.monotonic_ns())
        except Exception as exc:  # noqa: BLE001 - carried to the owner, which ends with it
            self._failed(exc)
        self._ended.set()

    def _take_over(self, call: Call) -> None:
        """In the thread of the watch: a call exceeded the limit."""
        if not self._thread.give_up(call):
            return
        self._given_up = [*(one for one in self._given_up if one.is_alive), self._thread]
        self._thread = CallingThread(self._run, self._name)
        try:
            self._thread.start()
        except RuntimeError as exc:  # the system has no thread left
            self._failed(exc)
            self._ended.set()
