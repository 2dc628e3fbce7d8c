"""The benchmarks ``start`` and ``start-1024``: a farm and its controller from nothing to data exchange."""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import TYPE_CHECKING

from pnfarm.cli.bench_child import difference
from pnfarm.cli.bench_line import FARM_CPU, PEER, PEER_CPU, Child, farm_file, wire
from pnfarm.cli.bench_loops import interpreter_loop
from pnfarm.cli.bench_result import Result, Windows
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pnfarm.cli.bench_load import Load

__all__ = ["start_64", "start_1024"]

#: The start of few drives takes seconds, and is repeated.
STARTS = 3


def _start(drives: int, load: Load) -> tuple[float, float]:
    """Seconds until all exchange data, and milliseconds of the farm's event loop for each connection."""
    with wire(), ExitStack() as stack, load:
        begin = time.monotonic()
        farm = Child("farm", FARM_CPU, file=farm_file(drives, "16ms", 16, FARM_CPU))
        stack.callback(farm.close)
        plc = Child("plc", PEER_CPU, file=farm_file(drives, "16ms", 16, PEER_CPU), interface_from_outside=PEER)
        stack.callback(plc.close)
        farm.answer()
        farm.ask("mark")
        before = farm.answer()
        plc.answer()
        plc.ask("connected 120")
        if not plc.answer()["connected"]:
            raise InternalError(f"{drives} drives did not connect within 120 s")
        took = time.monotonic() - begin
        farm.ask("mark")
        spent = difference(before, farm.answer())
    return took, spent["loop_cpu"] / drives * 1e3


def start_64(load: Load) -> list[Result]:
    """Start 64 drives, several times."""
    took, loops = [], []
    for _ in range(STARTS):
        loops.append(interpreter_loop(3))
        took.append(_start(64, load)[0])
    windows, loop = Windows(took), Windows(loops)
    value = windows.median
    return [
        windows.row("start-64", "s", value * 1e3 / loop.median, "<= 5", value <= 5),
        loop.row("start-64-interpreter", "ms for a fixed loop in Python", 1.0),
    ]


def start_1024(load: Load) -> list[Result]:
    """Start 64 drives, then 1,024, then 64 again: the cost of a connection is to be the same."""
    loops, fews = [interpreter_loop(3)], [_start(64, load)[1]]
    loops.append(interpreter_loop(3))
    took, many = _start(1024, load)
    loops.append(interpreter_loop(3))
    fews.append(_start(64, load)[1])
    few, loop = Windows(fews), Windows(loops)
    ratio, low = many / few.median, few.median
    unit = "ms of the event loop's CPU per connection"
    return [
        Result("start-1024", took, "s", took * 1e3 / loop.median, "<= 10", took <= 10),
        Result("start-1024-farm", many, unit, many / loop.median, "<= 3", many <= 3),
        few.row("start-1024-farm-64", unit, few.over(loop), "<= 3", low <= 3),
        Result("start-1024-ratio", ratio, "1,024 over 64 drives", None, "<= 1.3", ratio <= 1.3),
        loop.row("start-1024-interpreter", "ms for a fixed loop in Python", 1.0),
    ]
