"""A thread that looks now and then whether a call of people's code lasts too long."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.user_code.calling_thread import Call

__all__ = ["Watch"]

#: Shortest time between two checks, and longest by default.
LEAST_SECONDS, MOST_SECONDS = 0.001, 0.05


class Watch:
    """``running`` is set by who makes the calls; ``exceeded`` is called in the thread at each check beyond the limit.

    It counts its looks at one call, so that a machine that stalls for a while counts as one.
    """

    def __init__(
        self, exceeded: Callable[[Call], None], name: str, limit_ns: int = 0, most_seconds: float = MOST_SECONDS
    ) -> None:
        self.running: Call | None = None
        self.limit_ns = limit_ns
        self._exceeded = exceeded
        self._most_seconds = most_seconds
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._look, name=name, daemon=True)
        self._thread.start()

    @property
    def is_alive(self) -> bool:
        return self._thread.is_alive()

    def close(self) -> None:
        self._closed.set()
        self._thread.join()

    def _look(self) -> None:
        seen: Call | None = None
        looks = 0
        while not self._closed.wait(pause := max(LEAST_SECONDS, min(self._most_seconds, self.limit_ns / 4e9))):
            running = self.running
            if running is None or running is not seen:
                seen, looks = running, 0
                continue
            looks += 1
            if looks * pause * 1e9 >= self.limit_ns:
                self._exceeded(running)
