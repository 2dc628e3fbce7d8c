"""A cylinder and its valve, with end positions."""

from __future__ import annotations

from typing import Any

from pnfarm.behaviours.declaration import Behaviour, bit, choice, duration, number, quantity
from pnfarm.table.compiling.compiled import inlined

__all__ = ["CYLINDER", "step_cylinder"]

MONOSTABLE, BISTABLE, CENTRE = 0.0, 1.0, 2.0
#: Of the stroke.
_ROUNDING = 1e-9


@inlined
def step_cylinder(values: Any, memory: Any, seconds: float) -> None:
    """Ports: extend, retract, stuck, position, extended, retracted.

    Memory: valve, out time, in time, width of an end position, start; the valve's last order, begun.
    """
    if memory[6] == 0.0:
        memory[6] = 1.0
        values[3] = memory[4]
        memory[5] = 1.0 if memory[0] == BISTABLE and memory[4] >= 0.5 else 0.0
    place = values[3]
    # by the order that was in force since the last step
    order = memory[5]
    if values[2] == 0.0 and order != 0.0:
        time = memory[1] if order > 0.0 or memory[2] < 0.0 else memory[2]
        # at once where there is no time to wait for
        place = place + order * seconds / time if time > 0.0 else order
        # the rounding of many steps is no way to go
        if place < _ROUNDING:
            place = 0.0
        elif place > 1.0 - _ROUNDING:
            place = 1.0
    extend, retract = values[0] != 0.0, values[1] != 0.0
    if memory[0] == MONOSTABLE or extend != retract:
        order = 1.0 if extend else -1.0
    elif memory[0] == CENTRE:
        # its spring centres the spool, and the piston stands
        order = 0.0
    memory[5] = order
    values[3] = place
    values[4] = 1.0 if place >= 1.0 - memory[3] else 0.0
    values[5] = 1.0 if place <= memory[3] else 0.0


CYLINDER = Behaviour(
    "cylinder",
    "A cylinder, a gripper or a flap, with its valve and two end position sensors.",
    "dx/dt = 1 / time while the valve extends, -1 / time_in while it retracts; 0 <= x <= 1",
    inputs=(
        bit("extend", "coil that extends"),
        bit("retract", "coil that retracts; a monostable valve has none, its spring retracts"),
        bit("stuck", "1 = the piston does not move"),
    ),
    outputs=(
        number("position", "0 retracted, 1 extended"),
        bit("extended", "sensor of the extended end"),
        bit("retracted", "sensor of the retracted end"),
    ),
    parameters=(
        choice("valve", "its behaviour without a command", "monostable", "bistable", "centre"),
        duration("time", "from one end to the other"),
        duration("time_in", "the way back, if it takes another time", default=-1.0),
        quantity("end", "part of the stroke in which an end's sensor is on", default=0.0, low=0.0, high=0.5),
        quantity("start", "where the piston is at the start", default=0.0, low=0.0, high=1.0),
    ),
    state=2,
    step=step_cylinder,
)
