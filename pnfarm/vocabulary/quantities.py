"""Measured values of people and for people.

Shown with a few digits and the unit, but never so few that a comparison looks other than it is.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

__all__ = ["in_unit", "show_quantity"]

#: Significant digits that people read, and those that distinguish any two numbers.
_FEW, _ALL = 4, 17
#: Units that are no words after a number: a ratio, a count.
_BARE = frozenset({"", "1"})
#: Units of numbers: unit of the signal -> unit as written -> factor.
_UNITS: Mapping[str, Mapping[str, float]] = {
    "rpm": {"rpm": 1.0},
    "revolutions": {"revolutions": 1.0, "rev": 1.0, "deg": 1 / 360, "°": 1 / 360},
    "A": {"A": 1.0, "mA": 1e-3},
    "V": {"V": 1.0, "mV": 1e-3},
    "Nm": {"Nm": 1.0},
    "1": {"%": 0.01},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "min": 60.0},
}


def in_unit(value: float, unit: str, own: str) -> float:
    """A number with a unit, or without one, in a signal's ``own``; raises :class:`Problem` for a unit of others."""
    if not unit:
        return value
    units = _UNITS.get(own) or ({own: 1.0} if own else {})
    if unit not in units:
        raise Problem(f"is not measured in {unit}", "a number in " + ", ".join(units) if units else "a plain number")
    return value * units[unit]


def show_quantity(value: float | str | bool, unit: str = "", beside: Iterable[float] = ()) -> str:
    """``22.82 rpm``; words and whole numbers as they are.

    ``beside`` are numbers that the value was compared with: it gets as many digits as it takes to be above, below or
    equal to each of them as it is.
    """
    if isinstance(value, (bool, int, str)):
        text = str(value)
    elif not math.isfinite(value):
        text = f"{value:g}"
    else:
        others = [other for other in beside if math.isfinite(other)]
        digits = next(digits for digits in range(_FEW, _ALL + 1) if all(_tell(value, one, digits) for one in others))
        text = _rounded(value, digits)
    return text if unit in _BARE else f"{text} {unit}"


def _tell(value: float, other: float, digits: int) -> bool:
    """Whether so many digits of either, or of both, leave the one above, below or equal to the other as it is."""
    pairs = [(a, b) for a in (value, float(_rounded(value, digits))) for b in (other, float(_rounded(other, digits)))]
    return len({_order(*pair) for pair in pairs}) == 1


def _order(one: float, other: float) -> int:
    return (one > other) - (one < other)


def _rounded(value: float, digits: int) -> str:
    """So many significant digits, and none of a whole number left out, if its size is one that people read."""
    size = abs(value)
    if not 1e-4 <= size < 1e15:
        return f"{value:.{digits}g}"
    return f"{value:.{max(digits, len(str(int(size))))}g}"
