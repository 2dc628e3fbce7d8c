"""A device by its maker's file on EtherNet/IP: plain data in assemblies, parameters, the connections of the file."""

from __future__ import annotations

from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.described.file_signals import SUBSLOT
from pnfarm.buses.ethernetip.described.parameters import ParameterObject, ParameterValues, objects_at_paths
from pnfarm.buses.ethernetip.described.station import composed
from pnfarm.buses.ethernetip.device.kind import Carried
from pnfarm.buses.plain_layout import signal_places
from pnfarm.engine.channels.parts import Piece
from pnfarm.errors import InternalError
from pnfarm.protocols.enip.connection import ConnectionSettings, IoOffer, RpiBelowMinimum
from pnfarm.protocols.enip.connection_check import Refusal
from pnfarm.protocols.enip.objects.assembly import AssemblyData
from pnfarm.protocols.enip.status import GeneralStatus
from pnfarm.protocols.enip.wire.forward_open import ConnectionType
from pnfarm.signals.station_signals import StationSignals
from pnfarm.table.access.plain_data import ConsumedData, ProvidedData

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from ipaddress import IPv4Address

    from pnfarm.buses.ethernetip.config.device import EthernetIpDeviceConfig
    from pnfarm.buses.ethernetip.described.station import DescribedStation
    from pnfarm.buses.plain_layout import PlainLayout
    from pnfarm.engine.columns import Columns
    from pnfarm.protocols.enip.connection import Connection
    from pnfarm.protocols.enip.eds.document import Connection as EdsConnection
    from pnfarm.protocols.enip.eds.document import Limits, Member
    from pnfarm.protocols.enip.object import CipObject
    from pnfarm.protocols.enip.objects.identity import IdentityData
    from pnfarm.protocols.enip.wire.epath import ElectronicKey

__all__ = ["DescribedKind", "io_connections", "offer_of"]

#: Where the file's section Capacity has no number.
_USUAL_IO, _USUAL_EXPLICIT = 8, 16
_MOST_IO, _MOST_EXPLICIT = 32, 64
#: Shortest packet interval of a file that names none.
_SHORTEST_RPI_US = 1000


def io_connections(described: DescribedStation) -> int:
    """Cyclic connections at once."""
    return min(described.sheet.io_connections or _USUAL_IO, _MOST_IO)


