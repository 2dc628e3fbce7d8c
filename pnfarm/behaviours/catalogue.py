"""All built-in behaviours; a new one is added here, and to the engine's list of steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.behaviours.conveyor import CONVEYOR
from pnfarm.behaviours.counter import COUNTER
from pnfarm.behaviours.cylinder import CYLINDER
from pnfarm.behaviours.encoder import ENCODER
from pnfarm.behaviours.first_order import FIRST_ORDER
from pnfarm.behaviours.motor_starter import MOTOR_STARTER
from pnfarm.behaviours.position_sensor import POSITION_SENSOR
from pnfarm.behaviours.push_button import PUSH_BUTTON
from pnfarm.behaviours.stack_light import LAMP, STACK_LIGHT

if TYPE_CHECKING:
    from pnfarm.behaviours.declaration import Behaviour

__all__ = ["BEHAVIOURS", "behaviour_number"]

#: By name; a behaviour's number is its place here.
BEHAVIOURS: dict[str, Behaviour] = {
    one.name: one
    for one in (
        CYLINDER,
        MOTOR_STARTER,
        POSITION_SENSOR,
        CONVEYOR,
        FIRST_ORDER,
        COUNTER,
        ENCODER,
        PUSH_BUTTON,
        LAMP,
        STACK_LIGHT,
    )
}


def behaviour_number(name: str) -> int:
    """What :func:`pnfarm.behaviours.dispatch.step_behaviour` knows it by."""
    return list(BEHAVIOURS).index(name)
