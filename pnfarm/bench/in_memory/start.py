"""The benchmark ``start-cpu``: what a start costs, farm and controller together, in memory and virtual time.

Only CPU counts, beside a loop of the interpreter that is measured before and after each start: other work on the
machine changes both alike.
"""

from __future__ import annotations

import gc
import time
from typing import TYPE_CHECKING

from pnfarm.bench.cyclic.multi_axis import AXES, CYCLE, SEVERAL, WATCHDOG
from pnfarm.bench.line import DRIVES, FARM_CPU, Child, farm_file
from pnfarm.bench.loops import interpreter_loop
from pnfarm.bench.result import Result, Windows
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pnfarm.bench.load import Load

__all__ = ["start_cpu"]

#: Stations of a start, with one axis and with eight.
SINGLE, SYSTEMS = 64, 8
STARTS = 6


def _started(stations: int, cycle: str, watchdog: int, drives: str) -> tuple[float, float]:
    """CPU of making farm and controller, and of connecting them, ms for each station."""
    import anyio

    from pnfarm.controller.line import VirtualLine
    from pnfarm.farm.file.reading import parse_farm

    config = parse_farm(farm_file(stations, cycle, watchdog, FARM_CPU, in_memory=True, stations=drives))
    begin = time.thread_time()
    line = anyio.run(VirtualLine.create, config)
    made = time.thread_time()
    if not line.world.run(60.0, until=lambda: line.plc.all_connected):
        raise InternalError(f"{stations} stations did not connect in virtual time")
    end = time.thread_time()
    return (made - begin) * 1e3 / stations, (end - made) * 1e3 / stations


def _process() -> float:
    """CPU of a new process until its farm is up, s; interfaces and a start's frames are not in it."""
    file = farm_file(SYSTEMS, CYCLE, WATCHDOG, FARM_CPU, in_memory=True, stations=SEVERAL)
    child = Child("farm", FARM_CPU, file=file)
    try:
        return float(child.answer()["cpu"])
    finally:
        child.close()


def start_cpu(seconds: float, load: Load) -> list[Result]:
    """A process, a start of AKDs, and one of drive systems of eight axes, in turn."""
    del seconds
    # loads the machine code, and what a process works out once
    _started(1, "16ms", 16, DRIVES)
    _started(1, CYCLE, WATCHDOG, SEVERAL)
    processes, single, systems, loops = [], [], [], []
    for _ in range(STARTS):
        with load:
            loops.append(interpreter_loop())
            processes.append(_process())
            single.append(_started(SINGLE, "16ms", 16, DRIVES))
            systems.append(_started(SYSTEMS, CYCLE, WATCHDOG, SEVERAL))
            loops.append(interpreter_loop())
        gc.collect()
    loop = Windows(loops)

    def row(name: str, values: list[float], unit: str) -> Result:
        windows = Windows(values)
        return windows.row(name, unit, windows.over(loop))

    unit, system = "ms of CPU for each drive", f"ms of CPU for each station of {AXES} axes"
    process = Windows(processes)
    return [
        process.row("start-cpu-process", "s of CPU until a farm is up", process.over(loop) * 1e3),
        row("start-cpu-made", [made for made, _ in single], unit),
        row("start-cpu-connected", [connected for _, connected in single], unit),
        row("start-cpu-system-made", [made for made, _ in systems], system),
        row("start-cpu-system-connected", [connected for _, connected in systems], system),
        loop.row("start-cpu-interpreter", "ms for a fixed loop in Python", 1.0),
    ]
