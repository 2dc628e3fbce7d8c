"""Benchmarks in memory: virtual time, firmware, a trace, and a scrape, in this process."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from pnfarm.bench.line import FARM_CPU, farm_file
from pnfarm.bench.loops import compiled_loop, interpreter_loop
from pnfarm.bench.result import WINDOWS, Result, Windows
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pnfarm.bench.load import Load
    from pnfarm.controller.line import VirtualLine

__all__ = ["firmware", "scrape", "trace", "virtual_time"]

#: 96 x real time on the machine of docs/bench.md, where the loop that only copies the frames is 965 x as fast as real
#: time: as a ratio, it says the same on another machine, and at an hour when this one is slower.
WANTED_SPEED, USUAL_FLOOR = 96, 965
#: Farm time of a turn of farm and loop, s, and the turns of a window.
TURN_SECONDS, TURNS = 0.2, 12
HOUR = 3600.0
LOOP = "ms for a fixed loop in Python"


def _in_memory(drives: int, cycle: str, watchdog: int) -> VirtualLine:
    """The benchmarks' farm and controller in virtual time."""
    import anyio

    from pnfarm.controller.line import VirtualLine
    from pnfarm.farm.file.reading import parse_farm

    return anyio.run(VirtualLine.create, parse_farm(farm_file(drives, cycle, watchdog, FARM_CPU, in_memory=True)))


def scrape(seconds: float, load: Load) -> list[Result]:
    """Prometheus scrapes 256 connected drives, with changed counters each time."""
    del seconds
    from pnfarm.metrics.collector import FarmCollector

    line = _in_memory(256, "16ms", 16)
    collector = FarmCollector(line.farm)
    if not line.world.run(60.0, until=lambda: line.plc.all_connected):
        raise InternalError("256 drives did not connect in virtual time")
    # the first scrape makes what later ones keep
    collector.gather().text()
    took, loops = [], []
    for _ in range(10):
        line.world.run(0.1)
        with load:
            begin = time.thread_time()
            collector.gather().text()
            took.append((time.thread_time() - begin) * 1000)
            loops.append(interpreter_loop())
    windows, loop = Windows(took), Windows(loops)
    return [
        windows.row("scrape-256", "ms of CPU", windows.over(loop)),
        loop.row("scrape-256-interpreter", LOOP, 1.0),
    ]


def virtual_time(seconds: float, load: Load) -> list[Result]:
    """64 drives at 1 ms and their controller in memory, beside the copying of their frames; an hour of two drives."""
    del seconds
    many, few = _in_memory(64, "1ms", 3), _in_memory(2, "16ms", 3)
    _run_up(many)
    _run_up(few)
    compiled_loop(1)
    speeds, floors, hours, loops = [], [], [], []
    for _ in range(WINDOWS):
        took = floor = 0.0
        with load:
            for _ in range(TURNS):
                begin = time.thread_time()
                many.world.run(TURN_SECONDS)
                took += time.thread_time() - begin
                # a round is a cycle of 1 ms
                floor += compiled_loop(round(TURN_SECONDS * 1000))
            begin = time.thread_time()
            few.world.run(HOUR / WINDOWS)
            hours.append((time.thread_time() - begin) * WINDOWS)
            loops.append(interpreter_loop())
        speeds.append(TURN_SECONDS * TURNS / took)
        floors.append(TURN_SECONDS * TURNS / floor)
    speed, copying, hour, loop = Windows(speeds), Windows(floors), Windows(hours), Windows(loops)
    ratio, most = copying.over(speed), USUAL_FLOOR / WANTED_SPEED
    unit = "times faster than real time"
    goal = f"ratio <= {most:.1f}: {WANTED_SPEED} where the floor is {USUAL_FLOOR}"
    return [
        speed.row("virtual-64", unit, ratio, goal, ratio <= most),
        copying.row("virtual-64-floor", unit, 1.0),
        hour.row("virtual-hour", "s of CPU for an hour of 2 drives", hour.median * 1000 / loop.median),
        loop.row("virtual-interpreter", LOOP, 1.0),
    ]


def _run_up(line: VirtualLine) -> None:
    if not line.world.run(30.0, until=lambda: line.plc.all_connected and line.plc.all_running):
        raise InternalError("the drives did not run in virtual time")


def firmware(seconds: float, load: Load) -> list[Result]:
    """One drive's own firmware in a step of 1 ms: all models mixed, moving."""
    del seconds
    from pnfarm.bench.in_memory.firmware import POSITION, SPEED, costs_of_a_step

    unit = "ns per drive and step"
    results: list[Result] = []
    loops: list[float] = []
    for name, text, motor_step_ns in (
        ("speed", SPEED, 0),
        ("position", POSITION, 0),
        ("position-16-khz", POSITION, 62_500),
    ):
        with load:
            cost, loop = costs_of_a_step(text, motor_step_ns=motor_step_ns)
        loops += loop.values
        goal, ok = ("none", True) if motor_step_ns else ("< 500", cost.median < 500)
        results.append(cost.row(f"firmware-{name}", unit, cost.over(loop), goal, ok))
    return [*results, Windows(loops).row("firmware-loop", "ns for copying and reading a frame", 1.0)]


def trace(seconds: float, load: Load) -> list[Result]:
    """Trace 8 signals of 64 drives at 1 ms, in memory: what it adds, beside the whole engine without a trace."""
    del seconds
    from pnfarm.bench.in_memory.trace import cost_of_a_trace

    line = _in_memory(64, "1ms", 3)
    with load:
        floor, traced = cost_of_a_trace(line)
    added = Windows((t - f) * 100 for t, f in zip(traced.values, floor.values, strict=True))
    return [
        added.row("trace-64x8", "% of a core", traced.over(floor), "<= 3", added.median <= 3),
        Windows(value * 100 for value in floor.values).row("trace-64x8-floor", "% of a core", 1.0),
    ]
