"""The encapsulation of one drive: its TCP connections and datagrams on port 44818 (CIP volume 2, chapters 2-3 to 2-5).

Octets and ``now`` in; octets to send, and TCP connections to close, out.  A *stream* is a TCP connection by a number of
its carrier's.

=====================================================  ==============================================================
what comes                                             what happens
=====================================================  ==============================================================
options or status other than 0                         the message is dropped
a command that is not known, or not allowed over UDP   status 0x01
a second RegisterSession on the stream                 status 0x01, with the handle of the first one
another version of the protocol, or its options        status 0x69, with the version that is spoken
a wrong length for the command                         status 0x65
more octets than are held for a message                status 0x65, and they are skipped
a session handle that is not the stream's              status 0x64
items that cannot be read, or other ones               status 0x03
more streams than allowed                              the TCP connection is closed
no whole message for the inactivity timeout            the TCP connection is closed, session or not
more replies to one input than are held                the TCP connection is closed
=====================================================  ==============================================================

NOP and UnRegisterSession have no reply.  ListIdentity by broadcast is answered after a random part of the time that the
sender grants in its context, so that many devices do not answer at once.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from ipaddress import IPv4Address
from typing import TYPE_CHECKING, Final, Protocol

from pnfarm.errors import DecodeError
from pnfarm.protocols.deadlines import Deadlines
from pnfarm.protocols.enip.encapsulation_states import SESSION, SessionEvent, SessionState
from pnfarm.protocols.enip.wire.cpf import (
    CommonPacket,
    ConnectedAddress,
    ConnectedData,
    Item,
    NullAddress,
    SocketAddress,
    UnconnectedData,
    emit_items,
)
from pnfarm.protocols.enip.wire.encapsulation import (
    HEADER_OCTETS,
    PROTOCOL_VERSION,
    Command,
    EncapsulationHeader,
    EncapsulationPdu,
    EncapsulationStatus,
    RegisterSession,
    emit_encapsulation,
    parse_encapsulation,
    parse_header,
)
from pnfarm.protocols.enip.wire.identity import IdentityItem, ServiceItem

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = [
    "Encapsulation",
    "EncapsulationSettings",
    "ExplicitMessages",
    "Output",
    "Peer",
    "SendDatagram",
    "SendStream",
    "StreamEnd",
]  # fmt: skip

Peer = tuple[IPv4Address, int]

_NS_PER_MS: Final = 1_000_000
#: Times for the answers to ListIdentity, in ms (CIP volume 2, 2-4.2.2): without a time, and the least one.
_DEFAULT_DELAY_MS, _LEAST_DELAY_MS = 2000, 500
_LISTS: Final = {Command.LIST_SERVICES, Command.LIST_IDENTITY, Command.LIST_INTERFACES}


@dataclass(frozen=True, slots=True)
class EncapsulationSettings:
    """Bounds of what peers can make a drive hold."""

    streams: int = 20
    message_octets: int = 4608
    reply_octets: int = 65_536
    delayed_answers: int = 16


@dataclass(frozen=True, slots=True)
class SendStream:
    stream: int
    data: bytes


@dataclass(frozen=True, slots=True)
class StreamEnd:
    """Close this TCP connection, after what was sent on it."""

    stream: int


@dataclass(frozen=True, slots=True)
class SendDatagram:
    peer: Peer
    data: bytes


Output = SendStream | StreamEnd | SendDatagram


class ExplicitMessages(Protocol):
    """What is behind the encapsulation."""

    def unconnected(
        self, stream: int, session: int, peer: Peer, message: bytes, items: tuple[SocketAddress, ...], now: int
    ) -> tuple[bytes, tuple[SocketAddress, ...]] | None:
        """The reply with its socket address items; None for octets that are no request."""

    def connected(self, stream: int, connection_id: int, data: bytes, now: int) -> tuple[int, bytes] | None:
        """The reply's connection id and data; None for no reply."""

    def stream_closed(self, stream: int, now: int) -> None:
        """A stream is gone, whichever end closed it."""


@dataclass(slots=True)
class _Stream:
    number: int
    peer: Peer
    heard_ns: int
    state: SessionState = SessionState.IDLE
    session: int = 0
    held: bytes = b""
    #: Octets of a message that is too long, still to come.
    skip: int = 0
    replied: int = 0


