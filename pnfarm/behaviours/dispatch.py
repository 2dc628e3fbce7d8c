"""The step of a behaviour by its number, its place in :data:`pnfarm.behaviours.catalogue.BEHAVIOURS`."""

from __future__ import annotations

from typing import Any

from pnfarm.behaviours.conveyor import step_conveyor
from pnfarm.behaviours.counter import step_counter
from pnfarm.behaviours.cylinder import step_cylinder
from pnfarm.behaviours.encoder import step_encoder
from pnfarm.behaviours.first_order import step_first_order
from pnfarm.behaviours.motor_starter import step_motor_starter
from pnfarm.behaviours.position_sensor import step_position_sensor
from pnfarm.behaviours.push_button import step_push_button
from pnfarm.behaviours.stack_light import step_lamp, step_stack_light
from pnfarm.table.compiling.compiled import inlined

__all__ = ["step_behaviour"]


@inlined
def step_behaviour(number: int, values: Any, memory: Any, seconds: float) -> None:
    """See :mod:`pnfarm.behaviours.declaration`."""
    if number == 0:
        step_cylinder(values, memory, seconds)
    elif number == 1:
        step_motor_starter(values, memory, seconds)
    elif number == 2:
        step_position_sensor(values, memory, seconds)
    elif number == 3:
        step_conveyor(values, memory, seconds)
    elif number == 4:
        step_first_order(values, memory, seconds)
    elif number == 5:
        step_counter(values, memory, seconds)
    elif number == 6:
        step_encoder(values, memory, seconds)
    elif number == 7:
        step_push_button(values, memory, seconds)
    elif number == 8:
        step_lamp(values, memory, seconds)
    elif number == 9:
        step_stack_light(values, memory, seconds)
