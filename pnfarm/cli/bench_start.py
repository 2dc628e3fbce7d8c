"""The benchmark ``start-1024``: a large farm and its controller from nothing to data exchange."""

from __future__ import annotations

import time
from contextlib import ExitStack

from pnfarm.cli.bench_child import difference
from pnfarm.cli.bench_line import FARM_CPU, PEER, PEER_CPU, Child, Result, farm_file, interpreter_loop, wire
from pnfarm.errors import InternalError

__all__ = ["start_1024"]


def _start(drives: int) -> tuple[float, float]:
    """Seconds until all exchange data, and milliseconds of the farm's event loop for each connection."""
    with wire(), ExitStack() as stack:
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


def start_1024() -> list[Result]:
    """Start 64 drives, then 1,024: the cost of a connection is to be the same."""
    _, few = _start(64)
    took, many = _start(1024)
    ratio = many / few
    unit = "ms of the event loop's CPU per connection"
    return [
        Result("start-1024", took, "s", None, "<= 10", took <= 10),
        Result("start-1024-farm", many, unit, None, "<= 3", many <= 3),
        Result("start-1024-farm-64", few, unit, None, "<= 3", few <= 3),
        Result("start-1024-ratio", ratio, "1,024 over 64 drives", None, "<= 1.3", ratio <= 1.3),
        Result("start-1024-interpreter", interpreter_loop(), "ms for a fixed loop in Python", None, "none", True),
    ]
