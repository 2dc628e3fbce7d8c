"""Calls people's code: by a thread in real time, in the main thread in virtual time where that is possible."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.user_code.in_place import in_place as main_thread
from pnfarm.user_code.worker import Worker

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.user_code.worker import Call

__all__ = ["Caller"]


class Caller:
    """Makes calls in turn.  A call that does not return is left to its thread, and the next ones get a new one.

    ``in_place``: call in the caller's own thread if that is the main thread, which is faster.
    """

    def __init__(self, *, in_place: bool) -> None:
        self._in_place = in_place
        self._worker = Worker()
        self._abandoned: list[Worker] = []

    def run(self, calls: Sequence[Call], limit_ns: int) -> list[Call]:
        """Make the calls and wait; those that exceeded the limit."""
        if self._in_place and main_thread.is_possible():
            return main_thread.run(calls, limit_ns)
        stuck: list[Call] = []
        begun = 0
        while begun < len(calls):
            late = self._worker.run(calls[begun:], limit_ns)
            if late is None:
                break
            self._abandoned.append(self._worker)
            self._worker = Worker()
            stuck.append(late)
            begun = calls.index(late) + 1
        return stuck

    def close(self) -> None:
        """End the threads; one that waits in the kernel ends with the process."""
        for worker in (self._worker, *self._abandoned):
            worker.close()
