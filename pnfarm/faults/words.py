"""What an injection's fields may hold: durations, and errors that name the field and what is allowed."""

from __future__ import annotations

import difflib
import re
from decimal import Decimal
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["DURATION_PATTERN", "InjectionError", "Problem", "did_you_mean", "format_duration", "read_duration", "shown"]

_UNITS_NS = {
    "ns": 1,
    "us": 1_000,
    "µs": 1_000,
    "ms": 1_000_000,
    "s": 1_000_000_000,
    "min": 60_000_000_000,
    "h": 3_600_000_000_000,
}
_DURATION = re.compile(r"([0-9]{1,15}(?:\.[0-9]{1,9})?) ?(ns|us|µs|ms|s|min|h)")
#: For a JSON Schema.
DURATION_PATTERN = r"^[0-9]+(\.[0-9]+)? ?(ns|us|µs|ms|s|min|h)$"
#: Longest word that is compared with the known ones; a station name has at most 240 characters, most have twenty.
_WORD = 80
#: A year: integer nanoseconds stay far inside 64 bits.
MAX_DURATION_NS = 366 * 24 * _UNITS_NS["h"]


class Problem(ValueError):  # noqa: N818 - a finding about one value, turned into InjectionError with its field's name
    """One value that cannot be: what is wrong, and what is allowed."""

    def __init__(self, what: str, allowed: str) -> None:
        super().__init__(f"{what}; allowed: {allowed}")
        self.what = what
        self.allowed = allowed


class InjectionError(ConfigError):
    """An injection that cannot be put in force; one line for each wrong field."""

    def __init__(self, issues: Iterable[tuple[str, str, str]]) -> None:
        self.issues = tuple(issues)
        super().__init__(
            "\n".join(
                f"fault.{field}: {what}" + (f"; allowed: {allowed}" if allowed else "")
                for field, what, allowed in self.issues
            )
        )


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """``", did you mean X?"``, or nothing when no known word is near.

    A long word is near none: the comparison would cost its length times that of every known word.
    """
    if len(word) > _WORD:
        return ""
    near = difflib.get_close_matches(word.lower(), list(known), n=1, cutoff=0.6)
    return f", did you mean {near[0]}?" if near else ""


def shown(value: object) -> str:
    """A value as a message quotes it: on one line, bounded."""
    if value is None:
        return "nothing"
    text = {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def read_duration(value: object) -> int:
    """``500ms``, ``2s``, ``31.25us`` in nanoseconds; raises :class:`Problem`."""
    allowed = "a number with a unit, such as 500ms or 2s, at most a year"
    if not isinstance(value, str):
        raise Problem(f"is {shown(value)}, which has no unit", allowed)
    match = _DURATION.fullmatch(value)
    if match is None:
        raise Problem(f"{shown(value)} is no duration", allowed)
    duration = Decimal(match[1]) * _UNITS_NS[match[2]]
    if duration != int(duration) or duration > MAX_DURATION_NS:
        raise Problem(f"{shown(value)} is out of range", allowed + ", in whole nanoseconds")
    return int(duration)


def format_duration(duration_ns: int) -> str:
    """Nanoseconds as :func:`read_duration` takes them back: ``2s``, ``31.25us``."""
    for unit in ("s", "ms", "us"):
        if duration_ns >= _UNITS_NS[unit]:
            return f"{Decimal(duration_ns) / _UNITS_NS[unit]:f}{unit}"
    return f"{duration_ns}ns"
