"""Shares and rates as people write them: ``25%``, ``2/min``."""

from __future__ import annotations

import re
from decimal import Decimal

from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

__all__ = ["RATE_PATTERN", "SHARE_PATTERN", "format_rate", "format_share", "read_rate", "read_share"]

SHARE_PATTERN = r"^[0-9]+(\.[0-9]+)? ?%$"
RATE_PATTERN = r"^[0-9]+(\.[0-9]+)? ?/ ?(s|min|h)$"
_SHARE = re.compile(r"([0-9]{1,3}(?:\.[0-9]{1,6})?) ?%")
_RATE = re.compile(r"([0-9]{1,9}(?:\.[0-9]{1,9})?) ?/ ?(s|min|h)")
_SECONDS = {"s": 1, "min": 60, "h": 3600}
_SHARE_ALLOWED = "a percentage above 0%, at most 100%, such as 25%"
_RATE_ALLOWED = "a number a second, minute or hour, such as 2/min, from 0.001/h to 1000/s"
#: Per second.
_LOWEST, _HIGHEST = 0.001 / 3600, 1000.0


def read_share(value: object) -> float:
    """``25%`` as 25.0.  Raises :class:`Problem`."""
    match = _SHARE.fullmatch(value.strip()) if isinstance(value, str) else None
    share = 0.0 if match is None else float(match[1])
    if not 0.0 < share <= 100.0:
        raise Problem(f"is {shown(value)}", _SHARE_ALLOWED)
    return share


def format_share(share: float) -> str:
    """As :func:`read_share` takes it."""
    return f"{Decimal(repr(share)).normalize():f}%"


def read_rate(value: object) -> tuple[float, str]:
    """``2/min`` as (occurrences per second, the text).  Raises :class:`Problem`."""
    match = _RATE.fullmatch(value.strip()) if isinstance(value, str) else None
    rate = 0.0 if match is None else float(match[1]) / _SECONDS[match[2]]
    # a text such as 0.001/h is divided, so that the bounds need room for rounding
    if match is None or not _LOWEST * (1 - 1e-9) <= rate <= _HIGHEST * (1 + 1e-9):
        raise Problem(f"is {shown(value)}", _RATE_ALLOWED)
    return rate, f"{match[1]}/{match[2]}"


def format_rate(rate: tuple[float, str]) -> str:
    """As :func:`read_rate` takes it."""
    return rate[1]
