"""Compiles everything that runs each tick, before the first farm starts: ``python -m pnfarm.engine.warm``.

For images and installations: the machine code goes to :func:`~pnfarm.table.compiling.code_cache.cache_directory`, and a
farm that starts later loads it in half a second.  Nothing is sent, no privilege is needed, and nothing is run.

Numba's compiler is written in Python, so that threads would not help: one process compiles the loops, another one the
drive's step, which the loops call by its address, and the impairment of frames that are sent.  What exchanges frames in
memory, in virtual time, comes last, and is left out where a farm is to start in real time (``--real-time``): what needs
it compiles it later.  A bus with compiled code of its own has a module ``warm`` with a function of that name.

It is for all processors of a level (:mod:`pnfarm.table.compiling.processor`).  With ``PYTHONHASHSEED=0`` and an empty
cache the code has the same octets each time; the two processes then run one after the other, as what one finds in the
cache depends on how far the other one is.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import importlib
import os
import socket
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import typeof
from numba.core import event, targetconfig

from pnfarm.engine.channels.impair import impair_sent
from pnfarm.engine.columns import Columns, allocate, lookup_rebuild
from pnfarm.engine.realtime import run_loop
from pnfarm.engine.sockets.rings import make_ring
from pnfarm.engine.tick import next_due, next_step, tick
from pnfarm.engine.virtual import run_alone, run_virtual
from pnfarm.errors import InternalError
from pnfarm.table.compiling.by_address import promise
from pnfarm.table.compiling.compiled import (
    IS_COMPILED,
    REAL_TIME,
    cache_directory,
    copy_code,
    function_count,
    is_cached,
    kept_functions,
    mark_cached,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

__all__ = ["Warmed", "main", "warm"]

#: Arguments of the two processes: the loops, and what they call by its address.
LOOPS, STEP = HALVES = ("--loops", "--step")
#: Argument: only what a farm needs in real time over interfaces.
ONLY_REAL_TIME = f"--{REAL_TIME}"
#: Argument, with a folder: copy the machine code there.
COPY_TO = "--copy-to"
#: Without colours in its messages: the compiler makes those of all overloads that do not match, and shows none.
PLAIN = {"NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING": "1"}


@dataclass(frozen=True, slots=True)
class Warmed:
    """Where the machine code is, how many functions it has, and how long it took."""

    directory: Path
    functions: int
    seconds: float


class _Compiled(event.Listener):  # type: ignore[misc]  # numba has no types
    """Reports the names of this package's functions as they are compiled, and not those loaded from a cache."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell

    def on_start(self, event: event.Event) -> None:
        """Only ends are reported."""

    def on_end(self, event: event.Event) -> None:
        function = event.data["dispatcher"].py_func
        name = f"{function.__module__}.{function.__qualname__}"
        if name.startswith("pnfarm."):
            self._tell(name)


class _Count:
    """Counts the functions that one process or both compiled, each once."""

    def __init__(self, progress: Callable[[int, int], None]) -> None:
        self._progress = progress
        self._done: set[str] = set()
        self._lock = threading.Lock()

    def __call__(self, name: str) -> None:
        with self._lock:
            if name not in self._done:
                self._done.add(name)
                self._progress(len(self._done), function_count())


def warm(progress: Callable[[int, int], None] | None = None, *, load: bool = True, part: str = "") -> Warmed:
    """Compile, or load from the cache, each function that Python calls, with all that it calls.

    ``progress`` is called with the number of functions compiled so far, and their total.  Without ``load`` what
    was just compiled is not loaded into this process.  ``part``: only this part of it (:data:`REAL_TIME`).
    """
    started = time.monotonic()
    of_buses = _of_buses()
    tell = _Count(progress or (lambda _done, _of: None))
    cached = is_cached(part)
    if IS_COMPILED and not cached:
        _compile_in_processes(tell, part)
    if load or cached:
        # where something of a complete cache is missing after all, it is compiled here
        with event.install_listener("numba:compile", _Compiled(tell)):
            _compile_loops(part)
            for compile_bus in of_buses:
                compile_bus()
    directory = cache_directory()
    functions = 0
    if IS_COMPILED:
        mark_cached(part)
        functions = kept_functions()
    return Warmed(directory, functions, time.monotonic() - started)


def _compile_in_processes(tell: Callable[[str], None], part: str) -> None:
    """Both halves at once, or one after the other where there is one CPU or the code is to be the same each time."""
    at_once = len(os.sched_getaffinity(0)) > 1 and os.environ.get("PYTHONHASHSEED", "random") == "random"
    with contextlib.ExitStack() as stack:
        running: list[tuple[subprocess.Popen[str], threading.Thread]] = []
        for half in HALVES:
            program = [sys.executable, "-m", "pnfarm.engine.warm", half, *([f"--{part}"] if part else ())]
            process = stack.enter_context(
                subprocess.Popen(program, stdout=subprocess.PIPE, text=True, env={**os.environ, **PLAIN})
            )
            # called before the process is waited for, also when an exception passes
            stack.callback(process.kill)
            assert process.stdout is not None
            reader = threading.Thread(target=_hear, args=(process.stdout, tell))
            reader.start()
            running.append((process, reader))
            if not at_once:
                _finish(process, reader)
        for process, reader in running:
            _finish(process, reader)


