"""Fields of the axis record: positioning."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["POSITIONING_RECORD"]

POSITIONING_RECORD = subject(
    "positioning",
    "Positioning: what the axis does in position mode.",
    settings=[
        Field("gain", "f8", "1/s", "parameter", "proportional position controller"),
        Field("following_window", "f8", "rev", "parameter", "ZSW1.8 in position mode"),
        Field("following_limit", "f8", "rev", "parameter", "following error that is a fault, 0 = none"),
        Field("following_fault", "u4", "", "parameter", "that fault, number | reaction << 24"),
        Field("target_window", "f8", "rev", "parameter", "ZSW1.10 in position mode"),
        Field("target_velocity_window", "f8", "rpm", "parameter", "how near a task's velocity counts as reached"),
        Field(
            "resume_first",
            "u1",
            "",
            "parameter",
            "1 = a waiting task takes precedence over one whose edge comes with STW1.5",
        ),
        Field("interpolation_by_edge", "u1", "", "parameter", "1 = interpolation begins with the edge of STW1.6"),
        Field(
            "targets_counted_on",
            "u1",
            "",
            "parameter",
            "1 = an absolute target counts from the home, even if XIST_A has wrapped since",
        ),
        Field("rest_without_task", "u1", "", "parameter", "1 = ZSW1.13 is set only while no task is active"),
    ],
    state=[
        Field("following_error", "f8", "rev", "firmware", "commanded minus actual position (PL.ERR)"),
        Field("over_ns", "i8", "ns", "firmware", "when the dwell of a chained task began, 0 = it runs"),
        Field("top", "f8", "rpm", "firmware", "velocity of the running task at an override of 100 %"),
        Field("task", "i2", "", "firmware", "number of the running task, coded as asked.number"),
        Field("state", "u1", "", "firmware", "state of positioning, see firmware/positioning.py; 0 = none"),
        Field("home_before", "u1", "", "firmware", "orders.home of the last step"),
        Field("free_before", "u1", "", "firmware", "1 = orders.pause was 0 in the last step"),
        Field("acknowledged", "u1", "", "firmware", "ZSW1.12"),
        Field("target_reached", "u1", "", "firmware", "the last task ended in its target"),
        Field("endless", "u1", "", "firmware", "1 = the running task has no target and runs until it is ended"),
        Field("relative", "u1", "", "firmware", "1 = the running task is relative"),
        Field("backwards", "u1", "", "firmware", "1 = the running task runs backwards"),
        Field(
            "error",
            "u1",
            "",
            "firmware",
            "1 = the last task could not be started, 2 = the next one of a chain could not",
        ),
    ],
)
