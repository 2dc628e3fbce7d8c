"""Fields of the axis record: interpolation."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["INTERPOLATION_RECORD"]

INTERPOLATION_RECORD = subject(
    "interpolation",
    "Cyclic set points: positions (class 5) and dynamic servo control (class 4).",
    settings=[
        Field("cycle_ns", "i8", "ns", "station", "cycle of the connection that brings set points, 0 = not known"),
        Field(
            "servo_control", "u1", "", "parameter", "drive.opmode in which XERR and KPC of the telegram act, 0 = none"
        ),
    ],
    state=[
        Field("frames_ns", "i8", "ns", "firmware", "when the last set point frame was taken, 0 = none yet"),
        Field("start", "f8", "rev", "firmware", "where the present curve begins"),
        Field("start_speed", "f8", "rev/s", "firmware", "velocity there"),
        Field("end", "f8", "rev", "firmware", "where it ends: the last set point"),
        Field("end_speed", "f8", "rev/s", "firmware", "velocity there"),
        Field("time", "f8", "s", "firmware", "duration of the curve"),
        Field("elapsed", "f8", "s", "firmware", "elapsed part of that"),
        Field("pause", "f8", "s", "firmware", "time between the last two positions of each cycle, 0 = none yet"),
        Field("servo_shown", "f8", "rev", "firmware", "position in the last actual value frame that left"),
        Field("servo_target", "f8", "rev", "firmware", "target of dynamic servo control"),
        Field("servo_gain", "f8", "1/s", "firmware", "KPC, 0 = NSOLL_B alone"),
        Field("frames_taken", "u4", "", "firmware", "set point frames that interpolation or servo control has taken"),
        Field("frames_told", "u4", "", "firmware", "actual value frames seen to leave"),
    ],
)
