"""Exceptions of a link's receiver, raised where a caller waits for the receiver's work."""

from __future__ import annotations

import asyncio
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

import anyio

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from typing import Any

__all__ = ["raise_of_callbacks"]


@asynccontextmanager
async def raise_of_callbacks() -> AsyncIterator[None]:
    """End the block with the first exception that a callback of the loop raised; asyncio would only log it.

    A block that waits for the callback's work would otherwise wait for ever.
    """
    loop = asyncio.get_running_loop()
    failed: list[BaseException] = []
    with anyio.CancelScope() as scope:

        def fail(_loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
            if (error := context.get("exception")) is None:
                loop.default_exception_handler(context)
                return
            failed.append(error)
            scope.cancel()

        before = loop.get_exception_handler()
        loop.set_exception_handler(fail)
        try:
            yield
        finally:
            loop.set_exception_handler(before)
    if failed:
        raise failed[0]
