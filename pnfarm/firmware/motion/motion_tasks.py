"""Motion tasks that the drive stores: copying one of them into the requested task."""

from __future__ import annotations

from typing import Any

from pnfarm.table.axis_codes import (
    MOTION_TASKS,
    TASK_DEFINED,
    TASK_FROM_ACTUAL,
    TASK_FROM_COMMAND,
    TASK_FROM_TARGET,
    TASK_RELATIVE,
)
from pnfarm.table.compiling.compiled import compiled

__all__ = ["select_task"]


@compiled
def select_task(asked: Any, motion_tasks: Any, number: int) -> None:
    """Take the data of one of the drive's motion tasks; a missing task has no velocity and cannot begin."""
    if not 0 <= number < MOTION_TASKS or not motion_tasks.settings.kind[number] & TASK_DEFINED:
        asked.velocity = 0.0
        return
    asked.number = number
    asked.position = motion_tasks.settings.position[number]
    flags = int(motion_tasks.settings.kind[number])
    asked.relative = 1 if flags & TASK_RELATIVE else 0
    asked.counts_from = flags & (TASK_FROM_COMMAND | TASK_FROM_TARGET | TASK_FROM_ACTUAL)
    asked.velocity = motion_tasks.settings.velocity[number]
    asked.acceleration = motion_tasks.settings.acceleration[number]
    asked.deceleration = motion_tasks.settings.deceleration[number]
