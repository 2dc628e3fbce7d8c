"""The stations of a farm file as they can be compared with a plant, or with what a project expects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pnfarm.buses import registry
from pnfarm.config.device import DeviceConfig
from pnfarm.config.drive import DriveConfig
from pnfarm.controller.plan import plan_controllers
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import expand_all

if TYPE_CHECKING:
    from pnfarm.buses.checking import StationFacts
    from pnfarm.farm.file.reading import FarmConfig
    from pnfarm.vocabulary.issues import Location

__all__ = ["FileStation", "foreign_stations", "stations_of"]

#: Keys of a device's address; without them the built-in controller chooses one.
_ADDRESS_KEYS = frozenset({"ip", "address"})


@dataclass(frozen=True, slots=True)
class FileStation:
    """``at``: its group in the file."""

    bus: str
    at: Location
    facts: StationFacts


def stations_of(config: FarmConfig, *, asked: bool = False) -> list[FileStation]:
    """Drives and then devices, of buses whose plants can be compared.

    ``asked``: with what their controllers ask for, and not all that they offer.
    """
    known = registry.checking()
    found = []
    for one in expand_all(config):
        model = None if isinstance(one, DeviceConfig) else model_of(one)
        bus = one.bus if isinstance(one, DeviceConfig) else "" if model is None else model.bus
        if bus in known:
            at = ("drives" if model is not None else "devices", one.group)
            found.append(FileStation(bus, at, known[bus].facts_of(one, model, asked=asked)))
    return found


def foreign_stations(config: FarmConfig) -> list[FileStation]:
    """Devices that only the sections of controllers name.  Raises :class:`ConfigError` for an impossible plan."""
    if not any(section.device_names for section in config.controllers):
        return []
    known = registry.checking()
    whole = expand_all(config)
    drives = [one for one in whole if isinstance(one, DriveConfig)]
    devices = [one for one in whole if isinstance(one, DeviceConfig)]
    found = []
    for one in plan_controllers(config, drives, devices):
        own = list(getattr(one.section, "devices", ()))
        for number, (device, plan) in enumerate(
            zip(own, one.plan.devices[len(one.plan.devices) - len(own) :], strict=True)
        ):
            if one.bus.name in known:
                facts = known[one.bus.name].planned_facts(plan)
                given = _ADDRESS_KEYS & device.model_fields_set
                at = one.section.at("devices", number)
                found.append(FileStation(one.bus.name, at, facts if given else replace(facts, address="")))
    return found
