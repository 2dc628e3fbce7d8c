"""Arguments of the library's functions."""

from __future__ import annotations

import math

from pnfarm.errors import ConfigError
from pnfarm.vocabulary.durations import parse_duration
from pnfarm.vocabulary.quoting import shown

__all__ = ["duration_ns"]


def duration_ns(value: float | str, name: str) -> int:
    """Seconds, or a duration with its unit (``"500ms"``), in nanoseconds.  Raises :class:`ConfigError`."""
    if isinstance(value, str):
        try:
            return parse_duration(value)
        except ValueError as exc:
            raise ConfigError(f"{name} is {shown(value)}: {exc}") from exc
    if isinstance(value, bool) or not math.isfinite(value) or value < 0:
        raise ConfigError(f"{name} is {shown(value)}: seconds from 0, or a duration such as '500ms'")
    return round(value * 1e9)
