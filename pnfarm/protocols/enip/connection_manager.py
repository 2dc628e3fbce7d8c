"""The Connection Manager of a target: the table of its connections (CIP volume 1, chapter 3-5; volume 2, 3-3).

It answers Forward_Open, Large_Forward_Open, Forward_Close and Unconnected_Send, carries the messages of class 3
connections to the Message Router, and says by events which cyclic connections its owner has to run.  Cyclic data never
come here; their owner reports that the first data of a connection came (``data_received``) and that its watchdog
expired (``expired``).  Until the first data this machine keeps the time itself.

The data of a class 1 connection live on UDP, so that the loss of the TCP connection by which it was opened does not
end it; class 3 connections end with theirs.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.deadlines import Deadlines
from pnfarm.protocols.enip.connection import (
    CloseReason,
    Connection,
    ConnectionClosed,
    ConnectionKind,
    ConnectionOpened,
    ConnectionRefused,
    ConnectionSettings,
    IoOffer,
    ManagerEvent,
    ProductionMoved,
    RpiBelowMinimum,
)
from pnfarm.protocols.enip.connection_check import Refusal, check_explicit, check_io, check_key, read_path
from pnfarm.protocols.enip.connection_states import CONNECTION, ConnectionEvent
from pnfarm.protocols.enip.message_router import MESSAGE_ROUTER, MessageRouter, Origin
from pnfarm.protocols.enip.object import Answer, cut_or_long, refused
from pnfarm.protocols.enip.status import ConnectionStatus, GeneralStatus, Service
from pnfarm.protocols.enip.wire.cpf import AF_INET, SocketAddress
from pnfarm.protocols.enip.wire.forward_open import (
    ConnectionType,
    ForwardClose,
    ForwardCloseReply,
    ForwardOpen,
    ForwardOpenReply,
    ForwardRefusal,
    Triad,
    UnconnectedSend,
    parse_forward_open,
)

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["CONNECTION_MANAGER", "ConnectionManager"]

CONNECTION_MANAGER: Final = 0x06
#: Events that wait to be taken; a caller that takes them after each input never comes near.
_MOST_EVENTS: Final = 1024
_FAILURE: Final = GeneralStatus.CONNECTION_FAILURE
#: No target produces faster, whatever it accepts: who asks for a microsecond would get a million packets a second.
_LEAST_PRODUCTION_US: Final = 100


@dataclass(frozen=True, slots=True)
class _Asked:
    """A Forward_Open that fits what is offered."""

    request: ForwardOpen
    offer: IoOffer | None

    @property
    def kind(self) -> ConnectionKind:
        return self.offer.kind if self.offer else ConnectionKind.EXPLICIT


class ConnectionManager:
    """``incarnation`` makes the connection ids of this start differ from those of the one before (16 bits)."""

    def __init__(self, settings: ConnectionSettings, router: MessageRouter, incarnation: int = 1) -> None:
        self.settings = settings
        self.connections: dict[int, Connection] = {}
        #: Open requests, closes, time-outs and refusals so far, by the names of the object's attributes.
        self.counts: Counter[str] = Counter()
        #: Asked before each Forward_Open that fits; what refuses it, or None.
        self.admit: Callable[[ForwardOpen], Refusal | None] = lambda _: None
        #: Takes the configuration of each cyclic connection that is about to be opened; what refuses it, or None.
        self.configure: Callable[[IoOffer, bytes], Refusal | None] = lambda *_: None
        self._router = router
        self._events: list[ManagerEvent] = []
        self._watchdogs = Deadlines()
        self._last_number = 0
        self._next_id = (incarnation & 0xFFFF) << 16
        router.add_origin_services(CONNECTION_MANAGER, self.origin_service)

    # -- services ----------------------------------------------------------------------------------------------------

    def origin_service(self, origin: Origin, service: int, data: bytes, now: int) -> Answer | None:
        """The services that open and close; None for those of its attributes."""
        match service:
            case Service.FORWARD_OPEN:
                return self._forward_open(origin, data, now, large=False)
            case Service.LARGE_FORWARD_OPEN:
                return self._forward_open(origin, data, now, large=True)
            case Service.FORWARD_CLOSE:
                return self._forward_close(data, now)
            case _:
                return None

    def _forward_open(self, origin: Origin, data: bytes, now: int, *, large: bool) -> Answer:
        self.counts["open_requests"] += 1
        try:
            request = parse_forward_open(data, large)
        except DecodeError as exc:
            self.counts["open_format_rejects"] += 1
            return cut_or_long(exc)
        try:
            asked = self._check(request, origin)
            connection = self._create(asked, origin, now)
        except Refusal as refusal:
            self.counts[_reject(refusal.extended)] += 1
            self._note(ConnectionRefused(refusal.status, refusal.extended, request, origin.address))
            return Answer(refusal.status, ForwardRefusal(request.triad).emit(), refusal.extended)
        if connection.offer is not None:
            origin.reply_items.extend(self._socket_items(connection))
        reply = ForwardOpenReply(
            connection.o_to_t_id,
            connection.t_to_o_id,
            connection.triad,
            connection.o_to_t_api_us,
            connection.t_to_o_api_us,
        )
        return Answer(data=reply.emit())

    def _check(self, request: ForwardOpen, origin: Origin) -> _Asked:
        if any(connection.triad == request.triad for connection in self.connections.values()):
            raise Refusal(ConnectionStatus.DUPLICATE_FORWARD_OPEN)
        path = read_path(request.path)
        check_key(path.key, self.settings.key)
        if path.class_id == MESSAGE_ROUTER:
            check_explicit(request, path, self.settings)
            asked = _Asked(request, None)
        else:
            asked = _Asked(request, check_io(request, path, self.settings))
            if any(item.family != AF_INET for item in origin.items):
                raise Refusal(ConnectionStatus.UNCONNECTED_PARAMETER)
        if (refusal := self.admit(request)) is not None:
            raise refusal
        self._check_others(asked)
        if asked.offer is not None and (refusal := self.configure(asked.offer, path.configuration)) is not None:
            raise refusal
        return asked

    def _check_others(self, asked: _Asked) -> None:
        """What depends on the connections that are open already."""
        explicit = sum(connection.explicit for connection in self.connections.values())
        if asked.offer is None:
            if explicit >= self.settings.explicit_connections:
                raise Refusal(ConnectionStatus.OUT_OF_CONNECTIONS)
            return
        others = [connection for connection in self.connections.values() if connection.offer is not None]
        if asked.kind is ConnectionKind.EXCLUSIVE_OWNER and any(
            other.kind is asked.kind and other.offer is not None and other.offer.consumed == asked.offer.consumed
            for other in others
        ):
            raise Refusal(ConnectionStatus.OWNERSHIP_CONFLICT)
        if asked.kind is ConnectionKind.LISTEN_ONLY and not self._owners(asked.offer.produced):
            raise Refusal(ConnectionStatus.NO_OWNER_CONNECTION)
        if asked.request.t_to_o.kind == ConnectionType.MULTICAST and any(
            one.t_to_o_size != asked.request.t_to_o.size for one in self._multicasts(asked.offer.produced)
        ):
            raise Refusal(ConnectionStatus.MISMATCHED_T_TO_O_SIZE)
        if len(others) >= self.settings.io_connections:
            owner = asked.kind is ConnectionKind.EXCLUSIVE_OWNER
            # a point that takes many connections has its own count of them
            raise Refusal(
                ConnectionStatus.OUT_OF_CONNECTIONS if owner else ConnectionStatus.TARGET_OBJECT_OUT_OF_CONNECTIONS
            )

    def _owners(self, produced: int) -> list[Connection]:
        """Connections that keep a multicast production alive, the oldest first."""
        return [
            connection for connection in self._multicasts(produced) if connection.kind is not ConnectionKind.LISTEN_ONLY
        ]

    def _multicasts(self, produced: int) -> list[Connection]:
        return [
            connection
            for connection in self.connections.values()
            if connection.multicast and connection.offer is not None and connection.offer.produced == produced
        ]

    # -- opening -----------------------------------------------------------------------------------------------------

    def _create(self, asked: _Asked, origin: Origin, now: int) -> Connection:
        request, offer = asked.request, asked.offer
        multicast = request.t_to_o.kind == ConnectionType.MULTICAST
        shared = self._multicasts(offer.produced) if multicast and offer is not None else []
        self._last_number += 1
        t_to_o_id, t_to_o_api_us = request.t_to_o_id, request.t_to_o_rpi_us
        if multicast:
            t_to_o_id = shared[0].t_to_o_id if shared else self._new_id()
        if offer is not None:
            # an originator that joins a production gets it at the interval that it has, which the reply contains
            t_to_o_api_us = shared[0].t_to_o_api_us if shared else self._interval(t_to_o_api_us)
        connection = Connection(
            number=self._last_number,
            kind=asked.kind,
            triad=request.triad,
            offer=offer,
            stream=origin.stream,
            originator=origin.address,
            o_to_t_id=self._new_id(),
            t_to_o_id=t_to_o_id,
            o_to_t_api_us=request.o_to_t_rpi_us,
            t_to_o_api_us=t_to_o_api_us,
            timeout_multiplier=request.timeout_multiplier,
            o_to_t_size=request.o_to_t.size,
            t_to_o_size=request.t_to_o.size,
            multicast=multicast,
            destination=(self.settings.multicast_address, self.settings.io_port)
            if multicast
            else (origin.address, self._port(origin)),
            produces=offer is not None and not shared,
            priority=request.t_to_o.priority,
        )
        self._step(connection, ConnectionEvent.CREATE, now)
        self._step(connection, ConnectionEvent.APPLY, now)
        return connection

    def _interval(self, rpi_us: int) -> int:
        """The interval at which the target produces."""
        rounds_up = self.settings.below_minimum is RpiBelowMinimum.ROUND_UP
        rpi_us = max(rpi_us, self.settings.minimum_rpi_us if rounds_up else _LEAST_PRODUCTION_US)
        step_us = self.settings.interval_step_us
        return -(-rpi_us // step_us) * step_us

    def _port(self, origin: Origin) -> int:
        """Where an originator wants its data: the port of its socket address item, else the registered one."""
        ports = [item.port for item in origin.items if not item.o_to_t and item.port]
        return ports[0] if ports else self.settings.io_port

    def _socket_items(self, connection: Connection) -> list[SocketAddress]:
        items = [SocketAddress(o_to_t=True, port=self.settings.io_port)]
        if connection.multicast:
            address, port = connection.destination
            items.append(SocketAddress(o_to_t=False, port=port, address=address))
        return items

    def _new_id(self) -> int:
        used = {number for one in self.connections.values() for number in (one.o_to_t_id, one.t_to_o_id)}
        while True:
            low = (self._next_id + 1) & 0xFFFF or 1
            self._next_id = self._next_id & 0xFFFF0000 | low
            if self._next_id not in used:
                return self._next_id

    # -- closing -----------------------------------------------------------------------------------------------------

    def _forward_close(self, data: bytes, now: int) -> Answer:
        self.counts["close_requests"] += 1
        try:
            request = ForwardClose.parse(data)
        except DecodeError as exc:
            self.counts["close_format_rejects"] += 1
            return cut_or_long(exc)
        for connection in self.connections.values():
            if connection.triad == request.triad:
                self._end(connection, ConnectionEvent.CLOSE, CloseReason.FORWARD_CLOSE, now)
                return Answer(data=ForwardCloseReply(request.triad).emit())
        self.counts["close_other_rejects"] += 1
        body = ForwardRefusal(request.triad).emit()
        return Answer(_FAILURE, body, (ConnectionStatus.CONNECTION_NOT_FOUND,))

    def close(self, number: int, now: int) -> None:
        """The drive ends a connection on its own; no message says so (there is none)."""
        if (connection := self.connections.get(number)) is not None:
            self._end(connection, ConnectionEvent.RELEASE, CloseReason.ENDED, now)

    def stream_closed(self, stream: int, now: int) -> None:
        """A TCP connection is gone, and with it the class 3 connections over it."""
        for connection in list(self.connections.values()):
            if connection.explicit and connection.stream == stream:
                self._end(connection, ConnectionEvent.RELEASE, CloseReason.STREAM_CLOSED, now)

    # -- time --------------------------------------------------------------------------------------------------------

    def data_received(self, number: int, now: int) -> None:
        """The first data of a cyclic connection came; from now on its owner watches it."""
        connection = self.connections.get(number)
        if connection is not None and not connection.explicit:
            connection.received = True
            self._step(connection, ConnectionEvent.DATA, now)

    def expired(self, number: int, now: int) -> None:
        """The originator of a connection has been silent for longer than its timeout."""
        if (connection := self.connections.get(number)) is not None:
            self.counts["timeouts"] += 1
            before_data = not connection.received
            self._step(connection, ConnectionEvent.WATCHDOG, now)
            self._end(connection, ConnectionEvent.AUTO_DELETE, CloseReason.TIMED_OUT, now, before_data=before_data)

    def next_deadline(self) -> int | None:
        return self._watchdogs.first()

    def handle_timeout(self, now: int) -> None:
        for number in self._watchdogs.take(now):
            self.expired(number, now)

    # -- class 3 -----------------------------------------------------------------------------------------------------

    def connected(self, stream: int, connection_id: int, data: bytes, now: int) -> tuple[int, bytes] | None:
        """A message of a class 3 connection: its T->O connection id and the reply with its sequence count.

        A repeated sequence count repeats the reply without doing anything again (CIP volume 1, 3-4.6).  None for an
        unknown connection, one of another stream, one that is too long, and what is no request.
        """
        connection = next(
            (
                one
                for one in self.connections.values()
                if one.explicit and one.stream == stream and one.o_to_t_id == connection_id
            ),
            None,
        )
        if connection is None or not 2 <= len(data) <= connection.o_to_t_size:
            return None
        connection.received = True
        self._step(connection, ConnectionEvent.DATA, now)
        count = int.from_bytes(data[:2], "little")
        if count != connection.last_count:
            reply = self._router.handle(data[2:], None, now, connection.t_to_o_size - 2)
            if reply is None:
                return None
            connection.last_count, connection.last_reply = count, data[:2] + reply
        return connection.t_to_o_id, connection.last_reply

    # -- events ------------------------------------------------------------------------------------------------------

    def take_events(self) -> list[ManagerEvent]:
        events, self._events = self._events, []
        return events

    def find(self, triad: Triad) -> Connection | None:
        return next((one for one in self.connections.values() if one.triad == triad), None)

    def _note(self, event: ManagerEvent) -> None:
        if isinstance(event, ConnectionRefused) and len(self._events) >= _MOST_EVENTS:
            return  # refusals are counted; events of connections are as many as connections
        self._events.append(event)

    # -- the machine -------------------------------------------------------------------------------------------------

    def _step(self, connection: Connection, event: ConnectionEvent, now: int) -> None:
        """The only writer of a connection's state."""
        connection.state, action = CONNECTION[connection.state, event]
        match action:
            case "_start":
                self._start(connection, now)
            case "_restart_watchdog":
                self._restart_watchdog(connection, now)
            case "_remove":
                self._remove(connection)

    def _start(self, connection: Connection, now: int) -> None:
        self.connections[connection.number] = connection
        self._watchdogs.set(connection.number, now + max(self.settings.first_data_ns, connection.timeout_ns))
        self._note(ConnectionOpened(connection))

    def _restart_watchdog(self, connection: Connection, now: int) -> None:
        due = now + connection.timeout_ns if connection.explicit else None
        self._watchdogs.set(connection.number, due)

    def _remove(self, connection: Connection) -> None:
        self.connections.pop(connection.number, None)
        self._watchdogs.set(connection.number, None)

    def _end(
        self,
        connection: Connection,
        event: ConnectionEvent,
        reason: CloseReason,
        now: int,
        *,
        before_data: bool = False,
    ) -> None:
        self._step(connection, event, now)
        self._note(ConnectionClosed(connection, reason, before_data))
        if connection.offer is None or not connection.multicast:
            return
        produced = connection.offer.produced
        if connection.kind is not ConnectionKind.LISTEN_ONLY and not self._owners(produced):
            for listener in self._multicasts(produced):
                self._end(listener, ConnectionEvent.RELEASE, CloseReason.OWNER_GONE, now)
        elif connection.produces:
            heir = self._owners(produced)[0]
            heir.produces = True
            self._note(ProductionMoved(connection, heir))

    # -- Unconnected_Send --------------------------------------------------------------------------------------------

    def unwrap(self, data: bytes) -> bytes | Answer:
        """The message within an Unconnected_Send to this device itself, or why there is none.

        The device has one port and routes nowhere: every route is refused as a port that is not there.
        """
        try:
            request = UnconnectedSend.parse(data)
        except DecodeError:
            return refused(_FAILURE, ConnectionStatus.UNCONNECTED_PARAMETER)
        if request.route:
            return refused(_FAILURE, ConnectionStatus.PORT_NOT_AVAILABLE)
        return request.message


def _reject(extended: tuple[int, ...]) -> str:
    resources = {ConnectionStatus.OUT_OF_CONNECTIONS, ConnectionStatus.TARGET_OBJECT_OUT_OF_CONNECTIONS}
    return "open_resource_rejects" if resources.intersection(extended[:1]) else "open_other_rejects"
