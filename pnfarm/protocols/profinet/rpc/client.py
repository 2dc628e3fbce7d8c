"""The client side of connectionless RPC: a controller's Connect, Read, Write, Control, and a device's ApplicationReady.

Calls to one peer share an *activity* with rising sequence numbers, one call at a time; a call made while another is
open gets an activity of its own.  One call walks through these states (C706 chapter 10, the connectionless client
machine):

=========  ======================================================================================
SENDING    fragments of the request wait for the window
WAITING    the request went out whole; the response has not begun
RECEIVING  fragments of the response are arriving
=========  ======================================================================================

While the server is silent, the client in turns repeats the request and pings; it only pings once the server has shown
that it knows the call, and for a long request: some servers do not answer a request that they hold already, some do
not support pings.  After *working* the client waits on; after *nocall*, and after a reject because the server is busy,
it repeats the request.
A server may answer from a port other than the one that was called, and does so in practice: what follows within the
call goes there.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.deadlines import Deadlines
from pnfarm.protocols.profinet.rpc.answers import answer_to, fack
from pnfarm.protocols.profinet.rpc.calls import (
    EVENTS_OF_TYPES,
    TRANSITIONS,
    ActivityPool,
    Call,
    refusal_text,
)
from pnfarm.protocols.profinet.rpc.calls import ClientEventKind as _Event
from pnfarm.protocols.profinet.rpc.events import CallFailed, CallReturned, ClientEvent, RpcClientConfig
from pnfarm.protocols.profinet.rpc.fragments import (
    STUB_MAX,
    Datagram,
    FragmentSender,
    Peer,
    Reassembly,
)
from pnfarm.protocols.profinet.wire.rpc.bodies import parse_fack
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    ARGS_HEADER_LENGTH,
    FRAGMENT_NONE,
    OK,
    UUID_EPM,
    Flags1,
    NcaStatus,
    PacketType,
    RequestArgs,
    RpcPdu,
    drep,
    emit_request_args,
    emit_rpc,
    parse_response_args,
    parse_rpc,
    parse_status,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from uuid import UUID

__all__ = [
    "CallFailed",
    "CallReturned",
    "Datagram",
    "Peer",
    "RpcClient",
    "RpcClientConfig",
]

_EPM_VERSION: Final = 3
_IDEMPOTENT: Final = int(Flags1.IDEMPOTENT)


class RpcClient:
    """See the module's docstring.  ``new_uuid`` gives a fresh activity UUID on each call of it."""

    def __init__(self, new_uuid: Callable[[], UUID], config: RpcClientConfig | None = None) -> None:
        self.config = config or RpcClientConfig()
        self.dropped: Counter[str] = Counter()
        self._activities = ActivityPool(new_uuid, self.config.idle_ns)
        self._calls: dict[int, Call] = {}
        self._deadlines = Deadlines()
        self._last_id = 0
        self._out: list[Datagram] = []
        self._events: list[ClientEvent] = []

    # --- the outside ---------------------------------------------------------------------------------------

    def call(
        self,
        peer: Peer,
        local_port: int,
        interface: UUID,
        object_uuid: UUID,
        opnum: int,
        args_maximum: int,
        payload: bytes,
        now: int,
        *,
        timeout_ns: int | None = None,
        little_endian: bool = True,
    ) -> int:
        """Start a call from ``local_port``; returns its id, which the event that ends it repeats.

        ``payload`` holds the blocks, or the whole stub for the endpoint mapper.  ``args_maximum`` bounds the answer,
        in octets of blocks.  Raises :class:`ValueError` for a payload longer than 64 KiB.
        """
        if len(payload) > STUB_MAX - ARGS_HEADER_LENGTH:
            raise ValueError(f"{len(payload)} octets of arguments, at most {STUB_MAX - ARGS_HEADER_LENGTH} fit")
        is_epm = interface == UUID_EPM
        stub, answer_max = payload, STUB_MAX
        if not is_epm:
            stub = emit_request_args(RequestArgs(args_maximum, payload), little_endian=little_endian)
            answer_max = min(STUB_MAX, args_maximum + ARGS_HEADER_LENGTH)
        activity = self._activities.take(peer)
        activity.sequence = (activity.sequence + 1) & 0xFFFFFFFF
        activity.last_fragment = FRAGMENT_NONE
        self._last_id += 1
        call = Call(
            call_id=self._last_id,
            activity=activity,
            peer=peer,
            local_port=local_port,
            request=RpcPdu(
                packet_type=PacketType.REQUEST,
                interface=interface,
                activity=activity.uuid,
                object_uuid=object_uuid,
                sequence=activity.sequence,
                opnum=opnum,
                drep=drep(little_endian=little_endian),
                server_boot_time=activity.boot_time,
                interface_version=_EPM_VERSION if is_epm else 1,
            ),
            sender=FragmentSender(stub, self.config.fragment_octets),
            answer_max=answer_max,
            expires_at=now + (self.config.timeout_ns if timeout_ns is None else timeout_ns),
            reassembly=Reassembly(answer_max),
        )
        activity.call = self._calls[call.call_id] = call
        self._transmit(call, now)
        return call.call_id

    def cancel(self, call_id: int, now: int) -> None:
        """Drop a call without an event; what still arrives for it is ignored.

        The server gets one cl_cancel, which orphans the call.  Some devices end the whole connection when they get it.
        """
        call = self._calls.get(call_id)
        if call is not None:
            self._fire(call, _Event.CANCELLED, None, now)

    def forget(self, call_id: int, now: int) -> None:
        """Drop a call without an event and without a cl_cancel: what it was about no longer exists at the server."""
        call = self._calls.get(call_id)
        if call is not None:
            self._fire(call, _Event.FAILED, None, now)

    def receive(self, peer: Peer, local_port: int, data: bytes, now: int) -> None:
        """Take one UDP payload; what belongs to no open call is counted in ``dropped``."""
        try:
            pdu = parse_rpc(data)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return
        event = EVENTS_OF_TYPES.get(pdu.kind)
        activity = self._activities.get(pdu.activity)
        if event is None:
            self.dropped["unexpected-type"] += 1
        elif activity is None or peer.ip != activity.peer.ip or not peer.port:
            self.dropped["unknown-activity"] += 1
        elif pdu.sequence != activity.sequence:
            self.dropped["stale-sequence"] += 1
        elif activity.call is None:
            self.dropped["call-is-over"] += 1
            if event is _Event.RESPONSE and pdu.wants_fack and activity.last_fragment != FRAGMENT_NONE:
                self._send_fack(peer, local_port, pdu, activity.last_fragment)
        else:
            if pdu.server_boot_time:
                activity.boot_time = pdu.server_boot_time
            activity.call.peer = peer
            self._fire(activity.call, event, pdu, now)

    def to_send(self, now: int) -> list[Datagram]:  # noqa: ARG002  # the convention of all machines
        out, self._out = self._out, []
        return out

    def events(self) -> list[ClientEvent]:
        events, self._events = self._events, []
        return events

    def next_deadline(self) -> int | None:
        due, idle = self._deadlines.first(), self._activities.next_deadline()
        if due is None or idle is None:
            return idle if due is None else due
        return min(due, idle)

    def handle_timeout(self, now: int) -> None:
        for call_id in self._deadlines.take(now):
            call = self._calls[call_id]
            if call.expires_at <= now:
                self._fail(call, "timeout", now)
            elif call.tries >= self.config.tries:
                self._fail(call, "no-answer", now)
            else:
                self._fire(call, _Event.RETRY, None, now)
        self._activities.handle_timeout(now)

    @property
    def open_calls(self) -> int:
        return len(self._calls)

    # --- the machine ---------------------------------------------------------------------------------------

    def _fire(self, call: Call, event: _Event, pdu: RpcPdu | None, now: int) -> None:
        row = TRANSITIONS.get((call.state, event))
        if row is None:
            self.dropped[f"{event.name.lower().replace('_', '-')}-in-{call.state.name.lower()}"] += 1
            return
        call.state, action = row
        if action is not None:
            getattr(self, f"_do_{action}")(call, pdu, now)

    # sending

    def _transmit(self, call: Call, now: int) -> None:
        sender = call.sender
        for fragment in sender.due():
            flags = _IDEMPOTENT | int(fragment.flags1)
            self._send(call, flags1=flags, fragment_number=fragment.number, body=fragment.body)
        self._rearm(call, now)
        self._fire(call, _Event.ALL_SENT if sender.all_sent else _Event.MORE_TO_SEND, None, now)

    def _rearm(self, call: Call, now: int) -> None:
        self._wake(call, now + (self.config.retry_ns << call.tries))
        call.tries += 1

    def _wake(self, call: Call, at: int) -> None:
        self._deadlines.set(call.call_id, min(at, call.expires_at))

    def _do_slide(self, call: Call, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        try:
            body = parse_fack(pdu.body, little_endian=pdu.little_endian)
        except DecodeError as exc:
            self.dropped[f"fack-{exc.reason}"] += 1
            return
        if not call.sender.acknowledge(pdu.fragment_number, body):
            self.dropped["stale-fack"] += 1
            return
        call.tries = call.nocalls = 0
        self._transmit(call, now)

    def _do_send_again(self, call: Call, pdu: RpcPdu | None, now: int) -> None:
        """The server does not know the call, or reports in a fack body how much of it arrived."""
        assert pdu is not None
        call.nocalls += 1
        if call.nocalls > self.config.tries:
            self._fail(call, "nocall", now)
            return
        call.tries = 0
        call.worked = False
        call.reassembly = Reassembly(call.answer_max)
        arrived = pdu.fragment_number if pdu.body and call.sender.fragmented else FRAGMENT_NONE
        call.sender.restart(0 if arrived == FRAGMENT_NONE else arrived + 1)
        self._transmit(call, now)

    def _do_resume(self, call: Call, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        call.sender.rewind()
        self._transmit(call, now)

    # waiting

    def _do_wait_on(self, call: Call, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        call.tries = 0
        call.worked = True
        self._wake(call, now + self.config.working_ping_ns)

    def _do_retry(self, call: Call, pdu: RpcPdu | None, now: int) -> None:
        if call.worked or call.sender.fragmented or call.tries % 2 == 0:
            self._do_ping(call, pdu, now)
        else:
            call.sender.restart()
            self._transmit(call, now)

    def _do_ping(self, call: Call, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        self._send(call, PacketType.PING)
        self._rearm(call, now)

    # receiving

    def _do_collect(self, call: Call, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        if call.response_drep and pdu.drep != call.response_drep and call.reassembly.octets:
            self.dropped["fragments-differ"] += 1
            return
        call.response_drep = pdu.drep
        number = pdu.fragment_number if pdu.is_fragment else 0
        reason = call.reassembly.add(number, pdu.body, last=pdu.is_last)
        if reason is None:
            call.tries = 0
            self._rearm(call, now)
        else:
            self.dropped[reason] += 1
        if pdu.wants_fack:
            self._send_fack(call.peer, call.local_port, pdu, call.reassembly.acknowledged)
        if reason == "too-long":
            self._fail(call, "bad-response", now)
        elif call.reassembly.complete:
            self._fire(call, _Event.COMPLETED, pdu, now)

    def _do_deliver(self, call: Call, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        stub, status = call.reassembly.stub(), OK
        if pdu.is_fragment:
            call.activity.last_fragment = call.reassembly.acknowledged
        if call.request.interface != UUID_EPM:
            try:
                args = parse_response_args(stub, little_endian=pdu.little_endian)
            except DecodeError as exc:
                self.dropped[f"args-{exc.reason}"] += 1
                self._fail(call, "bad-response", now)
                return
            stub, status = args.payload, args.status
        self._events.append(CallReturned(call.call_id, status, stub, call.peer, pdu.little_endian))
        self._fire(call, _Event.RETURNED, None, now)

    def _do_refused(self, call: Call, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        try:
            code = parse_status(pdu.body, little_endian=pdu.little_endian)
        except DecodeError as exc:
            self.dropped[f"status-{exc.reason}"] += 1
            self._fail(call, "bad-response", now)
            return
        if code == NcaStatus.WRONG_BOOT_TIME:
            call.activity.boot_time = 0
        busy = pdu.kind == PacketType.REJECT and code == NcaStatus.SERVER_TOO_BUSY
        if busy and call.refusals + 1 < self.config.tries:
            self._fire(call, _Event.BUSY, None, now)
            return
        self._fail(call, refusal_text(pdu.kind, code), now, code)

    def _do_wait_for_room(self, call: Call, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        """The server has not started the call, so it may be sent again unchanged after a pause."""
        call.sender.restart()
        call.reassembly = Reassembly(call.answer_max)
        call.worked, call.tries = False, 0
        self._wake(call, now + (self.config.retry_ns << call.refusals))
        call.refusals += 1

    # ending

    def _fail(self, call: Call, reason: str, now: int, code: int = 0) -> None:
        self._events.append(CallFailed(call.call_id, reason, call.peer, code))
        self._fire(call, _Event.FAILED, None, now)

    def _do_give_up(self, call: Call, pdu: RpcPdu | None, now: int) -> None:
        self._send(call, PacketType.CL_CANCEL)
        self._do_close(call, pdu, now)

    def _do_close(self, call: Call, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        self._deadlines.set(call.call_id, None)
        del self._calls[call.call_id]
        self._activities.give_back(call.activity, now)

    # --- datagrams -----------------------------------------------------------------------------------------

    def _send(
        self,
        call: Call,
        packet_type: int = PacketType.REQUEST,
        *,
        flags1: int = 0,
        fragment_number: int = 0,
        body: bytes = b"",
    ) -> None:
        pdu = answer_to(
            call.request, packet_type, flags1=flags1, fragment_number=fragment_number, body=body, serial=call.serial
        )
        call.serial = (call.serial + 1) & 0xFFFF
        self._out.append(Datagram(call.local_port, call.peer, emit_rpc(pdu)))

    def _send_fack(self, peer: Peer, local_port: int, pdu: RpcPdu, number: int) -> None:
        self._out.append(Datagram(local_port, peer, emit_rpc(fack(pdu, number))))
