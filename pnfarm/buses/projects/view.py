"""A project's links: which interface is at which PLC's IO system, and that PLC's tags."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from pnfarm.buses.projects.tags import tags_of

if TYPE_CHECKING:
    from pnfarm.buses.projects.caex import CaexElement, CaexProject
    from pnfarm.buses.projects.tags import Tag

__all__ = ["ProjectView"]


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
        owners = [_device_of(one) for one in self.root.walk() if one.has_role("TagTable")]
        return owners[0] if owners and all(one is owners[0] for one in owners) else None

    def interface_at_system(self, device: CaexElement) -> CaexElement | None:
        """The interface of a device that is at an IO system which is not its own."""
        for one in device.walk():
            if one.id in self._systems and all(outer is not one for outer in self._systems[one.id].around()):
                return one
        return None

    def tags(self, device: CaexElement) -> tuple[Tag, ...]:
        """Those of the PLC whose IO system a device is at; of the only PLC, where the project does not say."""
        interface = self.interface_at_system(device)
        plc = self._only_plc if interface is None else _device_of(self._systems[interface.id])
        if plc is None:
            return ()
        if id(plc) not in self._tags:
            self._tags[id(plc)] = tags_of(plc)
        return self._tags[id(plc)]


def _device_of(element: CaexElement) -> CaexElement:
    """The device around an element, else what is around it."""
    return next((one for one in element.around() if one.has_role("Device")), element.parent or element)
