"""A PROFINET drive on the wire: its protocol machines, its parameters and its rows of the table.

A device takes bytes and ``now`` and returns frames, like the machines that it consists of; the farm's runtime carries
the frames.  :mod:`pump` carries events between the machines.  Here

* an address set by DCP goes to the IP host and into non-volatile memory;
* a connected AR opens rows of the channel tables, an ended one closes them;
* an expired data hold timer, reported by the engine, aborts the AR;
* a drive that is still booting neither receives nor sends.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

from pnfarm.buses.profinet.device import events as happened
from pnfarm.buses.profinet.device.address import StationAddress
from pnfarm.buses.profinet.device.channels import StationChannels, channel_rows
from pnfarm.buses.profinet.device.connect_budget import ConnectBudget
from pnfarm.buses.profinet.device.connections import StationConnections
from pnfarm.buses.profinet.device.management.neighbour_rows import NeighbourRows
from pnfarm.buses.profinet.device.management.neighbours import StationNeighbours
from pnfarm.buses.profinet.device.management.station import snmp_view
from pnfarm.buses.profinet.device.management.traffic import PortTraffic
from pnfarm.buses.profinet.device.memory.kept_values import check_kept
from pnfarm.buses.profinet.device.memory.record_memory import records_of
from pnfarm.buses.profinet.device.pump import CALL_PORT, DevicePump
from pnfarm.buses.profinet.device.view import connection_of, details_of, losses_in_words, losses_of, view_of
from pnfarm.buses.profinet.uuids import uuid_source
from pnfarm.errors import DecodeError, InternalError
from pnfarm.protocols.deadlines import earliest
from pnfarm.protocols.profinet.cm.device.cmdev import CmDevice
from pnfarm.protocols.profinet.dcp.rules import DcpIdentity
from pnfarm.protocols.profinet.description import Plugged
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.protocols.profinet.records.store import DeviceRecords
from pnfarm.protocols.profinet.rpc.client import RpcClient
from pnfarm.protocols.profinet.rpc.endpoints import Endpoint
from pnfarm.protocols.profinet.rpc.events import RpcServerConfig
from pnfarm.protocols.profinet.rpc.server import RpcServer
from pnfarm.protocols.profinet.snmp.agent import SnmpAgent
from pnfarm.protocols.profinet.snmp.view import SystemText
from pnfarm.protocols.profinet.wire.frame_id import DCP_HELLO, DCP_IDENTIFY_RESPONSE
from pnfarm.protocols.profinet.wire.names import check_station_name
from pnfarm.protocols.profinet.wire.rpc.epm import annotation
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT, object_uuid
from pnfarm.protocols.profinet.wire.snmp.message import SNMP_PORT
from pnfarm.station.events import ControllerModeChanged, OutputsChanged
from pnfarm.station.visits import Caller
from pnfarm.table import engine_row
from pnfarm.table.channel import W_START
from pnfarm.wire.ethernet import ETHERTYPE_LLDP, ETHERTYPE_PROFINET, EthernetFrame, parse_ethernet
from pnfarm.wire.mac import mac_to_int

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.buses.bus import DeviceServices
    from pnfarm.buses.profinet.config.device import ProfinetDeviceConfig
    from pnfarm.buses.profinet.config.drive import ProfinetDriveConfig
    from pnfarm.buses.profinet.device.ar_channels import ArChannels
    from pnfarm.buses.profinet.device.kind import Kind
    from pnfarm.engine.channels.closed_channels import ClosedChannels
    from pnfarm.links.base import Port
    from pnfarm.protocols.ip.host import IpHost
    from pnfarm.protocols.profinet.dcp.device import DcpDevice
    from pnfarm.protocols.profinet.wire.lldp.pdu import Lldpdu
    from pnfarm.station.device import ConnectionView
    from pnfarm.station.event import Event
    from pnfarm.station.station import Station

__all__ = ["ProfinetDevice"]

#: The ethertype as in a frame.
LLDP = ETHERTYPE_LLDP.to_bytes(2, "big")
#: Drop reason of cyclic frames that belong to no connection.
STRAY = "unknown-frame-id"


class ProfinetDevice:
    """See the module's docstring; :class:`pnfarm.station.device.Device` defines the interface."""

    def __init__(
        self, station: Station, services: DeviceServices, kind: Kind, io_controllers: int, crs: int = 1
    ) -> None:
        """``io_controllers``: how many can be connected at once; ``crs``: the most of one direction of each."""
        self.station = station
        self.kind = kind
        self._services = services
        self._uuids = uuid_source(services.seed + station.port.mac)
        #: Frames dropped by reason, before any machine saw them.
        self.dropped: dict[str, int] = {}
        #: Frames for others that never came here, by reason; the segment sets it.
        self.unheard: Callable[[], Mapping[str, int]] = dict
        #: What these were when it left the wire, None while it is there; and those that came by while it was away.
        self._left_at: Mapping[str, int] | None = {}
        self._missed: Counter[str] = Counter()
        rows = channel_rows(io_controllers, crs)
        self.channels = StationChannels(
            self.index, kind, self.port, services.channels, services.impairments, rows, crs, station.flaws.drift
        )
        self.connections = StationConnections(self, services.lateness)
        self.budget = ConnectBudget()
        self._pump = DevicePump(self)
        self._built = False
        #: When something other than LLDP is due, None for nothing; known until the next whole turn.
        self._others_ns: int | None = None
        self._others_known = False
        #: A drive of a thousand sends LLDP each few milliseconds: nothing else is checked then.
        self._only_lldp = False
        self.cm: CmDevice

    # -- life --------------------------------------------------------------------------------------------------------

    def check(self, kept: Mapping[str, Any]) -> None:
        check_kept(kept)

    def commission(self, kept: Mapping[str, Any]) -> None:
        self.kind.commission(kept, has_address=self.config.ip is not None)

    def build(self, kept: dict[str, Any]) -> None:
        if self._built:
            # the machines are recreated; their drop counters are kept
            self.dropped = self._own_discards()
            self.connections.forget()
            self._pump.forget_calls()
        self._built = True
        self._others_known = self._only_lldp = False
        self._take_written_name(kept)
        kept = dict(kept)
        mac = self.port.mac
        own = self.description = self.kind.describe(mac)
        self.addressing = StationAddress(
            mac,
            DcpIdentity(own.station_type, own.vendor_id, own.device_id, instance=(0, own.instance)),
            self.config,
            kept,
            keep=self.keep,
            note=self.note,
        )
        self.dcp, self.ip = self.addressing.dcp, self.addressing.ip
        self.dcp.can_keep = self._can_keep
        self.ip.open_ports = {RPC_PORT, CALL_PORT, SNMP_PORT}
        self.neighbours = StationNeighbours(mac, self.index, self.description, enabled=self._services.lldp)
        self.neighbours.update(self.dcp.name, self.dcp.address, self.dcp.gateway, 0)
        prefix, *version = own.im0.software_revision
        self.rpc = RpcServer(
            RpcServerConfig(
                endpoints=(
                    Endpoint(
                        object_uuid(own.instance, own.device_id, own.vendor_id),
                        annotation(
                            own.station_type,
                            own.im0.order_id,
                            own.im0.hardware_revision,
                            prefix,
                            (version[0], version[1], version[2]),
                        ),
                    ),
                )
            )
        )
        if self.dcp.address is not None:
            self.rpc.set_address(self.dcp.address.ip)
        self.client = RpcClient(self._uuids)
        plugged = Plugged(self.description)
        self.records = DeviceRecords(
            self.description,
            plugged,
            lambda: self.cm.ars,
            application=self.kind.records,
            io_data=self.channels.io_data,
            pdev=self.neighbours.pdev,
            texts=records_of(kept.get("im")),
        )
        self.cm = CmDevice(
            self.description,
            plugged,
            self.records,
            mac=mac,
            station_name=self.dcp.name,
            diagnosis=self.records.diagnosis,
        )
        self.records.im.can_keep = self._can_keep
        self.cm.has_room = self.channels.room
        self.kind.join(self.dcp, mac, self.cm)
        #: Texts that SNMP managers wrote; they survive a power cycle.
        self.snmp_texts = {SystemText[which]: text for which, text in kept.get("snmp", {}).items()}
        self.neighbour_rows = NeighbourRows()
        self.snmp = SnmpAgent(lambda now: snmp_view(self, now))
        self.snmp.can_keep = self._can_keep
        self.traffic = PortTraffic(self._services.channels, self.channels, self.discards())

    def _take_written_name(self, kept: dict[str, Any]) -> None:
        """A station name set by a parameter is used from now on, like one that DCP set permanently."""
        name = self.kind.take_name(kept)
        if name is None:
            return
        if not name or check_station_name(name) is None:
            kept["name"] = name
        self.station.save()

    @property
    def index(self) -> int:
        """The station's in the farm."""
        return self.station.index

    @property
    def port(self) -> Port:
        """Its interface."""
        return cast("Port", self.station.port)

    @property
    def config(self) -> ProfinetDriveConfig | ProfinetDeviceConfig:
        """This drive's settings in the farm file."""
        return cast("ProfinetDriveConfig | ProfinetDeviceConfig", self.station.config)

    @property
    def ars(self) -> dict[int, ArChannels]:
        """The present connections, by the key of their AR."""
        return self.channels.ars

    @property
    def name(self) -> str:
        """The present station name: DCP may have changed it."""
        return self.dcp.name

    @property
    def _others(self) -> tuple[DcpDevice, IpHost, RpcServer, RpcClient, CmDevice, SnmpAgent]:
        """The machines that do not speak LLDP."""
        return self.dcp, self.ip, self.rpc, self.client, self.cm, self.snmp

    @property
    def _machines(self) -> tuple[DcpDevice, IpHost, RpcServer, RpcClient, CmDevice, SnmpAgent, StationNeighbours]:
        return *self._others, self.neighbours

    @property
    def connects(self) -> int:
        return self.connections.connects

    @property
    def aborts(self) -> Counter[tuple[int, int]]:
        """Connections that ended without a release, by the two codes of the ERR-RTA."""
        return self.connections.aborts

    @property
    def watchdog_expirations(self) -> int:
        """Number of expired data hold timers."""
        return self.connections.watchdog_expirations

    @property
    def watchdog_expirations_by_farm(self) -> int:
        return self.connections.watchdog_expirations_by_farm

    @property
    def powered(self) -> bool:
        """Whether the control supply is on."""
        return self.station.powered

    @property
    def booted_ns(self) -> int:
        """Time of the last power-on."""
        return self.station.booted_ns

    @property
    def configured_name(self) -> str:
        """The name in the farm file."""
        return self.station.configured_name

    @property
    def own_ip(self) -> bytes:
        """The address as in an ARP packet, empty for none."""
        return self.addressing.own_ip

    def start(self, now: int) -> list[str]:
        if self._left_at is not None:
            self._missed.update(self.unheard())
            self._missed.subtract(self._left_at)
            self._left_at = None
        self.addressing.link_up(now)
        return self.neighbours.pdev.restore(records_of(self.station.kept.get("pdev")), now)

    def leave(self, now: int) -> None:
        """See :class:`pnfarm.station.device.Device`: an ERR-RTA for each connection, and an LLDP shutdown frame."""
        self.cm.abort_all(RtaError.DEVICE_DEACTIVATED, now)
        self.neighbours.lldp.shut_down(now)

    def stop(self, now: int) -> None:
        if self._left_at is None:
            self._left_at = dict(self.unheard())
        for key in list(self.ars):
            self.connections.close(key)
        self.cm.supply_gone()
        if self.dcp.signalling:
            self.note(now, happened.SignalEnded())

    def change_mac(self, mac: bytes) -> None:
        """Have another address from the next power-on, as after a change of the hardware; the supply is off."""
        if self.powered:
            raise InternalError(f"{self.configured_name} cannot change its MAC address while it is on")
        self.station.port = replace(self.port, mac=mac)
        self.station.image.mac = mac_to_int(mac)
        self.channels.move(self.port)

    # -- frames ------------------------------------------------------------------------------------------------------

    def receive(self, data: bytes, now: int) -> None:
        if data[12:14] == LLDP:
            # already handled by the segment
            return
        self.traffic.frame_received(data)
        try:
            frame = parse_ethernet(data)
        except DecodeError as exc:
            self._drop(exc.reason)
            return
        if frame.ethertype == ETHERTYPE_PROFINET:
            self._receive_profinet(frame, now)
        else:
            self.ip.receive(frame, now)

    def _receive_profinet(self, frame: EthernetFrame, now: int) -> None:
        if len(frame.payload) < 2:
            self._drop("short")
        elif DCP_HELLO <= int.from_bytes(frame.payload[:2], "big") <= DCP_IDENTIFY_RESPONSE:
            self.dcp.in_operation = bool(self.cm.ars)
            identified, sought = self.dcp.identified, self.dcp.sought
            self.dcp.receive(frame, now)
            if self.dcp.identified != identified:
                by_name = self.dcp.sought != sought
                if by_name:
                    self.station.visits.step(Caller(mac=frame.source), "searched", now)
                self.connections.sought(now, by_name=by_name)
        elif frame.destination != self.port.mac:
            self._drop("other-destination")
        else:
            self.cm.receive_rta(frame.payload, frame.source, now)

    def hear_neighbour(self, frame: bytes, parsed: Lldpdu | str, now: int) -> bool:
        """Take an LLDP frame that was parsed once for all drives, or its decode error; whether more is to be done."""
        return self.station.on_the_wire and self.neighbours.hear(frame, parsed, now)

    def passed_over(self, reason: str) -> bool:
        """Count a frame that is not for this drive; always False."""
        self._drop(reason)
        return False

    def _drop(self, reason: str) -> None:
        self.dropped[reason] = self.dropped.get(reason, 0) + 1

    def discards(self) -> dict[str, int]:
        """Dropped frames and PDUs by reason, over all machines, and those of a shared cable that were for others."""
        total = self._own_discards()
        for reason, count in (self.unheard() if self._left_at is None else self._left_at).items():
            if count > self._missed[reason]:
                total[reason] = total.get(reason, 0) + count - self._missed[reason]
        return total

    def _own_discards(self) -> dict[str, int]:
        """Those that came here."""
        total = dict(self.dropped)
        for machine in self._machines:
            for reason, count in machine.dropped.items():
                total[reason] = total.get(reason, 0) + count
        total[STRAY] = int(self.station.image.strays)
        return total

    def next_deadline(self) -> int | None:
        if not self._others_known:
            self._others_ns = earliest(*self._others, self.connections, self.kind.records, self.kind)
            self._others_known = True
        others, own = self._others_ns, self.neighbours.next_deadline()
        if others is None or own is None:
            return own if others is None else others
        return min(others, own)

    def handle_timeout(self, now: int) -> None:
        others_wait = self._others_known and (self._others_ns is None or now < self._others_ns)
        self._only_lldp = others_wait and self.neighbours.only_sends(now)
        if self._only_lldp:
            return
        for machine in self._machines:
            deadline = machine.next_deadline()
            if deadline is not None and deadline <= now:
                machine.handle_timeout(now)
        self.connections.handle_timeout(now)
        self.kind.records.handle_timeout(now)
        self.kind.handle_timeout(now)

    def pump(self, now: int) -> list[bytes]:
        if self._only_lldp:
            self._only_lldp = False
            frames = self.neighbours.to_send(now)
            for frame in frames:
                self.traffic.frame_sent(frame)
            return frames
        self._others_known = False
        return self._pump.pump(now)

    def telegram_changed(self, axis: int) -> None:
        del axis
        self.channels.rewrite()

    # -- events of the engine ----------------------------------------------------------------------------------------

    def channel_event(self, kind: int, row: int, when: int, value: int, now: int) -> bool:
        consumer = self._services.channels.columns.cpm[row]
        # the connection ended while the event waited, and another may have the row by now
        seen = consumer["expirations" if kind == engine_row.EXPIRED else "received"]
        found = self.channels.of_consumer(row)
        if found is None or not seen:
            return False
        if kind == engine_row.FIRST_FRAME:
            self.connections.first_frame(row, when)
        elif kind == engine_row.EXPIRED:
            self.connections.expired(row, value, now, when)
        elif (worst := self.ars[found[0]].worst(kind, row, value)) is not None:
            runs = kind == engine_row.PROVIDER_CHANGED
            self.note(when, ControllerModeChanged(run=bool(worst)) if runs else OutputsChanged(good=bool(worst)))
        return True

    def catch_up(self, now: int) -> None:
        for row in [row for ar in self.ars.values() for row, _ in ar.consumers]:
            consumer = self._services.channels.columns.cpm[row]
            if consumer.state == W_START:
                self.connections.expired(row, now - int(consumer.last_ns), now)
            elif consumer.received:
                self.connections.first_frame(row, now)

    def fault_raised(self, axis: int, number: int) -> None:
        """See :class:`pnfarm.station.device.Device`: its diagnosis appears."""
        self.kind.fault_raised(axis, number)

    def faults_cleared(self, axis: int) -> None:
        """See :class:`pnfarm.station.device.Device`: their diagnosis disappears."""
        self.kind.faults_cleared(axis)

    def report_diagnosis(self) -> None:
        """Its own diagnosis that holds now appears where it is not in the store."""
        self.cm.moved()
        for entry in self.neighbours.diagnoses():
            self.cm.diagnosis.add(entry)

    def parameter_task(self, axis: int, value: int, now: int) -> None:
        self.kind.parameter_task(axis, value, now)

    # -- state for observers -----------------------------------------------------------------------------------------

    @property
    def connected(self) -> bool:
        """Whether some AR exchanges IO data."""
        return any(ar.established and ar.providers for ar in self.ars.values())

    def connection(self) -> ConnectionView | None:
        return connection_of(self)

    def losses(self) -> Mapping[str, int]:
        return losses_of(self.connections.aborts)

    def losses_by_farm(self) -> Mapping[str, int]:
        return losses_of(self.connections.aborts_by_farm)

    def losses_in_words(self) -> Mapping[str, int]:
        return losses_in_words(self)

    @property
    def closed(self) -> ClosedChannels:
        return self.channels.closed

    @property
    def channel_rows(self) -> tuple[list[int], list[int]]:
        ars = self.ars.values()
        return [row for ar in ars for row, _ in ar.providers], [row for ar in ars for row, _ in ar.consumers]

    def view(self, now: int) -> dict[str, Any]:
        return view_of(self, now)

    def details(self) -> dict[str, Any]:
        return details_of(self)

    # -- inside ------------------------------------------------------------------------------------------------------

    def note(self, now: int, event: Event) -> None:
        """Something happened to this drive."""
        self.station.note(now, event)

    def _can_keep(self) -> bool:
        """Whether what is set permanently can be written."""
        return self.station.can_save

    def keep(self, now: int, key: str, value: Any) -> None:
        """Write one value of non-volatile memory through; None forgets it."""
        self.station.keep(now, key, value)
