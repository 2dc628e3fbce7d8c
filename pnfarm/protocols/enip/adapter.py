"""An adapter: the target of one drive, its machines joined (CIP volume 2's word for a device that scanners connect to).

Encapsulation -> MessageRouter -> objects, with the ConnectionManager among them.  The room for the bus gives it the
drive's objects and plain data; carries its outputs, and runs the cyclic connections that its events open and close.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.connection import (
    CloseReason,
    ConnectionClosed,
    ConnectionRefused,
    ConnectionSettings,
    ManagerEvent,
)
from pnfarm.protocols.enip.connection_manager import CONNECTION_MANAGER, ConnectionManager
from pnfarm.protocols.enip.encapsulation import Encapsulation, EncapsulationSettings, Output, Peer
from pnfarm.protocols.enip.message_router import MessageRouter, Origin, object_path
from pnfarm.protocols.enip.object import Answer, CipObject
from pnfarm.protocols.enip.objects.assembly import AssemblyData, assembly_object
from pnfarm.protocols.enip.objects.connection_manager import connection_manager_object
from pnfarm.protocols.enip.objects.ethernet_link import EthernetLinkData, ethernet_link_object
from pnfarm.protocols.enip.objects.identity import IdentityData, identity_item, identity_object
from pnfarm.protocols.enip.objects.message_router import message_router_object
from pnfarm.protocols.enip.objects.qos import QosData, qos_object
from pnfarm.protocols.enip.objects.tcp_ip import TcpIpData, tcp_ip_object
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.message import MessageReply, parse_request

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.protocols.enip.wire.cpf import SocketAddress

__all__ = ["Adapter", "AdapterData"]

#: The longest reply to an unconnected request, as devices have it.
UNCONNECTED_ROOM: Final = 504
#: Events that wait to be taken; beyond it refusals are dropped, which are counted anyway.
_MOST_EVENTS: Final = 1024
_NS_PER_SECOND: Final = 1_000_000_000


@dataclass(slots=True)
class AdapterData:
    """All that a drive's standard objects are made of."""

    identity: IdentityData
    tcp_ip: TcpIpData
    ethernet_link: EthernetLinkData
    assemblies: Sequence[AssemblyData]
    connections: ConnectionSettings
    qos: QosData = field(default_factory=QosData)
    objects: Sequence[CipObject] = ()
    encapsulation: EncapsulationSettings = field(default_factory=EncapsulationSettings)
    incarnation: int = 1


class Adapter:
    """One drive's end of EtherNet/IP."""

    def __init__(self, data: AdapterData) -> None:
        self.data = data
        self.router = MessageRouter(data.objects)
        self.manager = ConnectionManager(data.connections, self.router, data.incarnation)
        self.encapsulation = Encapsulation(
            self,
            lambda: identity_item(data.identity, data.tcp_ip.interface.ip),
            data.encapsulation,
            data.identity.serial,
            data.tcp_ip.inactivity_timeout_s * _NS_PER_SECOND,
        )
        connections = data.connections.io_connections + data.connections.explicit_connections
        for one in (
            identity_object(data.identity),
            message_router_object(self.router, connections),
            assembly_object(data.assemblies),
            connection_manager_object(self.manager),
            tcp_ip_object(
                data.tcp_ip, lambda seconds: self.encapsulation.set_inactivity_timeout(seconds * _NS_PER_SECOND)
            ),
            ethernet_link_object(data.ethernet_link),
            qos_object(data.qos),
        ):
            self.router.add(one)
        self._events: list[ManagerEvent] = []

    # -- the carrier's side ------------------------------------------------------------------------------------------

    def opened(self, stream: int, peer: Peer, now: int) -> None:
        self.encapsulation.opened(stream, peer, now)

    def received(self, stream: int, data: bytes, now: int) -> None:
        self.encapsulation.received(stream, data, now)
        self._settle(now)

    def closed(self, stream: int, now: int) -> None:
        self.encapsulation.closed(stream, now)
        self._settle(now)

    def datagram(self, data: bytes, peer: Peer, now: int, *, broadcast: bool = False) -> None:
        self.encapsulation.datagram(data, peer, now, broadcast=broadcast)

    def next_deadline(self) -> int | None:
        due = [time for time in (self.encapsulation.next_deadline(), self.manager.next_deadline()) if time is not None]
        return min(due, default=None)

    def handle_timeout(self, now: int) -> None:
        self.encapsulation.handle_timeout(now)
        self.manager.handle_timeout(now)
        self._settle(now)

    def take_outputs(self) -> list[Output]:
        return self.encapsulation.take_outputs()

    def take_events(self) -> list[ManagerEvent]:
        events, self._events = self._events, []
        return events

    # -- the engine's side -------------------------------------------------------------------------------------------

    def data_received(self, number: int, now: int) -> None:
        """The first data of a cyclic connection came."""
        self.manager.data_received(number, now)

    def expired(self, number: int, now: int) -> None:
        """A cyclic connection's watchdog expired."""
        self.manager.expired(number, now)
        self._settle(now)

    def close(self, number: int, now: int) -> None:
        """End a connection from this side."""
        self.manager.close(number, now)
        self._settle(now)

    def end(self, now: int) -> None:
        """The farm stops: every connection and every stream ends."""
        for number in list(self.manager.connections):
            self.manager.close(number, now)
        self.encapsulation.end_all(now)
        self._settle(now)

    def _settle(self, now: int) -> None:
        """Take the manager's events; one that timed out may take its TCP connection along."""
        while events := self.manager.take_events():
            for event in events:
                if len(self._events) < _MOST_EVENTS or not isinstance(event, ConnectionRefused):
                    self._events.append(event)
                if isinstance(event, ConnectionClosed) and event.reason is CloseReason.TIMED_OUT:
                    self._end_stream_of(event.connection.stream, now)

    def _end_stream_of(self, stream: int, now: int) -> None:
        if not any(one.stream == stream for one in self.manager.connections.values()):
            self.encapsulation.end_stream(stream, now)

    # -- what is behind the encapsulation ----------------------------------------------------------------------------

    def unconnected(
        self, stream: int, session: int, peer: Peer, message: bytes, items: tuple[SocketAddress, ...], now: int
    ) -> tuple[bytes, tuple[SocketAddress, ...]] | None:
        origin = Origin(stream, session, peer[0], items)
        inner = self._unwrapped(message)
        if isinstance(inner, Answer):
            reply = MessageReply(Service.UNCONNECTED_SEND, inner.status, inner.extended, inner.data)
            return reply.emit(), ()
        answer = self.router.handle(inner, origin, now, UNCONNECTED_ROOM)
        return None if answer is None else (answer, tuple(origin.reply_items))

    def connected(self, stream: int, connection_id: int, data: bytes, now: int) -> tuple[int, bytes] | None:
        return self.manager.connected(stream, connection_id, data, now)

    def stream_closed(self, stream: int, now: int) -> None:
        self.manager.stream_closed(stream, now)

    def _unwrapped(self, message: bytes) -> bytes | Answer:
        """A message within an Unconnected_Send, or the message itself."""
        try:
            request = parse_request(message)
            if request.service != Service.UNCONNECTED_SEND:
                return message
            path = object_path(request.path)
        except DecodeError:
            return message
        if (path.class_id, path.instance_id) != (CONNECTION_MANAGER, 1):
            return message
        return self.manager.unwrap(request.data)
