"""A project's links: which interface is at which PLC's IO system, that PLC's tags, and which ports are connected."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from pnfarm.buses.projects.parts import devices, nodes
from pnfarm.buses.projects.tags import tags_of
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.buses.projects.caex import CaexElement, CaexProject
    from pnfarm.buses.projects.tags import Tag

__all__ = ["ProjectView", "device_of"]


#: The interface of a port that is linked with another device's (AR APC, "Physical topology").
_PORT = "CommunicationPortInterface"


class ProjectView:
    """``root`` is around all elements."""

    def __init__(self, project: CaexProject) -> None:
        self.root = project.root
        self._links = project.links
        self._tags: dict[int, tuple[Tag, ...]] = {}

    @cached_property
    def _systems(self) -> dict[str, CaexElement]:
        """By the ID of an interface, the IO system that it is at."""
        known = {one.id: one for one in self.root.walk() if one.id and one.has_role("IoSystem")}
        found: dict[str, CaexElement] = {}
        for link in self._links:
            one, other = (side.partition(":")[0] for side in link)
            if other in known:
                found[one] = known[other]
            elif one in known:
                found[other] = known[one]
        return found

    @cached_property
    def _only_plc(self) -> CaexElement | None:
        """The device that has all tables of tags, where there is one only."""
        owners = [device_of(one) for one in self.root.walk() if one.has_role("TagTable")]
        return owners[0] if owners and all(one is owners[0] for one in owners) else None

    @cached_property
    def _cables(self) -> dict[int, list[tuple[str, str, CaexElement]]]:
        """By the id() of a device; see :meth:`cables`."""
        known = {one.id: one for one in self.root.walk() if one.id}
        found: dict[int, list[tuple[str, str, CaexElement]]] = {}
        for link in self._links:
            ends = [known.get(side.partition(":")[0]) for side in link if side.partition(":")[2] == _PORT]
            if len(ends) != len(link) or None in ends:
                continue
            one, other = (end for end in ends if end is not None)
            for near, far in ((one, other), (other, one)):
                found.setdefault(id(device_of(near)), []).append((near.name, far.name, device_of(far)))
        return found

    def cables(self, device: CaexElement) -> list[tuple[str, str, CaexElement]]:
        """What the project's topology says of a device: its port, and the port of which device is connected with it."""
        return self._cables.get(id(device), [])

    def interface_at_system(self, device: CaexElement) -> CaexElement | None:
        """The interface of a device that is at an IO system which is not its own."""
        for one in device.walk():
            if one.id in self._systems and all(outer is not one for outer in self._systems[one.id].around()):
                return one
        return None

    @cached_property
    def _controlling(self) -> list[tuple[CaexElement, CaexElement]]:
        """Each IO system with its PLC."""
        return [(one, device_of(one)) for one in self.root.walk() if one.has_role("IoSystem")]

    def io_systems(self, plc: str | None) -> list[CaexElement]:
        """Those of the PLC of this name (its own, its device's, its station name), or the one of this name.

        None: those of the only PLC.  Raises :class:`ConfigError` for a name that there is not, and for None where there
        are several PLCs.
        """
        found = [(one, device) for one, device in self._controlling if plc is None or plc in _names(one, device)]
        if len({id(device) for _, device in found}) > 1 or not (plc is None or found):
            what = f"has no PLC {plc!r}" if plc is not None and not found else "has several PLCs: give --plc"
            known = dict.fromkeys(_names(one, device)[0] for one, device in self._controlling)
            raise ConfigError(f"the project {what}; its PLCs are {', '.join(map(repr, known)) or 'none'}")
        return [one for one, _ in found]

    def stations_of(self, systems: Sequence[CaexElement]) -> Iterator[CaexElement]:
        """Devices at these IO systems; those at none, too, where no other PLC is in the project."""
        plcs = {id(plc) for _, plc in self._controlling}
        for device in devices(self.root):
            interface = self.interface_at_system(device)
            system = None if interface is None else self._systems[interface.id]
            if any(system is one for one in systems) or (system is None and len(plcs) < 2 and id(device) not in plcs):
                yield device

    def tags(self, device: CaexElement) -> tuple[Tag, ...]:
        """Those of the PLC whose IO system a device is at; of the only PLC, where the project does not say."""
        interface = self.interface_at_system(device)
        plc = self._only_plc if interface is None else device_of(self._systems[interface.id])
        if plc is None:
            return ()
        if id(plc) not in self._tags:
            self._tags[id(plc)] = tags_of(plc)
        return self._tags[id(plc)]


def device_of(element: CaexElement) -> CaexElement:
    """The device around an element, else what is around it."""
    return next((one for one in element.around() if one.has_role("Device")), element.parent or element)


def _names(system: CaexElement, device: CaexElement) -> list[str]:
    """By which a user may call an IO system: the names of its PLC, of what is around it, and its own."""
    around = [one.name for one in system.around() if one is not device and one.has_role("DeviceItem")]
    stations = [one.attributes.get("ProfinetDeviceName", "") for one in nodes(device)]
    return [one for one in (*around, device.name, *stations, system.name) if one]
