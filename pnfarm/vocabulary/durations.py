"""Durations as people write them: ``500ms``, ``2 s``, ``31.25us``; the same syntax everywhere."""

from __future__ import annotations

import re
from decimal import Decimal
from typing import TYPE_CHECKING

from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["DURATION_PATTERN", "format_duration", "format_measured", "parse_duration", "read_duration"]

_UNITS_NS = {
    "ns": 1,
    "us": 1_000,
    # the micro sign, and the Greek letter that looks the same
    "\u00b5s": 1_000,
    "\u03bcs": 1_000,
    "ms": 1_000_000,
    "s": 1_000_000_000,
    "min": 60_000_000_000,
    "h": 3_600_000_000_000,
}
_DURATION = re.compile(rf"([0-9]{{1,15}}(?:\.[0-9]{{1,9}})?) ?({'|'.join(_UNITS_NS)})")
#: For a JSON Schema.
DURATION_PATTERN = r"^[0-9]+(\.[0-9]+)? ?(ns|us|µs|ms|s|min|h)$"
#: Longest duration, a year: integer nanoseconds stay far inside 64 bits.
MAX_DURATION_NS = 366 * 24 * _UNITS_NS["h"]
_ALLOWED = "a number with a unit, such as 500ms, 2s or 31.25us"


def parse_duration(text: str) -> int:
    """``31.25us``, ``2 s``, ``1.5min`` in nanoseconds.  Raises ValueError with what is allowed."""
    match = _DURATION.fullmatch(text)
    if match is None:
        raise ValueError(_ALLOWED)
    value = Decimal(match[1]) * _UNITS_NS[match[2]]
    if value != int(value):
        raise ValueError("whole nanoseconds")
    if value > MAX_DURATION_NS:
        raise ValueError("at most a year")
    return int(value)


def read_duration(value: object) -> int:
    """A value of a file, a body or an option in nanoseconds.  Raises :class:`Problem`."""
    if not isinstance(value, str):
        raise Problem(f"is {shown(value)}, which has no unit", _ALLOWED)
    try:
        return parse_duration(value)
    except ValueError as error:
        raise Problem(f"{shown(value)} is not a duration", str(error)) from error


def format_duration(duration_ns: int) -> str:
    """Nanoseconds in the largest unit that keeps the number at 1 or more: ``31.25us``, ``16ms``, ``1.5s``."""
    for unit in ("s", "ms", "us"):
        if abs(duration_ns) >= _UNITS_NS[unit]:
            value = Decimal(duration_ns) / _UNITS_NS[unit]
            return f"{value:f}{unit}"
    return f"{duration_ns}ns"


def format_measured(seconds: float, beside: Iterable[float] = ()) -> str:
    """A measured time for people: ``43.3 ms``, ``850 us``, ``3 s``, ``2.504 s``; no file or parser reads it.

    Three significant digits below a second, to the millisecond above, so that places in a run stay distinct; more
    where it would look equal to one of the times ``beside``, with which it was compared.
    """
    others = [other for other in beside if other != seconds]
    for digits in range(3, 18):
        text = _rounded(seconds, digits)
        if all(text != _rounded(other, digits) for other in others):
            break
    return text


def _rounded(seconds: float, digits: int) -> str:
    size = abs(seconds)
    for unit, factor in (("ns", 1e9), ("us", 1e6), ("ms", 1e3)):
        # rounded first: 999.96 us are 1 ms
        rounded = float(f"{size * factor:.{digits}g}")
        if rounded < 1000:
            sign = "-" if seconds < 0 and rounded else ""
            return f"{sign}{rounded:.{digits}g} {unit}" if rounded else "0 s"
    return f"{round(seconds, digits):.{digits}f}".rstrip("0").rstrip(".") + " s"
