"""A stack light, or a lamp."""

from __future__ import annotations

from typing import Any

from pnfarm.behaviours.declaration import Behaviour, bit, duration
from pnfarm.table.compiling.compiled import inlined

__all__ = ["LAMP", "STACK_LIGHT", "step_lamp", "step_stack_light"]


@inlined
def _look(values: Any, memory: Any, given: int, seen: int, kept: int, within: float, seconds: float) -> None:
    """One lamp: on, and whether it flashes; ``kept``: its last state, the time since a change is forgotten, below 0
    before, changes."""
    lit = 1.0 if values[given] != 0.0 else 0.0
    memory[kept + 1] = min(memory[kept + 1] + seconds, 0.0)
    if lit != memory[kept]:
        # two changes within the time are a flash; half a step is for the rounding of many
        memory[kept + 2] = 1.0 if memory[kept + 1] < 0.0 else 0.0
        memory[kept] = lit
        memory[kept + 1] = -within - 0.5 * seconds
    elif memory[kept + 1] == 0.0:
        memory[kept + 2] = 0.0
    values[seen] = lit
    values[seen + 1] = memory[kept + 2]


@inlined
def step_lamp(values: Any, memory: Any, seconds: float) -> None:
    """Ports: on, lit, flashing.  Memory: within; state of one lamp."""
    _look(values, memory, 0, 1, 1, memory[0], seconds)


@inlined
def step_stack_light(values: Any, memory: Any, seconds: float) -> None:
    """Ports: red, yellow, green, blue, buzzer; of each lit and flashing.  Memory: within; state of each."""
    for i in range(5):
        _look(values, memory, i, 5 + 2 * i, 1 + 3 * i, memory[0], seconds)


_WITHIN = duration("within", "two changes within this time are flashing", default=1.0)
_COLOURS = ("red", "yellow", "green", "blue", "buzzer")

LAMP = Behaviour(
    "lamp",
    "A lamp for expectations of a scenario.",
    "lit = on; flashing = changed twice within the time",
    inputs=(bit("on", "the PLC's output"),),
    outputs=(bit("lit", "it is on"), bit("flashing", "it flashes")),
    parameters=(_WITHIN,),
    state=3,
    step=step_lamp,
)
STACK_LIGHT = Behaviour(
    "stack-light",
    "A stack light with a buzzer.",
    "each as a lamp",
    inputs=tuple(bit(colour, "the PLC's output") for colour in _COLOURS),
    outputs=tuple(
        bit(f"{colour}_{what}", doc)
        for colour in _COLOURS
        for what, doc in (("lit", "it is on"), ("flashing", "it flashes"))
    ),
    parameters=(_WITHIN,),
    state=15,
    step=step_stack_light,
)
