"""Fields of the axis record: jog."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["JOG_RECORD"]

JOG_RECORD = subject(
    "jog",
    "Jogging.",
    settings=[
        Field("velocity", "f8", "rpm", "parameter", "jogging set points 1 and 2 (PNU 1004, 1005)", (2,)),
        Field("acceleration", "f8", "rpm/s", "parameter", "PNU 1006; 0 = as acceleration"),
        Field("deceleration", "f8", "rpm/s", "parameter", "PNU 1007; 0 = as deceleration"),
        Field("distance", "f8", "rev", "parameter", "of incremental jogging, by jogging set points 1 and 2", (2,)),
        Field("mirrored", "u1", "", "parameter", "1 = the second jogging velocity is the first one, backwards"),
        Field("form", "u1", "", "parameter", "how jogging follows its bits: JOG_*"),
        Field("both_bits", "u1", "", "parameter", "effect of both jog bits at once: BOTH_*"),
        Field("begun_lasts", "u1", "", "parameter", "1 = STW1.4 to 6 have to be 0 only when a jog begins"),
        Field("needs_its_bit", "u1", "", "parameter", "1 = JOG_SEQUENCES: a jog ends with the bit that began it"),
        Field("real_time", "u1", "", "parameter", "STW1.12 jogs with the data of the task: REAL_TIME_JOG_*, 0 = not"),
    ],
    state=[
        Field("speeds", "f8", "rpm", "firmware", "jogging set points in force", (2,)),
        Field("speed", "f8", "rpm", "firmware", "of the running jog"),
        Field("start", "f8", "rev", "firmware", "where the running jog began"),
        Field("asked", "u1", "", "firmware", "requested jogging: JOG_*"),
        Field("incremental", "u1", "", "firmware", "1 = the controller asks for jogging by a distance"),
        Field("bits", "u1", "", "firmware", "STW1.8 and 9 as they take effect, bits 0 and 1"),
        Field("first", "u1", "", "firmware", "the one of them that came first, 0 = none"),
        Field("sequence", "u1", "", "firmware", "state of jogging, 0 = none; firmware/jog.py"),
    ],
)
