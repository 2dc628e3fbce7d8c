"""A described device as data: its file, what it offers, its assemblies' places, its signals and parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.described.file_signals import SUBSLOT
from pnfarm.buses.plain_layout import PlainLayout, plain_layout
from pnfarm.protocols.enip.objects.identity import IdentityData

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pnfarm.protocols.enip.eds.document import Connection, Member, Parameter, Sheet
    from pnfarm.signals.signal import Direction, Signal

__all__ = ["DescribedStation", "Point", "composed", "points_of"]


#: Longest product name (CIP volume 1, 5A-2.2), octets.
_LONGEST_NAME = 32


@dataclass(frozen=True, slots=True)
class Point:
    """An assembly with cyclic data: as many octets as the longest of its connections, members of the first."""

    direction: Direction
    instance: int
    octets: int
    members: tuple[Member, ...]


def points_of(connections: Iterable[Connection]) -> tuple[Point, ...]:
    """In the order of the connections, the inputs of each before its outputs."""
    found: dict[tuple[Direction, int], Point] = {}
    for one in connections:
        ways: tuple[tuple[Direction, int], ...] = (("input", one.points[-1]), ("output", one.points[-2]))
        for direction, instance in ways:
            way = one.inputs if direction == "input" else one.outputs
            known = found.get((direction, instance), Point(direction, instance, 0, way.members))
            if way.size.most > known.octets:
                found[direction, instance] = Point(direction, instance, way.size.most, known.members or way.members)
    return tuple(found.values())


def composed(octets: int, members: Iterable[Member], value: Callable[[Parameter], bytes]) -> bytes:
    """The data of an assembly whose members have these values."""
    data = bytearray(octets)
    for member in members:
        if member.parameter is not None:
            member.put(data, value(member.parameter))
    return bytes(data)


@dataclass(frozen=True)
class DescribedStation:
    """``connection`` is the one that the built-in controller asks for, with so many octets of outputs and inputs
    (``sizes``); ``offered`` are those that any controller may have.

    ``parameters``: number -> octets that the farm file gives in place of the default.  ``notes`` are about connections
    of the file that are not offered.
    """

    sheet: Sheet
    connection: Connection
    sizes: tuple[int, int]
    offered: tuple[Connection, ...]
    points: tuple[Point, ...]
    signals: Mapping[str, Signal]
    parameters: Mapping[int, bytes]
    notes: tuple[str, ...] = ()

    @property
    def kinds(self) -> tuple[str, ...]:
        """What it is called in place of a model: catalogue number, product name."""
        return tuple(name for name in (self.sheet.catalog, self.sheet.product) if name)

    @property
    def title(self) -> str:
        return self.sheet.product or self.sheet.catalog or "device"

    def identity(self, serial: int) -> IdentityData:
        """What a device of this serial number answers."""
        key = self.sheet.key
        revision = key.major_revision, key.minor_revision
        name = self.title[:_LONGEST_NAME]
        return IdentityData(key.vendor_id, key.device_type, key.product_code, revision, serial, name)

    @cached_property
    def inputs(self) -> PlainLayout:
        """What goes to the controller."""
        return self._layout("input")

    @cached_property
    def outputs(self) -> PlainLayout:
        """What comes from it."""
        return self._layout("output")

    def _layout(self, direction: Direction) -> PlainLayout:
        return plain_layout((one.instance, SUBSLOT, one.octets) for one in self.points if one.direction == direction)

    @property
    def connected(self) -> dict[tuple[int, int, Direction], int]:
        """Octets of the assemblies of the built-in controller's connection, by instance, subslot and direction."""
        outputs, inputs = self.connection.points[-2:]
        return {(inputs, SUBSLOT, "input"): self.sizes[1], (outputs, SUBSLOT, "output"): self.sizes[0]}

    def parameter(self, parameter: Parameter) -> bytes:
        """A value before anybody wrote it."""
        own = self.parameters.get(parameter.number)
        return parameter.encode(parameter.default) if own is None else own

    def configuration(self) -> bytes:
        """What the built-in controller sends with Forward_Open."""
        way = self.connection.configuration
        return composed(way.size.default, way.members, self.parameter)

    def sentences(self) -> list[str]:
        """What was taken from the file, for people: the product, its connection, octets, signals, what is left out."""
        sheet = self.sheet
        catalog = f" ({sheet.catalog})" if sheet.catalog else ""
        configuration = self.connection.configuration.size.default
        chosen = f"{self.connection.keyword}: {self.connection.name or self.connection.kind}"
        octets = f"{self.sizes[1]} octets of inputs, {self.sizes[0]} of outputs, {configuration} of configuration"
        return [
            f"{self.title}{catalog}, {chosen}, of {len(self.offered)} that controllers may open",
            f"{octets}, {len(self.signals)} signals, {len(sheet.parameters)} parameters",
            *self.notes,
        ]
