"""What a drive of the farm has of its model's realism and of its farm file's."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

from pnfarm.drives.motor_kinds import axis_value
from pnfarm.drives.realism import RANGES
from pnfarm.farm.config_realism import ALL, OFF, ON, Realism
from pnfarm.station.imperfections import NOISES, Imperfections
from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.drives.model import Model

__all__ = ["asked_for", "imperfections", "missing_figures"]


def asked_for(section: Realism) -> Iterator[tuple[tuple[str, ...], str, Any]]:
    """Each figure: its place in the section, its name in the model, what the farm file says of it (None: nothing)."""
    yield ("noise", "velocity"), "velocity_noise", section.noise.velocity
    yield ("noise", "current"), "current_noise", section.noise.current
    yield ("noise", "position"), "position_noise", section.noise.position
    yield ("parameter_latency",), "parameter_latency_ns", section.parameter_latency
    yield ("boot_time", "answers"), "answer_time_ns", section.boot_time.answers
    yield ("boot_time", "ready"), "ready_time_ns", section.boot_time.ready
    yield ("clock_drift",), "clock_drift", section.clock_drift


def missing_figures(section: Realism, model: Model) -> list[tuple[str, ...]]:
    """Places where the farm file asks for a figure of the model's that it does not have."""
    return [place for place, name, given in asked_for(section) if given == ON and f"realism.{name}" not in model.facts]


def _seed(seed: int, drive: str) -> int:
    return int.from_bytes(hashlib.sha256(f"{seed}\0{drive}".encode()).digest()[:8], "big")


def imperfections(section: Realism, model: Model, drive: str, *, by_source: bool) -> Imperfections:
    """Of the drive with this name.

    ``by_source``: what the farm file says nothing of is on where a source gives the model's figure.
    """
    figures: dict[str, Any] = {}
    for _, name, given in asked_for(section):
        own = getattr(model.realism, name)
        if given is None:
            fact = model.facts.get(f"realism.{name}")
            given = ON if by_source and fact is not None and fact.source != "assumed" else OFF
        elif name in NOISES and not isinstance(given, str):
            given = axis_value(f"measurement.{name}", given, model.pitch)
        none = (0, 0) if name in RANGES else 0
        figures[name] = own if given in {ON, ALL} else none if given == OFF else given
    seed = _seed(section.seed, drive)
    low, high = figures["clock_drift"]
    least, most = figures["parameter_latency_ns"]
    return Imperfections(
        **{name: float(figures[name]) for name in NOISES},
        latency_ns=(int(least), int(most)),
        answer_ns=int(figures["answer_time_ns"]),
        ready_ns=int(figures["ready_time_ns"]),
        drift=(low + SplitMix64(seed).uniform() * (high - low)) * 1e-6,
        seed=seed,
    )
