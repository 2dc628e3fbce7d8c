"""When the plant steps: on its own grid, with the axes, which step up to the same time before it.

After a time without ticks (the machine stood) the steps that were due are made up for, so that a spring between two
shafts sees no step of another length; after a longer one they are left out.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.by_pointer import array_at, call_at
from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.plant import PLANT

__all__ = ["plant_moment", "step_plant"]

#: Most steps that a tick makes up for.
MOST_STEPS = 64
_ROW = PLANT.dtype


@inlined
def plant_moment(engine: Any, now: int) -> int:
    """Up to when axes and plant step next in a tick at ``now``."""
    step = int(engine.plant_step_ns)
    due = int(engine.plant_due_ns)
    if due == 0:
        engine.plant_due_ns = now
        return now
    if now - due > MOST_STEPS * step:
        left = (now - due) // step
        engine.plant_late += left
        due += left * step
        engine.plant_due_ns = due
    # one that is a part of a step late is made now
    return now if now - due < step else due


@inlined
def step_plant(engine: Any, moment: int) -> None:
    """A step of the plant, if one is due."""
    if moment >= engine.plant_due_ns:
        call_at(int(engine.plant_call), array_at(int(engine.plant_row), 1, _ROW)[0], moment)
        engine.plant_due_ns += engine.plant_step_ns
