"""Shared by commands that run until stopped: signals, and the compilation at the first start."""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

import anyio
import structlog
from anyio.streams.text import TextReceiveStream

from pnfarm.terminal.settings import settings

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from pathlib import Path
    from typing import Self

    from anyio.abc import ByteReceiveStream, TaskStatus
    from rich.progress import Progress, TaskID

__all__ = ["compile_ahead", "stop_on_signals"]

#: Message of a first start; it names no time, which depends on the machine and its load.
COMPILING = "compiling the engine for this processor (only at the first start of a version)"
#: Between two log lines about the progress, where there is no progress bar.
LOG_SECONDS = 5.0
#: Characters of the compiler's error output that are kept.
MAX_ERROR_OUTPUT = 4000

logger = structlog.get_logger("pnfarm")


@asynccontextmanager
async def stop_on_signals() -> AsyncIterator[anyio.CancelScope]:
    """A scope that the first stop signal cancels; the clean-up goes outside of it.

    Stop signals are SIGINT, SIGTERM, SIGQUIT and, unless it is ignored, SIGHUP.
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
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # it is ignored under nohup
        wanted.append(signal.SIGHUP)
    with anyio.open_signal_receiver(*wanted) as signals:
        task_status.started()
        async for number in signals:
            logger.info("stopping", signal=number.name)
            scope.cancel()


async def compile_ahead(*, in_memory: bool = True) -> None:
    """Compile the engine if its machine code is not cached, and show the progress: half a minute, once per version.

    Without ``in_memory`` what exchanges frames in memory is left out, an eighth of the work.
    Runs in a process of its own, so that a signal still ends the program, and before any interface is created.
    """
    from pnfarm.table.compiling.compiled import IS_COMPILED, REAL_TIME, cache_directory, is_cached

    part = "" if in_memory else REAL_TIME
    if not IS_COMPILED or is_cached(part) or not _writable(cache_directory()):
        return
    started = time.monotonic()
    program = [sys.executable, "-m", "pnfarm.engine.warm", "--progress", *([f"--{part}"] if part else ())]
    last = ""
    with _Progress() as progress:
        async with await anyio.open_process(program, start_new_session=True) as run, anyio.create_task_group() as tasks:
            assert run.stdout is not None
            assert run.stderr is not None
            errors: list[str] = []
            tasks.start_soon(_keep, run.stderr, errors)
            async for last in _lines(run.stdout):
                done, _, functions = last.partition(" of ")
                if done.isdecimal() and functions.isdecimal():
                    progress.show(int(done), int(functions))
            code = await run.wait()
    if code == 0:
        logger.info("engine compiled", seconds=round(time.monotonic() - started, 1))
    else:
        # the engine compiles itself when it starts, and the error is then shown in full
        logger.warning("engine not compiled ahead", reason="".join(errors).strip()[-500:])


async def _lines(stream: ByteReceiveStream) -> AsyncIterator[str]:
    rest = ""
    async for text in TextReceiveStream(stream, errors="replace"):
        *whole, rest = (rest + text).split("\n")
        for line in whole:
            yield line


async def _keep(stream: ByteReceiveStream, kept: list[str]) -> None:
    """Read a process's error output, so that it does not block on a full pipe, and keep the end of it."""
    async for text in TextReceiveStream(stream, errors="replace"):
        kept[:] = ["".join(kept)[-MAX_ERROR_OUTPUT:], text]


def _writable(directory: Path) -> bool:
    return directory.is_dir() and os.access(directory, os.W_OK)


class _Progress:
    """Progress of the compilation: a bar on a terminal, otherwise a log line every few seconds."""

    def __init__(self) -> None:
        self._bar: Progress | None = None
        self._task: TaskID | None = None
        self._started = self._logged = time.monotonic()

    def __enter__(self) -> Self:
        if settings.logs_json or not sys.stderr.isatty():
            logger.info(COMPILING)
            return self
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
        self._task = self._bar.add_task(COMPILING, total=None)
        self._bar.start()
        return self

    def show(self, done: int, functions: int) -> None:
        now = time.monotonic()
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=done, total=functions)
        elif now - self._logged >= LOG_SECONDS:
            self._logged = now
            logger.info("compiling", functions=done, of=functions, seconds=round(now - self._started))

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()
