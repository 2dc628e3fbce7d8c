"""The way from the server's thread to the farm's event loop."""

from __future__ import annotations

import asyncio
import time
from concurrent.futures import Future
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Carrier"]

#: After what took the farm's loop a time, nothing more is asked of it for so many times that.
_REST = 3
_Found = TypeVar("_Found")


class Carrier:
    """``loop`` is the farm's.  One action is under way at a time."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._lock = asyncio.Lock()

    async def __call__(self, action: Callable[[], _Found]) -> _Found:
        """What the action returns or raises, called in the farm's loop; :class:`RuntimeError` when that is closed."""
        done: Future[_Found] = Future()
        spent = 0.0

        def run() -> None:
            nonlocal spent
            if not done.set_running_or_notify_cancel():
                # the client that asked is gone
                return
            begun = time.perf_counter()
            try:
                found = action()
            except BaseException as exc:  # noqa: BLE001 - carried to the caller, which would wait for ever
                done.set_exception(exc)
            else:
                spent = time.perf_counter() - begun
                done.set_result(found)

        async with self._lock:
            self._loop.call_soon_threadsafe(run)
            found = await asyncio.wrap_future(done)
            # so long the farm's loop is the drives' alone
            await asyncio.sleep(_REST * spent)
        return found
