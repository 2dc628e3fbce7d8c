"""Who was on the wire and how it was connected: what a capture's frames say of the plant, for a farm file.

The decoder tells each fact as it finds it.  Of each kind a bounded number is kept, the last of each station counts.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.captures.stations import Bounded
from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq, ArProperties, ArType
from pnfarm.protocols.profinet.wire.cm.expected import ExpectedApi, ExpectedSubmoduleBlockReq, ModuleDiffBlock
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockReq
from pnfarm.protocols.profinet.wire.dcp import blocks
from pnfarm.wire.mac import is_group
from pnfarm.wire.rtc import SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from ipaddress import IPv4Address

    from pnfarm.protocols.profinet.wire.block import Block
    from pnfarm.protocols.profinet.wire.records.iod import WriteRequest

__all__ = ["Observed", "SeenConnection", "SeenStation"]

#: Start-up records that are kept of a connection.
MOST_RECORDS = 4096


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
    #: The neighbour's name and port by LLDP, as this station announces itself.
    port: str = ""


@dataclass(slots=True)
class SeenConnection:
    """A connection for cyclic data, as the controller asked for it; ``records`` are (slot, subslot, index, octets)."""

    controller: bytes
    device: bytes
    controller_name: str
    advanced: bool
    cycle_ns: int
    watchdog_factor: int
    apis: tuple[ExpectedApi, ...]
    accepted: bool | None = None
    differs: bool = False
    records: list[tuple[int, int, int, int]] = field(default_factory=list)


class Observed:
    """See the module's docstring.  ``connections``: the last of each pair of controller and device."""

    def __init__(self) -> None:
        self.stations: Bounded[bytes, SeenStation] = Bounded()
        self.connections: Bounded[tuple[bytes, bytes], SeenConnection] = Bounded()

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
                case blocks.NameBlock(name):
                    seen.name = name
                case blocks.IpParameterBlock(address, mask, gateway) | blocks.FullIpSuiteBlock(address, mask, gateway):
                    seen.ip, seen.mask, seen.gateway = address, mask, gateway
                case blocks.DeviceIdBlock(vendor, device):
                    seen.vendor, seen.device = vendor, device
                case blocks.StationTypeBlock(station_type):
                    seen.station_type = station_type
                case _:
                    pass

    def announced(self, mac: bytes, name: str, port: str) -> None:
        """LLDP, which a station sends from an address of its port."""
        seen = self.station(mac)
        seen.port = port
        seen.name = seen.name or name

    def asked(self, request: tuple[Block, ...], controller: bytes, device: bytes, ids: Mapping[str, int]) -> None:
        """A Connect; ``ids`` are vendor and device of the object that it addresses."""
        ar = next((block for block in request if isinstance(block, ArBlockReq)), None)
        iocrs = [block for block in request if isinstance(block, IocrBlockReq)]
        if ar is None or not iocrs or ar.ar_type == ArType.IOSAR:
            return
        seen = self.station(device)
        if seen.vendor is None:
            seen.vendor, seen.device = ids["vendor"], ids["device"]
        self.connections[controller, device] = SeenConnection(
            controller,
            device,
            ar.station_name.decode("latin-1"),
            bool(ar.properties & ArProperties.STARTUP_MODE_ADVANCED),
            min(SEND_CLOCK_NS * iocr.send_clock_factor * iocr.reduction_ratio for iocr in iocrs),
            max(iocr.watchdog_factor for iocr in iocrs),
            tuple(api for block in request if isinstance(block, ExpectedSubmoduleBlockReq) for api in block.apis),
        )

    def answered(self, controller: bytes, device: bytes, answer: tuple[Block, ...] | None) -> None:
        """The Connect's answer; None: it was refused."""
        found = self.connections.get((controller, device))
        if found is not None:
            found.accepted = answer is not None
            found.differs = any(isinstance(block, ModuleDiffBlock) for block in answer or ())

    def wrote(self, controller: bytes, device: bytes, write: WriteRequest) -> None:
        """Records that the controller wrote."""
        found = self.connections.get((controller, device))
        if found is None:
            return
        for one in write.writes:
            if len(found.records) < MOST_RECORDS:
                found.records.append((one.header.slot, one.header.subslot, one.header.index, len(one.data)))
