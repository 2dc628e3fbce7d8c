"""Selects the buses by whose keys the values of a farm file are read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.buses.devices import DeviceBus, DevicesPart, devices_part
from pnfarm.buses.registry import BUSES
from pnfarm.config.controller import ControllerSection
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.buses.bus import Bus
    from pnfarm.config.device import DeviceGroup
    from pnfarm.config.drive import DriveGroup
    from pnfarm.config.known import Known
    from pnfarm.config.section import Section
    from pnfarm.vocabulary.issues import Location

__all__ = ["Choice", "bus_of", "bus_of_controller", "bus_of_devices", "device_part", "titles"]


@dataclass(frozen=True, slots=True)
class ControllerValues:
    """What a file says of the controller on one bus; ``in_map``: keys from the map for that bus."""

    bus: Bus
    section: type[ControllerSection]
    values: Any
    in_map: frozenset[str] = frozenset()

    def at(self, location: Location) -> Location:
        """Where the file has what is at this place in the values."""
        return (self.bus.name, *location) if location[:1] and location[0] in self.in_map else location


class Choice:
    """A group is on its model's bus; there is a controller for each bus that has drives in the file.

    A bus without a controller in this version has none here.  Where nothing names the bus (an unknown model, a file
    without drives), it is the one that knows most of the keys, the first of several with the same number.
    """

    def __init__(self, values: Any, known: Known) -> None:
        """``values``: the whole file, as it was written."""
        groups = values.get("drives") if isinstance(values, dict) else None
        self._groups = groups if isinstance(groups, list) else []
        devices = values.get("devices") if isinstance(values, dict) else None
        self._devices = devices if isinstance(devices, list) else []
        self._known = known

    def group(self, value: Any) -> Bus:
        """The bus of a group, as it was written."""
        return self._of_model(value) or _knows_most(value, {name: bus.farm_file.drives for name, bus in BUSES.items()})

    def devices(self, value: Any) -> Bus:
        """The bus of a group of devices, as it was written: that of the key for its maker's file, else the first."""
        buses = device_buses()
        given = value if isinstance(value, dict) else {}
        return next((bus for key, bus in buses.items() if key in given), next(iter(buses.values())))

    def controllers(self, value: Any) -> list[ControllerValues]:
        """The controllers that a section stands for, in the order of their buses' first drives; at least one.

        A key holds for every bus that knows it, one that is known nowhere goes to the first.  The map that is named
        after a bus has the keys for that bus alone.
        """
        sections = self._sections(value)
        if not isinstance(value, dict):
            name, section = next(iter(sections.items()))
            return [ControllerValues(BUSES[name], section, value)]
        flat = {key: each for key, each in value.items() if key not in BUSES}
        known = {key for section in sections.values() for key in section.listed_keys()}
        found: list[ControllerValues] = []
        for name, section in sections.items():
            own = _mapping(value.get(name))
            keys = section.listed_keys()
            values = {key: each for key, each in flat.items() if key in keys or (not found and key not in known)}
            if found:
                # each is a station of its own
                values["name"] = _further_name(flat.get("name", section.model_fields["name"].default), name)
            if len(sections) > 1:
                for key in section.single_keys.intersection(values):
                    if sum(key in other.listed_keys() for other in sections.values()) > 1:
                        del values[key]
            found.append(ControllerValues(BUSES[name], section, values | own, frozenset(own)))
        return found

    def misplaced(self, value: Any) -> Iterator[tuple[Location, str, str]]:
        """What is wrong with the maps of single buses in a section: place in the section, what, and what is allowed."""
        if not isinstance(value, dict):
            return
        sections = self._sections(value)
        there = titles(BUSES[name] for name in sections)
        for name in (name for name in value if name in BUSES):
            bus, own = BUSES[name], value[name]
            if bus.farm_file.controller is None:
                yield (name,), f"{bus.title} has no built-in controller in this version", f"a map for {there}"
            elif name not in sections:
                if all(self._of_model(group) for group in self._groups):
                    what = f"is for drives on {bus.title}, and this file has none"
                    yield (name,), what, f"a map for {there}, or none"
            elif not isinstance(own, dict):
                yield (name,), f"is {shown(own)}", f"a mapping with keys for {bus.title} alone"
            else:
                for key, inside in sections[name].shared_keys.items():
                    for shared in sorted(inside.intersection(_mapping(own.get(key)))):
                        yield (name, key, shared), "is the same on every bus", f"{key} beside `{name}`, for all drives"
        for key in ControllerSection.single_keys.intersection(value):
            knowing = [name for name, section in sections.items() if key in section.listed_keys()]
            if len(knowing) > 1:
                what = f"may be for {titles((BUSES[name] for name in knowing), 'or')}"
                yield (key,), what, " or ".join(f"{name}: {{{key}: ...}}" for name in knowing)

    def _sections(self, value: Any) -> dict[str, type[ControllerSection]]:
        """The buses that have a controller in this file, and its keys there."""
        having = {name: section for name, bus in BUSES.items() if (section := bus.farm_file.controller) is not None}
        buses = [*map(self._of_model, self._groups), *map(self.devices, self._devices)]
        found = {bus.name: having[bus.name] for bus in buses if bus is not None and bus.name in having}
        for name, section in having.items():
            if isinstance(value, dict) and any(_mapping(value.get(name)).get(key) for key in section.single_keys):
                found.setdefault(name, section)
        if not found:
            name = _knows_most(value, having).name
            found[name] = having[name]
        return found

    def _of_model(self, group: Any) -> Bus | None:
        model = group.get("model") if isinstance(group, dict) else None
        facts = self._known.model(model) if isinstance(model, str) else None
        return BUSES.get(facts.bus) if facts is not None else None


def _mapping(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _further_name(name: Any, bus: str) -> Any:
    """Station name of a controller beside the first; a name that is none is reported as it is."""
    return f"{name}-{bus}" if isinstance(name, str) else name


def _knows_most(value: Any, sections: Mapping[str, type[Section]]) -> Bus:
    given = set(value) if isinstance(value, dict) else set()
    return BUSES[max(sections, key=lambda name: len(given.intersection(sections[name].listed_keys())))]


def titles(buses: Iterator[Bus] | list[Bus], word: str = "and") -> str:
    """``PROFINET and EtherNet/IP``."""
    *most, last = [bus.title for bus in buses]
    return f"{', '.join(most)} {word} {last}" if most else last


def bus_of(group: DriveGroup) -> Bus:
    """The bus by whose keys a group was read."""
    return next(bus for bus in BUSES.values() if isinstance(group, bus.farm_file.drives))


def bus_of_controller(section: ControllerSection) -> Bus:
    """The bus by whose keys the controller was read."""
    return next(
        bus for bus in BUSES.values() if (own := bus.farm_file.controller) is not None and isinstance(section, own)
    )


def device_buses() -> dict[str, Bus]:
    """The buses that have devices by files, by the key for the file."""
    return {bus.description_key: bus for bus in BUSES.values() if isinstance(bus, DeviceBus)}


def bus_of_devices(group: DeviceGroup) -> Bus:
    """The bus by whose keys a group of devices was read."""
    return next(bus for bus in device_buses().values() if isinstance(group, devices_part(bus).devices))


def device_part(group: DeviceGroup) -> DevicesPart:
    """The part of its bus that knows a group of devices."""
    return devices_part(bus_of_devices(group))