class Encapsulation:
    """``identity`` gives the identity item at each request; ``seed`` spreads the drives' answers.

    ``inactivity_timeout_ns`` is that of :class:`~pnfarm.protocols.enip.objects.tcp_ip.TcpIpData`, 0 for none.
    """

    def __init__(
        self,
        messages: ExplicitMessages,
        identity: Callable[[], IdentityItem],
        settings: EncapsulationSettings | None = None,
        seed: int = 0,
        inactivity_timeout_ns: int = 0,
    ) -> None:
        self.settings = settings or EncapsulationSettings()
        #: What was dropped or refused, by reason.
        self.discards: Counter[str] = Counter()
        self._messages = messages
        self._identity = identity
        self._streams: dict[int, _Stream] = {}
        self._outputs: list[Output] = []
        self._inactivity_timeout_ns = inactivity_timeout_ns
        self._inactivity = Deadlines()
        self._answers = Deadlines()
        self._delayed: dict[int, SendDatagram] = {}
        self._last_session = 0
        self._last_answer = 0
        self._random = (seed * 2 + 1) & 0xFFFFFFFF

    # -- the carrier's side ------------------------------------------------------------------------------------------

    @property
    def streams(self) -> int:
        return len(self._streams)

    @property
    def sessions(self) -> int:
        return sum(stream.state is SessionState.ESTABLISHED for stream in self._streams.values())

    def opened(self, stream: int, peer: Peer, now: int) -> None:
        """A peer has connected."""
        if len(self._streams) >= self.settings.streams:
            self.discards["streams"] += 1
            self._outputs.append(StreamEnd(stream))
            return
        self._streams[stream] = _Stream(stream, peer, now)
        self._heard(self._streams[stream], now)

    def set_inactivity_timeout(self, timeout_ns: int) -> None:
        """Another timeout, for the open streams as well: each since its last message.  0: none."""
        self._inactivity_timeout_ns = timeout_ns
        for stream in self._streams.values():
            self._heard(stream, stream.heard_ns)

    def received(self, stream: int, data: bytes, now: int) -> None:
        """Octets of a stream, however they were cut."""
        if (at := self._streams.get(stream)) is None:
            return  # closed here, and the peer does not know yet
        at.replied = 0
        data = at.held + data
        at.held = b""
        place = 0
        while stream in self._streams and place < len(data):
            if at.skip:
                skipped = min(at.skip, len(data) - place)
                at.skip -= skipped
                place += skipped
                continue
            if len(data) - place < HEADER_OCTETS:
                break
            header = parse_header(data[place : place + HEADER_OCTETS])
            end = place + HEADER_OCTETS + header.length
            if header.length > self.settings.message_octets:
                self._refuse_long(at, header)
                place += HEADER_OCTETS
                at.skip = header.length
                continue
            if end > len(data):
                break
            self._heard(at, now)
            self._message(at, _whole(header, data[place + HEADER_OCTETS : end]), now)
            place = end
        if stream in self._streams:
            at.held = data[place:]

    def closed(self, stream: int, now: int) -> None:
        """The peer closed the connection, or it broke."""
        if (at := self._streams.get(stream)) is not None:
            self._step(at, SessionEvent.TCP_CLOSED, now)

    def datagram(self, data: bytes, peer: Peer, now: int, *, broadcast: bool = False) -> None:
        """A datagram to port 44818; ``broadcast`` for one that was not for this drive alone."""
        try:
            pdu = parse_encapsulation(data)
        except DecodeError as exc:
            self.discards[exc.reason] += 1
            return
        if pdu.options or pdu.status:
            self.discards["options" if pdu.options else "status"] += 1
            return
        if pdu.command == Command.NOP:
            return
        if pdu.command not in _LISTS:
            if not broadcast:
                self._send_datagram(peer, _refusal(pdu, EncapsulationStatus.INVALID_COMMAND), 0, now)
            return
        delay = self._delay_ns(pdu) if broadcast and pdu.command == Command.LIST_IDENTITY else 0
        self._send_datagram(peer, self._list(pdu), delay, now)

    def end_stream(self, stream: int, now: int) -> None:
        """Close a stream from this end (a fault, a connection that timed out)."""
        if (at := self._streams.get(stream)) is not None:
            self._step(at, SessionEvent.ABORT, now)

    def end_all(self, now: int) -> None:
        """The drive goes: no stream and no answer is left."""
        for stream in list(self._streams):
            self.end_stream(stream, now)
        for answer in list(self._delayed):
            self._answers.set(answer, None)
        self._delayed.clear()

    def next_deadline(self) -> int | None:
        due = [time for time in (self._inactivity.first(), self._answers.first()) if time is not None]
        return min(due, default=None)

    def handle_timeout(self, now: int) -> None:
        for stream in self._inactivity.take(now):
            if stream in self._streams:
                self.discards["inactivity"] += 1
                self._step(self._streams[stream], SessionEvent.INACTIVITY, now)
        for answer in self._answers.take(now):
            self._outputs.append(self._delayed.pop(answer))

    def take_outputs(self) -> list[Output]:
        outputs, self._outputs = self._outputs, []
        return outputs

    # -- messages ----------------------------------------------------------------------------------------------------

    def _message(self, at: _Stream, pdu: EncapsulationPdu, now: int) -> None:
        if pdu.options or pdu.status:
            self.discards["options" if pdu.options else "status"] += 1
            return
        match pdu.command:
            case Command.NOP:
                return
            case Command.LIST_SERVICES | Command.LIST_IDENTITY | Command.LIST_INTERFACES:
                self._reply(at, self._list(pdu), now)
            case Command.REGISTER_SESSION:
                self._reply(at, self._register(at, pdu, now), now)
            case Command.UNREGISTER_SESSION | Command.SEND_RR_DATA | Command.SEND_UNIT_DATA:
                self._in_session(at, pdu, now)
            case _:
                self._reply(at, _refusal(pdu, EncapsulationStatus.INVALID_COMMAND), now)

    def _in_session(self, at: _Stream, pdu: EncapsulationPdu, now: int) -> None:
        if at.state is not SessionState.ESTABLISHED or pdu.session != at.session:
            self._reply(at, _refusal(pdu, EncapsulationStatus.INVALID_SESSION_HANDLE), now)
        elif pdu.command == Command.UNREGISTER_SESSION:
            if pdu.data:
                self._reply(at, _refusal(pdu, EncapsulationStatus.INVALID_LENGTH), now)
            else:
                self._step(at, SessionEvent.UNREGISTER, now)
        else:
            try:
                packet = CommonPacket.parse(pdu.data)
            except DecodeError as exc:
                self.discards[exc.reason] += 1
                self._reply(at, _refusal(pdu, EncapsulationStatus.INCORRECT_DATA), now)
                return
            if pdu.command == Command.SEND_RR_DATA:
                self._unconnected(at, pdu, packet, now)
            else:
                self._connected(at, pdu, packet, now)

    def _list(self, pdu: EncapsulationPdu) -> EncapsulationPdu:
        if pdu.data:
            return _refusal(pdu, EncapsulationStatus.INVALID_LENGTH)
        items: dict[int, tuple[Item, ...]] = {
            Command.LIST_SERVICES: (ServiceItem(),),
            Command.LIST_IDENTITY: (self._identity(),),
            Command.LIST_INTERFACES: (),
        }
        return replace(pdu, data=emit_items(items[pdu.command]), session=0)

    def _register(self, at: _Stream, pdu: EncapsulationPdu, now: int) -> EncapsulationPdu:
        if at.state is SessionState.ESTABLISHED:
            return replace(pdu, status=EncapsulationStatus.INVALID_COMMAND, session=at.session)
        try:
            asked = RegisterSession.parse(pdu.data)
        except DecodeError:
            return _refusal(pdu, EncapsulationStatus.INVALID_LENGTH)
        if asked != RegisterSession():
            body = RegisterSession(PROTOCOL_VERSION, 0).emit()
            return replace(pdu, status=EncapsulationStatus.UNSUPPORTED_PROTOCOL_REVISION, data=body, session=0)
        self._last_session = (self._last_session + 1) & 0xFFFFFFFF or 1
        at.session = self._last_session
        self._step(at, SessionEvent.REGISTER, now)
        return replace(pdu, session=at.session)

    def _unconnected(self, at: _Stream, pdu: EncapsulationPdu, packet: CommonPacket, now: int) -> None:
        match packet.items:
            case (NullAddress(), UnconnectedData(message), *others) if packet.interface == 0:
                addresses = tuple(item for item in others if isinstance(item, SocketAddress))
                answer = self._messages.unconnected(at.number, at.session, at.peer, message, addresses, now)
            case _:
                answer = None
        if answer is None:
            self._reply(at, _refusal(pdu, EncapsulationStatus.INCORRECT_DATA), now)
            return
        reply, items = answer
        body = CommonPacket((NullAddress(), UnconnectedData(reply), *items)).emit()
        self._reply(at, replace(pdu, data=body), now)

    def _connected(self, at: _Stream, pdu: EncapsulationPdu, packet: CommonPacket, now: int) -> None:
        match packet.items:
            case (ConnectedAddress(connection_id), ConnectedData(data), *_) if packet.interface == 0:
                answer = self._messages.connected(at.number, connection_id, data, now)
            case _:
                self._reply(at, _refusal(pdu, EncapsulationStatus.INCORRECT_DATA), now)
                return
        if answer is None:
            self.discards["connection"] += 1  # a message of a connection has no reply that could say so
            return
        connection_id, reply = answer
        body = CommonPacket((ConnectedAddress(connection_id), ConnectedData(reply))).emit()
        self._reply(at, replace(pdu, data=body), now)

    def _refuse_long(self, at: _Stream, header: EncapsulationHeader) -> None:
        self.discards["long"] += 1
        if not header.options and not header.status:
            pdu = _refusal(_whole(header, b""), EncapsulationStatus.INVALID_LENGTH)
            self._outputs.append(SendStream(at.number, emit_encapsulation(pdu)))

    # -- replies -----------------------------------------------------------------------------------------------------

    def _reply(self, at: _Stream, pdu: EncapsulationPdu, now: int) -> None:
        if at.number not in self._streams:
            return
        data = emit_encapsulation(pdu)
        at.replied += len(data)
        if at.replied > self.settings.reply_octets:
            self.discards["replies"] += 1
            self._step(at, SessionEvent.ABORT, now)
            return
        self._outputs.append(SendStream(at.number, data))

    def _send_datagram(self, peer: Peer, pdu: EncapsulationPdu, delay_ns: int, now: int) -> None:
        datagram = SendDatagram(peer, emit_encapsulation(pdu))
        if not delay_ns:
            self._outputs.append(datagram)
            return
        if len(self._delayed) >= self.settings.delayed_answers:
            self.discards["delayed"] += 1
            return
        self._last_answer += 1
        self._delayed[self._last_answer] = datagram
        self._answers.set(self._last_answer, now + delay_ns)

    def _delay_ns(self, pdu: EncapsulationPdu) -> int:
        """A random time up to what the sender grants."""
        asked = int.from_bytes(pdu.context[:2], "little")
        longest = max(asked, _LEAST_DELAY_MS) if asked else _DEFAULT_DELAY_MS
        self._random = (self._random * 1664525 + 1013904223) & 0xFFFFFFFF
        return (self._random * longest >> 32) * _NS_PER_MS

    # -- the machine -------------------------------------------------------------------------------------------------

    def _heard(self, at: _Stream, now: int) -> None:
        at.heard_ns = now
        timeout = self._inactivity_timeout_ns
        self._inactivity.set(at.number, now + timeout if timeout else None)

    def _step(self, at: _Stream, event: SessionEvent, now: int) -> None:
        """The only writer of a session's state."""
        at.state, action = SESSION[at.state, event]
        if not action:
            return
        if action == "_close_stream":
            self._outputs.append(StreamEnd(at.number))
        self._streams.pop(at.number, None)
        self._inactivity.set(at.number, None)
        at.held = b""
        self._messages.stream_closed(at.number, now)


def _whole(header: EncapsulationHeader, data: bytes) -> EncapsulationPdu:
    return EncapsulationPdu(header.command, data, header.session, header.status, header.context, header.options)


def _refusal(pdu: EncapsulationPdu, status: EncapsulationStatus) -> EncapsulationPdu:
    return replace(pdu, status=status, data=b"")
