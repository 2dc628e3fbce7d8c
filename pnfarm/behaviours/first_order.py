"""A process of first order: a temperature, a pressure, a level."""

from __future__ import annotations

from math import exp
from typing import Any

from pnfarm.behaviours.declaration import Behaviour, duration, number, quantity
from pnfarm.table.compiling.compiled import inlined

__all__ = ["FIRST_ORDER", "step_first_order"]


@inlined
def step_first_order(values: Any, memory: Any, seconds: float) -> None:
    """Ports: input, value.  Memory: gain, time constant, rest, start; begun, the input since the last step.

    Exact for an input that is constant between two steps.
    """
    if memory[4] == 0.0:
        memory[4] = 1.0
        values[1] = memory[3]
    else:
        final = memory[2] + memory[0] * memory[5]
        time = memory[1]
        values[1] = final + (values[1] - final) * exp(-seconds / time) if time > 0.0 else final
    memory[5] = values[0]


FIRST_ORDER = Behaviour(
    "first-order",
    "A temperature, a pressure or a level that follows its input with a time constant.",
    "time_constant * dy/dt = rest + gain * input - y",
    inputs=(number("input", "heating power, a valve's opening"),),
    outputs=(number("value", "the temperature, the pressure"),),
    parameters=(
        quantity("gain", "final value for an input of 1, above rest", default=1.0),
        duration("time_constant", "time until 63 % of a change is reached"),
        quantity("rest", "final value without input", default=0.0),
        quantity("start", "value at the start", default=0.0),
    ),
    state=2,
    step=step_first_order,
)