def _finish(process: subprocess.Popen[str], reader: threading.Thread) -> None:
    reader.join()
    if process.wait():
        raise InternalError(f"a process that compiles the engine ended with code {process.returncode}")


def _hear(lines: Iterable[str], tell: Callable[[str], None]) -> None:
    for line in lines:
        tell(line.strip())


def _compile_half(half: str, part: str) -> None:
    """What one of the two processes does; it prints the names of functions, a line for each."""

    def tell(name: str) -> None:
        sys.stdout.write(f"{name}\n")
        sys.stdout.flush()

    _spare_the_compiler()
    step = promise()
    # the compiler's many objects are not searched for unreachable ones: a tenth of the time
    gc.disable()
    with event.install_listener("numba:compile", _Compiled(tell)):
        if half == LOOPS:
            _compile_loops(part)
        else:
            # the other process needs it before its first function is complete
            _compile_impairment(allocate(images=1, axes=1, channels=1))
            step()
            for compile_bus in _of_buses():
                compile_bus()


def _spare_the_compiler() -> None:
    """Do in a shorter way what Numba does some hundred thousand times, with the same results.

    It takes the times of its parts, once for each function that waits for the one that it compiles; and it compares
    flags name by name, where most are the same object.
    """
    event.install_timer = lambda *_arguments: contextlib.nullcontext()
    flags = targetconfig.TargetConfig
    by_name = flags.__eq__

    def equal(self: Any, other: Any) -> Any:
        if self is other or (type(self) is type(other) and self._values == other._values):  # noqa: SLF001 - Numba has no public way to all flags at once
            return True
        return by_name(self, other)

    flags.__eq__ = equal
    # that of the flags' names, as Numba's own
    flags.__hash__ = lambda self: _hash_of_names(tuple(self.options))


@functools.cache
def _hash_of_names(names: tuple[str, ...]) -> int:
    return hash(tuple(sorted(names)))


def _of_buses() -> list[Callable[[], None]]:
    """What compiles the code of each bus that has some; the engine knows no bus, so they are looked for."""
    root = Path(__file__).parents[1]
    names = sorted(path.parent.name for path in root.glob("buses/*/warm.py"))
    return [importlib.import_module(f"pnfarm.buses.{name}.warm").warm for name in names]


def _compile_impairment(columns: Columns) -> None:
    """What half of sending is: changes to frames and copies of them, for the arguments that a tick calls it with."""
    _compile(
        impair_sent, columns.engine[0], columns.impairment, columns.ppm[0], columns.held, columns.held_order,
        columns.frames, 0, np.int32(0), 0,
    )  # fmt: skip


def _compile_loops(part: str) -> None:
    farm = allocate(images=1, axes=1, channels=1)
    controller = allocate(images=1, programs=1, channels=1)
    addresses, ports = np.zeros(0, np.int64), np.zeros(0, np.int32)
    for columns in (farm, controller):
        _compile(tick, columns, 0, 0)
        _compile(lookup_rebuild, columns)
        _compile(next_due, columns, 0)
        _compile(next_step, columns, 0)
    near, far = socket.socketpair()
    with near, far:
        _compile(run_loop, farm, make_ring(farm, near), 0, np.ones(1, np.uint64), 1)
    if part == REAL_TIME:
        return
    _compile(run_alone, farm, 1, 0)
    _compile(run_virtual, farm, controller, addresses, ports, addresses, ports, 1, 0)


def _compile(function: Any, *arguments: Any) -> None:
    """For a call with these arguments; plain functions stay what they are."""
    if IS_COMPILED:
        function.compile(tuple(typeof(argument) for argument in arguments))


def _say(done: int, functions: int) -> None:
    sys.stdout.write(f"{done} of {functions}\n")
    sys.stdout.flush()


def main(arguments: Sequence[str] = ()) -> int:
    """Compile everything, and print one line; returns 1 if nothing was compiled because compilation is switched off.

    With ``--real-time`` only what a farm over interfaces needs is compiled; with ``--progress`` there is a line
    ``N of M`` for each function that was compiled, before the last one; ``--copy-to FOLDER`` copies the machine code to
    a folder in that one, with the processor's name.
    """
    if not IS_COMPILED:
        sys.stderr.write("NUMBA_DISABLE_JIT is set, so nothing was compiled: unset it and run this again\n")
        return 1
    part = REAL_TIME if ONLY_REAL_TIME in arguments else ""
    half = next((half for half in HALVES if half in arguments), "")
    if half:
        _compile_half(half, part)
        return 0
    done = warm(_say if "--progress" in arguments else None, load=False, part=part)
    if COPY_TO in arguments:
        copy_code(Path(arguments[arguments.index(COPY_TO) + 1]))
    sys.stdout.write(f"{done.functions} compiled functions in {done.directory}, {done.seconds:.1f} s\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
