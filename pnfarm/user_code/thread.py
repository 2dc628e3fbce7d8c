"""Users' code in real time: a thread that waits for each of its deadlines."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["CodeThread"]


class _Runner(Protocol):
    """What calls the users' code when it is due."""

    def service(self, now: int) -> None: ...

    def next_deadline(self) -> int | None: ...

    def close(self) -> None: ...


class CodeThread:
    """``failed`` is called, in this thread, with an exception of the runner itself, which ends the thread."""

    def __init__(self, runner: _Runner, failed: Callable[[Exception], None], name: str) -> None:
        self._runner = runner
        self._failed = failed
        # held until the thread is to end
        self._stop = threading.Lock()
        self._stop.acquire()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """Stop between two calls."""
        if self._stop.locked():
            self._stop.release()
        if self._thread.ident is not None:
            self._thread.join()
        self._runner.close()

    def _run(self) -> None:
        try:
            while True:
                self._runner.service(time.monotonic_ns())
                due = self._runner.next_deadline()
                if self._stop.acquire(timeout=-1 if due is None else max(0.0, (due - time.monotonic_ns()) / 1e9)):
                    return
        except Exception as exc:  # noqa: BLE001 - carried to the owner, which ends with it
            self._failed(exc)
