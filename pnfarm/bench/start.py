"""The benchmarks ``start`` and ``start-1024``: a farm and its controller from nothing to data exchange."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.bench.line import DRIVES, FARM_CPU, PEER, PEER_CPU, SETTLED_SECONDS, Child, farm_file, wire
from pnfarm.bench.loops import interpreter_loop
from pnfarm.bench.result import Result, Windows
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pnfarm.bench.load import Load

__all__ = ["start_64", "start_1024", "started"]

#: The start of few drives takes seconds, and is repeated.
STARTS = 3


@dataclass(frozen=True, slots=True)
class Start:
    """Seconds until all stations exchange data, or all axes are in operation.

    For each connection, from the first question of the controller until nothing more follows from it: milliseconds of
    the farm's event loop, and frames that it received.
    """

    took: float
    spent: float
    frames: float


def started(
    stations: int, load: Load, cycle: str = "16ms", watchdog: int = 16, drives: str = DRIVES, until: str = "connected"
) -> Start:
    """The start of so many ``drives`` (a part of a farm file) until they are ``connected``, or ``running``."""
    files = [farm_file(stations, cycle, watchdog, cpu, stations=drives) for cpu in (FARM_CPU, PEER_CPU)]
    with wire(), ExitStack() as stack, load:
        begin = time.monotonic()
        farm = Child("farm", FARM_CPU, file=files[0])
        stack.callback(farm.close)
        plc = Child("plc", PEER_CPU, file=files[1], interface_from_outside=PEER)
        stack.callback(plc.close)
        before = farm.answer()
        plc.answer()
        if not plc.told(f"{until} 120")[until]:
            raise InternalError(f"{stations} stations were not {until} within 120 s")
        took = time.monotonic() - begin
        after = farm.told(f"settled {SETTLED_SECONDS}")
    spent, heard = (after[key] - before[key] for key in ("loop_cpu", "heard"))
    return Start(took, spent / stations * 1e3, heard / stations)


def start_64(seconds: float, load: Load) -> list[Result]:
    """Time for 64 drives to connect and exchange data."""
    del seconds
    took, loops = [], []
    for _ in range(STARTS):
        loops.append(interpreter_loop(3))
        took.append(started(64, load).took)
    windows, loop = Windows(took), Windows(loops)
    value = windows.median
    return [
        windows.row("start-64", "s", value * 1e3 / loop.median, "<= 5", value <= 5),
        loop.row("start-64-interpreter", "ms for a fixed loop in Python", 1.0),
    ]


def start_1024(seconds: float, load: Load) -> list[Result]:
    """Time for 1,024 AKDs to exchange data, and what a connection costs among them and among 64."""
    del seconds
    # the cost of a connection is to be the same among few
    loops, fews = [interpreter_loop(3)], [started(64, load)]
    loops.append(interpreter_loop(3))
    many = started(1024, load)
    loops.append(interpreter_loop(3))
    fews.append(started(64, load))
    few, loop = Windows(one.spent for one in fews), Windows(loops)
    ratio, low = many.spent / few.median, few.median
    unit = "ms of the event loop's CPU per connection"
    return [
        Result("start-1024", many.took, "s", many.took * 1e3 / loop.median, "<= 6", many.took <= 6),
        Result("start-1024-farm", many.spent, unit, many.spent / loop.median, "<= 3", many.spent <= 3),
        few.row("start-1024-farm-64", unit, few.over(loop), "<= 3", low <= 3),
        Result("start-1024-ratio", ratio, "1,024 over 64 drives", None, "<= 1.3", ratio <= 1.3),
        Result("start-1024-frames", many.frames, "frames to the event loop per connection", None, "none", True),
        Windows(one.frames for one in fews).row("start-1024-frames-64", "of 64 drives"),
        loop.row("start-1024-interpreter", "ms for a fixed loop in Python", 1.0),
    ]
