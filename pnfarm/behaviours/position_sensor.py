"""A sensor over a range of positions: a cam, a proximity switch, a light barrier."""

from __future__ import annotations

from math import ceil, floor
from typing import Any

from pnfarm.behaviours.declaration import Behaviour, bit, duration, number, quantity
from pnfarm.table.compiling.compiled import inlined

__all__ = ["POSITION_SENSOR", "step_position_sensor"]


@inlined
def step_position_sensor(values: Any, memory: Any, seconds: float) -> None:
    """Ports: position, blocked, on.

    Memory: from, to, period, hysteresis, delay on, delay off, bounce; the contact, the time since the output is
    settled, below 0 before: at the start it is.
    """
    low, high, period, wide = memory[0], memory[1], memory[2], memory[3]
    place = values[0]
    if period > 0.0:
        place = low + (place - low) - period * floor((place - low) / period)
        if high < low:
            high += period * ceil((low - high) / period)
    contact = memory[7]
    if contact == 0.0:
        inside = low <= place <= high
    else:
        # it is left only beyond the hysteresis, before its start a period later, too
        inside = low - wide <= place <= high + wide or (period > 0.0 and place >= low + period - wide)
    inside = inside or values[1] != 0.0
    wanted = 1.0 if inside else 0.0
    bounce = memory[6]
    if wanted != contact:
        memory[7] = wanted
        # what ends within its delay has not reached the output, which stays as it is
        waits = -memory[8] > bounce + 0.5 * seconds
        memory[8] = 0.0 if waits else -bounce - (memory[4] if wanted != 0.0 else memory[5])
    else:
        memory[8] = min(memory[8] + seconds, 0.0)
    left = -memory[8]
    if left > bounce + 0.5 * seconds:
        return
    if left > 0.5 * seconds and int((bounce - left) / max(seconds, 1e-9) + 0.5) % 2 == 1:
        # each other step of the time in which the contact bounces
        values[2] = 1.0 - wanted
    else:
        values[2] = wanted


POSITION_SENSOR = Behaviour(
    "position-sensor",
    "A cam, a proximity switch or a light barrier that is on over a range of positions.",
    "on = from <= position <= to; off again hysteresis beyond it; each change after its delay",
    inputs=(
        number("position", "what passes the sensor"),
        bit("blocked", "1 = another object is before the sensor"),
    ),
    outputs=(bit("on", "the sensor's output"),),
    parameters=(
        quantity("from", "where it begins"),
        quantity("to", "where it ends; below `from` where it lies across the end of the period"),
        quantity("period", "distance after which the sensor comes again, 0 = one sensor", default=0.0, low=0.0),
        quantity("hysteresis", "how far beyond the range it stays on", default=0.0, low=0.0),
        duration("delay_on", "from entering to on", default=0.0),
        duration("delay_off", "from leaving to off", default=0.0),
        duration("bounce", "time for which the output changes in each step", default=0.0),
    ),
    state=2,
    step=step_position_sensor,
)
