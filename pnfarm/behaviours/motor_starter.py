"""A motor starter with feedback."""

from __future__ import annotations

from typing import Any

from pnfarm.behaviours.declaration import Behaviour, bit, duration
from pnfarm.table.compiling.compiled import inlined

__all__ = ["MOTOR_STARTER", "step_motor_starter"]


@inlined
def step_motor_starter(values: Any, memory: Any, seconds: float) -> None:
    """Ports: run, trip, reset, running, tripped.  Memory: close time, open time; the order, how long it is there."""
    if values[1] != 0.0:
        values[4] = 1.0
    elif values[2] != 0.0:
        values[4] = 0.0
    order = 1.0 if values[0] != 0.0 and values[4] == 0.0 else 0.0
    if order == memory[2]:
        memory[3] += seconds
    else:
        memory[2] = order
        memory[3] = 0.0
    # half a step early is nearer than half a step late
    if memory[3] + 0.5 * seconds >= (memory[0] if order != 0.0 else memory[1]):
        values[3] = order


MOTOR_STARTER = Behaviour(
    "motor-starter",
    "A contactor or motor starter with a feedback contact and an overload relay.",
    "running = run and not tripped, after time_on or time_off",
    inputs=(
        bit("run", "the PLC's command"),
        bit("trip", "1 = the overload relay trips"),
        bit("reset", "1 = it is reset"),
    ),
    outputs=(bit("running", "feedback contact"), bit("tripped", "the overload relay has tripped")),
    parameters=(
        duration("time_on", "from the command to the feedback", default=0.05),
        duration("time_off", "from the end of the command to that of the feedback", default=0.05),
    ),
    state=2,
    step=step_motor_starter,
)
