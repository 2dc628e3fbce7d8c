"""The life of each session: its signs and their actions, and the events of its machine."""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING, Final

from pnfarm.buses.controllers.session_life import RETRY_NS, Life
from pnfarm.buses.ethernetip.controller import events
from pnfarm.buses.ethernetip.controller.identity import READ_IDENTITY, differences, parse_identification
from pnfarm.buses.ethernetip.controller.session import TRANSITIONS, DeviceSession, SessionState, Sign
from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.originator import Originator, OriginatorSettings
from pnfarm.protocols.enip.originator_events import (
    ConnectionEnded,
    ConnectionMade,
    ConnectionNotMade,
    RequestAnswered,
    RequestFailed,
    SendTcp,
    SessionEnded,
    SessionRegistered,
)
from pnfarm.protocols.enip.originator_states import OriginatorState
from pnfarm.protocols.enip.status import ConnectionStatus, GeneralStatus, status_text
from pnfarm.protocols.enip.wire.encapsulation import ENIP_PORT
from pnfarm.protocols.enip.wire.forward_open import ForwardOpen, Triad
from pnfarm.wire.endpoint import StreamData, StreamEnd

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.ethernetip.controller.channels import SessionChannels
    from pnfarm.links.base import Port
    from pnfarm.links.sockets import SocketCarrier
    from pnfarm.protocols.enip.originator_events import OriginatorNote
    from pnfarm.station.event_log import EventLog

__all__ = ["SessionLife"]

#: Vendor id of the scanner; with its serial number it distinguishes its connections from others'.  No vendor has it.
VENDOR_ID: Final = 0xFFFF
#: A TCP connection on one wire needs no longer; a device that is not there yet is asked again by a new one.
STREAM_NS: Final = 500_000_000
#: A pause doubles with each refusal in a row, so many times.
DOUBLINGS: Final = 2
#: Idle is sent for so many packet intervals before Forward_Close, and no longer than this time.
IDLE_INTERVALS: Final = 2
LONGEST_IDLE_NS: Final = 500_000_000
#: Packet intervals that a device may answer.
LEAST_INTERVAL_US, MOST_INTERVAL_US = 100, 100_000_000
#: A connection of the scanner's own is in the way: the device still has one from before.
_OLD: Final = {ConnectionStatus.OWNERSHIP_CONFLICT, ConnectionStatus.DUPLICATE_FORWARD_OPEN}


