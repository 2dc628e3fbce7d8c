"""Who was on the wire and how it was connected: what a capture's frames say of the plant, for a farm file.

The decoder reports each fact as it finds it.  Of each kind a bounded number is kept, the last of each station counts.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from pnfarm.captures.stations import Bounded
from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.records.directory import Index
from pnfarm.protocols.profinet.wire.any_block import read_blocks
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq, ArProperties, ArServerBlock, ArType
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock
from pnfarm.protocols.profinet.wire.cm.expected import ExpectedApi, ExpectedSubmoduleBlockReq, ModuleDiffBlock
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockReq
from pnfarm.protocols.profinet.wire.dcp import blocks
from pnfarm.protocols.profinet.wire.records.container import parse_container
from pnfarm.protocols.profinet.wire.records.identification import Im0
from pnfarm.protocols.profinet.wire.rpc.pdu import device_of
from pnfarm.wire.mac import is_group
from pnfarm.wire.rtc import SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Iterable
    from ipaddress import IPv4Address
    from uuid import UUID

    from pnfarm.protocols.profinet.wire.block import Block
    from pnfarm.protocols.profinet.wire.records.iod import IodWriteReqHeader, IodWriteResHeader, WriteRequest

__all__ = ["Observed", "RecordPlace", "SeenConnection", "SeenStation", "cr_cycle_ns", "expected_apis"]

#: Start-up records that are kept of a connection, their octets, ports of a station, its names and its addresses.
MOST_RECORDS, MOST_OCTETS, MOST_PORTS, MOST_CHANGES = 4096, 1 << 20, 64, 16
_Value = TypeVar("_Value")
#: API, slot, subslot, index.
RecordPlace = tuple[int, int, int, int]


@dataclass(slots=True)
class SeenStation:
    """A station by what it said of itself, and what others set."""

    mac: bytes
    name: str = ""
    ip: IPv4Address | None = None
    mask: IPv4Address | None = None
    gateway: IPv4Address | None = None
    vendor: int | None = None
    device: int | None = None
    station_type: str = ""
    #: Names and addresses that it had one after the other, as far as it had any; the last ones count.
    names: list[str] = field(default_factory=list)
    addresses: list[IPv4Address] = field(default_factory=list)
    #: Its address as its controllers use it.
    called: IPv4Address | None = None
    #: Its ports, as it announces them by LLDP.
    ports: list[str] = field(default_factory=list)
    #: I&M0 of a slot and subslot, as it was read.
    im0: dict[tuple[int, int], Im0] = field(default_factory=dict)


@dataclass(slots=True)
class SeenConnection:
    """A connection for cyclic data, as the controller asked for it; ``numbers`` are vendor, device and instance.

    ``parameters`` are the octets last written between Connect and PrmEnd, in the order of their first writing;
    ``rewritten`` those of them that had other octets before, with their number; ``later`` records that were written
    after that with other octets, and their number; ``refused`` what the device did not take.
    """

    controller: bytes
    device: bytes
    numbers: tuple[int, int, int]
    request: tuple[Block, ...]
    time_ns: int
    accepted: bool | None = None
    difference: ModuleDiffBlock | None = None
    parameters: dict[RecordPlace, bytes] = field(default_factory=dict)
    rewritten: dict[RecordPlace, int] = field(default_factory=dict)
    later: dict[RecordPlace, int] = field(default_factory=dict)
    refused: set[RecordPlace] = field(default_factory=set)
    octets: int = 0
    multiple_write: bool = False
    started: bool = False

    @property
    def ar(self) -> ArBlockReq:
        return next(block for block in self.request if isinstance(block, ArBlockReq))

    @property
    def iocrs(self) -> list[IocrBlockReq]:
        return [block for block in self.request if isinstance(block, IocrBlockReq)]

    @property
    def apis(self) -> tuple[ExpectedApi, ...]:
        return expected_apis(self.request)

    @property
    def controller_name(self) -> str:
        return self.ar.station_name.decode("latin-1")

    @property
    def advanced(self) -> bool:
        return bool(self.ar.properties & ArProperties.STARTUP_MODE_ADVANCED)

    @property
    def cycle_ns(self) -> int:
        return min(map(cr_cycle_ns, self.iocrs))

    @property
    def cycles(self) -> dict[int, int]:
        """The fastest cycle of each slot that has a place among the data of a CR, ns."""
        found: dict[int, int] = {}
        for iocr in sorted(self.iocrs, key=cr_cycle_ns, reverse=True):
            found |= {place.slot: cr_cycle_ns(iocr) for api in iocr.apis for place in api.data_objects}
        return found

    @property
    def watchdog_factor(self) -> int:
        return max(iocr.watchdog_factor for iocr in self.iocrs)


def _last(value: _Value, known: list[_Value]) -> _Value:
    """The value, noted unless it is the last one already."""
    if known[-1:] != [value] and len(known) < MOST_CHANGES:
        known.append(value)
    return value


def cr_cycle_ns(iocr: IocrBlockReq) -> int:
    """Between two frames of a CR."""
    return SEND_CLOCK_NS * iocr.send_clock_factor * iocr.reduction_ratio


def expected_apis(request: Iterable[Block]) -> tuple[ExpectedApi, ...]:
    """The modules that a Connect expects, by slot."""
    return tuple(api for block in request if isinstance(block, ExpectedSubmoduleBlockReq) for api in block.apis)


class Observed:
    """See the module's docstring.  ``connections``: each that a controller asked of a device, the last ones last; one
    that asks for the same modules again is the same."""

    def __init__(self) -> None:
        self.stations: Bounded[bytes, SeenStation] = Bounded()
        self.connections: Bounded[tuple[bytes, bytes, tuple[ExpectedApi, ...]], SeenConnection] = Bounded()
        self._current: Bounded[tuple[bytes, bytes], SeenConnection] = Bounded()

    def station(self, mac: bytes) -> SeenStation:
        """What is known of a station."""
        found = self.stations.get(mac)
        if found is None:
            found = SeenStation(mac)
            if not is_group(mac):
                self.stations[mac] = found
        return found

    def said(self, mac: bytes, facts: Iterable[blocks.Block]) -> None:
        """A station's answer, or what another set of it."""
        seen = self.station(mac)
        for fact in facts:
            match fact:
                case blocks.NameBlock(name) if name:
                    seen.name = _last(name, seen.names)
                case blocks.IpParameterBlock(address, mask, gateway) | blocks.FullIpSuiteBlock(
                    address, mask, gateway
                ) if int(address):
                    seen.ip, seen.mask, seen.gateway = _last(address, seen.addresses), mask, gateway
                case blocks.DeviceIdBlock(vendor, device):
                    seen.vendor, seen.device = vendor, device
                case blocks.StationTypeBlock(station_type):
                    seen.station_type = station_type
                case _:
                    pass

    def announced(self, mac: bytes, name: str, port: str) -> None:
        """LLDP, which a station sends from an address of its port; ``mac`` is the station's own if it names that."""
        seen = self.station(mac)
        if port not in seen.ports and len(seen.ports) < MOST_PORTS:
            seen.ports.append(port)
        seen.name = seen.name or name

    def asked(
        self, request: tuple[Block, ...], controller: bytes, device: bytes, called: tuple[UUID, IPv4Address], now: int
    ) -> None:
        """A Connect to the object and the address ``called``."""
        if not any(isinstance(block, IocrBlockReq) for block in request):
            return
        ar = next((block for block in request if isinstance(block, ArBlockReq)), None)
        if ar is None or ar.ar_type == ArType.IOSAR:
            return
        target, address = called
        instance, number, vendor = device_of(target)
        seen = self.station(device)
        seen.called = address
        if seen.vendor is None:
            seen.vendor, seen.device = vendor, number
        key = controller, device, expected_apis(request)
        found = self.connections.pop(key, None)
        if found is None:
            found = SeenConnection(controller, device, (vendor, number, instance), request, now)
        found.request, found.started = request, False
        self.connections[key] = self._current[controller, device] = found

    def answered(self, controller: bytes, device: bytes, answer: tuple[Block, ...] | None) -> None:
        """The Connect's answer; None: it was refused."""
        found = self._current.get((controller, device))
        if found is None:
            return
        found.accepted = answer is not None
        found.difference = next((block for block in answer or () if isinstance(block, ModuleDiffBlock)), None)
        for block in answer or ():
            if isinstance(block, ArServerBlock):
                seen = self.station(device)
                if name := block.station_name.decode("latin-1"):
                    seen.name = _last(name, seen.names)

    def wrote(self, controller: bytes, device: bytes, write: WriteRequest) -> None:
        """Records that the controller wrote."""
        found = self._current.get((controller, device))
        if found is None:
            return
        found.multiple_write |= write.multiple
        for one in write.writes:
            self._wrote(found, (one.header.api, one.header.slot, one.header.subslot, one.header.index), one.data)

    def _wrote(self, found: SeenConnection, place: RecordPlace, data: bytes) -> None:
        if place[3] == Index.COMBINED_OBJECT_CONTAINER:
            with suppress(DecodeError):  # it is a record of its own then, which no device takes
                for inner in parse_container(data):
                    if inner.index != Index.COMBINED_OBJECT_CONTAINER:
                        self._wrote(found, (inner.api, inner.slot, inner.subslot, inner.index), inner.data)
                return
        known = found.parameters.get(place)
        if found.started:
            if known != data and len(found.later) < MOST_RECORDS:
                found.later[place] = len(data)
            return
        grown = found.octets + len(data) - len(known or b"")
        if grown > MOST_OCTETS or (known is None and len(found.parameters) >= MOST_RECORDS):
            return
        if known is not None and known != data:
            found.rewritten[place] = len(known)
        found.parameters[place], found.octets = data, grown
        found.refused.discard(place)

    def refused(
        self, controller: bytes, device: bytes, headers: Iterable[IodWriteReqHeader | IodWriteResHeader]
    ) -> None:
        """What the device did not take of a Write is no parameter of it."""
        found = self._current.get((controller, device))
        if found is None:
            return
        for header in headers:
            place = header.api, header.slot, header.subslot, header.index
            if (data := found.parameters.pop(place, None)) is not None:
                found.octets -= len(data)
                found.refused.add(place)

    def controlled(self, controller: bytes, device: bytes, request: tuple[Block, ...]) -> None:
        """A Control: what is written after the end of the parameters is none of them."""
        found = self._current.get((controller, device))
        if found is not None and any(
            isinstance(block, ControlBlock) and block.block_type == BlockType.PRM_END_REQ for block in request
        ):
            found.started = True

    def read(self, device: bytes, slot: int, subslot: int, index: int, data: bytes) -> None:
        """A record that someone read: its answer."""
        if index != Index.IM0:
            return
        found = next((block for block in read_blocks(data)[0] if isinstance(block, Im0)), None)
        seen = self.station(device)
        if found is not None and ((slot, subslot) in seen.im0 or len(seen.im0) < MOST_RECORDS):
            seen.im0[slot, subslot] = found
