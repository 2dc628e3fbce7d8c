"""A push-button."""

from __future__ import annotations

from typing import Any

from pnfarm.behaviours.declaration import Behaviour, bit, choice
from pnfarm.table.compiling.compiled import inlined

__all__ = ["PUSH_BUTTON", "step_push_button"]

MOMENTARY, LATCHING = 0.0, 1.0


@inlined
def step_push_button(values: Any, memory: Any, _seconds: float) -> None:
    """Ports: press, on, off.  Memory: action; press in the last step."""
    pressed = values[0] != 0.0
    if memory[0] == LATCHING:
        if pressed and memory[1] == 0.0:
            values[1] = 1.0 - values[1]
    else:
        values[1] = 1.0 if pressed else 0.0
    memory[1] = 1.0 if pressed else 0.0
    values[2] = 1.0 - values[1]


PUSH_BUTTON = Behaviour(
    "push-button",
    "A push-button, a key switch or an emergency stop that a user or a scenario presses.",
    "on = press, or changes with each press; off = not on",
    inputs=(bit("press", "it is pressed"),),
    outputs=(bit("on", "make contact"), bit("off", "break contact, as emergency stops have it")),
    parameters=(choice("action", "whether it stays on when released", "momentary", "latching"),),
    state=1,
    step=step_push_button,
)
