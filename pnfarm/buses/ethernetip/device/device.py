"""One station on EtherNet/IP: its adapter, its objects, its cyclic connections.

Bytes and ``now`` in, bytes and typed events out.  Machines and objects are created at each power-on.
"""

from __future__ import annotations

import zlib
from dataclasses import replace
from ipaddress import IPv4Address
from typing import TYPE_CHECKING, Any, cast

from pnfarm.buses.ethernetip.device import events as happened
from pnfarm.buses.ethernetip.device.address import DeviceAddress
from pnfarm.buses.ethernetip.device.answers import HeldAnswers, WorkingObject, WorkingTime
from pnfarm.buses.ethernetip.device.channels import StationChannels, channel_rows
from pnfarm.buses.ethernetip.device.connections import StationConnections
from pnfarm.buses.ethernetip.device.kept_values import check_kept
from pnfarm.buses.ethernetip.device.traffic import Traffic
from pnfarm.buses.ethernetip.device.view import connection_of, details_of, losses_in_words, view_of
from pnfarm.errors import InternalError
from pnfarm.protocols.enip.adapter import Adapter, AdapterData
from pnfarm.protocols.enip.encapsulation import EncapsulationSettings, SendDatagram, SendStream
from pnfarm.protocols.enip.objects.ethernet_link import EthernetLinkData
from pnfarm.protocols.enip.objects.identity import identity_key
from pnfarm.protocols.enip.objects.qos import QosData
from pnfarm.protocols.enip.objects.tcp_ip import TcpIpData, multicast_address
from pnfarm.protocols.enip.status import GeneralStatus
from pnfarm.protocols.enip.wire.encapsulation import ENIP_PORT, IO_PORT, Command
from pnfarm.station.events import ControllerModeChanged
from pnfarm.station.visits import Caller
from pnfarm.table import engine_row
from pnfarm.wire.endpoint import (
    Datagram,
    DatagramReceived,
    Services,
    StreamClosed,
    StreamData,
    StreamEnd,
    StreamOpened,
    StreamReceived,
)
from pnfarm.wire.mac import mac_to_int

if TYPE_CHECKING:
    from collections.abc import Mapping
    from ipaddress import IPv4Interface

    from pnfarm.buses.bus import DeviceServices
    from pnfarm.buses.ethernetip.device.kind import Kind, Settings
    from pnfarm.engine.channels.closed_channels import ClosedChannels
    from pnfarm.station.device import ConnectionView
    from pnfarm.station.event import Event
    from pnfarm.station.station import Station
    from pnfarm.wire.endpoint import SocketAction, SocketEvent

__all__ = ["EthernetIpDevice"]

_LIST_IDENTITY = Command.LIST_IDENTITY.to_bytes(2, "little")
#: A reset leaves the drive this time to send its answer.
RESET_NS = 100_000_000
#: Attributes of the Identity object (CIP volume 1, 5A-2.2): bits and field of the status, and the state.
_OWNED, _MAJOR_RECOVERABLE = 0x0001, 0x0400
_EXTENDED = 4
_NO_CONNECTION, _RUNNING, _IDLE, _FAULTED = 3, 6, 7, 2
_OPERATIONAL, _RECOVERABLE_FAULT = 3, 4


