"""Conditions that the engine watches for injections that wait: ``velocity > 1000 and zsw1.operation_enabled``.

A *condition* is a row, and a part of the table of its *operations*, in an order in which each stands after those that
it combines; the last one is the condition.  An operation's value is a number of double precision, yes is 1.
"""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout

__all__ = ["CONDITION", "CONDITION_OP", "MAX_CONDITIONS", "MAX_OPERATIONS"]

#: Rows of conditions: one for each drive on which an injection waits for one.
MAX_CONDITIONS = 4096
MAX_OPERATIONS = 32768

# What an operation's value is (``CONDITION_OP.code``).
OP_GIVEN = 0  # ``given``
OP_AXIS_REAL = 1  # a field f8 of the axis table
OP_AXIS_INTEGER = 2  # a whole number in it
OP_EQUAL = 3  # of ``left`` and ``right``, as the following
OP_UNEQUAL = 4
OP_BELOW = 5
OP_AT_MOST = 6
OP_ABOVE = 7
OP_AT_LEAST = 8
OP_AND = 9
OP_OR = 10
OP_NOT = 11  # of ``left``
OP_PRODUCT = 12

CONDITION = Layout(
    "condition",
    "What an injection waits for on one drive.",
    [
        Field("active", "u1", "", "fault", "set last when a row is ready, cleared first when it goes"),
        Field("first_op", "i4", "", "fault", "first row of its operations"),
        Field("ops", "i4", "", "fault", "number of those"),
        Field("serial", "i8", "", "fault", "which condition this is, of all so far; written after all else"),
        Field("reported", "i8", "", "engine", "serial number of the last one in this row that held"),
    ],
)

CONDITION_OP = Layout(
    "condition_op",
    "One operation of a condition: a number, a field as a place in 64-bit words, or two operations combined.",
    [
        Field("code", "u1", "", "fault", "OP_*"),
        Field("left", "i4", "", "fault", "row of the first operation that it combines"),
        Field("right", "i4", "", "fault", "row of the second"),
        Field("given", "f8", "", "fault", "a number, or what the event loop knows of the drive"),
        Field("word", "i4", "", "fault", "64-bit word of the table that holds the field"),
        Field("less", "i4", "", "fault", "word whose number is subtracted (f8 only), -1 = none"),
        Field("shift", "u1", "bits", "fault", "lowest bit of the field in the word"),
        Field("mask", "i8", "", "fault", "bits of the field, after the shift"),
        Field("sign", "i8", "", "fault", "its sign bit, after the shift; 0 = unsigned"),
        Field("value", "f8", "", "engine", "its value in this tick"),
    ],
)
