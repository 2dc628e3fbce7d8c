"""The server side of connectionless RPC: a device's context management port, or a controller's for ApplicationReady.

A client numbers its calls within an *activity*.  The server keeps one row per activity (C706 chapter 10, the
connectionless server machine); what a datagram does depends on the row's state and on whether the datagram's sequence
number is new, the same or old:

=========  ======================================================================================
IDLE       no call, or nothing is kept of the last one but its number
RECEIVING  fragments of a request are arriving
EXECUTING  the application holds the call; a repeated request or a ping is answered *working*
ORPHANED   the client gave the call up: an answer goes nowhere, and the call does not run again
REPLYING   a reply is on its way and not acknowledged to its end
REPLIED    the reply is kept, and sent again when the request or a ping comes again
=========  ======================================================================================

A call runs once.  The exceptions are C706's: a call whose client marked it idempotent runs again when it comes again
after its reply was acknowledged or is too old to be kept; any other is then rejected.  A client that restarts
its numbers is accepted after a while (``stale_ns``), or when it calls another operation under the last number.

Driven by datagrams, by :meth:`RpcServer.respond` and :meth:`RpcServer.fault`, and by time.  Everything that a peer
can make it keep is bounded: activities, open calls, and octets held in all.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from ipaddress import IPv4Address
from operator import attrgetter
from typing import Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.rpc.activities import TRANSITIONS, Activity, ActivityTable, ServerState
from pnfarm.protocols.profinet.rpc.activities import ServerEventKind as _Event
from pnfarm.protocols.profinet.rpc.answers import answer_to, cancel_ack, fack, nocall, nocall_so_far, reject
from pnfarm.protocols.profinet.rpc.endpoints import EndpointMapper
from pnfarm.protocols.profinet.rpc.events import (
    CallKey,
    CallMisdirected,
    CallReceived,
    Interface,
    LateAnswers,
    RpcServerConfig,
    ServerEvent,
)
from pnfarm.protocols.profinet.rpc.fragments import (
    STUB_MAX,
    Datagram,
    FragmentSender,
    Peer,
    Reassembly,
    is_newer,
)
from pnfarm.protocols.profinet.rpc.offer import Offer, read_arguments
from pnfarm.protocols.profinet.wire.rpc.bodies import parse_cancel, parse_fack
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    ARGS_HEADER_LENGTH,
    UUID_EPM,
    Flags1,
    NcaStatus,
    PacketType,
    PnioStatus,
    ResponseArgs,
    RpcPdu,
    args_length_invalid,
    emit_response_args,
    emit_rpc,
    emit_status,
    parse_rpc,
)
from pnfarm.wire.octets import Reader

__all__ = [
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
#: How long an activity may stay in a state.
_WAITS: Final = {
    ServerState.IDLE: attrgetter("idle_ns"),
    ServerState.RECEIVING: attrgetter("reassembly_ns"),
    ServerState.EXECUTING: attrgetter("execution_ns"),
    ServerState.ORPHANED: attrgetter("execution_ns"),
    ServerState.REPLYING: attrgetter("fragment_retry_ns"),
    ServerState.REPLIED: attrgetter("reply_ns"),
}
#: Flags of an answer in one PDU.
_WHOLE: Final = int(Flags1.NO_FACK | Flags1.LAST_FRAGMENT)


class RpcServer:
    """See the module's docstring.  ``address`` is the device's, which the endpoint mapper reports; 0.0.0.0: none yet.

    ``late``, when set, is asked about every answer of the application; one that is held back leaves its call EXECUTING.
    """

    def __init__(self, config: RpcServerConfig, address: IPv4Address = NO_ADDRESS) -> None:
        self.config = config
        self.dropped: Counter[str] = Counter()
        self._mapper = EndpointMapper(config.endpoints, config.port, address) if config.endpoints else None
        own = () if self._mapper is None else (Interface(UUID_EPM, self._mapper.opnums, self._mapper.version),)
        self._offer = Offer((*config.interfaces, *own), config.endpoints, config.boot_time)
        self._activities = ActivityTable(config.activities_max, config.held_octets_max, self.dropped)
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
        if not peer.port:
            # nothing could be answered
            self.dropped["source-port-0"] += 1
            return
        if pdu.unanswered:
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
                self._about_call(_Event.CANCEL if pdu.body else _Event.ORPHAN, peer, local_port, pdu, now)
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
        """Send every answer that is held back."""
        kept, self._kept = self._kept, []
        for _, call, status, payload in kept:
            self._answer_late(call, status, payload, now)

    def _answer_late(self, call: CallKey, status: PnioStatus, payload: bytes, now: int) -> None:
        activity = self._open_call(call)
        sent = activity is not None and self._respond(activity, status, payload, now)
        if self.late is not None:
            self.late.left(call, sent=sent)

    def _respond(self, activity: Activity, status: PnioStatus, payload: bytes, now: int) -> bool:
        if len(payload) > min(activity.args_maximum, STUB_MAX - ARGS_HEADER_LENGTH):
            self._answer_status(activity, NcaStatus.OUT_ARGS_TOO_BIG, now)
            return True
        args = ResponseArgs(status, payload, activity.args_maximum)
        stub = emit_response_args(args, little_endian=activity.request.little_endian)
        self._answer(activity, PacketType.RESPONSE, stub, now)
        return True

    def fault(self, call: CallKey, code: int, now: int) -> bool:
        """Answer a call with a fault status (:class:`NcaStatus`); False when it is no longer open."""
        activity = self._open_call(call)
        if activity is None:
            return False
        self._answer_status(activity, code, now)
        return True

    def to_send(self, now: int) -> list[Datagram]:  # noqa: ARG002  # the convention of all machines
        out, self._out = self._out, []
        return out

    def events(self) -> list[ServerEvent]:
        events, self._events = self._events, []
        return events

    def next_deadline(self) -> int | None:
        first = self._activities.next_deadline()
        if self._kept:
            kept = min(entry[0] for entry in self._kept)
            return kept if first is None else min(first, kept)
        return first

    def handle_timeout(self, now: int) -> None:
        for late in [entry for entry in self._kept if entry[0] <= now]:
            self._kept.remove(late)
            self._answer_late(*late[1:], now)
        for activity in self._activities.due(now):
            match activity.state:
                case ServerState.IDLE | ServerState.RECEIVING:
                    self._activities.forget(activity, f"expired-{activity.state.name.lower()}")
                case ServerState.REPLYING if activity.tries < self.config.fragment_tries:
                    self._fire(activity, _Event.RETRY, None, now)
                case _:
                    if activity.unfinished:
                        self.dropped[f"expired-{activity.state.name.lower()}"] += 1
                    self._fire(activity, _Event.EXPIRED, None, now)

    @property
    def activities(self) -> dict[CallKey, ServerState]:
        """The last call of every remembered activity and how far it is."""
        return {activity.call: activity.state for activity in self._activities}

    @property
    def held_octets(self) -> int:
        """Octets of unfinished requests and kept replies."""
        return self._activities.held_octets

    # --- what a datagram means -----------------------------------------------------------------------------

    def _request(self, peer: Peer, local_port: int, pdu: RpcPdu, now: int, source_mac: bytes | None) -> None:
        refusal = self._offer.refusal(pdu)
        if refusal is not None:
            if self._offer.is_for_another(pdu) and not (pdu.is_fragment and pdu.fragment_number):
                self._events.append(CallMisdirected(pdu.object_uuid, pdu.opnum, peer, source_mac))
            self._reject(peer, local_port, pdu, refusal)
            return
        activity = self._activities.get((peer.ip, pdu.activity))
        if activity is None:
            activity = Activity((peer.ip, pdu.activity), peer, local_port, pdu, now)
            if not self._activities.add(activity):
                self._reject(peer, local_port, pdu, NcaStatus.SERVER_TOO_BUSY)
                return
            event = _Event.REQUEST_NEW
        elif activity.lookups_only and pdu.interface != UUID_EPM:
            # a client may restart its numbers for the interface that the endpoint mapper named; C706 does not
            event = _Event.REQUEST_NEW
        elif pdu.sequence == activity.request.sequence:
            event = _Event.REQUEST_NEW if activity.runs_again(pdu) else _Event.REQUEST_SAME
        elif is_newer(pdu.sequence, activity.request.sequence) or now - activity.touched >= self.config.stale_ns:
            event = _Event.REQUEST_NEW
        else:
            self.dropped["old-sequence"] += 1
            return
        activity.peer, activity.local_port, activity.source_mac = peer, local_port, source_mac
        activity.touched = now
        self._fire(activity, event, pdu, now)

    def _about_call(self, event: _Event, peer: Peer, local_port: int, pdu: RpcPdu, now: int) -> None:
        if self._offer.is_of_another_boot(pdu):
            self._reject(peer, local_port, pdu, NcaStatus.WRONG_BOOT_TIME)
            return
        activity = self._activities.get((peer.ip, pdu.activity))
        newer = activity is None or is_newer(pdu.sequence, activity.request.sequence)
        if activity is not None and activity.request.sequence == pdu.sequence:
            activity.peer, activity.local_port = peer, local_port
            self._fire(activity, event, pdu, now)
        elif event is _Event.PING and newer:
            self._send_to(peer, local_port, nocall(pdu))
        elif event is _Event.ORPHAN and activity is not None and newer:
            # the call that it gives up never arrived
            self._send_to(peer, local_port, cancel_ack(pdu, None, accepting=False))
        else:
            self.dropped[f"no-call-for-{event.name.lower()}"] += 1

    def _open_call(self, call: CallKey) -> Activity | None:
        activity = self._activities.get((call.ip, call.activity))
        if activity is None or activity.state is not ServerState.EXECUTING or activity.call != call:
            self.dropped["late-answer"] += 1
            return None
        return activity

    def _answer_status(
        self, activity: Activity, code: int, now: int, reply_type: PacketType = PacketType.FAULT
    ) -> None:
        self._answer(activity, reply_type, emit_status(code, little_endian=activity.request.little_endian), now)

    def _answer(self, activity: Activity, reply_type: PacketType, stub: bytes, now: int) -> None:
        if not self._activities.make_room(activity, len(stub)):
            # no memory although everything that may be dropped was dropped: this call has to do without its answer
            self.dropped["held-octets"] += 1
            reply_type = PacketType.FAULT
            stub = emit_status(NcaStatus.FAULT_REMOTE_NO_MEMORY, little_endian=activity.request.little_endian)
        activity.reply_type = reply_type
        activity.reply = FragmentSender(stub, self.config.fragment_octets)
        self._fire(activity, _Event.ANSWERED, None, now)

    # --- the machine ---------------------------------------------------------------------------------------

    def _fire(self, activity: Activity, event: _Event, pdu: RpcPdu | None, now: int) -> None:
        row = TRANSITIONS.get((activity.state, event))
        if row is None:
            self.dropped[f"{event.name.lower().replace('_', '-')}-in-{activity.state.name.lower()}"] += 1
            return
        state, action = row
        self._enter(activity, state, now)
        if action is not None:
            getattr(self, f"_do_{action}")(activity, pdu, now)
        self._activities.settle(activity)

    def _enter(self, activity: Activity, state: ServerState, now: int) -> None:
        """Move a row to a state and set its deadline; no other place does."""
        if state is not activity.state:
            self._activities.move(activity, state)
        elif state is ServerState.EXECUTING or state is ServerState.ORPHANED or state is ServerState.REPLYING:
            return
        activity.deadline = now + _WAITS[state](self.config)

    # receiving

    def _do_begin(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        activity.request = replace(pdu, body=b"")
        activity.lookups_only &= pdu.interface == UUID_EPM
        activity.reassembly = Reassembly(STUB_MAX)
        activity.reply = None
        activity.serial = activity.tries = 0
        self._do_collect(activity, pdu, now)

    def _do_collect(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        if pdu.drep != activity.request.drep or pdu.opnum != activity.request.opnum:
            self.dropped["fragments-differ"] += 1
            return
        if not self._activities.make_room(activity, len(pdu.body)):
            self._activities.forget(activity, "held-octets")
            return
        number = pdu.fragment_number if pdu.is_fragment else 0
        reason = activity.reassembly.add(number, pdu.body, last=pdu.is_last)
        if reason is not None:
            self.dropped[reason] += 1
        if reason == "too-long":
            self._reject(activity.peer, activity.local_port, pdu, NcaStatus.PROTO_ERROR)
            self._activities.forget(activity, "request-too-long")
            return
        if pdu.wants_fack:
            self._send(activity, fack(pdu, activity.reassembly.acknowledged))
        if activity.reassembly.complete:
            self._fire(activity, _Event.COMPLETED, pdu, now)

    def _do_indicate(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:
        assert pdu is not None
        request = activity.request
        activity.args_maximum = 0
        stub, activity.reassembly = activity.reassembly.stub(), Reassembly(STUB_MAX)
        if self._activities.count(ServerState.EXECUTING) > self.config.calls_max:
            self._reject(activity.peer, activity.local_port, pdu, NcaStatus.SERVER_TOO_BUSY)
            self._activities.forget(activity, "calls-max")
            return
        if request.interface == UUID_EPM and self._mapper is not None:
            reply_type, answer = self._mapper.answer(request.opnum, stub, little_endian=request.little_endian)
            self._answer(activity, reply_type, answer, now)
            return
        if len(stub) < ARGS_HEADER_LENGTH:
            # not even the counts, so there is nothing that a response could be made of
            self.dropped["args-short"] += 1
            self._answer_status(activity, NcaStatus.PROTO_ERROR, now, PacketType.REJECT)
            return
        activity.args_maximum = Reader(stub, request.little_endian).u32()
        try:
            args = read_arguments(stub, little_endian=request.little_endian)
        except DecodeError as exc:
            self.dropped[f"args-{exc.reason}"] += 1
            self.respond(activity.call, args_length_invalid(request.opnum), b"", now)
            return
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

    def _do_refuse_rerun(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        """A call that must not run twice came again, and its reply is gone."""
        assert pdu is not None
        if pdu.is_fragment and pdu.fragment_number:
            self.dropped["rerun-fragment"] += 1
        else:
            self._reject(activity.peer, activity.local_port, pdu, NcaStatus.PROTO_ERROR)

    # executing

    def _do_working(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        assert pdu is not None
        self._send(activity, answer_to(pdu, PacketType.WORKING))

    def _do_nocall(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        assert pdu is not None
        self._send(activity, nocall(pdu))

    def _do_arrived(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        """Answer a ping during reassembly."""
        assert pdu is not None
        self._send(activity, nocall_so_far(pdu, activity.reassembly.acknowledged))

    def _do_abandon(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        """The application never answered: inform the client, so that it does not repeat a call that may have run."""
        self._answer_status(activity, NcaStatus.FAULT_UNSPEC, now)

    # replying

    def _do_reply(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        """Send the reply from its beginning: the first time, or because the request came again."""
        assert activity.reply is not None
        activity.reply.restart()
        activity.tries = 0
        self._transmit(activity, now)

    def _do_resume(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:
        assert activity.reply is not None
        activity.reply.rewind()
        if pdu is not None:
            # the client is still there
            activity.tries = 0
        self._transmit(activity, now)

    def _transmit(self, activity: Activity, now: int) -> None:
        sender = activity.reply
        assert sender is not None
        for fragment in sender.due():
            answer = answer_to(
                activity.request,
                activity.reply_type,
                fragment_number=fragment.number,
                body=fragment.body,
                flags1=int(fragment.flags1) if sender.fragmented else _WHOLE,
                serial=activity.serial,
            )
            activity.serial = (activity.serial + 1) & 0xFFFF
            self._send(activity, answer)
        activity.tries += 1
        if sender.fragmented:
            activity.deadline = now + self.config.fragment_retry_ns
        elif activity.idempotent:
            self._fire(activity, _Event.DELIVERED, None, now)
        else:
            activity.deadline = now + self.config.resend_ns

    def _do_slide(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:
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
        self._transmit(activity, now)

    def _do_release(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        activity.reply = None

    # cancelling: with a body a cl_cancel asks to end the call, without one it orphans the call

    def _do_cancel(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        """The application may still answer."""
        self._acknowledge_cancel(activity, pdu, accepting=True)

    def _do_cancel_unbegun(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:
        """The call never reaches the application."""
        if self._acknowledge_cancel(activity, pdu, accepting=True):
            activity.reassembly = Reassembly(STUB_MAX)
            self._answer_status(activity, NcaStatus.FAULT_CANCEL, now)

    def _do_cancel_late(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        self._acknowledge_cancel(activity, pdu, accepting=False)

    def _acknowledge_cancel(self, activity: Activity, pdu: RpcPdu | None, *, accepting: bool) -> bool:
        assert pdu is not None
        try:
            cancel = parse_cancel(pdu.body, little_endian=pdu.little_endian)
        except DecodeError as exc:
            self.dropped[f"cancel-{exc.reason}"] += 1
            return False
        self._send(activity, cancel_ack(pdu, cancel, accepting=accepting))
        return True

    def _do_orphan(self, activity: Activity, pdu: RpcPdu | None, now: int) -> None:  # noqa: ARG002  # an action
        assert pdu is not None
        activity.reassembly, activity.reply = Reassembly(STUB_MAX), None
        self._send(activity, cancel_ack(pdu, None, accepting=False))

    # --- sending -------------------------------------------------------------------------------------------

    def _reject(self, peer: Peer, local_port: int, pdu: RpcPdu, status: NcaStatus) -> None:
        self.dropped[f"reject-{status.name.lower().replace('_', '-')}"] += 1
        # a client that knows another boot time would ignore a reject with ours
        self._send_to(peer, local_port, reject(pdu, status), stamp=status is not NcaStatus.WRONG_BOOT_TIME)

    def _send(self, activity: Activity, pdu: RpcPdu) -> None:
        self._send_to(activity.peer, activity.local_port, pdu)

    def _send_to(self, peer: Peer, local_port: int, pdu: RpcPdu, *, stamp: bool = True) -> None:
        boot_time = (self.config.boot_time or None) if stamp else None
        self._out.append(Datagram(local_port, peer, emit_rpc(pdu, server_boot_time=boot_time)))