class EthernetIpDevice:
    """See :class:`pnfarm.station.device.Device` and :class:`pnfarm.station.device.SocketDevice`."""

    def __init__(self, station: Station, services: DeviceServices, kind: Kind) -> None:
        self.station = station
        self.port = station.port
        self.kind = kind
        self._services = services
        self.channels = StationChannels(
            station.index,
            station.port,
            services.channels,
            services.impairments,
            channel_rows(kind.io_connections),
            services.next_hop,
            kind,
            station.flaws.drift,
        )
        self.connections = StationConnections(station, self.channels, services.lateness, lambda: self.adapter, kind)
        self.held = HeldAnswers()
        self.work = WorkingTime(station.latency)
        #: Dropped messages by reason, of the machines before the last power-on.
        self.dropped: dict[str, int] = {}
        self.adapter: Adapter
        self._built = False
        self.boots = 0
        self._peers: dict[int, tuple[IPv4Address, int]] = {}
        #: A reset was asked for; and when it comes.
        self._reset_wanted = False
        self._reset_ns: int | None = None
        self._actions: list[SocketAction] = []

    # -- life --------------------------------------------------------------------------------------------------------

    def check(self, kept: Mapping[str, Any]) -> None:
        check_kept(kept)

    def commission(self, kept: Mapping[str, Any]) -> None:
        del kept

    def build(self, kept: dict[str, Any]) -> None:
        if self._built:
            self.dropped = self.discards()
        self._built = True
        self.boots += 1
        self.kind.build()
        self.traffic = Traffic(self.channels)
        interface = self.interface
        self.channels.address = interface.ip
        self.identity = self.kind.identity(int.from_bytes(self.port.mac[2:], "big"))
        self.identity.reset = self._reset
        self.tcp_ip = TcpIpData(
            interface,
            self.config.gateway or IPv4Address(0),
            self.name,
            conflict_detection=kept.get("conflict_detection", True),
            inactivity_timeout_s=kept.get("inactivity_timeout", 120),
        )
        self.tcp_ip.changed = self._keep_tcp_ip
        self.tcp_ip.last_conflict = kept.get("last_conflict", self.tcp_ip.last_conflict)
        self.address = DeviceAddress(
            interface.ip,
            self.port.mac,
            detects=self.tcp_ip.conflict_detection,
            answers=not self._services.answers_arp,
            note=self.note,
            conflict=self._keep_conflict,
        )
        self.qos = QosData()
        self.qos.dscp.update({int(number): dscp for number, dscp in kept.get("qos", {}).items()})
        self.qos.changed = self._keep_qos
        self.channels.dscp = self.qos.dscp
        self.channels.ttl = self.tcp_ip.ttl
        self.link = EthernetLinkData(self.port.mac, label=self.kind.label, counters=self.traffic.counters)
        seed = zlib.crc32(self._services.seed + self.station.configured_name.encode())
        self.adapter = Adapter(
            AdapterData(
                self.identity,
                self.tcp_ip,
                self.link,
                self.kind.assemblies,
                self.kind.settings(identity_key(self.identity), multicast_address(interface)),
                qos=self.qos,
                objects=[WorkingObject(one, self.work) for one in self.kind.objects],
                encapsulation=EncapsulationSettings(streams=self.kind.sessions),
                incarnation=(seed + self.boots) & 0xFFFF,
            )
        )
        self.connections.built()

    def start(self, now: int) -> list[str]:
        """See :class:`pnfarm.station.device.Device`: look whether the address is free."""
        self.address.start(now)
        return []

    def stop(self, now: int) -> None:
        """See :class:`pnfarm.station.device.Device`: streams and connections are gone without a word."""
        self.connections.forget(now)
        self.adapter.end(now)
        self.adapter.take_outputs()
        self.adapter.take_events()
        self._peers.clear()
        self._actions.clear()
        self.held = HeldAnswers()
        self._reset_ns = None

    def leave(self, now: int) -> None:
        """See :class:`pnfarm.station.device.Device`: there is no message that ends a connection; the streams close."""
        self.connections.leave()
        self.adapter.end(now)

    def change_mac(self, mac: bytes) -> None:
        """Have another address from the next power-on, as after a change of the hardware; the supply is off."""
        if self.station.powered:
            raise InternalError(f"{self.name} cannot change its MAC address while it is on")
        self.port = replace(cast("Any", self.port), mac=mac)
        self.station.port = self.port
        self.station.image.mac = mac_to_int(mac)
        self.channels.move(self.port)

    # -- frames and time ---------------------------------------------------------------------------------------------

    def receive(self, data: bytes, now: int) -> None:
        """See :class:`pnfarm.station.device.Device`: ARP."""
        self.address.receive(data, now)

    def pump(self, now: int) -> list[bytes]:
        if self._reset_ns is not None and self._reset_ns <= now:
            self._reset_ns = None
            self.station.power_cycle(now)
        while self.station.pump_drive(now):
            pass
        self._settle(now)
        return self.address.to_send()

    def _settle(self, now: int) -> None:
        """Events of the machines, and what they send; an answer to what was worked on waits."""
        if self._reset_wanted:
            self._reset_wanted = False
            # one that is asked for again puts nothing off
            if self._reset_ns is None:
                self._reset_ns = now + RESET_NS
        self.connections.take(self.adapter.take_events(), now)
        work_ns = self.work.take()
        for output in self.adapter.take_outputs():
            if isinstance(output, SendDatagram):
                self.traffic.sent(len(output.data))
                self._actions.append(Datagram(ENIP_PORT, output.peer, output.data))
            elif isinstance(output, SendStream):
                self.traffic.sent(len(output.data))
                if self.held.put(output, work_ns, now):
                    work_ns = 0
                else:
                    self._actions.append(StreamData(output.stream, output.data))
            else:
                self._forget(output.stream, now)
                self._actions.append(StreamEnd(output.stream))

    def _forget(self, stream: int, now: int) -> None:
        """A stream is gone."""
        self.held.forget(stream)
        if (peer := self._peers.pop(stream, None)) is not None:
            self.note(now, happened.SessionEnded(*peer))

    def next_deadline(self) -> int | None:
        due = (
            self.address.next_deadline(),
            self.adapter.next_deadline(),
            self.connections.next_deadline(),
            self.kind.next_deadline(),
            self.held.next_deadline(),
            self._reset_ns,
        )
        return min((time for time in due if time is not None), default=None)

    def handle_timeout(self, now: int) -> None:
        self.address.handle_timeout(now)
        self.adapter.handle_timeout(now)
        self.connections.handle_timeout(now)
        self.kind.handle_timeout(now)
        for answer in self.held.due(now):
            self._actions.append(StreamData(answer.stream, answer.data))

    def telegram_changed(self, axis: int) -> None:
        """See :class:`pnfarm.station.device.Device`: an assembly's layout is fixed."""
        del axis

    # -- streams and datagrams ---------------------------------------------------------------------------------------

    def services(self) -> Services | None:
        """See :class:`pnfarm.station.device.SocketDevice`: none before the address is known to be free."""
        if not self.address.in_use:
            return None
        return Services(
            self.interface,
            self.config.gateway,
            streams=(ENIP_PORT,),
            datagrams=(ENIP_PORT,),
            silent=(IO_PORT,),
            # one more is accepted and closed by the encapsulation, which counts it
            sessions=self.kind.sessions + 1,
        )

    def socket_event(self, event: SocketEvent, now: int) -> None:
        self._show_state()
        match event:
            case StreamOpened(stream=stream, peer=peer):
                self._peers[stream] = peer
                self.station.visits.step(Caller(str(peer[0])), "searched", now)
                self.note(now, happened.SessionOpened(*peer))
                self.adapter.opened(stream, peer, now)
            case StreamReceived(stream=stream, data=data):
                self.traffic.received(len(data))
                if self.held.full(stream):
                    # it asks on and on, and takes no answer's time
                    self.dropped["held-answers"] = self.dropped.get("held-answers", 0) + 1
                    self.adapter.encapsulation.end_stream(stream, now)
                else:
                    before = self.adapter.encapsulation.sessions
                    self.adapter.received(stream, data, now)
                    if self.adapter.encapsulation.sessions > before:
                        self.connections.session_registered(now)
            case StreamClosed(stream=stream):
                self._forget(stream, now)
                self.adapter.closed(stream, now)
            case DatagramReceived(peer=peer, data=data, broadcast=broadcast):
                self.traffic.received(len(data), broadcast=broadcast)
                if data[:2] == _LIST_IDENTITY:
                    self.station.visits.step(Caller(str(peer[0])), "searched", now)
                self.adapter.datagram(data, peer, now, broadcast=broadcast)
        self._settle(now)

    def pump_sockets(self, now: int) -> list[SocketAction]:
        del now
        actions, self._actions = self._actions, []
        return actions

    def next_hop(self, address: IPv4Address) -> bytes | None:
        """The MAC address to which frames for an address go, None while it is not known."""
        return self._services.next_hop(self.port.index, address)

    # -- events of the engine ----------------------------------------------------------------------------------------

    def channel_event(self, kind: int, row: int, when: int, value: int, now: int) -> bool:
        consumer = self._services.channels.columns.cpm[row]
        # the connection ended while the event waited, and another may have the row by now
        seen = consumer.expirations if kind == engine_row.EXPIRED else consumer.received
        channels = self.channels.of_consumer(row)
        if channels is None or not seen:
            return False
        match kind:
            case engine_row.FIRST_FRAME:
                self.connections.first_frame(row, when)
            case engine_row.EXPIRED:
                self.connections.expired(row, value, now, when)
            case engine_row.PROVIDER_CHANGED:
                if channels.feeds:
                    self.note(when, ControllerModeChanged(run=bool(value)))
            case _:
                return False
        return True

    def catch_up(self, now: int) -> None:
        self.connections.catch_up(now)

    def fault_raised(self, axis: int, number: int) -> None:
        """See :class:`pnfarm.station.device.Device`: status word 1 and the Identity object show it."""
        del axis, number

    def faults_cleared(self, axis: int) -> None:
        del axis

    def parameter_task(self, axis: int, value: int, now: int) -> None:
        del axis
        self.kind.parameter_task(value, now)

    # -- state for observers -----------------------------------------------------------------------------------------

    @property
    def config(self) -> Settings:
        """This station's settings in the farm file."""
        return cast("Settings", self.station.config)

    @property
    def interface(self) -> IPv4Interface:
        """Its address; the farm file's checks see to it that there is one."""
        if self.config.ip is None:
            raise InternalError(f"{self.name} has no address")
        return self.config.ip

    @property
    def name(self) -> str:
        return self.station.configured_name

    @property
    def connects(self) -> int:
        return self.connections.connects

    @property
    def watchdog_expirations(self) -> int:
        return self.connections.watchdog_expirations

    @property
    def watchdog_expirations_by_farm(self) -> int:
        return self.connections.watchdog_expirations_by_farm

    @property
    def connected(self) -> bool:
        return any(channels.established for channels in self.channels.open.values())

    def connection(self) -> ConnectionView | None:
        return connection_of(self)

    def losses(self) -> Mapping[str, int]:
        return self.connections.lost

    def losses_by_farm(self) -> Mapping[str, int]:
        return self.connections.lost_by_farm

    def losses_in_words(self) -> Mapping[str, int]:
        return losses_in_words(self)

    @property
    def closed(self) -> ClosedChannels:
        return self.channels.closed

    @property
    def channel_rows(self) -> tuple[list[int], list[int]]:
        opened = self.channels.open.values()
        return [one.provider for one in opened if one.provider is not None], [one.consumer for one in opened]

    def discards(self) -> dict[str, int]:
        total = dict(self.dropped)
        for reason, count in self.adapter.encapsulation.discards.items():
            total[reason] = total.get(reason, 0) + count
        return total

    def view(self, now: int) -> dict[str, Any]:
        del now
        return view_of(self)

    def details(self) -> dict[str, Any]:
        return details_of(self)

    # -- inside ------------------------------------------------------------------------------------------------------

    def note(self, now: int, event: Event) -> None:
        """Something happened to this drive."""
        self.station.note(now, event)

    def _show_state(self) -> None:
        """Status and state of the Identity object as they are now."""
        owner = next((one for one in self.channels.open.values() if one.feeds), None)
        faulty = self.kind.faulty
        if owner is None:
            # those without an owner carry no mode
            others = _IDLE if self.channels.open else _NO_CONNECTION
            condition = _FAULTED if self.connections.lost_owner else others
        else:
            condition = _RUNNING if self.station.image.valid else _IDLE
        self.identity.status = condition << _EXTENDED | (_OWNED if owner else 0) | (_MAJOR_RECOVERABLE if faulty else 0)
        self.identity.state = _RECOVERABLE_FAULT if faulty else _OPERATIONAL

    def _keep_tcp_ip(self) -> bool:
        timeout, detection = self.tcp_ip.inactivity_timeout_s, self.tcp_ip.conflict_detection
        return self._keep_written({"conflict_detection": detection, "inactivity_timeout": timeout})

    def _keep_written(self, values: dict[str, Any]) -> bool:
        """Write attributes through that a client wrote; False: they could not be stored and are as before."""
        return self.station.can_save and self.station.try_save({**self.station.kept, **values})

    def _keep_conflict(self, found: bytes) -> None:
        self.tcp_ip.last_conflict = found
        if self.station.kept.get("last_conflict") != found:
            self.station.kept["last_conflict"] = found
            self.station.save()

    def _keep_qos(self) -> bool:
        return self._keep_written({"qos": {str(number): dscp for number, dscp in self.qos.dscp.items()}})

    def _reset(self, kind: int) -> int:
        """Identity, Reset: 0 restarts the drive, 1 with its parameters as delivered (CIP volume 1, 5A-2.3)."""
        if kind == 1:
            if not self.station.can_save:
                return GeneralStatus.STORE_OPERATION_FAILURE
            for key in ("drive", "qos", "conflict_detection", "inactivity_timeout", "last_conflict"):
                self.station.kept.pop(key, None)
            self.station.save()
        elif kind != 0:
            return GeneralStatus.INVALID_PARAMETER
        self._reset_wanted = True
        return GeneralStatus.SUCCESS
