"""Fields of the axis record: profile."""

from __future__ import annotations

from pnfarm.table.axis_codes import JERK_TAPS
from pnfarm.table.layout import Field, subject

__all__ = ["PROFILE_RECORD"]

PROFILE_RECORD = subject(
    "profile",
    "The profile generator of positioning: a trapezoid, averaged over the jerk time.",
    settings=[
        Field("jerk_time", "f8", "s", "parameter", "how long the trapezoid is averaged, 0 = not at all"),
        Field("slowness", "f8", "", "fault", "by how much longer its ramps take than asked: 1 = twice the time"),
    ],
    state=[
        Field("position", "f8", "rev", "firmware", "integral of the velocity command while enabled (PL.CMD)"),
        Field("velocity", "f8", "rpm", "firmware", "of position while a profile moves it"),
        Field("target", "f8", "rev", "firmware", "target of PROFILE_TARGET"),
        Field("top", "f8", "rpm", "firmware", "of the running task, with override"),
        Field("acceleration", "f8", "rpm/s", "firmware", "of the present task"),
        Field("deceleration", "f8", "rpm/s", "firmware", "of the present task"),
        Field("raw_position", "f8", "rev", "firmware", "position of the trapezoid, before averaging"),
        Field("raw_velocity", "f8", "rev/s", "firmware", "the trapezoid's velocity"),
        Field("mean_velocity", "f8", "rev/s", "firmware", "mean of taps: the velocity at the end of the present tap"),
        Field("tap_left", "f8", "s", "firmware", "time left of the present tap"),
        Field("mode", "u1", "", "firmware", "mode of the profile generator: PROFILE_*"),
        Field("tap_next", "u1", "", "firmware", "index of the oldest tap"),
        Field("taps", "f8", "rev/s", "firmware", "last mean velocities of the trapezoid, tap by tap", (JERK_TAPS,)),
    ],
)
