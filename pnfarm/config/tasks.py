"""Motion tasks of the farm file: those that a commissioning tool has stored in a drive."""

from __future__ import annotations

from pydantic import Field

from pnfarm.config.section import Section
from pnfarm.config.values import Duration
from pnfarm.drives.motion_tasks import MotionTask
from pnfarm.table.axis_codes import MOTION_TASKS

__all__ = ["Task", "drive_task"]


class Task(Section):
    """One motion task, which the controller starts by its number (SATZANW)."""

    number: int = Field(ge=0, lt=MOTION_TASKS, description="Number for SATZANW.")
    position: float = Field(
        ge=-1e9, le=1e9, description="Target from the home position, or relative distance, revolutions."
    )
    velocity: float = Field(ge=1e-3, le=1e6, description="rpm.")
    acceleration: float = Field(ge=1e-3, le=1e9, description="rpm/s.")
    deceleration: float | None = Field(default=None, ge=1e-3, le=1e9, description="rpm/s; left out, as acceleration.")
    relative: bool = Field(default=False, description="Whether position is relative to the present set position.")
    next: int | None = Field(default=None, ge=0, lt=MOTION_TASKS, description="Task that follows this one.")
    wait_ns: Duration = Field(default=0, alias="wait", description="Pause before the next task.")


def drive_task(task: Task) -> MotionTask:
    """The task as a drive takes it."""
    return MotionTask(
        number=task.number,
        position=task.position,
        velocity=task.velocity,
        acceleration=task.acceleration,
        deceleration=task.acceleration if task.deceleration is None else task.deceleration,
        relative=task.relative,
        following=task.next,
        dwell_ns=task.wait_ns,
    )
