"""A counter of pulses."""

from __future__ import annotations

from typing import Any

from pnfarm.behaviours.declaration import Behaviour, bit, number, quantity
from pnfarm.table.compiling.compiled import inlined

__all__ = ["COUNTER", "step_counter"]


@inlined
def step_counter(values: Any, memory: Any, _seconds: float) -> None:
    """Ports: up, down, reset, count, reached.  Memory: preset; up and down in the last step."""
    up, down = values[0] != 0.0, values[1] != 0.0
    if up and memory[1] == 0.0:
        values[3] += 1.0
    if down and memory[2] == 0.0:
        values[3] -= 1.0
    memory[1] = 1.0 if up else 0.0
    memory[2] = 1.0 if down else 0.0
    if values[2] != 0.0:
        values[3] = 0.0
    values[4] = 1.0 if values[3] >= memory[0] else 0.0


COUNTER = Behaviour(
    "counter",
    "Counts rising edges up and down.",
    "count = rising edges of up - rising edges of down since the last reset",
    inputs=(bit("up", "counts up"), bit("down", "counts down"), bit("reset", "1 = the count is 0")),
    outputs=(number("count", "the count"), bit("reached", "the count is the preset or more")),
    parameters=(quantity("preset", "count at which reached is on", default=1.0),),
    state=2,
    step=step_counter,
)
