"""Of the axis record: profile."""

from __future__ import annotations

from pnfarm.table.axis_codes import JERK_TAPS
from pnfarm.table.layout import Field, subject

__all__ = ["PROFILE_RECORD"]

PROFILE_RECORD = subject(
    "profile",
    "The profile generator of positioning: a trapezoid, averaged over the jerk time.",
    settings=[
        Field("jerk_time", "f8", "s", "parameter", "how long the trapezoid is averaged, 0 = not at all"),
    ],
    state=[
        Field("position", "f8", "rev", "firmware", "integral of the velocity command while enabled (PL.CMD)"),
        Field("velocity", "f8", "rpm", "firmware", "of commanded_position while a profile moves it"),
        Field("target", "f8", "rev", "firmware", "where PROFILE_TARGET leads to"),
        Field("top", "f8", "rpm", "firmware", "of the task at hand, override taken into account"),
        Field("acceleration", "f8", "rpm/s", "firmware", "of the task at hand"),
        Field("deceleration", "f8", "rpm/s", "firmware", "of the task at hand"),
        Field("raw_position", "f8", "rev", "firmware", "the trapezoid, before the jerk time"),
        Field("raw_velocity", "f8", "rev/s", "firmware", "the trapezoid's velocity"),
        Field("mean_velocity", "f8", "rev/s", "firmware", "their mean: the velocity at the end of the tap at hand"),
        Field("tap_left", "f8", "s", "firmware", "what is left of that tap"),
        Field("mode", "u1", "", "firmware", "what the profile generator is about: PROFILE_*"),
        Field("tap_next", "u1", "", "firmware", "the oldest of these"),
        Field("taps", "f8", "rev/s", "firmware", "its last mean velocities, tap by tap", (JERK_TAPS,)),
    ],
)
