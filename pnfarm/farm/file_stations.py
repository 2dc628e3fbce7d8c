"""The stations of a farm file as they can be compared with a plant, or with what a project expects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.buses import registry
from pnfarm.config.device import DeviceConfig
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import expand_all

if TYPE_CHECKING:
    from pnfarm.buses.plant import StationFacts
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.vocabulary.issues import Location

__all__ = ["FileStation", "stations_of"]


@dataclass(frozen=True, slots=True)
class FileStation:
    """``at``: its group in the file."""

    bus: str
    at: Location
    facts: StationFacts


def stations_of(config: FarmConfig) -> list[FileStation]:
    """Drives and then devices, of buses whose plants can be compared."""
    known = registry.plants()
    found = []
    for one in expand_all(config):
        model = None if isinstance(one, DeviceConfig) else model_of(one)
        bus = one.bus if isinstance(one, DeviceConfig) else "" if model is None else model.bus
        if bus in known:
            at = ("drives" if model is not None else "devices", one.group)
            found.append(FileStation(bus, at, known[bus].facts_of(one, model)))
    return found
