"""An originator's end of one TCP connection to one target: session, unconnected requests, connections.

Its owner opens the TCP connection, gives the octets that come and carries those that are to go.  Each request has a
number, which travels as its sender context; its reply or its failure is an event with that number.
"""

from __future__ import annotations

from dataclasses import dataclass
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


#: What a request asks that opens or closes a connection, None for any other.
_Asked = ForwardOpen | Triad | None


class Originator:
    """One session with one target."""

    def __init__(self, settings: OriginatorSettings | None = None) -> None:
        self.settings = settings or OriginatorSettings()
        self.state = OriginatorState.CLOSED
        self.session = 0
        self._held = b""
        #: Requests without their reply, by number.
        self._pending: dict[int, _Asked] = {}
        self._deadlines = Deadlines()
        self._outputs: list[OriginatorOutput] = []
        self._notes: list[OriginatorNote] = []
        self._last_number = 0

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
            else:
                self._fail(number, self._pending.pop(number), "no reply in time")

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

    def unregister(self, now: int) -> None:
        """End the session; the connection is closed after it."""
        if self.state is OriginatorState.ESTABLISHED:
            self._step(OriginatorEvent.UNREGISTER, now, "the session was unregistered")

    def _unconnected(
        self,
        request: MessageRequest,
        items: tuple[SocketAddress, ...],
        asked: _Asked,
        now: int,
    ) -> int:
        self._last_number += 1
        number = self._last_number
        if self.state is not OriginatorState.ESTABLISHED:
            self._fail(number, asked, "there is no session")
        elif len(self._pending) >= self.settings.pending:
            self._fail(number, asked, "too many requests are waiting")
        else:
            self._pending[number] = asked
            self._deadlines.set(number, now + self.settings.timeout_ns)
            packet = CommonPacket((NullAddress(), UnconnectedData(request.emit()), *items))
            self._send(Command.SEND_RR_DATA, packet.emit(), number)
        return number

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
            case _:
                pass  # NOP, and replies to nothing

    def _unconnected_reply(self, pdu: EncapsulationPdu) -> None:
        number = int.from_bytes(pdu.context, "little")
        if number not in self._pending:
            return  # too late, or to nothing
        asked = self._pending.pop(number)
        self._deadlines.set(number, None)
        if pdu.status:
            self._fail(number, asked, f"encapsulation status 0x{pdu.status:02X}")
            return
        try:
            match CommonPacket.parse(pdu.data).items:
                case (NullAddress(), UnconnectedData(data), *others):
                    items = tuple(item for item in others if isinstance(item, SocketAddress))
                    self._answered(number, asked, parse_reply(data), items)
                case _:
                    self._fail(number, asked, "the reply has other items")
        except DecodeError as exc:
            self._fail(number, asked, f"the reply cannot be read: {exc}")

    def _answered(self, number: int, asked: _Asked, reply: MessageReply, items: tuple[SocketAddress, ...]) -> None:
        match asked:
            case ForwardOpen() if reply.status:
                self._notes.append(ConnectionNotMade(number, asked, reply, status_text(reply.status, reply.extended)))
            case ForwardOpen():
                made = ForwardOpenReply.parse(reply.data)
                if made.triad != asked.triad:
                    raise DecodeError("bad-value", "the reply is about another connection")
                self._notes.append(ConnectionMade(number, asked, made, items))
            case Triad() if reply.status == 0 or ConnectionStatus.CONNECTION_NOT_FOUND in reply.extended[:1]:
                self._notes.append(ConnectionEnded(number, asked))
            case _:
                self._notes.append(RequestAnswered(number, reply))

    def _fail(self, number: int, asked: _Asked, reason: str) -> None:
        if isinstance(asked, ForwardOpen):
            self._notes.append(ConnectionNotMade(number, asked, None, reason))
        else:
            self._notes.append(RequestFailed(number, reason))

    def _send(self, command: int, data: bytes, number: int) -> None:
        pdu = EncapsulationPdu(command, data, self.session, context=number.to_bytes(8, "little"))
        self._outputs.append(SendTcp(emit_encapsulation(pdu)))

    # -- the machine -------------------------------------------------------------------------------------------------

    def _step(self, event: OriginatorEvent, now: int, reason: str) -> None:
        """The only writer of the session's state."""
        self.state, action = ORIGINATOR[self.state, event]
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
                self._end(reason)
            case "_end":
                self._end(reason)

    def _end(self, reason: str) -> None:
        self._deadlines.set(_SESSION, None)
        self._deadlines.set(_ALIVE, None)
        self._held = b""
        for number, asked in self._pending.items():
            self._deadlines.set(number, None)
            self._fail(number, asked, reason)
        self._pending.clear()
        self._outputs.append(CloseTcp())
        self._notes.append(SessionEnded(reason))
