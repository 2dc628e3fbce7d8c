"""Waiting for what sets no event: another process, the kernel, another thread.  It is checked again and again."""

import asyncio
import time


def until(condition, seconds: float = 30.0, pause: float = 0.05):
    """What the condition gives once that is true, or at the end of the time."""
    end = time.monotonic() + seconds
    while not (found := condition()) and time.monotonic() < end:
        # not for an outcome: only until the next check
        time.sleep(pause)
    return found


async def reached(condition, seconds: float = 20.0) -> None:
    """As :func:`until`, in an event loop; raises :class:`TimeoutError`."""
    async with asyncio.timeout(seconds):
        while not condition():  # noqa: ASYNC110 - another process or thread sets no event of this loop
            # until the next check; shorter than a test notices, and leaves the loop to the others
            await asyncio.sleep(0.005)