class DescribedKind:
    """See :class:`pnfarm.buses.ethernetip.device.kind.Kind`.

    Inputs begin with the values of their parameters, and survive a power cycle (assumed: what a sensor sees does not
    depend on the device's supply).
    """

    keys: Mapping[str, tuple[str, ...]] = MappingProxyType(
        {"key": ("eds",), "path": ("eds",), "sizes": ("sizes",), "interval": ("limits",)}
    )

    def __init__(self, settings: EthernetIpDeviceConfig, columns: Columns, plain_row: int) -> None:
        self.described = settings.described
        self.plain_row = plain_row
        self._strict = settings.strict
        sheet = self.described.sheet
        self.label = sheet.port
        self.io_connections = io_connections(self.described)
        self._explicit = min(sheet.explicit_connections or _USUAL_EXPLICIT, _MOST_EXPLICIT)
        self.sessions = min(self.io_connections + self._explicit, _MOST_EXPLICIT)
        inputs, outputs = self.described.inputs, self.described.outputs
        self.inputs = ProvidedData(columns.provided, plain_row, inputs.octets, len(inputs.places))
        self.inputs.write(
            {
                inputs.places[one.instance, SUBSLOT].place: composed(one.octets, one.members, self.described.parameter)
                for one in self.described.points
                if one.direction == "input"
            }
        )
        self.outputs = ConsumedData(columns.consumed, plain_row, outputs.octets, len(outputs.places))
        self.signals = StationSignals(self.described.signals, signal_places(inputs, outputs), self.inputs, self.outputs)
        self._offers: dict[IoOffer, EdsConnection] = {}
        for one in self.described.offered:
            self._offers.setdefault(offer_of(one, strict=self._strict), one)
        self.values = ParameterValues(sheet.parameters, self.described.parameter, self._cyclic(), strict=self._strict)
        self.objects: Sequence[CipObject] = ()
        if sheet.parameters:
            configuration = next((one.configuration for one in self._offers if one.configuration), 0)
            self.objects = (ParameterObject(self.values, configuration), *objects_at_paths(self.values))
        self.assemblies: Sequence[AssemblyData] = tuple(self._assemblies())

    def build(self) -> None:
        self.values.forget()

    def identity(self, serial: int) -> IdentityData:
        return self.described.identity(serial)

    def settings(self, key: ElectronicKey, multicast: IPv4Address) -> ConnectionSettings:
        ways = [way for one in self._offers for way in (one.consumed_rpi_us, one.produced_rpi_us)]
        named = [way[0] for way in ways if way is not None and way[0]]
        return ConnectionSettings(
            key,
            tuple(self._offers),
            multicast,
            io_connections=self.io_connections,
            explicit_connections=self._explicit,
            minimum_rpi_us=min([_SHORTEST_RPI_US, *named]),
            maximum_rpi_us=0xFFFF_FFFF,
            below_minimum=RpiBelowMinimum.REFUSE if self._strict else RpiBelowMinimum.ACCEPT,
            paths_told_apart=True,
        )

    def configure(self, offer: IoOffer, data: bytes) -> Refusal | None:
        """All values or none: one that the file does not allow refuses with its place (CIP volume 1, 3-5.5.2: 0x09)."""
        wrong = self._put(self._offers[offer].configuration.members, data)
        return None if wrong is None else Refusal(wrong.place // 8, status=GeneralStatus.INVALID_ATTRIBUTE_VALUE)

    def _put(self, members: Sequence[Member], data: bytes) -> Member | None:
        """Write the parameters of an assembly; the first that is wrong, and then none is written."""
        found = [(one, one.parameter, one.take(data)) for one in members if one.parameter is not None]
        for member, parameter, octets in found:
            if self.values.judged(parameter, octets) != GeneralStatus.SUCCESS:
                return member
        for _, parameter, octets in found:
            self.values.put(parameter, octets)
        return None

    # -- assemblies --------------------------------------------------------------------------------------------------

    def _cyclic(self) -> dict[int, Callable[[], bytes]]:
        """The parameters that are in cyclic data, the first place of each."""
        found: dict[int, Callable[[], bytes]] = {}
        for point in self.described.points:
            for member in point.members:
                if member.parameter is not None:
                    read = partial(self._data, point.direction == "input", point.instance)
                    found.setdefault(member.parameter.number, partial(_taken, member, read))
        return found

    def _data(self, inputs: bool, instance: int) -> bytes:
        """The data of an assembly as they are now."""
        layout: PlainLayout = self.described.inputs if inputs else self.described.outputs
        place = layout.places[instance, SUBSLOT]
        return (self.inputs if inputs else self.outputs).read()[place.place : place.place + place.length]

    def _assemblies(self) -> list[AssemblyData]:
        """Those of connections, and further ones of the file: an output's data are its owner's, and are only read."""
        found: dict[int, AssemblyData] = {}
        for point in self.described.points:
            read = partial(self._data, point.direction == "input", point.instance)
            found.setdefault(point.instance, AssemblyData(point.instance, point.octets, read))
        made = [
            (one.points[0], one.configuration.size.default, one.configuration.members)
            for one in self.described.offered
            if len(one.points) > 2
        ]
        made += [
            (one.instance, one.size.default, one.members)
            for one in self.described.sheet.assemblies.values()
            if one.instance is not None
        ]
        for instance, octets, members in made:
            read = partial(composed, octets, members, self.values.read)
            writable = [one.parameter for one in members if one.parameter is not None]
            write = partial(self._written, members) if writable and not any(p.read_only for p in writable) else None
            found.setdefault(instance, AssemblyData(instance, octets, read, write))
        return list(found.values())

    def _written(self, members: Sequence[Member], data: bytes) -> int:
        return GeneralStatus.SUCCESS if self._put(members, data) is None else GeneralStatus.INVALID_ATTRIBUTE_VALUE

    # -- cyclic data -------------------------------------------------------------------------------------------------

    def consumed(self, connection: Connection) -> Carried:
        assert connection.offer is not None
        return _carried(self.described.outputs, connection.offer.consumed, connection.consumed_octets)

    def produced(self, connection: Connection) -> Carried:
        assert connection.offer is not None
        return _carried(self.described.inputs, connection.offer.produced, connection.produced_octets)

    def fed(self, timeout_ns: int, cycle_ns: int) -> None:
        """No axis depends on the connection."""

    def unfed(self) -> None:
        """Outputs keep their last value, with status BAD: the engine sees to that."""

    def lost(self) -> None:
        """A device has no fault of its own for it."""

    def paced(self, fastest_ns: int | None) -> None:
        """No firmware step depends on the interval."""

    faulty = False

    # -- tasks -------------------------------------------------------------------------------------------------------

    def parameter_task(self, value: int, now: int) -> None:
        """There is no axis."""
        raise InternalError(f"a device without axes has task {value:#x} at {now}")

    def next_deadline(self) -> int | None:
        """Every request is carried out at once."""
        return None

    def handle_timeout(self, now: int) -> None:
        """See :meth:`next_deadline`."""


def _taken(member: Member, read: Callable[[], bytes]) -> bytes:
    return member.take(read())


def _carried(layout: PlainLayout, instance: int, octets: int) -> Carried:
    """The first octets of an assembly; class 1 has no status on the wire."""
    if not octets:
        return Carried()
    place = layout.places[instance, SUBSLOT]
    return Carried(pieces=(Piece(0, place.place, octets, None, place.status),))


def _least(size: Limits) -> int | None:
    return None if size.least == size.most else size.least


def offer_of(one: EdsConnection, *, strict: bool) -> IoOffer:
    """``strict``: with the packet intervals of the file."""
    types = {ConnectionType.MULTICAST: one.multicast, ConnectionType.POINT_TO_POINT: one.point_to_point}
    intervals = [
        (way.rpi.least, way.rpi.most) if strict and way.rpi is not None else None for way in (one.outputs, one.inputs)
    ]
    return IoOffer(
        kind=one.kind,
        consumed=one.points[-2],
        produced=one.points[-1],
        consumed_octets=one.outputs.size.most,
        produced_octets=one.inputs.size.most,
        configuration=one.points[0] if len(one.points) > 2 else None,
        configuration_octets=one.configuration.size.default,
        consumed_header=one.output_header,
        produced_header=one.input_header,
        consumed_least=_least(one.outputs.size),
        produced_least=_least(one.inputs.size),
        consumed_variable=one.output_sizes,
        produced_variable=one.input_sizes,
        produced_types=frozenset(kind for kind, possible in types.items() if possible),
        triggers=one.triggers,
        consumed_rpi_us=intervals[0],
        produced_rpi_us=intervals[1],
    )