class SessionLife(Life[DeviceSession]):
    """See :class:`pnfarm.buses.controllers.session_life.Life`."""

    transitions = TRANSITIONS

    def __init__(
        self, port: Port, *, sockets: SocketCarrier, channels: SessionChannels, log: EventLog, seed: bytes
    ) -> None:
        super().__init__(log)
        self._port = port
        self._sockets = sockets
        self._channels = channels
        self.serial_number = int.from_bytes(port.mac[2:], "big")
        start = zlib.crc32(seed + port.mac)
        self._connection_serial = start & 0xFFFF
        self._next_id = (start >> 16) << 16
        self.by_stream: dict[int, DeviceSession] = {}

    # -- actions -----------------------------------------------------------------------------------------------------

    def _do_connect(self, session: DeviceSession, now: int) -> None:
        if session.measures.search_ns == 0:
            session.measures.search_ns = now
        self._open_stream(session, now)

    def _open_stream(self, session: DeviceSession, now: int) -> None:
        self._end_stream(session, now, "another one is opened")
        session.stream = self._sockets.connect(self._port.index, (session.plan.ip.ip, ENIP_PORT))
        self.by_stream[session.stream] = session
        session.due_ns = now + min(STREAM_NS, session.plan.request_timeout_ns)

    def _do_register(self, session: DeviceSession, now: int) -> None:
        session.due_ns = None
        session.machine = Originator(OriginatorSettings(timeout_ns=session.plan.request_timeout_ns))
        session.machine.opened(now)

    def _do_identify(self, session: DeviceSession, now: int) -> None:
        assert session.machine is not None
        session.asked_identity = session.machine.request(READ_IDENTITY, now)

    def _do_open(self, session: DeviceSession, now: int) -> None:
        assert session.machine is not None
        mac = self._sockets.next_hop(self._port.index, session.plan.ip.ip)
        if mac is None:
            self._refused(session, f"the MAC address of {session.plan.ip.ip} is not known", (), now)
            return
        session.mac = mac
        session.opened = self._forward_open(session)
        session.machine.forward_open(session.opened, now)

    def _do_established(self, session: DeviceSession, now: int) -> None:
        measures = session.measures
        session.told = ""
        took = measures.established(now)
        measures.search_ns = 0
        session.failures = 0
        session.left.clear()
        group = "" if session.group is None else str(session.group)
        kind = session.plan.connection.kind
        self.note(session, events.Connected(took, session.mac, kind, group), now)

    def _do_pause(self, session: DeviceSession, now: int) -> None:
        self._channels.close(session)
        self._end_stream(session, now, "the connection is given up")
        self.pause(session, now, doublings=min(max(session.failures - 1, 0), DOUBLINGS))

    def _do_reopen(self, session: DeviceSession, now: int) -> None:
        """Beside cyclic data: the pause before the next TCP connection."""
        after = session.plan.reconnect_after_ns
        session.due_ns = now + (RETRY_NS if after is None else after)

    def _do_resume(self, session: DeviceSession, now: int) -> None:
        if session.stream is not None and session.machine is None:
            # the last attempt had no answer
            self._end_stream(session, now, "no TCP connection in time")
            self._do_reopen(session, now)
        elif session.stream is None:
            self._open_stream(session, now)

    def _do_resumed(self, session: DeviceSession, now: int) -> None:
        session.told = ""
        self.note(session, events.SessionResumed(), now)

    def _do_idle(self, session: DeviceSession, now: int) -> None:
        self._channels.set_mode(session, run=False)
        session.due_ns = now + min(IDLE_INTERVALS * session.plan.rpi_ns, LONGEST_IDLE_NS)

    def _do_close(self, session: DeviceSession, now: int) -> None:
        self._channels.close(session)
        machine = session.machine
        if machine is None or session.opened is None or machine.state is not OriginatorState.ESTABLISHED:
            self.sign(session, Sign.CLOSED, now)
            return
        session.due_ns = now + session.plan.request_timeout_ns
        session.asked_close = machine.forward_close(session.opened.triad, session.opened.path, now)

    def _do_drop(self, session: DeviceSession, now: int) -> None:
        self._channels.close(session)
        self._end_stream(session, now, "the controller ends the session")
        session.due_ns = None

    # -- what actions do ---------------------------------------------------------------------------------------------

    def _forward_open(self, session: DeviceSession) -> ForwardOpen:
        plan, wanted = session.plan, session.plan.connection
        rpi_us = plan.rpi_ns // 1000
        return ForwardOpen(
            triad=self._triad(),
            o_to_t_id=0,
            t_to_o_id=self._id(),
            o_to_t_rpi_us=rpi_us,
            o_to_t=wanted.output,
            t_to_o_rpi_us=rpi_us,
            t_to_o=wanted.input,
            transport=wanted.transport,
            path=wanted.path,
            timeout_multiplier=plan.timeout_multiplier.bit_length() - 3,
            large=wanted.large,
        )

    def _triad(self) -> Triad:
        self._connection_serial = self._connection_serial % 0xFFFF + 1
        return Triad(self._connection_serial, VENDOR_ID, self.serial_number)

    def _id(self) -> int:
        """A connection id that none of the scanner's has had for the last 65,535."""
        self._next_id = self._next_id & 0xFFFF0000 | ((self._next_id & 0xFFFF) % 0xFFFF + 1)
        return self._next_id

    def _end_stream(self, session: DeviceSession, now: int, reason: str) -> None:
        """End the session in order, where there is one, and the TCP connection; nothing of them is heard any more."""
        machine, session.machine = session.machine, None
        if machine is not None:
            machine.unregister(now)
            self._carry(session, machine)
            machine.take_events()
        self._end_tcp(session)
        session.asked_identity = session.asked_close = None
        session.queue.forget(reason)

    def _carry(self, session: DeviceSession, machine: Originator) -> bool:
        """Send what a machine sends; whether it was something."""
        outputs = machine.take_outputs()
        for output in outputs:
            if session.stream is None:
                break
            if isinstance(output, SendTcp):
                self._sockets.act(self._port.index, StreamData(session.stream, output.data))
            else:
                self._end_tcp(session)
        return bool(outputs)

    def _end_tcp(self, session: DeviceSession) -> None:
        if session.stream is not None:
            self.by_stream.pop(session.stream, None)
            self._sockets.act(self._port.index, StreamEnd(session.stream))
            session.stream = None

    # -- streams and time --------------------------------------------------------------------------------------------

    def stream_closed(self, session: DeviceSession, now: int) -> None:
        """The TCP connection was refused, closed or broke."""
        if session.stream is not None:
            self.by_stream.pop(session.stream, None)
            session.stream = None
        if session.machine is not None:
            session.machine.closed(now)
            self.pump(session, now)
        else:
            self._session_lost(session, f"the TCP connection to {session.plan.ip.ip} was refused", now)

    def timed(self, session: DeviceSession, now: int) -> None:
        if session.state is SessionState.STREAM:
            self._unreached(session, f"no TCP connection to {session.plan.ip.ip}", now)
        elif session.state is SessionState.CLOSE:
            self.note(session, events.ConnectionBroken("no answer to Forward_Close"), now)
        self.sign(session, Sign.TIME, now)

    def expired(self, session: DeviceSession, now: int) -> None:
        """No cyclic data came for longer than the timeout, or none at all."""
        session.measures.expirations += 1
        if session.opened is not None:
            session.left.append(session.opened)
        if session.state is SessionState.DATA:
            self._broken(session, f"no cyclic data for {self._channels.awaited_ns(session) / 1e6:g} ms", now)
        self.sign(session, Sign.EXPIRED, now)

    def _broken(self, session: DeviceSession, reason: str, now: int) -> None:
        measures = session.measures
        session.told = ""
        measures.last_reason = reason
        measures.losses += 1
        measures.lost_ns = now
        self.note(session, events.ConnectionBroken(reason), now)

    def _unreached(self, session: DeviceSession, reason: str, now: int) -> None:
        """A device that is not there yet, or not any more: reported once, and looked for again and again."""
        if session.measures.lost_ns is None:
            session.measures.last_reason = reason
        if session.told != reason:
            session.told = reason
            self.note(session, events.ConnectFailed(reason), now)

    def _failed(self, session: DeviceSession, reason: str, status: tuple[int, ...], now: int) -> None:
        measures = session.measures
        measures.refusals += 1
        session.failures += 1
        # the reason of a loss is more useful than that the device does not answer yet
        if measures.lost_ns is None or status:
            measures.last_reason = reason
        self.note(session, events.ConnectFailed(reason, status), now)

    def _refused(self, session: DeviceSession, reason: str, status: tuple[int, ...], now: int) -> None:
        self._failed(session, reason, status, now)
        self.sign(session, Sign.REFUSED, now)

    def _session_lost(self, session: DeviceSession, reason: str, now: int) -> None:
        session.machine = None
        session.asked_identity = None
        session.queue.forget(reason)
        if session.state is SessionState.DATA:
            if not session.told:
                # else it was tried again in vain
                session.told = reason
                session.measures.sessions_lost += 1
                self.note(session, events.SessionLost(reason), now)
        elif session.state is SessionState.STREAM:
            self._unreached(session, reason, now)
        elif session.state in {SessionState.SESSION, SessionState.IDENTITY, SessionState.OPEN}:
            if session.state is SessionState.OPEN and session.opened is not None:
                # its answer may have been on the way
                session.left.append(session.opened)
            self._failed(session, reason, (), now)
        self.sign(session, Sign.SESSION_LOST, now)

    # -- the machine's events ----------------------------------------------------------------------------------------

    def pump(self, session: DeviceSession, now: int) -> bool:
        """Send what a session's machine sends and take its events; whether something moved."""
        machine = session.machine
        if machine is None:
            return False
        if machine.state is OriginatorState.ESTABLISHED:
            session.queue.send(machine, now)
        moved = self._carry(session, machine)
        notes = machine.take_events()
        for note in notes:
            if not session.queue.take(note):
                self._take(session, note, now)
        return moved or bool(notes)

    def _take(self, session: DeviceSession, note: OriginatorNote, now: int) -> None:
        match note:
            case SessionRegistered():
                self.sign(session, Sign.REGISTERED, now)
            case SessionEnded(reason=reason):
                self._session_lost(session, reason, now)
            case RequestAnswered(number=number) | RequestFailed(number=number) if number == session.asked_identity:
                session.asked_identity = None
                self._identified(session, note, now)
            case ConnectionMade() if session.state is SessionState.OPEN:
                self._made(session, note, now)
            case ConnectionNotMade() if session.state is SessionState.OPEN:
                self._not_made(session, note, now)
            case ConnectionEnded(triad=triad) if session.left and session.left[0].triad == triad:
                session.left.popleft()
                self.note(session, events.OldConnectionClosed(), now)
                self.sign(session, Sign.AGAIN, now)
            case ConnectionEnded(number=number) if number == session.asked_close:
                self.note(session, events.Released(), now)
                self.sign(session, Sign.CLOSED, now)
            case RequestAnswered(number=number) | RequestFailed(number=number) if number == session.asked_close:
                self.sign(session, Sign.CLOSED, now)
            case RequestAnswered() | RequestFailed() if session.state is SessionState.OPEN:
                if isinstance(note, RequestAnswered) and session.left:
                    # without an answer it is tried again
                    session.left.popleft()
                self._refused(session, "an old connection of the controller's own cannot be closed", (), now)
            case _:
                pass

    def _identified(self, session: DeviceSession, note: RequestAnswered | RequestFailed, now: int) -> None:
        """Whatever the identity is, the device decides by the electronic key."""
        if isinstance(note, RequestFailed):
            problem = note.reason
        elif note.reply.status:
            problem = status_text(note.reply.status, note.reply.extended)
        else:
            problem = ""
            try:
                session.identification = parse_identification(note.reply.data)
            except DecodeError as exc:
                problem = str(exc)
        if problem:
            self.note(session, events.IdentityUnread(problem), now)
        elif session.identification is not None:
            for what, found, planned in differences(session.identification, session.plan.key):
                self.note(session, events.IdentityDiffers(what, found, planned), now)
        self.sign(session, Sign.IDENTIFIED, now)

    def _made(self, session: DeviceSession, note: ConnectionMade, now: int) -> None:
        """Start both directions, unless the answer cannot be used."""
        wrong = _wrong_answer(session, note)
        if wrong:
            session.left.append(note.request)
            self._refused(session, f"Forward_Open: {wrong}", (), now)
            return
        self._channels.open(session, note)
        self.sign(session, Sign.MADE, now)

    def _not_made(self, session: DeviceSession, note: ConnectionNotMade, now: int) -> None:
        """Close an old connection that is in the way, else report why not, and try again after a pause."""
        if note.reply is None:
            # the device may have opened it all the same
            session.left.append(note.request)
            self._refused(session, f"Forward_Open: {note.reason}", (), now)
            return
        status, extended = note.reply.status, note.reply.extended
        refusal = extended[0] if status == GeneralStatus.CONNECTION_FAILURE and extended else None
        if refusal in _OLD and session.left and session.machine is not None:
            session.machine.forward_close(session.left[0].triad, session.left[0].path, now)
            return
        self._refused(session, f"Forward_Open: {_explained(note, refusal)}", (status, *extended), now)


def _wrong_answer(session: DeviceSession, made: ConnectionMade) -> str:
    """What is wrong with a positive answer, empty for nothing."""
    for interval_us in (made.reply.o_to_t_api_us, made.reply.t_to_o_api_us):
        if not LEAST_INTERVAL_US <= interval_us <= MOST_INTERVAL_US:
            return f"the device answers with a packet interval of {interval_us} us"
    groups = [item for item in made.items if not item.o_to_t and item.address.is_multicast]
    if session.plan.connection.multicast and not groups:
        return "the device names no group to which it sends"
    return ""


def _explained(note: ConnectionNotMade, refusal: int | None) -> str:
    """The status in words, with the size that the device has where it says so."""
    sizes: dict[int, Callable[[], int]] = {
        ConnectionStatus.O_TO_T_SIZE: lambda: note.request.o_to_t.size,
        ConnectionStatus.T_TO_O_SIZE: lambda: note.request.t_to_o.size,
    }
    extended = note.reply.extended if note.reply is not None else ()
    if refusal in sizes and len(extended) > 1:
        return f"{note.reason}: the device has {extended[1]} octets with its headers, not {sizes[refusal]()}"
    return note.reason
