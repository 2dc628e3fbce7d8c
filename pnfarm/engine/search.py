"""Search in sorted arrays."""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import inlined

__all__ = ["first_not_below", "first_not_below_near"]


@inlined
def first_not_below(values: Any, value: int) -> int:
    """Index of the first of the sorted ``values`` that is not below ``value``; their number if all are."""
    low = 0
    high = values.shape[0]
    while low < high:
        middle = (low + high) >> 1
        if value > values[middle]:
            low = middle + 1
        else:
            high = middle
    return low


@inlined
def first_not_below_near(values: Any, value: int, guess: int) -> int:
    """:func:`first_not_below`, which is often ``guess``, at least 0: a sixth of the instructions then."""
    if guess < values.shape[0] and value <= values[guess] and (guess == 0 or value > values[guess - 1]):
        return guess
    return first_not_below(values, value)
