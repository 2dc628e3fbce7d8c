"""The called end of connectionless RPC: a device's context management port, or a controller's for ApplicationReady.

A client numbers its calls within an *activity*.  The server keeps one row per activity (C706 chapter 10, the
connectionless server machine); what a datagram does depends on the row's state and on whether the datagram's sequence
number is new, the same or old:

=========  ======================================================================================
IDLE       no call, or the client acknowledged the last reply
RECEIVING  fragments of a request are arriving
EXECUTING  the application holds the call; a repeated request or a ping is answered *working*
REPLYING   a fragmented reply is on its way and not acknowledged to its end
REPLIED    the reply is kept, and sent again when the request or a ping comes again
=========  ======================================================================================

Driven by datagrams, by :meth:`RpcServer.respond` and :meth:`RpcServer.fault`, and by time.  Everything that a stranger
can make it keep is bounded: activities, open calls, and octets held in all.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from ipaddress import IPv4Address
from typing import TYPE_CHECKING, ClassVar, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.rpc_endpoints import EndpointMapper
from pnfarm.protocols.profinet.rpc_events import (
    CallCancelled,
    CallKey,
    CallReceived,
    Interface,
    LateAnswers,
    RpcServerConfig,
    ServerEvent,
)
from pnfarm.protocols.profinet.rpc_fragments import (
    STUB_MAX,
    Datagram,
    FragmentSender,
    Peer,
    Reassembly,
    fack_body,
    is_newer,
)
from pnfarm.protocols.profinet.wire.rpc import (
    BODY_MAX,
    FRAGMENT_NONE,
    NIL_UUID,
    UUID_EPM,
    Flags1,
    NcaStatus,
    PacketType,
    PnioStatus,
    ResponseArgs,
    RpcPdu,
    args_length_invalid,
    emit_fack,
    emit_response_args,
    emit_rpc,
    emit_status,
    parse_fack,
    parse_request_args,
    parse_rpc,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from uuid import UUID

    _Action = Callable[["RpcServer", "_Activity", RpcPdu | None, int], None]

__all__ = [
    "CallCancelled",
    "CallKey",
    "CallReceived",
    "Datagram",
    "Interface",
    "Peer",
    "RpcServer",
    "RpcServerConfig",
    "ServerState",
]


NO_ADDRESS: Final = IPv4Address(0)


class ServerState(Enum):
    """States of one activity."""

    IDLE = auto()
    RECEIVING = auto()
    EXECUTING = auto()
    REPLYING = auto()
    REPLIED = auto()


class _Event(Enum):
    REQUEST_NEW = auto()
    REQUEST_SAME = auto()
    COMPLETED = auto()
    ANSWERED = auto()
    PING = auto()
    FACK = auto()
    ACK = auto()
    CANCEL = auto()
    DELIVERED = auto()
    RETRY = auto()
    GAVE_UP = auto()


@dataclass(slots=True)
class _Activity:
    key: tuple[IPv4Address, UUID]
    peer: Peer
    local_port: int
    request: RpcPdu
    touched: int
    state: ServerState = ServerState.IDLE
    deadline: int = 0
    reassembly: Reassembly = field(default_factory=lambda: Reassembly(STUB_MAX))
    args_maximum: int = 0
    source_mac: bytes | None = None
    reply_type: int = PacketType.RESPONSE
    reply: FragmentSender | None = None
    serial: int = 0
    tries: int = 0

    @property
    def call(self) -> CallKey:
        return CallKey(*self.key, self.request.sequence)

    @property
    def held(self) -> int:
        return self.reassembly.octets + (self.reply.octets if self.reply else 0)


class RpcServer:
    """See the module's text.  ``address`` is the device's own, which the endpoint mapper tells; 0.0.0.0 is none yet.

    ``late``, when set, is asked about every answer of the application; one that is kept back leaves its call EXECUTING.
    """

    def __init__(self, config: RpcServerConfig, address: IPv4Address = NO_ADDRESS) -> None:
        self.config = config
        self.dropped: Counter[str] = Counter()
        self._interfaces = {interface.uuid: interface for interface in config.interfaces}
        self._mapper = EndpointMapper(config.endpoints, config.port, address) if config.endpoints else None
        if self._mapper is not None:
            self._interfaces[UUID_EPM] = Interface(UUID_EPM, self._mapper.opnums, self._mapper.version)
        self._activities: dict[tuple[IPv4Address, UUID], _Activity] = {}
        self._out: list[Datagram] = []
        self._events: list[ServerEvent] = []
        self.late: LateAnswers | None = None
        self._kept: list[tuple[int, CallKey, PnioStatus, bytes]] = []

    # --- the outside ---------------------------------------------------------------------------------------

    def set_address(self, address: IPv4Address) -> None:
        """Tell the endpoint mapper that the device's address changed."""
        if self._mapper is not None:
            self._mapper.address = address

    def receive(self, peer: Peer, local_port: int, data: bytes, now: int, source_mac: bytes | None = None) -> None:
        """Take one UDP payload; what is wrong with it is counted in ``dropped`` and, where C706 says so, rejected."""
        try:
            pdu = parse_rpc(data)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return
        if pdu.flags1 & (Flags1.MAYBE | Flags1.BROADCAST):
            # PROFINET uses neither, and neither may be answered with a reject
            self.dropped["maybe-or-broadcast"] += 1
            return
        match pdu.kind:
            case PacketType.REQUEST:
                self._request(peer, local_port, pdu, now, source_mac)
            case PacketType.PING:
                self._about_call(_Event.PING, peer, local_port, pdu, now)
            case PacketType.FACK:
                self._about_call(_Event.FACK, peer, local_port, pdu, now)
            case PacketType.ACK:
                self._about_call(_Event.ACK, peer, local_port, pdu, now)
            case PacketType.CL_CANCEL:
                self._about_call(_Event.CANCEL, peer, local_port, pdu, now)
            case _:
                self.dropped["unexpected-type"] += 1

    def respond(self, call: CallKey, status: PnioStatus, payload: bytes, now: int) -> bool:
        """Answer a call; False when it is no longer open.

        A payload above the call's ``args_maximum`` cannot be returned: the client gets the fault
        ``nca_out_args_too_big`` instead.
        """
        activity = self._open_call(call)
        if activity is None:
            return False
        wait_ns = self.late.wait_ns(call, activity.request.opnum, now) if self.late is not None else 0
        if wait_ns > 0:
            self._kept.append((now + wait_ns, call, status, payload))
            return True
        return self._respond(activity, status, payload, now)

    def release_answers(self, now: int) -> None:
        """Let every answer go that is kept back."""
        kept, self._kept = self._kept, []
        for _, call, status, payload in kept:
            self._answer_late(call, status, payload, now)

    def _answer_late(self, call: CallKey, status: PnioStatus, payload: bytes, now: int) -> None:
        activity = self._open_call(call)
        sent = activity is not None and self._respond(activity, status, payload, now)
        if self.late is not None:
            self.late.left(call, sent=sent)

    def _respond(self, activity: _Activity, status: PnioStatus, payload: bytes, now: int) -> bool:
        if len(payload) > min(activity.args_maximum, STUB_MAX - 24):
            return self.fault(activity.call, NcaStatus.OUT_ARGS_TOO_BIG, now)
        args = ResponseArgs(status, payload, activity.args_maximum)
        stub = emit_response_args(args, little_endian=activity.request.little_endian)
        self._answer(activity, PacketType.RESPONSE, stub, now)
        return True

    def fault(self, call: CallKey, code: int, now: int) -> bool:
        """Answer a call with a fault status (:class:`NcaStatus`); False when it is no longer open."""
        activity = self._open_call(call)
        if activity is None:
            return False
        self._answer(activity, PacketType.FAULT, emit_status(code, little_endian=activity.request.little_endian), now)
        return True

    def to_send(self, now: int) -> list[Datagram]:  # noqa: ARG002  # the convention of all machines
        out, self._out = self._out, []
        return out

    def events(self) -> list[ServerEvent]:
        events, self._events = self._events, []
        return events

    def next_deadline(self) -> int | None:
        first = min((activity.deadline for activity in self._activities.values()), default=None)
        if self._kept:
            kept = min(entry[0] for entry in self._kept)
            return kept if first is None else min(first, kept)
        return first

    def handle_timeout(self, now: int) -> None:
        for kept in [entry for entry in self._kept if entry[0] <= now]:
            self._kept.remove(kept)
            self._answer_late(*kept[1:], now)
        for activity in [row for row in self._activities.values() if row.deadline <= now]:
            if activity.state is not ServerState.REPLYING:
                self._forget(activity, f"expired-{activity.state.name.lower()}")
            elif activity.tries >= self.config.fragment_tries:
                self._fire(activity, _Event.GAVE_UP, None, now)
            else:
                self._fire(activity, _Event.RETRY, None, now)

    @property
    def activities(self) -> dict[CallKey, ServerState]:
        """The last call of every remembered activity and how far it is."""
        return {activity.call: activity.state for activity in self._activities.values()}

    @property
    def held_octets(self) -> int:
        """Octets of unfinished requests and kept replies."""
        return sum(activity.held for activity in self._activities.values())

    # --- what a datagram means -----------------------------------------------------------------------------

    def _request(self, peer: Peer, local_port: int, pdu: RpcPdu, now: int, source_mac: bytes | None) -> None:
        refusal = self._refusal(pdu)
        if refusal is not None:
            self._reject(peer, local_port, pdu, refusal)
            return
        key = (peer.ip, pdu.activity)
        activity = self._activities.get(key)
        if activity is None:
            if not self._make_room(None):
                self._reject(peer, local_port, pdu, NcaStatus.SERVER_TOO_BUSY)
                return
            activity = self._activities[key] = _Activity(key, peer, local_port, pdu, now)
            event = _Event.REQUEST_NEW
        elif pdu.sequence == activity.request.sequence:
            event = _Event.REQUEST_SAME
        elif is_newer(pdu.sequence, activity.request.sequence) or now - activity.touched >= self.config.stale_ns:
            event = _Event.REQUEST_NEW
        else:
            self.dropped["old-sequence"] += 1
            return
        activity.peer, activity.local_port, activity.source_mac = peer, local_port, source_mac
        activity.touched = now
        self._fire(activity, event, pdu, now)

    def _refusal(self, pdu: RpcPdu) -> NcaStatus | None:
        interface = self._interfaces.get(pdu.interface)
        major, minor = pdu.interface_version & 0xFFFF, pdu.interface_version >> 16
        if interface is None or major != interface.version or minor:
            return NcaStatus.UNK_IF
        if pdu.opnum not in interface.opnums:
            return NcaStatus.OP_RNG_ERROR
        if pdu.activity == NIL_UUID:
            return NcaStatus.BAD_ACTID
        if pdu.auth_protocol:
            return NcaStatus.UNSUPPORTED_AUTHN_LEVEL
        if pdu.trailer or len(pdu.body) > BODY_MAX:
            return NcaStatus.PROTO_ERROR
        if pdu.server_boot_time and self.config.boot_time and pdu.server_boot_time != self.config.boot_time:
            return NcaStatus.WRONG_BOOT_TIME
        return None

    def _about_call(self, event: _Event, peer: Peer, local_port: int, pdu: RpcPdu, now: int) -> None:
        activity = self._activities.get((peer.ip, pdu.activity))
        if activity is not None and activity.request.sequence == pdu.sequence:
            activity.peer, activity.local_port = peer, local_port
            self._fire(activity, event, pdu, now)
        elif event is _Event.PING:
            self._send_to(peer, local_port, _answer_to(pdu, PacketType.NOCALL, fragment_number=FRAGMENT_NONE))
        else:
            self.dropped[f"no-call-for-{event.name.lower()}"] += 1

    def _open_call(self, call: CallKey) -> _Activity | None:
        activity = self._activities.get((call.ip, call.activity))
        if activity is None or activity.state is not ServerState.EXECUTING or activity.call != call:
            self.dropped["late-answer"] += 1
            return None
        return activity

    def _answer(self, activity: _Activity, reply_type: PacketType, stub: bytes, now: int) -> None:
        if not self._make_room(activity, len(stub)):
            # this call is the last that has a right to memory: what others keep was let go already
            self.dropped["held-octets"] += 1
            reply_type = PacketType.FAULT
            stub = emit_status(NcaStatus.FAULT_REMOTE_NO_MEMORY, little_endian=activity.request.little_endian)
        activity.reply_type = reply_type
        activity.reply = FragmentSender(stub, self.config.fragment_octets)
        self._fire(activity, _Event.ANSWERED, None, now)

    # --- the machine ---------------------------------------------------------------------------------------

    def _fire(self, activity: _Activity, event: _Event, pdu: RpcPdu | None, now: int) -> None:
        row = self._TRANSITIONS.get((activity.state, event))
        if row is None:
            self.dropped[f"{event.name.lower().replace('_', '-')}-in-{activity.state.name.lower()}"] += 1
            return
        state, action = row
        self._enter(activity, state, now)
        if action is not None:
            action(self, activity, pdu, now)

    def _enter(self, activity: _Activity, state: ServerState, now: int) -> None:
        """Write the state; the only place that does."""
        if state is activity.state and state in {ServerState.EXECUTING, ServerState.REPLYING}:
            return
        activity.state = state
        waits = {
            ServerState.IDLE: self.config.idle_ns,
            ServerState.RECEIVING: self.config.reassembly_ns,
            ServerState.EXECUTING: self.config.execution_ns,
            ServerState.REPLYING: self.config.fragment_retry_ns,
            ServerState.REPLIED: self.config.idle_ns,
        }
        activity.deadline = now + waits[state]

    def _begin(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        activity.request = pdu
        activity.reassembly = Reassembly(STUB_MAX)
        activity.reply = None
        activity.serial = activity.tries = 0
        self._collect(activity, pdu, now)

    def _collect(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        if pdu.drep != activity.request.drep or pdu.opnum != activity.request.opnum:
            self.dropped["fragments-differ"] += 1
            return
        if not self._make_room(activity, len(pdu.body)):
            self._forget(activity, "held-octets")
            return
        number = pdu.fragment_number if pdu.is_fragment else 0
        reason = activity.reassembly.add(number, pdu.body, last=pdu.is_last)
        if reason is not None:
            self.dropped[reason] += 1
        if reason == "too-long":
            self._reject(activity.peer, activity.local_port, pdu, NcaStatus.PROTO_ERROR)
            self._forget(activity, "request-too-long")
        elif activity.reassembly.complete:
            self._fire(activity, _Event.COMPLETED, pdu, now)
        elif pdu.wants_fack:
            self._fack(activity, pdu)

    def _indicate(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        request = activity.request
        stub, activity.reassembly = activity.reassembly.stub(), Reassembly(STUB_MAX)
        open_calls = sum(row.state is ServerState.EXECUTING for row in self._activities.values())
        if open_calls > self.config.calls_max:
            self._reject(activity.peer, activity.local_port, pdu, NcaStatus.SERVER_TOO_BUSY)
            self._forget(activity, "calls-max")
            return
        if request.interface == UUID_EPM and self._mapper is not None:
            reply_type, answer = self._mapper.answer(request.opnum, stub, little_endian=request.little_endian)
            self._answer(activity, reply_type, answer, now)
            return
        try:
            args = parse_request_args(stub, little_endian=request.little_endian)
        except DecodeError as exc:
            self.dropped[f"args-{exc.reason}"] += 1
            activity.args_maximum = 0
            self.respond(activity.call, args_length_invalid(request.opnum), b"", now)
            return
        activity.args_maximum = args.args_maximum
        self._events.append(
            CallReceived(
                activity.call,
                request.interface,
                request.object_uuid,
                request.opnum,
                args.args_maximum,
                args.payload,
                activity.peer,
                activity.local_port,
                activity.source_mac,
            )
        )

    def _working(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        assert pdu is not None
        self._send(activity, _answer_to(pdu, PacketType.WORKING))

    def _nocall(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        assert pdu is not None
        self._send(activity, _answer_to(pdu, PacketType.NOCALL, fragment_number=FRAGMENT_NONE))

    def _arrived(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        """Answer a ping during reassembly: no call yet, and this is what has arrived of it."""
        assert pdu is not None
        body = emit_fack(fack_body(pdu.serial), little_endian=pdu.little_endian)
        number = activity.reassembly.acknowledged
        self._send(activity, _answer_to(pdu, PacketType.NOCALL, fragment_number=number, body=body))

    def _fack(self, activity: _Activity, pdu: RpcPdu) -> None:
        body = emit_fack(fack_body(pdu.serial), little_endian=pdu.little_endian)
        number = activity.reassembly.acknowledged
        self._send(activity, _answer_to(pdu, PacketType.FACK, fragment_number=number, body=body))

    def _reply(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:
        """Send the reply from its beginning: the first time, or because the request came again."""
        assert activity.reply is not None
        activity.reply.restart()
        activity.tries = 0
        self._transmit(activity, pdu, now)

    def _resume(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:
        assert activity.reply is not None
        activity.reply.rewind()
        self._transmit(activity, pdu, now)

    def _transmit(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        sender = activity.reply
        assert sender is not None
        for fragment in sender.due():
            flags = fragment.flags1 if sender.fragmented else Flags1.NO_FACK | Flags1.LAST_FRAGMENT
            answer = replace(
                _answer_to(activity.request, activity.reply_type, fragment_number=fragment.number, body=fragment.body),
                flags1=int(flags),
                serial=activity.serial,
            )
            activity.serial = (activity.serial + 1) & 0xFFFF
            self._send(activity, answer)
        if sender.fragmented:
            activity.deadline = now + (self.config.fragment_retry_ns << min(activity.tries, self.config.fragment_tries))
            activity.tries += 1
        else:
            self._fire(activity, _Event.DELIVERED, None, now)

    def _slide(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        assert activity.reply is not None
        try:
            body = parse_fack(pdu.body, little_endian=pdu.little_endian)
        except DecodeError as exc:
            self.dropped[f"fack-{exc.reason}"] += 1
            return
        if not activity.reply.acknowledge(pdu.fragment_number, body):
            self.dropped["stale-fack"] += 1
            return
        activity.touched = now
        if activity.reply.delivered:
            self._fire(activity, _Event.DELIVERED, None, now)
            return
        activity.tries = 0
        self._transmit(activity, pdu, now)

    def _release(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        activity.reply = None

    def _cancel(self, activity: _Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        assert pdu is not None
        self._events.append(CallCancelled(activity.call, activity.peer))
        self._send(activity, _answer_to(pdu, PacketType.CANCEL_ACK))

    # --- bounds --------------------------------------------------------------------------------------------

    def _make_room(self, keeper: _Activity | None, octets: int = 0) -> bool:
        """Let go of what matters least until ``octets`` more, or one more activity, fit; False when they cannot."""

        def fits() -> bool:
            if keeper is None and len(self._activities) >= self.config.activities_max:
                return False
            return self.held_octets + octets <= self.config.held_octets_max

        for state in (ServerState.IDLE, ServerState.REPLIED, ServerState.RECEIVING, ServerState.REPLYING):
            if fits():
                return True
            rows = [row for row in self._activities.values() if row.state is state and row is not keeper]
            for row in sorted(rows, key=lambda row: row.touched):
                self._forget(row, "evicted")
                if fits():
                    return True
        return fits()

    def _forget(self, activity: _Activity, reason: str) -> None:
        if self._activities.pop(activity.key, None) is not None:
            self.dropped[reason] += 1

    # --- sending -------------------------------------------------------------------------------------------

    def _reject(self, peer: Peer, local_port: int, pdu: RpcPdu, status: NcaStatus) -> None:
        self.dropped[f"reject-{status.name.lower().replace('_', '-')}"] += 1
        body = emit_status(status, little_endian=pdu.little_endian)
        self._send_to(peer, local_port, _answer_to(pdu, PacketType.REJECT, body=body))

    def _send(self, activity: _Activity, pdu: RpcPdu) -> None:
        self._send_to(activity.peer, activity.local_port, pdu)

    def _send_to(self, peer: Peer, local_port: int, pdu: RpcPdu) -> None:
        stamped = replace(pdu, server_boot_time=self.config.boot_time or pdu.server_boot_time)
        self._out.append(Datagram(local_port, peer, emit_rpc(stamped)))

    _TRANSITIONS: ClassVar[dict[tuple[ServerState, _Event], tuple[ServerState, _Action | None]]] = {
        (ServerState.IDLE, _Event.REQUEST_NEW): (ServerState.RECEIVING, _begin),
        (ServerState.RECEIVING, _Event.REQUEST_NEW): (ServerState.RECEIVING, _begin),
        (ServerState.RECEIVING, _Event.REQUEST_SAME): (ServerState.RECEIVING, _collect),
        (ServerState.RECEIVING, _Event.COMPLETED): (ServerState.EXECUTING, _indicate),
        (ServerState.RECEIVING, _Event.PING): (ServerState.RECEIVING, _arrived),
        (ServerState.EXECUTING, _Event.REQUEST_NEW): (ServerState.RECEIVING, _begin),
        (ServerState.EXECUTING, _Event.REQUEST_SAME): (ServerState.EXECUTING, _working),
        (ServerState.EXECUTING, _Event.PING): (ServerState.EXECUTING, _working),
        (ServerState.EXECUTING, _Event.CANCEL): (ServerState.EXECUTING, _cancel),
        (ServerState.EXECUTING, _Event.ANSWERED): (ServerState.REPLYING, _reply),
        (ServerState.REPLYING, _Event.REQUEST_NEW): (ServerState.RECEIVING, _begin),
        (ServerState.REPLYING, _Event.REQUEST_SAME): (ServerState.REPLYING, _resume),
        (ServerState.REPLYING, _Event.PING): (ServerState.REPLYING, _resume),
        (ServerState.REPLYING, _Event.FACK): (ServerState.REPLYING, _slide),
        (ServerState.REPLYING, _Event.RETRY): (ServerState.REPLYING, _resume),
        (ServerState.REPLYING, _Event.DELIVERED): (ServerState.REPLIED, None),
        (ServerState.REPLYING, _Event.GAVE_UP): (ServerState.REPLIED, None),
        (ServerState.REPLYING, _Event.ACK): (ServerState.IDLE, _release),
        (ServerState.REPLIED, _Event.REQUEST_NEW): (ServerState.RECEIVING, _begin),
        (ServerState.REPLIED, _Event.REQUEST_SAME): (ServerState.REPLYING, _reply),
        (ServerState.REPLIED, _Event.PING): (ServerState.REPLYING, _reply),
        (ServerState.REPLIED, _Event.ACK): (ServerState.IDLE, _release),
        (ServerState.IDLE, _Event.PING): (ServerState.IDLE, _nocall),
    }


def _answer_to(pdu: RpcPdu, packet_type: int, *, fragment_number: int = 0, body: bytes = b"") -> RpcPdu:
    return replace(
        pdu,
        packet_type=int(packet_type),
        flags1=0,
        flags2=0,
        fragment_number=fragment_number,
        serial=0,
        body=body,
        trailer=b"",
        auth_protocol=0,
    )
