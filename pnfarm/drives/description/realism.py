"""How a real drive of a model differs from an ideal one: noise, response times, boot time, clock drift.

A model gives the known figures in its section ``realism``, each with its source.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import isfinite
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from pnfarm.drives.description.sections import Section

__all__ = ["BOUNDS", "RANGES", "Realism", "read_realism"]

_SECOND = 1_000_000_000

#: Maximum of each figure in its own unit; a drift may also be negative, the others start at 0.
BOUNDS: dict[str, float] = {
    "velocity_noise": 1_000.0,
    "current_noise": 100.0,
    "position_noise": 0.1,
    "parameter_latency_ns": 10 * _SECOND,
    "answer_time_ns": 600 * _SECOND,
    "ready_time_ns": 600 * _SECOND,
    "clock_drift": 1_000.0,
}
#: Figures that are ranges: each drive, or each request, has its own value in it.
RANGES = frozenset({"parameter_latency_ns", "clock_drift"})
_UNITS = {
    "velocity_noise": "rpm",
    "current_noise": "A",
    "position_noise": "rev",
    "clock_drift": "ppm",
}


@dataclass(frozen=True, slots=True)
class Realism:
    """See the module's docstring; 0 turns a figure off.

    * ``velocity_noise`` (rpm), ``current_noise`` (A), ``position_noise`` (rev): RMS of the noise added to
      the measured values.  Of a linear motor a revolution is its pitch.
    * ``parameter_latency_ns``: the shortest and the longest processing time of a parameter request.
    * ``answer_time_ns``, ``ready_time_ns``: from power-on until it answers on the network, and until S1.
    * ``clock_drift``: bounds of how much its clock is faster (below 0: slower) than the time, ppm.
    """

    velocity_noise: float = 0.0
    current_noise: float = 0.0
    position_noise: float = 0.0
    parameter_latency_ns: tuple[int, int] = (0, 0)
    answer_time_ns: int = 0
    ready_time_ns: int = 0
    clock_drift: tuple[float, float] = (0.0, 0.0)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def read_realism(section: Section) -> Realism:
    """The section of a model; raises :class:`ConfigError` that names the key."""
    known = Realism()
    for key, fact in section.items():
        if key not in BOUNDS:
            names = ", ".join(field.name for field in fields(Realism))
            raise section.wrong(key, f"there is no such figure; there are {names}")
        if fact.unit != _UNITS.get(key, "ns"):
            raise ConfigError(f"{section.where(key)}, unit: {fact.unit!r}; it is {_UNITS.get(key, 'ns')!r}")
        values = fact.value if key in RANGES else (fact.value,)
        if not isinstance(values, tuple) or (key in RANGES and len(values) != 2):
            raise section.wrong(key, f"{fact.value!r} is not a list of two, the lowest and the highest")
        least = -BOUNDS[key] if key == "clock_drift" else 0
        if not all(_is_number(value) and least <= value <= BOUNDS[key] for value in values):
            raise section.wrong(key, f"{fact.value!r} is not within {least}..{BOUNDS[key]}")
        if key in RANGES and values[0] > values[1]:
            raise section.wrong(key, f"{fact.value!r} has a lowest value above its highest")
        known = replace(known, **{key: fact.value})
    return known
