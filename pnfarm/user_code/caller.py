"""Calls people's code for one that waits: in its own thread if that is the main thread, else by another."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.user_code.in_place import in_place as main_thread
from pnfarm.user_code.worker import Worker

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.user_code.calling_thread import Call

__all__ = ["Caller"]


class Caller:
    """Makes calls in turn.  One that does not return is ended, or left to its thread; the next ones are made then."""

    def __init__(self) -> None:
        self._worker = Worker()
        self._abandoned: list[Worker] = []

    def run(self, calls: Sequence[Call], limit_ns: int) -> None:
        """Make the calls and wait."""
        if main_thread.is_possible():
            main_thread.run(calls, limit_ns)
            return
        begun = 0
        while begun < len(calls):
            late = self._worker.run(calls[begun:], limit_ns)
            if late is None:
                break
            self._abandoned.append(self._worker)
            self._worker = Worker()
            begun = calls.index(late) + 1

    def close(self) -> None:
        """End the threads; one that waits in the kernel ends with the process."""
        for worker in (self._worker, *self._abandoned):
            worker.close()
