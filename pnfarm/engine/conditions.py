"""Conditions of injections that wait, checked at the end of each tick's firmware steps.

Without a condition this is one comparison a tick; one that waits costs a few nanoseconds for each name and comparison.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiled import compiled
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
    OP_UNEQUAL,
)
from pnfarm.table.engine_row import CONDITION_HELD, emit

__all__ = ["watch_conditions"]


@compiled
def _read(op: Any, axis_reals: Any, axis_words: Any) -> float:
    """The present value of a field; 0 of a place that the table does not have."""
    word = int(op.word)
    if op.code == OP_AXIS_REAL:
        less = int(op.less)
        if not 0 <= word < axis_reals.shape[0] or less >= axis_reals.shape[0]:
            return 0.0
        return float(axis_reals[word]) - (float(axis_reals[less]) if less >= 0 else 0.0)
    if not 0 <= word < axis_words.shape[0]:
        return 0.0
    sign = int(op.sign)
    bits = (int(axis_words[word]) >> int(op.shift)) & int(op.mask)
    return float((bits ^ sign) - sign)


@compiled
def _combine(code: int, left: float, right: float) -> bool:
    if code == OP_EQUAL:
        return left == right
    if code == OP_UNEQUAL:
        return left != right
    if code == OP_BELOW:
        return left < right
    if code == OP_AT_MOST:
        return left <= right
    if code == OP_ABOVE:
        return left > right
    if code == OP_AT_LEAST:
        return left >= right
    if code == OP_AND:
        return left != 0.0 and right != 0.0
    if code == OP_OR:
        return left != 0.0 or right != 0.0
    return code == OP_NOT and left == 0.0


@compiled
def _holds(condition: Any, ops: Any, axis_reals: Any, axis_words: Any) -> bool:
    first = int(condition.first_op)
    end = min(first + int(condition.ops), ops.shape[0])
    value = 0.0
    for number in range(first, end):
        op = ops[number]
        code = int(op.code)
        if code == OP_GIVEN:
            value = float(op.given)
        elif code in {OP_AXIS_REAL, OP_AXIS_INTEGER}:
            value = _read(op, axis_reals, axis_words)
        else:
            left, right = int(op.left), int(op.right)
            value = 0.0
            # the event loop may be writing a row of a condition that has ended
            if first <= left < number and first <= right < number:
                value = 1.0 if _combine(code, float(ops[left].value), float(ops[right].value)) else 0.0
        op.value = value
    return value != 0.0


@compiled
def watch_conditions(
    engine: Any, events: Any, conditions: Any, ops: Any, axis_reals: Any, axis_words: Any, now: int
) -> None:
    """Report each condition once, in the tick in which it holds first."""
    for number in range(engine.condition_rows):
        condition = conditions[number]
        # first: if the event loop writes another condition into this row meanwhile, what is reported is the old one
        serial = int(condition.serial)
        if condition.active == 0 or condition.reported == serial:
            continue
        if _holds(condition, ops, axis_reals, axis_words):
            condition.reported = serial
            emit(engine, events, CONDITION_HELD, number, now, serial)
