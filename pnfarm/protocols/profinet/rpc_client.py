"""The calling end of connectionless RPC: a controller's Connect, Read, Write, Control, and a device's ApplicationReady.

Calls to one peer share an *activity* with rising sequence numbers, one call at a time; a call made while another is
open gets an activity of its own.  One call walks through these states (C706 chapter 10, the connectionless client
machine):

=========  ======================================================================================
SENDING    fragments of the request wait for the window
WAITING    the request went out whole; the response has not begun
RECEIVING  fragments of the response are arriving
=========  ======================================================================================

Silence is answered by sending the request again as long as the server gave no sign of it, and by a ping once it did or
when the request is a long one.  *Working* to a ping means patience, *nocall* that the request is to be sent again.
A server may answer from a port other than the one that was called, and does so in practice: what follows within the
call goes there.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import TYPE_CHECKING, ClassVar, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.rpc_events import CallFailed, CallReturned, ClientEvent, RpcClientConfig
from pnfarm.protocols.profinet.rpc_fragments import (
    STUB_MAX,
    Datagram,
    FragmentSender,
    Peer,
    Reassembly,
    fack_body,
)
from pnfarm.protocols.profinet.wire.rpc import (
    FRAGMENT_NONE,
    OK,
    UUID_EPM,
    Flags1,
    NcaStatus,
    PacketType,
    RequestArgs,
    RpcPdu,
    drep,
    emit_fack,
    emit_request_args,
    emit_rpc,
    parse_fack,
    parse_response_args,
    parse_rpc,
    parse_status,
    status_name,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from uuid import UUID

    _Action = Callable[["RpcClient", "_Call", RpcPdu | None, int], None]

__all__ = [
    "CallFailed",
    "CallReturned",
    "Datagram",
    "Peer",
    "RpcClient",
    "RpcClientConfig",
]

_EPM_VERSION: Final = 3


class ClientState(Enum):
    """States of one call."""

    SENDING = auto()
    WAITING = auto()
    RECEIVING = auto()
    DONE = auto()


class _Event(Enum):
    FACK = auto()
    ALL_SENT = auto()
    MORE_TO_SEND = auto()
    WORKING = auto()
    NOCALL = auto()
    RESPONSE = auto()
    COMPLETED = auto()
    RETURNED = auto()
    REFUSED = auto()
    RETRY = auto()
    FAILED = auto()
    CANCELLED = auto()


@dataclass(slots=True)
class _Activity:
    uuid: UUID
    peer: Peer
    sequence: int = 0xFFFFFFFF
    boot_time: int = 0
    call: _Call | None = None
    idle_since: int = 0
    last_fragment: int = FRAGMENT_NONE
    """Number that ended the last response, to acknowledge it again when its fack was lost."""


@dataclass(slots=True)
class _Call:
    call_id: int
    activity: _Activity
    peer: Peer
    local_port: int
    request: RpcPdu
    sender: FragmentSender
    expires_at: int
    retry_at: int
    reassembly: Reassembly
    state: ClientState = ClientState.SENDING
    response_drep: bytes = b""
    serial: int = 0
    tries: int = 0
    nocalls: int = 0
    worked: bool = False


class RpcClient:
    """See the module's text.  ``new_uuid`` gives a fresh activity UUID on each call of it."""

    def __init__(self, new_uuid: Callable[[], UUID], config: RpcClientConfig | None = None) -> None:
        self.config = config or RpcClientConfig()
        self.dropped: Counter[str] = Counter()
        self._new_uuid = new_uuid
        self._activities: dict[UUID, _Activity] = {}
        self._calls: dict[int, _Call] = {}
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
        """Start a call from ``local_port``; answers its id, which the event that ends it repeats.

        ``payload`` holds the blocks, or the whole stub for the endpoint mapper.  ``args_maximum`` bounds the answer,
        in octets of blocks.  Raises :class:`ValueError` for a payload longer than 64 KiB.
        """
        if len(payload) > STUB_MAX - 24:
            raise ValueError(f"{len(payload)} octets of arguments, {STUB_MAX - 24} are possible")
        is_epm = interface == UUID_EPM
        stub = payload
        if not is_epm:
            stub = emit_request_args(RequestArgs(args_maximum, payload), little_endian=little_endian)
        activity = self._free_activity(peer)
        activity.sequence = (activity.sequence + 1) & 0xFFFFFFFF
        activity.last_fragment = FRAGMENT_NONE
        self._last_id += 1
        call = _Call(
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
            expires_at=now + (self.config.timeout_ns if timeout_ns is None else timeout_ns),
            retry_at=now,
            reassembly=Reassembly(STUB_MAX),
        )
        activity.call = self._calls[call.call_id] = call
        self._transmit(call, now)
        return call.call_id

    def cancel(self, call_id: int, now: int) -> None:
        """Give a call up without an event; what still arrives for it is dropped."""
        call = self._calls.get(call_id)
        if call is not None:
            self._fire(call, _Event.CANCELLED, None, now)

    def receive(self, peer: Peer, local_port: int, data: bytes, now: int) -> None:
        """Take one UDP payload; what belongs to no open call is counted in ``dropped``."""
        try:
            pdu = parse_rpc(data)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return
        event = _EVENTS_OF_TYPES.get(pdu.kind)
        activity = self._activities.get(pdu.activity)
        if event is None:
            self.dropped["unexpected-type"] += 1
        elif activity is None or peer.ip != activity.peer.ip:
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
        calls = (min(call.expires_at, call.retry_at) for call in self._calls.values())
        idle = (row.idle_since + self.config.idle_ns for row in self._activities.values() if row.call is None)
        return min((*calls, *idle), default=None)

    def handle_timeout(self, now: int) -> None:
        for call in list(self._calls.values()):
            if call.expires_at <= now:
                self._fail(call, "timeout", now)
            elif call.retry_at <= now and call.tries >= self.config.tries:
                self._fail(call, "no-answer", now)
            elif call.retry_at <= now:
                self._fire(call, _Event.RETRY, None, now)
        for activity in list(self._activities.values()):
            if activity.call is None and activity.idle_since + self.config.idle_ns <= now:
                del self._activities[activity.uuid]

    @property
    def open_calls(self) -> int:
        return len(self._calls)

    # --- the machine ---------------------------------------------------------------------------------------

    def _fire(self, call: _Call, event: _Event, pdu: RpcPdu | None, now: int) -> None:
        row = self._TRANSITIONS.get((call.state, event))
        if row is None:
            self.dropped[f"{event.name.lower().replace('_', '-')}-in-{call.state.name.lower()}"] += 1
            return
        call.state, action = row
        if action is not None:
            action(self, call, pdu, now)

    def _transmit(self, call: _Call, now: int) -> None:
        sender = call.sender
        for fragment in sender.due():
            flags = Flags1.IDEMPOTENT | fragment.flags1
            self._send(call, replace(call.request, flags1=int(flags), fragment_number=fragment.number), fragment.body)
        self._rearm(call, now)
        self._fire(call, _Event.ALL_SENT if sender.all_sent else _Event.MORE_TO_SEND, None, now)

    def _rearm(self, call: _Call, now: int) -> None:
        call.retry_at = now + (self.config.retry_ns << call.tries)
        call.tries += 1

    def _alive(self, call: _Call) -> None:
        """The server gave a sign of the call: the count of silent tries begins anew."""
        call.tries = 0

    def _slide(self, call: _Call, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        try:
            body = parse_fack(pdu.body, little_endian=pdu.little_endian)
        except DecodeError as exc:
            self.dropped[f"fack-{exc.reason}"] += 1
            return
        if not call.sender.acknowledge(pdu.fragment_number, body):
            self.dropped["stale-fack"] += 1
            return
        self._alive(call)
        call.nocalls = 0
        self._transmit(call, now)

    def _be_patient(self, call: _Call, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        self._alive(call)
        call.worked = True
        call.retry_at = now + self.config.working_ping_ns

    def _send_again(self, call: _Call, pdu: RpcPdu | None, now: int) -> None:
        """The server knows nothing of the call, or tells in a fack body how much of it arrived."""
        assert pdu is not None
        call.nocalls += 1
        if call.nocalls > self.config.tries:
            self._fail(call, "nocall", now)
            return
        self._alive(call)
        call.worked = False
        call.reassembly = Reassembly(STUB_MAX)
        arrived = pdu.fragment_number if pdu.body and call.sender.fragmented else FRAGMENT_NONE
        call.sender.restart(0 if arrived == FRAGMENT_NONE else arrived + 1)
        self._transmit(call, now)

    def _collect(self, call: _Call, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        if call.response_drep and pdu.drep != call.response_drep and call.reassembly.octets:
            self.dropped["fragments-differ"] += 1
            return
        call.response_drep = pdu.drep
        number = pdu.fragment_number if pdu.is_fragment else 0
        reason = call.reassembly.add(number, pdu.body, last=pdu.is_last)
        if reason is None:
            self._alive(call)
            self._rearm(call, now)
        else:
            self.dropped[reason] += 1
        if pdu.wants_fack:
            self._send_fack(call.peer, call.local_port, pdu, call.reassembly.acknowledged)
        if reason == "too-long":
            self._fail(call, "bad-response", now)
        elif call.reassembly.complete:
            self._fire(call, _Event.COMPLETED, pdu, now)

    def _deliver(self, call: _Call, pdu: RpcPdu | None, now: int) -> None:
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

    def _refused(self, call: _Call, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        try:
            code = parse_status(pdu.body, little_endian=pdu.little_endian)
        except DecodeError as exc:
            self.dropped[f"status-{exc.reason}"] += 1
            self._fail(call, "bad-response", now)
            return
        if code == NcaStatus.WRONG_BOOT_TIME:
            call.activity.boot_time = 0
        kind = "reject" if pdu.kind == PacketType.REJECT else "fault"
        self._fail(call, f"{kind} {status_name(code)}", now, code)

    def _retry(self, call: _Call, pdu: RpcPdu | None, now: int) -> None:
        if call.worked or call.sender.fragmented:
            self._ping(call, pdu, now)
        else:
            call.sender.restart()
            self._transmit(call, now)

    def _resume(self, call: _Call, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        call.sender.rewind()
        self._transmit(call, now)

    def _ping(self, call: _Call, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        self._send(call, replace(call.request, packet_type=int(PacketType.PING)), b"")
        self._rearm(call, now)

    def _fail(self, call: _Call, reason: str, now: int, code: int = 0) -> None:
        self._events.append(CallFailed(call.call_id, reason, call.peer, code))
        self._fire(call, _Event.FAILED, None, now)

    def _close(self, call: _Call, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        call.activity.call = None
        call.activity.idle_since = now
        del self._calls[call.call_id]

    def _free_activity(self, peer: Peer) -> _Activity:
        for activity in self._activities.values():
            if activity.call is None and activity.peer == peer:
                return activity
        activity = _Activity(self._new_uuid(), peer)
        self._activities[activity.uuid] = activity
        return activity

    # --- sending -------------------------------------------------------------------------------------------

    def _send(self, call: _Call, pdu: RpcPdu, body: bytes) -> None:
        stamped = replace(pdu, body=body, serial=call.serial)
        call.serial = (call.serial + 1) & 0xFFFF
        self._out.append(Datagram(call.local_port, call.peer, emit_rpc(stamped)))

    def _send_fack(self, peer: Peer, local_port: int, pdu: RpcPdu, number: int) -> None:
        body = emit_fack(fack_body(pdu.serial), little_endian=pdu.little_endian)
        fack = replace(
            pdu,
            packet_type=int(PacketType.FACK),
            flags1=0,
            flags2=0,
            fragment_number=number,
            serial=0,
            body=body,
            trailer=b"",
        )
        self._out.append(Datagram(local_port, peer, emit_rpc(fack)))

    _TRANSITIONS: ClassVar[dict[tuple[ClientState, _Event], tuple[ClientState, _Action | None]]] = {
        (ClientState.SENDING, _Event.FACK): (ClientState.SENDING, _slide),
        (ClientState.SENDING, _Event.ALL_SENT): (ClientState.WAITING, None),
        (ClientState.SENDING, _Event.MORE_TO_SEND): (ClientState.SENDING, None),
        (ClientState.SENDING, _Event.WORKING): (ClientState.WAITING, _be_patient),
        (ClientState.SENDING, _Event.NOCALL): (ClientState.SENDING, _send_again),
        (ClientState.SENDING, _Event.RESPONSE): (ClientState.RECEIVING, _collect),
        (ClientState.SENDING, _Event.REFUSED): (ClientState.SENDING, _refused),
        (ClientState.SENDING, _Event.RETRY): (ClientState.SENDING, _resume),
        (ClientState.SENDING, _Event.FAILED): (ClientState.DONE, _close),
        (ClientState.SENDING, _Event.CANCELLED): (ClientState.DONE, _close),
        (ClientState.WAITING, _Event.FACK): (ClientState.WAITING, _slide),
        (ClientState.WAITING, _Event.ALL_SENT): (ClientState.WAITING, None),
        (ClientState.WAITING, _Event.MORE_TO_SEND): (ClientState.SENDING, None),
        (ClientState.WAITING, _Event.WORKING): (ClientState.WAITING, _be_patient),
        (ClientState.WAITING, _Event.NOCALL): (ClientState.SENDING, _send_again),
        (ClientState.WAITING, _Event.RESPONSE): (ClientState.RECEIVING, _collect),
        (ClientState.WAITING, _Event.REFUSED): (ClientState.WAITING, _refused),
        (ClientState.WAITING, _Event.RETRY): (ClientState.WAITING, _retry),
        (ClientState.WAITING, _Event.FAILED): (ClientState.DONE, _close),
        (ClientState.WAITING, _Event.CANCELLED): (ClientState.DONE, _close),
        (ClientState.RECEIVING, _Event.NOCALL): (ClientState.SENDING, _send_again),
        (ClientState.RECEIVING, _Event.RESPONSE): (ClientState.RECEIVING, _collect),
        (ClientState.RECEIVING, _Event.COMPLETED): (ClientState.RECEIVING, _deliver),
        (ClientState.RECEIVING, _Event.RETURNED): (ClientState.DONE, _close),
        (ClientState.RECEIVING, _Event.REFUSED): (ClientState.RECEIVING, _refused),
        (ClientState.RECEIVING, _Event.RETRY): (ClientState.RECEIVING, _ping),
        (ClientState.RECEIVING, _Event.FAILED): (ClientState.DONE, _close),
        (ClientState.RECEIVING, _Event.CANCELLED): (ClientState.DONE, _close),
    }


_EVENTS_OF_TYPES: Final[dict[int, _Event]] = {
    PacketType.RESPONSE: _Event.RESPONSE,
    PacketType.FAULT: _Event.REFUSED,
    PacketType.REJECT: _Event.REFUSED,
    PacketType.WORKING: _Event.WORKING,
    PacketType.NOCALL: _Event.NOCALL,
    PacketType.FACK: _Event.FACK,
}
