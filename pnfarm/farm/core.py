"""A whole farm without a clock and without tasks: stations, table, link, and what goes between them.

:class:`Node` is what a runtime drives, in real time (:mod:`pnfarm.farm.realtime`) or virtual
(:mod:`pnfarm.farm.virtual`); the built-in controller is one too.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Protocol
from uuid import UUID

from pnfarm.buses.profinet.device.channels import channel_rows
from pnfarm.buses.profinet.device.station import DriveStation, StationServices
from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.engine.impairments import ImpairmentTable
from pnfarm.engine.schedule import ChannelTable
from pnfarm.errors import ConfigError, DecodeError, InternalError
from pnfarm.farm.config_axis import apply_axis
from pnfarm.farm.config_machine import apply_machine
from pnfarm.farm.events import EngineEventsLost
from pnfarm.farm.fault_log import log_fault
from pnfarm.farm.realism import imperfections
from pnfarm.links.base import unwrap
from pnfarm.links.memory import MemoryLink
from pnfarm.protocols.deadlines import Deadlines
from pnfarm.protocols.profinet.dcp_device import identify_matches
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.protocols.profinet.wire.dcp import DcpPdu, parse_dcp
from pnfarm.protocols.profinet.wire.dcp_blocks import NameBlock
from pnfarm.protocols.profinet.wire.lldp import parse_lldp
from pnfarm.station.events import (
    ControllerModeChanged,
    FaultRaised,
    FaultReacted,
    FaultsCleared,
    OutputsChanged,
    StateChanged,
    WarningChanged,
)
from pnfarm.table import engine_row
from pnfarm.table.axis_codes import FIRMWARE_PROFIDRIVE
from pnfarm.table.channel import W_START
from pnfarm.table.columns import Columns, allocate
from pnfarm.table.image import LOST_NEVER

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.drives.memory import NonVolatile
    from pnfarm.drives.model import Model
    from pnfarm.farm.config_expand import DriveConfig
    from pnfarm.faults.manager import FaultManager
    from pnfarm.links.base import Link, Port
    from pnfarm.protocols.profinet.wire.lldp import Lldpdu
    from pnfarm.station.event_log import EventLog

#: Ethertypes of ARP and of LLDP; ethertype and frame id of DCP's Identify request and of its Hello.
ARP = bytes.fromhex("0806")
LLDP = bytes.fromhex("88cc")
DCP_IDENTIFY = bytes.fromhex("8892fefe")
DCP_GREETING = bytes.fromhex("8892fefc")

#: Events whose row is a consumer's.
_OF_CONSUMERS = frozenset(
    {engine_row.FIRST_FRAME, engine_row.EXPIRED, engine_row.PROVIDER_CHANGED, engine_row.IOPS_CHANGED}
)

__all__ = ["FarmCore", "Node", "uuid_source"]

#: Impairment rows for each drive: faults on its frames that can be active at once.
IMPAIRMENTS_PER_DRIVE = 8


class Node(Protocol):
    """One end of the wire as a runtime sees it."""

    columns: Columns
    link: Link

    def receive(self, port: int, frame: bytes, now: int) -> None:
        """One acyclic frame."""
        ...

    def service(self, now: int) -> None:
        """Take the engine's events and whatever timers are due."""
        ...

    def next_deadline(self) -> int | None:
        """When :meth:`service` is wanted at the latest."""
        ...


def uuid_source(seed: bytes) -> Callable[[], UUID]:
    """UUIDs that differ from each other, and from those of any other seed: version 8, digest of seed and count."""
    count = 0

    def new() -> UUID:
        nonlocal count
        count += 1
        digest = bytearray(hashlib.sha256(seed + count.to_bytes(8, "big")).digest()[:16])
        digest[6] = digest[6] & 0x0F | 0x80
        digest[8] = digest[8] & 0x3F | 0x80
        return UUID(bytes=bytes(digest))

    return new


