"""Calls people's code for one that waits: in its own thread if that is the main thread, else by another."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.user_code.in_place import in_place as main_thread
from pnfarm.user_code.worker import Worker

if TYPE_CHECKING:
    from pnfarm.user_code.calling_thread import Call

__all__ = ["Caller"]


class Caller:
    """Makes calls.  One that does not return is ended, or left to its thread; the next ones get a new one then."""

    def __init__(self) -> None:
        self._worker = Worker()
        self._abandoned: list[Worker] = []

    def run(self, call: Call, limit_ns: int) -> None:
        """Make the call and wait."""
        if main_thread.is_possible():
            main_thread.run(call, limit_ns)
        elif not self._worker.run(call, limit_ns):
            self._abandoned.append(self._worker)
            self._worker = Worker()

    def close(self) -> None:
        """End the threads; one that waits in the kernel ends with the process."""
        for worker in (self._worker, *self._abandoned):
            worker.close()
