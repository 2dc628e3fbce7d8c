"""Waiting for what has no event: another process, the kernel, another thread.  It is looked at again and again."""

import asyncio
import time


def until(condition, seconds: float = 30.0, pause: float = 0.05):
    """What the condition gives once that is true, or at the end of the time."""
    end = time.monotonic() + seconds
    while not (found := condition()) and time.monotonic() < end:
        time.sleep(pause)
    return found


async def reached(condition, seconds: float = 20.0) -> None:
    """As :func:`until`, in an event loop; raises :class:`TimeoutError`."""
    async with asyncio.timeout(seconds):
        while not condition():  # noqa: ASYNC110 - what is waited for sets no event
            await asyncio.sleep(0.005)
