"""The imperfections of a drive, from its model's figures and its farm file's."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

from pnfarm.config.realism import ALL, OFF, ON, asked_for
from pnfarm.drives.description.motor_kinds import axis_value
from pnfarm.drives.description.realism import RANGES
from pnfarm.station.imperfections import NOISES, Imperfections
from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from pnfarm.config.realism import Realism
    from pnfarm.drives.description.model import Model

__all__ = ["imperfections"]


def _seed(seed: int, drive: str) -> int:
    return int.from_bytes(hashlib.sha256(f"{seed}\0{drive}".encode()).digest()[:8], "big")


def imperfections(section: Realism, model: Model, drive: str, *, by_source: bool) -> Imperfections:
    """The imperfections of the drive with this name.

    ``by_source``: keys that the farm file leaves out are on where a source gives the model's figure.
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