class FarmCore:
    """``ports`` belong to ``drives`` one by one; ``models`` gives a drive's model under its own identity."""

    def __init__(
        self,
        name: str,
        drives: Sequence[DriveConfig],
        models: Callable[[DriveConfig], Model],
        link: Link,
        ports: Sequence[Port],
        *,
        memory: NonVolatile,
        log: EventLog,
        seed: bytes,
        tick_ns: int = 1_000_000,
        lldp: bool = True,
    ) -> None:
        self.name = name
        self.link = link
        self.log = log
        count = len(drives)
        known = [models(config) for config in drives]
        self.columns = allocate(
            stations=count,
            axes=count,
            channels=sum(channel_rows(model.limits.io_controllers) for model in known),
            impairments=count * IMPAIRMENTS_PER_DRIVE + 8,
        )
        self.columns.engine[0].tick_ns = tick_ns
        self.columns.image.lost[:] = LOST_NEVER
        self.impairments = ImpairmentTable(self.columns)
        self.channels = ChannelTable(self.columns)
        self.stations: list[DriveStation] = []
        self._by_port: dict[int, DriveStation] = {}
        self._by_name: dict[str, DriveStation] = {}
        self._deadlines = Deadlines()
        #: The last Identify, what it says, and the name if it asks for one only.
        self._identify: tuple[bytes, DcpPdu | None, str | None] = (b"", None, None)
        #: The last LLDP frame and what it says, or why it says nothing.
        self._lldp: tuple[bytes, Lldpdu | str] = (b"", "short")
        self._tail = 0
        self.events_lost = 0
        #: Faults on the drives, once :func:`pnfarm.farm.fault_targets.attach_faults` gave the farm its manager.
        self.faults: FaultManager | None = None
        for index, (config, model, port) in enumerate(zip(drives, known, ports, strict=True)):
            axis, image = self.columns.axis[index], self.columns.image[index]
            model.apply_motor(axis)
            apply_axis(axis, config.load, config.motor, model.pitch)
            apply_machine(axis, config.machine, config.load, model.pitch)
            flaws = imperfections(config.realism, model, config.name, by_source=config.realism_by_source)
            flaws.apply(axis)
            axis.step_ns = 4_000_000
            image.port = port.index
            image.mac = int.from_bytes(port.mac, "big")
            uuids = uuid_source(seed + port.mac)
            services = StationServices(self.channels, self.impairments, memory, log, uuids, lldp)
            station = DriveStation(config, model, index, port, AxisHandle(axis, image), services, flaws)
            axis.powered = 1
            axis.firmware = FIRMWARE_PROFIDRIVE
            self.stations.append(station)
            self._by_port[port.index] = station
            self._by_name[config.name] = station
        #: Stations by their address as in an ARP packet, and the address that each is listed under.
        self._by_ip: dict[bytes, list[DriveStation]] = {}
        self._listed: list[bytes] = [b""] * count
        for station in self.stations:
            self._list_address(station)
        link.set_receiver(self.receive)
        if isinstance(innermost := unwrap(link), MemoryLink):
            innermost.set_audience(self._audience)

    def start(self, now: int) -> None:
        """Power on at ``now``: announce addresses."""
        for axis in self.columns.axis[: len(self.stations)]:
            axis.last_ns = now
            axis.boot_ns = now
            axis.clock_start_ns = now
        for station in self.stations:
            station.boot(now)
            self.settle(station, now)

    def stop(self, now: int) -> None:
        """Tell every controller that its drive goes: an ERR-RTA for each connection."""
        for station in self.stations:
            station.cm.abort_all(RtaError.DEVICE_DEACTIVATED, now)
            station.neighbours.lldp.shut_down(now)
            self.settle(station, now)

    def station(self, name: str) -> DriveStation:
        """By the name in the farm file, or the one that DCP gave; raises :class:`ConfigError`."""
        found = self._by_name.get(name) or next((s for s in self.stations if s.name == name), None)
        if found is None:
            raise ConfigError(f"there is no drive {name!r} in farm {self.name}; `pnfarm inspect` lists them")
        return found

    # -- frames and time ---------------------------------------------------------------------------------------------

    def receive(self, port: int, frame: bytes, now: int) -> None:
        station = self._by_port.get(port)
        if station is None:
            raise InternalError(f"the link delivered a frame for port {port}, which no drive has")
        if frame[12:14] == LLDP:
            self._receive_lldp(station, frame, now)
            return
        if frame and frame[0] & 1 and not self._concerns(station, frame):
            return
        if not station.budget.passes(frame, now):
            station.passed_over("connect-flood")
            return
        if self.faults is not None:
            self.faults.refresh(station.configured_name, now)
        station.receive(frame, now)
        self.settle(station, now)
        if self.faults is not None:
            self.faults.poke(station.configured_name, now)

    def _receive_lldp(self, station: DriveStation, frame: bytes, now: int) -> None:
        """Drives that share a cable all hear the same frame: it is parsed once, and mostly says nothing new."""
        if frame is not self._lldp[0] and frame != self._lldp[0]:
            self._lldp = (frame, _read_lldp(frame))
        if station.hear_neighbour(frame, self._lldp[1], now):
            self.settle(station, now)

    def _concerns(self, station: DriveStation, frame: bytes) -> bool:
        """Whether a group-addressed frame can mean anything to this station.

        A wire delivers each one to every drive: a thousand drives that are sought by name are a million
        copies.  So an Identify is parsed once for all of them, and an ARP for somebody else or a Hello goes no further.
        In memory the switch asks :meth:`_audience` and does not even make the copies.
        """
        if frame[12:14] == ARP:
            own = station.own_ip
            if own and own in {frame[28:32], frame[38:42]}:
                return True
            return station.passed_over("arp-for-another")
        if frame[12:16] == DCP_GREETING:
            return station.passed_over("hello")
        if frame[12:16] == DCP_IDENTIFY:
            if frame != self._identify[0]:
                self._identify = (frame, *_read_identify(frame))
            _, pdu, name = self._identify
            if pdu is not None and (
                station.dcp.name != name if name is not None else not identify_matches(pdu, station.dcp)
            ):
                return station.passed_over("identify-for-another")
        return True

    def _audience(self, frame: bytes) -> list[int] | None:
        """The ports that a group-addressed frame can concern; None: all, :meth:`_concerns` tells."""
        if frame[12:16] == DCP_GREETING:
            return []
        if frame[12:14] != ARP or len(frame) < 42:
            return None
        sender, target = frame[28:32], frame[38:42]
        found = self._by_ip.get(target, [])
        if sender != target:
            found = found + self._by_ip.get(sender, [])
        return [station.port.index for station in found]

    def _list_address(self, station: DriveStation) -> None:
        before, own = self._listed[station.index], station.own_ip
        if own == before:
            return
        if before:
            self._by_ip[before].remove(station)
        if own:
            self._by_ip.setdefault(own, []).append(station)
        self._listed[station.index] = own

    def settle(self, station: DriveStation, now: int) -> None:
        """Let a station finish what an input began, send its frames, note when it wants to be called."""
        frames = station.pump(now)
        self._list_address(station)
        for frame in frames:
            self.link.send(station.port.index, frame)
        self._deadlines.set(station.index, station.next_deadline())

    def service(self, now: int) -> None:
        self._drain(now)
        for index in self._deadlines.take(now):
            station = self.stations[index]
            station.handle_timeout(now)
            self.settle(station, now)
            if self.faults is not None:
                self.faults.touch(station.configured_name)
        if self.faults is not None:
            self.faults.handle_timeout(now)
            for happened in self.faults.events():
                log_fault(self.log, happened)

    def next_deadline(self) -> int | None:
        deadlines = (self._deadlines.first(), self.faults.next_deadline() if self.faults is not None else None)
        return min((due for due in deadlines if due is not None), default=None)

    # -- the engine's events -----------------------------------------------------------------------------------------

    def _drain(self, now: int) -> None:
        head = int(self.columns.engine[0].event_head)
        size = self.columns.events.shape[0]
        if head - self._tail > size:
            self.events_lost += head - self._tail - size
            self.log.record(now, "", EngineEventsLost(head - self._tail - size))
            self._tail = head - size
            self._catch_up(now)
        touched: dict[int, DriveStation] = {}
        while self._tail < head:
            event = self.columns.events[self._tail % size]
            kind, row, when, value = int(event.kind), int(event.row), int(event.now_ns), int(event.value)
            self._tail += 1
            station = self._take(kind, row, when, value, now)
            if station is not None:
                touched[station.index] = station
        for station in touched.values():
            self.settle(station, now)
            if self.faults is not None:
                self.faults.touch(station.configured_name)

    def _catch_up(self, now: int) -> None:
        """The ring of events ran over: what the rows themselves tell of connections is not lost."""
        for station in self.stations:
            for row in [row for ar in station.ars.values() for row, _ in ar.consumers]:
                consumer = self.columns.cpm[row]
                if consumer.state == W_START:
                    station.connections.expired(row, now - int(consumer.last_ns), now)
                elif consumer.received:
                    station.connections.first_frame(row, now)
            self.settle(station, now)

    def _take(self, kind: int, row: int, when: int, value: int, now: int) -> DriveStation | None:
        if kind in _OF_CONSUMERS:
            consumer = self.columns.cpm[row]
            station = self.stations[int(consumer.image)]
            # the connection went while the event waited, and another may have the row by now
            seen = consumer.expirations if kind == engine_row.EXPIRED else consumer.received
            if station.channels.of_consumer(row) is None or not seen:
                return None
            if kind == engine_row.FIRST_FRAME:
                station.connections.first_frame(row, when)
            elif kind == engine_row.EXPIRED:
                station.connections.expired(row, value, now, when)
            elif kind == engine_row.PROVIDER_CHANGED:
                self.log.record(when, station.configured_name, ControllerModeChanged(run=bool(value)))
            else:
                self.log.record(when, station.configured_name, OutputsChanged(good=bool(value)))
            return station
        station = self.stations[row]
        name = station.configured_name
        match kind:
            case engine_row.STATE_CHANGED:
                self.log.record(when, name, StateChanged(value >> 8, value & 0xFF))
            case engine_row.FAULT_RAISED:
                station.fault_counts[value] = station.fault_counts.get(value, 0) + 1
                station.fault_diagnosis.raised(value)
                station.keep_faults(when)
                self.log.record(when, name, FaultRaised(value))
            case engine_row.FAULTS_CLEARED:
                station.fault_diagnosis.cleared()
                station.keep_faults(when)
                self.log.record(when, name, FaultsCleared(value))
            case engine_row.FAULT_REACTED:
                self.log.record(when, name, FaultReacted(value))
            case engine_row.WARNING_CHANGED:
                self.log.record(when, name, WarningChanged(value))
            case engine_row.PARAMETER_TASK:
                station.parameter_words.take(value, now)
            case _:
                return None
        return station


def _read_identify(frame: bytes) -> tuple[DcpPdu | None, str | None]:
    """The PDU of an Identify request, None if it is none; and the name, if that is its one filter."""
    try:
        pdu = parse_dcp(frame[14:])
    except DecodeError:
        return None, None
    if len(pdu.blocks) == 1 and isinstance(pdu.blocks[0], NameBlock):
        return pdu, pdu.blocks[0].name
    return pdu, None


def _read_lldp(frame: bytes) -> Lldpdu | str:
    try:
        return parse_lldp(frame[14:])
    except DecodeError as exc:
        return exc.reason
