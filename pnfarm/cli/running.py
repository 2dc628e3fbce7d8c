"""What commands that run until they are stopped have in common: signals, and the compilation of the first start."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import time
from contextlib import asynccontextmanager, contextmanager
from typing import TYPE_CHECKING

import anyio
import structlog

from pnfarm.cli.settings import settings

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator
    from pathlib import Path
    from typing import Any

    from anyio.abc import TaskStatus

__all__ = ["compile_ahead", "raise_of_callbacks", "stop_on_signals"]

logger = structlog.get_logger("pnfarm")


@asynccontextmanager
async def stop_on_signals() -> AsyncIterator[anyio.CancelScope]:
    """A scope that the first signal to end cancels; what stands outside of it, the cleaning up, goes on.

    These are SIGINT, SIGTERM, SIGQUIT and, where nobody ignores it, SIGHUP.
    """
    scope = anyio.CancelScope()
    async with anyio.create_task_group() as tasks:
        await tasks.start(_watch, scope)
        try:
            yield scope
        finally:
            tasks.cancel_scope.cancel()


async def _watch(scope: anyio.CancelScope, *, task_status: TaskStatus[None]) -> None:
    wanted = [signal.SIGINT, signal.SIGTERM, signal.SIGQUIT]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # it is under nohup, which means it
        wanted.append(signal.SIGHUP)
    with anyio.open_signal_receiver(*wanted) as signals:
        task_status.started()
        async for number in signals:
            logger.info("stopping", signal=number.name)
            scope.cancel()


@asynccontextmanager
async def raise_of_callbacks() -> AsyncIterator[None]:
    """End the block with the first exception that a callback of the loop raised; asyncio would only tell of it.

    Whoever waits inside for what the callback was to do would wait for ever.
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


async def compile_ahead() -> None:
    """Compile the engine where no earlier start has, and say so: it takes some seconds, once for each version.

    In a process of its own, so that a signal still ends the program, and before any interface is made.
    """
    from pnfarm.table.compiled import IS_COMPILED, cache_directory, is_cached

    if not IS_COMPILED or is_cached() or not _writable(cache_directory()):
        return
    started = time.monotonic()
    with _announced("compiling the engine for this machine; only the first start takes these seconds"):
        run = await anyio.run_process([sys.executable, "-m", "pnfarm.engine.warm"], check=False, start_new_session=True)
    if run.returncode == 0:
        logger.info("engine compiled", seconds=round(time.monotonic() - started, 1))
    else:
        # the engine compiles itself when it starts, and what is wrong is then told in full
        logger.warning("engine not compiled ahead", reason=run.stderr.decode(errors="replace").strip()[-500:])


def _writable(directory: Path) -> bool:
    return directory.is_dir() and os.access(directory, os.W_OK)


@contextmanager
def _announced(text: str) -> Iterator[None]:
    if settings.logs_json or not sys.stderr.isatty():
        logger.info(text)
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(text):
        yield
