"""Compiles everything that runs each tick, before the first farm starts: ``python -m pnfarm.engine.warm``.

For images and installations: the machine code goes to :func:`~pnfarm.table.code_cache.cache_directory`, and a
farm that starts later loads it in half a second.  Nothing is sent and no privilege is needed: the loop is called
with an end time in the past, over a socket without a network.

Machine code is kept per processor type.  Where it is made on one machine and used on another, set
``NUMBA_CPU_NAME=generic`` for both.
"""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numba.core import event

from pnfarm.engine.columns import allocate, lookup_rebuild
from pnfarm.engine.realtime import run_loop
from pnfarm.engine.rings import make_ring
from pnfarm.engine.tick import next_due, next_step, tick
from pnfarm.engine.virtual import run_alone, run_virtual
from pnfarm.table.compiled import IS_COMPILED, cache_directory, function_count, kept_functions, mark_cached

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

__all__ = ["Warmed", "main", "warm"]


@dataclass(frozen=True, slots=True)
class Warmed:
    """Where the machine code is, how many functions it has, and how long it took."""

    directory: Path
    functions: int
    seconds: float


class _Compiled(event.Listener):  # type: ignore[misc]  # numba has no types
    """Reports how many of this package's functions have been compiled; those loaded from a cache are not counted."""

    def __init__(self, progress: Callable[[int, int], None]) -> None:
        self._progress = progress
        self._done: set[str] = set()

    def on_start(self, event: event.Event) -> None:
        """Only ends are reported."""

    def on_end(self, event: event.Event) -> None:
        function = event.data["dispatcher"].py_func
        name = f"{function.__module__}.{function.__qualname__}"
        if name.startswith("pnfarm.") and name not in self._done:
            self._done.add(name)
            self._progress(len(self._done), function_count())


def warm(progress: Callable[[int, int], None] | None = None) -> Warmed:
    """Compile, or load from the cache, each function that Python calls, with all that it calls.

    ``progress`` is called with the number of functions compiled so far, and their total.
    """
    started = time.monotonic()
    with contextlib.ExitStack() as stack:
        if progress is not None:
            stack.enter_context(event.install_listener("numba:compile", _Compiled(progress)))
        _call_everything()
    directory = cache_directory()
    functions = 0
    if IS_COMPILED:
        mark_cached()
        functions = kept_functions()
    return Warmed(directory, functions, time.monotonic() - started)


def _call_everything() -> None:
    farm = allocate(stations=1, axes=1, channels=1)
    controller = allocate(stations=1, programs=1, channels=1)
    addresses, ports = np.zeros(0, np.int64), np.zeros(0, np.int32)
    for columns in (farm, controller):
        lookup_rebuild(columns)
        next_due(columns, 0)
        next_step(columns, 0)
        tick(columns, 0, 0)
        run_alone(columns, 1, 0)
    run_virtual(farm, controller, addresses, ports, addresses, ports, 1, 0)
    near, far = socket.socketpair()
    wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
    with near, far, contextlib.closing(os.fdopen(wake, "rb", buffering=0)):
        # an end at 1 ns: the clock is past it, so the loop returns before its first tick
        run_loop(farm, make_ring(farm, near), wake, np.ones(1, np.uint64), 1)


def _say(done: int, functions: int) -> None:
    sys.stdout.write(f"{done} of {functions}\n")
    sys.stdout.flush()


def main(arguments: Sequence[str] = ()) -> int:
    """Compile everything, and print one line; returns 1 if nothing was compiled because compilation is switched off.

    With ``--progress`` there is a line ``N of M`` for each function that was compiled, before the last one.
    """
    if not IS_COMPILED:
        sys.stderr.write("NUMBA_DISABLE_JIT is set, so nothing was compiled: unset it and run this again\n")
        return 1
    done = warm(_say if "--progress" in arguments else None)
    sys.stdout.write(f"{done.functions} compiled functions in {done.directory}, {done.seconds:.1f} s\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
