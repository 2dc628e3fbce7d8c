"""State tables of compiled machines: written as dictionaries, looked up as arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["as_array", "possible"]


def as_array(
    transitions: Mapping[tuple[int, int], int], states: int, events: int
) -> np.ndarray[Any, np.dtype[np.int8]]:
    """``[state, event]`` -> next state, -1 where the table has no row."""
    table = np.full((states, events), -1, np.int8)
    for (state, event), following in transitions.items():
        table[state, event] = following
    return table


def possible(transitions: Mapping[tuple[int, int], int], states: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """``[state]`` -> the events that lead somewhere from there, as a bit set: mostly none of them holds."""
    sets = np.zeros(states, np.int64)
    for state, event in transitions:
        sets[state] |= 1 << event
    return sets
