"""Conditions of injections that wait, checked at the end of each tick's firmware steps.

Without a condition this is one comparison a tick; one that waits costs a few nanoseconds for each name and comparison.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.condition import (
    OP_ABOVE,
    OP_AND,
    OP_AT_LEAST,
    OP_AT_MOST,
    OP_AXIS_INTEGER,
    OP_AXIS_REAL,
    OP_BELOW,
    OP_EQUAL,
    OP_GIVEN,
    OP_NOT,
    OP_OR,
    OP_PRODUCT,
    OP_UNEQUAL,
)
from pnfarm.table.engine_row import CONDITION_HELD, emit

__all__ = ["watch_conditions"]


@inlined
def watch_conditions(  # one loop: a call for each operation, with these arrays, would cost more than the operation
    engine: Any, events: Any, conditions: Any, ops: Any, axis_reals: Any, axis_words: Any, now: int
) -> None:
    """Report each condition once, in the tick in which it holds first.

    A place that a table does not have is 0: the event loop may be writing a row of a condition that has ended.
    """
    words = axis_words.shape[0]
    most = ops.shape[0]
    for number in range(engine.condition_rows):
        condition = conditions[number]
        # first: if the event loop writes another condition into this row meanwhile, what is reported is the old one
        serial = int(condition.serial)
        if condition.active == 0 or condition.reported == serial:
            continue
        first = int(condition.first_op)
        end = min(first + int(condition.ops), most)
        value = 0.0
        for place in range(first, end):
            op = ops[place]
            code = int(op.code)
            value = 0.0
            if code == OP_GIVEN:
                value = float(op.given)
            elif code == OP_AXIS_REAL:
                word, less = int(op.word), int(op.less)
                if 0 <= word < words and less < words:
                    value = float(axis_reals[word])
                    if less >= 0:
                        value -= float(axis_reals[less])
            elif code == OP_AXIS_INTEGER:
                word = int(op.word)
                if 0 <= word < words:
                    sign = int(op.sign)
                    bits = (int(axis_words[word]) >> int(op.shift)) & int(op.mask)
                    value = float((bits ^ sign) - sign)
            else:
                left, right = int(op.left), int(op.right)
                if first <= left < place and first <= right < place:
                    one, other = float(ops[left].value), float(ops[right].value)
                    if code == OP_PRODUCT:
                        value = one * other
                    elif (
                        (code == OP_EQUAL and one == other)
                        or (code == OP_UNEQUAL and one != other)
                        or (code == OP_BELOW and one < other)
                        or (code == OP_AT_MOST and one <= other)
                        or (code == OP_ABOVE and one > other)
                        or (code == OP_AT_LEAST and one >= other)
                        or (code == OP_AND and one != 0.0 and other != 0.0)
                        or (code == OP_OR and (one != 0.0 or other != 0.0))
                        or (code == OP_NOT and one == 0.0)
                    ):
                        value = 1.0
            op.value = value
        if value != 0.0:
            condition.reported = serial
            emit(engine, events, CONDITION_HELD, number, now, serial)
