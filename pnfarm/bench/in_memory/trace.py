"""Cost of a trace in the engine: a farm and its controller in virtual time, with and without one, in turn."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from pnfarm.bench.result import Windows
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pnfarm.controller.line import VirtualLine

__all__ = ["SIGNALS", "cost_of_a_trace"]

#: Eight signals of each drive, of every kind.
SIGNALS = ("setpoint", "velocity", "position", "current", "stw1", "zsw1", "state", "frame_age")
#: Farm time of one measurement, s, and how many there are of each kind.
SECONDS, TURNS = 1.0, 25


def _measured(line: VirtualLine) -> float:
    begin = time.process_time()
    line.world.run(SECONDS)
    return (time.process_time() - begin) / SECONDS


def cost_of_a_trace(line: VirtualLine) -> tuple[Windows, Windows]:
    """CPU seconds per second of farm time: without a trace, and with one of all drives that waits for its trigger.

    Waiting costs most: each tick takes a sample and watches the trigger on every drive.
    """
    if not line.world.run(30.0, until=lambda: line.plc.all_connected and line.plc.all_running):
        raise InternalError("the drives did not connect in virtual time")
    plain, traced = [], []
    for _ in range(TURNS):
        plain.append(_measured(line))
        fields = {
            "on": "all",
            "signals": list(SIGNALS),
            "trigger": "velocity > 1000000",
            "pre": "1s",
            "length": "100ms",
        }
        trace = line.farm.traces.start(fields, line.world.now)
        traced.append(_measured(line))
        taken = int(line.farm.columns.trace[trace.row].head)
        if not SECONDS * 1000 <= taken <= SECONDS * 1000 + 2:
            raise InternalError(f"the trace took {taken} samples in {SECONDS:g} s at 1 ms")
        line.farm.traces.delete(trace.id, line.world.now)
        line.world.run(0.02)
    return Windows(plain), Windows(traced)
