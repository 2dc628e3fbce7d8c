"""Fields of the axis record: asked, driving sets, motion tasks."""

from __future__ import annotations

from pnfarm.table.axis_codes import DRIVING_SETS, MOTION_TASKS
from pnfarm.table.layout import Field, subject

__all__ = ["ASKED_RECORD", "DRIVING_SETS_RECORD", "MOTION_TASKS_RECORD"]

ASKED_RECORD = subject(
    "asked",
    "The requested traversing task.",
    settings=[
        Field("feedrate_whole", "f8", "", "parameter", "value of MT_FEEDRATE that is 100 %", default=100.0),
        Field("relative_base", "u1", "", "parameter", "base of the telegram's relative tasks: TASK_FROM_*, or 0"),
        Field("mdi_rejects", "u1", "", "parameter", "1 = a task of MDI ends when MDI is deselected"),
        Field("control_config", "u2", "", "parameter", "how STW1 is read in position mode: CONFIG_*"),
        Field(
            "reference_keeps_place",
            "u1",
            "",
            "parameter",
            "1 = a new reference point does not move the target of a running absolute task",
        ),
    ],
    state=[
        Field("position", "f8", "rev", "firmware", "target, or distance"),
        Field("velocity", "f8", "rpm", "firmware", "of the task"),
        Field("acceleration", "f8", "rpm/s", "firmware", "of the task"),
        Field("deceleration", "f8", "rpm/s", "firmware", "of the task"),
        Field("override", "f8", "", "firmware", "velocity override, 1 = 100 %"),
        Field("number", "i2", "", "firmware", "number of the motion task, TASK_MDI = the data are the telegram's"),
        Field("pos_stw2", "u2", "", "firmware", "POS_STW2 of the last step, for edges"),
        Field("begins", "u1", "", "firmware", "1 in the step that sees a task begin"),
        Field("relative", "u1", "", "firmware", "1 = position is a distance"),
        Field("counts_from", "u1", "", "firmware", "base of a distance: TASK_FROM_*, 0 = the last target"),
        Field("backwards", "u1", "", "firmware", "direction of real-time jogging"),
        Field("endless", "u1", "", "firmware", "1 = the requested task has no target"),
        Field("still", "u1", "", "firmware", "1 = its velocity may be 0"),
        Field("mdi", "u1", "", "firmware", "1 = the controller brings the task's data itself"),
        Field("renewed", "u1", "", "firmware", "1 = a change without a handshake (STW1.13) has yet to begin"),
        Field("feed_free", "u1", "", "firmware", "1 = STW1.5 has no meaning"),
    ],
)

DRIVING_SETS_RECORD = subject(
    "driving_sets",
    "Driving sets: their targets.",
    settings=[
        Field("position", "f8", "", "parameter", "target or distance of each set, in position steps", (DRIVING_SETS,)),
    ],
)

MOTION_TASKS_RECORD = subject(
    "motion_tasks",
    "Motion tasks by number; last, because few drives use them.",
    settings=[
        Field("position", "f8", "rev", "parameter", "target, or distance", (MOTION_TASKS,)),
        Field("velocity", "f8", "rpm", "parameter", "of each task", (MOTION_TASKS,)),
        Field("acceleration", "f8", "rpm/s", "parameter", "of each task", (MOTION_TASKS,)),
        Field("deceleration", "f8", "rpm/s", "parameter", "of each task", (MOTION_TASKS,)),
        Field("dwell_ns", "i8", "ns", "parameter", "before the next one begins", (MOTION_TASKS,)),
        Field("kind", "u1", "", "parameter", "what each task is: TASK_*", (MOTION_TASKS,)),
        Field("next", "u1", "", "parameter", "the next one of a chained task", (MOTION_TASKS,)),
    ],
)
