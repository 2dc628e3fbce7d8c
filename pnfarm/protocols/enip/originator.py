"""An originator's end of one TCP connection to one target: session, requests, connections, class 3 messages.

Its owner opens the TCP connection, gives the octets that come and carries those that are to go.  Each request has a
number, which travels as the sender context of an unconnected request; its reply or its failure is an event with that
number.  A class 3 connection has one request under way, the others wait; its sequence count rises with each.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.deadlines import Deadlines
from pnfarm.protocols.enip.originator_events import (
    CloseTcp,
    ConnectionEnded,
    ConnectionMade,
    ConnectionNotMade,
    OriginatorNote,
    OriginatorOutput,
    RequestAnswered,
    RequestFailed,
    SendTcp,
    SessionEnded,
    SessionRegistered,
)
from pnfarm.protocols.enip.originator_states import ORIGINATOR, OriginatorEvent, OriginatorState
from pnfarm.protocols.enip.status import ConnectionStatus, Service, status_text
from pnfarm.protocols.enip.wire.cpf import (
    CommonPacket,
    ConnectedAddress,
    ConnectedData,
    NullAddress,
    SocketAddress,
    UnconnectedData,
)
from pnfarm.protocols.enip.wire.encapsulation import (
    HEADER_OCTETS,
    Command,
    EncapsulationPdu,
    RegisterSession,
    emit_encapsulation,
    parse_encapsulation,
    parse_header,
)
from pnfarm.protocols.enip.wire.epath import logical_path
from pnfarm.protocols.enip.wire.forward_open import (
    ForwardClose,
    ForwardOpen,
    ForwardOpenReply,
    Triad,
    emit_forward_open,
)
from pnfarm.protocols.enip.wire.message import MessageReply, MessageRequest, message_request, parse_reply

__all__ = ["Originator", "OriginatorSettings"]

_MANAGER: Final = logical_path(0x06, 1)
#: The keys of the session's own deadlines among those of the requests: for its reply, for the next NOP.
_SESSION, _ALIVE = 0, -1


@dataclass(frozen=True, slots=True)
class OriginatorSettings:
    """Bounds of an originator; ``timeout_ns`` is the time for any reply.

    In a session it sends a NOP every ``alive_ns``: a target closes a TCP connection on which nothing comes, usually
    after 120 s (TCP/IP Interface object, attribute 13).
    """

    timeout_ns: int = 5_000_000_000
    alive_ns: int = 30_000_000_000
    pending: int = 64
    message_octets: int = 65_511


@dataclass(slots=True)
class _Pending:
    """A request without its reply; ``asked`` for those that open or close."""

    number: int
    service: int
    asked: ForwardOpen | Triad | None = None


@dataclass(slots=True)
class _Explicit:
    """A class 3 connection: at most one request under way."""

    o_to_t_id: int
    t_to_o_id: int
    triad: Triad
    count: int = 0
    under_way: _Pending | None = None
    waiting: deque[tuple[_Pending, bytes]] = field(default_factory=deque)


class Originator:
    """One session with one target."""

    def __init__(self, settings: OriginatorSettings | None = None) -> None:
        self.settings = settings or OriginatorSettings()
        self.state = OriginatorState.CLOSED
        self.session = 0
        self._held = b""
        self._pending: dict[int, _Pending] = {}
        self._explicit: dict[int, _Explicit] = {}
        self._deadlines = Deadlines()
        self._outputs: list[OriginatorOutput] = []
        self._notes: list[OriginatorNote] = []
        self._last_number = 0
        self._reason = ""

    # -- the carrier's side ------------------------------------------------------------------------------------------

    def opened(self, now: int) -> None:
        """The TCP connection is up: register a session."""
        self._step(OriginatorEvent.TCP_OPENED, now, "")

    def closed(self, now: int) -> None:
        """The TCP connection is gone."""
        if self.state is not OriginatorState.CLOSED:
            self._step(OriginatorEvent.TCP_CLOSED, now, "the TCP connection was closed")

    def received(self, data: bytes, now: int) -> None:
        """Octets of the TCP connection, however they were cut."""
        self._held += data
        while self.state is not OriginatorState.CLOSED and len(self._held) >= HEADER_OCTETS:
            header = parse_header(self._held[:HEADER_OCTETS])
            end = HEADER_OCTETS + header.length
            if header.length > self.settings.message_octets:
                self._step(OriginatorEvent.ABORT, now, f"a message of {header.length} octets")
                return
            if len(self._held) < end:
                return
            pdu, self._held = parse_encapsulation(self._held[:end]), self._held[end:]
            self._message(pdu, now)

    def next_deadline(self) -> int | None:
        return self._deadlines.first()

    def handle_timeout(self, now: int) -> None:
        for number in self._deadlines.take(now):
            if number == _SESSION:
                self._step(OriginatorEvent.TIMEOUT, now, "no reply to RegisterSession")
            elif number == _ALIVE:
                self._send(Command.NOP, b"", 0)
                self._deadlines.set(_ALIVE, now + self.settings.alive_ns)
            elif (pending := self._pending.pop(number, None)) is not None:
                self._fail(pending, "no reply in time")
                self._free(pending, now)

    def take_outputs(self) -> list[OriginatorOutput]:
        outputs, self._outputs = self._outputs, []
        return outputs

    def take_events(self) -> list[OriginatorNote]:
        notes, self._notes = self._notes, []
        return notes

    # -- requests ----------------------------------------------------------------------------------------------------

    def request(self, request: MessageRequest, now: int) -> int:
        """An unconnected request; the number of its reply.  Without a session, or with too many requests, it fails."""
        return self._unconnected(request, (), None, now)

    def forward_open(self, asked: ForwardOpen, now: int, items: tuple[SocketAddress, ...] = ()) -> int:
        """Open a connection; ``items`` may name the port at which data are expected."""
        service = Service.LARGE_FORWARD_OPEN if asked.large else Service.FORWARD_OPEN
        return self._unconnected(message_request(service, _MANAGER, emit_forward_open(asked)), items, asked, now)

    def forward_close(self, triad: Triad, path: bytes, now: int) -> int:
        """Close a connection; a target that does not know it (0x0107) has closed it as well."""
        body = ForwardClose(triad, path).emit()
        return self._unconnected(message_request(Service.FORWARD_CLOSE, _MANAGER, body), (), triad, now)

    def connected_request(self, connection_id: int, request: MessageRequest, now: int) -> int:
        """A request over the class 3 connection with this O->T id."""
        pending = self._new(request.service)
        connection = self._explicit.get(connection_id)
        if connection is None or self.state is not OriginatorState.ESTABLISHED:
            self._fail(pending, "the connection is not open")
        elif len(connection.waiting) >= self.settings.pending:
            self._fail(pending, "too many requests are waiting")
        else:
            connection.waiting.append((pending, request.emit()))
            self._next(connection, now)
        return pending.number

    def unregister(self, now: int) -> None:
        """End the session; the connection is closed after it."""
        if self.state is OriginatorState.ESTABLISHED:
            self._step(OriginatorEvent.UNREGISTER, now, "the session was unregistered")

    def _unconnected(
        self,
        request: MessageRequest,
        items: tuple[SocketAddress, ...],
        asked: ForwardOpen | Triad | None,
        now: int,
    ) -> int:
        pending = self._new(request.service, asked)
        if self.state is not OriginatorState.ESTABLISHED:
            self._fail(pending, "there is no session")
        elif len(self._pending) >= self.settings.pending:
            self._fail(pending, "too many requests are waiting")
        else:
            self._wait(pending, now)
            packet = CommonPacket((NullAddress(), UnconnectedData(request.emit()), *items))
            self._send(Command.SEND_RR_DATA, packet.emit(), pending.number)
        return pending.number

    def _new(self, service: int, asked: ForwardOpen | Triad | None = None) -> _Pending:
        self._last_number += 1
        return _Pending(self._last_number, service, asked)

    def _wait(self, pending: _Pending, now: int) -> None:
        self._pending[pending.number] = pending
        self._deadlines.set(pending.number, now + self.settings.timeout_ns)

    def _next(self, connection: _Explicit, now: int) -> None:
        if connection.under_way is not None or not connection.waiting:
            return
        pending, octets = connection.waiting.popleft()
        connection.under_way = pending
        connection.count = (connection.count + 1) & 0xFFFF
        self._wait(pending, now)
        data = connection.count.to_bytes(2, "little") + octets
        packet = CommonPacket((ConnectedAddress(connection.o_to_t_id), ConnectedData(data)))
        self._send(Command.SEND_UNIT_DATA, packet.emit(), 0)

    def _free(self, pending: _Pending, now: int) -> None:
        """The class 3 connection that this request held may send its next one."""
        for connection in self._explicit.values():
            if connection.under_way is pending:
                connection.under_way = None
                self._next(connection, now)

    # -- replies -----------------------------------------------------------------------------------------------------

    def _message(self, pdu: EncapsulationPdu, now: int) -> None:
        match pdu.command:
            case Command.REGISTER_SESSION if self.state is OriginatorState.REGISTERING:
                self.session = pdu.session
                good = pdu.status == 0 and pdu.session != 0
                event = OriginatorEvent.REGISTERED if good else OriginatorEvent.REFUSED
                self._step(event, now, f"RegisterSession was refused with status 0x{pdu.status:02X}")
            case Command.SEND_RR_DATA if self.state is OriginatorState.ESTABLISHED:
                self._unconnected_reply(pdu)
            case Command.SEND_UNIT_DATA if self.state is OriginatorState.ESTABLISHED:
                self._connected_reply(pdu, now)
            case _:
                pass  # NOP, and replies to nothing

    def _unconnected_reply(self, pdu: EncapsulationPdu) -> None:
        pending = self._pending.pop(int.from_bytes(pdu.context, "little"), None)
        if pending is None:
            return  # too late, or to nothing
        self._deadlines.set(pending.number, None)
        if pdu.status:
            self._fail(pending, f"encapsulation status 0x{pdu.status:02X}", pdu.status)
            return
        try:
            match CommonPacket.parse(pdu.data).items:
                case (NullAddress(), UnconnectedData(data), *others):
                    items = tuple(item for item in others if isinstance(item, SocketAddress))
                    self._answered(pending, parse_reply(data), items)
                case _:
                    self._fail(pending, "the reply has other items")
        except DecodeError as exc:
            self._fail(pending, f"the reply cannot be read: {exc}")

    def _connected_reply(self, pdu: EncapsulationPdu, now: int) -> None:
        try:
            match CommonPacket.parse(pdu.data).items:
                case (ConnectedAddress(connection_id), ConnectedData(data), *_):
                    pass
                case _:
                    return
            reply = parse_reply(data[2:])
        except DecodeError:
            return
        count = int.from_bytes(data[:2], "little")
        for connection in self._explicit.values():
            pending = connection.under_way
            if connection.t_to_o_id == connection_id and connection.count == count and pending is not None:
                self._pending.pop(pending.number, None)
                self._deadlines.set(pending.number, None)
                self._notes.append(RequestAnswered(pending.number, reply))
                self._free(pending, now)
                return

    def _answered(self, pending: _Pending, reply: MessageReply, items: tuple[SocketAddress, ...]) -> None:
        number, asked = pending.number, pending.asked
        match asked:
            case ForwardOpen() if reply.status:
                self._notes.append(ConnectionNotMade(number, asked, reply, status_text(reply.status, reply.extended)))
            case ForwardOpen():
                made = ForwardOpenReply.parse(reply.data)
                if made.triad != asked.triad:
                    raise DecodeError("bad-value", "the reply is about another connection")
                if asked.transport.transport == 3:
                    self._explicit[made.o_to_t_id] = _Explicit(made.o_to_t_id, made.t_to_o_id, made.triad)
                self._notes.append(ConnectionMade(number, asked, made, items))
            case Triad() if reply.status == 0 or ConnectionStatus.CONNECTION_NOT_FOUND in reply.extended[:1]:
                self._forget(asked)
                self._notes.append(ConnectionEnded(number, asked))
            case _:
                self._notes.append(RequestAnswered(number, reply))

    def _forget(self, triad: Triad) -> None:
        for connection in [one for one in self._explicit.values() if one.triad == triad]:
            del self._explicit[connection.o_to_t_id]
            self._drop(connection, "the connection was closed")

    def _drop(self, connection: _Explicit, reason: str) -> None:
        left = [pending for pending, _ in connection.waiting]
        if connection.under_way is not None:
            left.insert(0, connection.under_way)
        for pending in left:
            self._pending.pop(pending.number, None)
            self._deadlines.set(pending.number, None)
            self._fail(pending, reason)

    def _fail(self, pending: _Pending, reason: str, status: int = 0) -> None:
        if isinstance(pending.asked, ForwardOpen):
            self._notes.append(ConnectionNotMade(pending.number, pending.asked, None, reason))
        else:
            self._notes.append(RequestFailed(pending.number, reason, status))

    def _send(self, command: int, data: bytes, number: int) -> None:
        pdu = EncapsulationPdu(command, data, self.session, context=number.to_bytes(8, "little"))
        self._outputs.append(SendTcp(emit_encapsulation(pdu)))

    # -- the machine -------------------------------------------------------------------------------------------------

    def _step(self, event: OriginatorEvent, now: int, reason: str) -> None:
        """The only writer of the session's state."""
        self.state, action = ORIGINATOR[self.state, event]
        self._reason = reason
        match action:
            case "_send_register":
                self.session, self._held = 0, b""
                self._deadlines.set(_SESSION, now + self.settings.timeout_ns)
                self._send(Command.REGISTER_SESSION, RegisterSession().emit(), 0)
            case "_report_registered":
                self._deadlines.set(_SESSION, None)
                self._deadlines.set(_ALIVE, now + self.settings.alive_ns)
                self._notes.append(SessionRegistered(self.session))
            case "_send_unregister":
                self._send(Command.UNREGISTER_SESSION, b"", 0)
                self._end()
            case "_end":
                self._end()

    def _end(self) -> None:
        self._deadlines.set(_SESSION, None)
        self._deadlines.set(_ALIVE, None)
        self._held = b""
        for connection in self._explicit.values():
            self._drop(connection, self._reason)
        self._explicit.clear()
        for pending in self._pending.values():
            self._deadlines.set(pending.number, None)
            self._fail(pending, self._reason)
        self._pending.clear()
        self._outputs.append(CloseTcp())
        self._notes.append(SessionEnded(self._reason))
