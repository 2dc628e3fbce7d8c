"""CMDEV: the device's side of context management (IEC 61158-6-10, CMDEV, CMSM and CMSU protocol machines).

Theory.  One :class:`CmDevice` serves one device and holds one :class:`~pnfarm.protocols.profinet.ar.Ar` for each
controller connected to it; the state machine is :data:`~.cmdev_states.TRANSITIONS`, and
:meth:`CmDevice._step` alone writes ``ar.state``.

* A server of RPC hands it calls (:meth:`CmDevice.receive_call`) and sends what :meth:`CmDevice.responses` drains.
* A client of RPC sends what :meth:`CmDevice.calls` drains (ApplicationReady) and reports back by
  :meth:`CmDevice.call_returned` or :meth:`CmDevice.call_failed`.
* The cyclic engine starts both channels at :class:`ArConnected`, in legacy and in advanced start-up alike: a real
  controller's captures show the device's frames even before its Connect response.  It reports the first frame
  by :meth:`CmDevice.data_received` and a silent controller by :meth:`CmDevice.watchdog_expired`.
* The application says when it is ready (:meth:`CmDevice.application_ready`) after :class:`PrmEndReceived`; that it
  may never do so, or late, is its own affair.
* The activity timeout of the controller (CMSM) runs from Connect to DATA and starts anew with each record call.

A Connect with the UUID of a standing AR is refused and ends that AR (state conflict; the controller's next try
succeeds).  A Connect of the same controller with a new UUID replaces its old AR.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NoReturn

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.ar import Ar, CmdevState
from pnfarm.protocols.profinet.cmdev_check import (
    FRAME_ID_RANGES,
    RefusedError,
    check_connect,
    check_plugged,
    parse_connect,
)
from pnfarm.protocols.profinet.cmdev_diff import module_diff, unusable_submodules
from pnfarm.protocols.profinet.cmdev_records import serve_read, serve_write
from pnfarm.protocols.profinet.cmdev_states import TRANSITIONS, CmdevEvent
from pnfarm.protocols.profinet.errors import (
    OK,
    CmdevError,
    CmrpcError,
    ConnectFault,
    ControlField,
    ErrorCode,
    RtaError,
    describe_status,
    pnio_error,
    rta_status,
)
from pnfarm.protocols.profinet.events import (
    ApplicationReadyConfirmed,
    ArAborted,
    ArConnected,
    ArReleased,
    ConnectRefused,
)
from pnfarm.protocols.profinet.wire.blocks import VERSION_1_0, BlockType, split_blocks
from pnfarm.protocols.profinet.wire.blocks_any import emit_blocks
from pnfarm.protocols.profinet.wire.blocks_connect import (
    AlarmCrBlockRes,
    ArBlockRes,
    ArProperties,
    ArRpcBlockRes,
    ArServerBlock,
    ArVendorBlockRes,
)
from pnfarm.protocols.profinet.wire.blocks_control import (
    ControlBlock,
    ControlCommand,
    control_response,
    emit_control_block,
    parse_control_block,
)
from pnfarm.protocols.profinet.wire.iocr import FRAME_ID_ASSIGN, IocrBlockRes
from pnfarm.protocols.profinet.wire.rpc import Opnum
from pnfarm.protocols.profinet.wire.rta import emit_rta_error, parse_rta_error, rta_error

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable
    from ipaddress import IPv4Address
    from uuid import UUID

    from pnfarm.protocols.profinet.ar import IocrLayout
    from pnfarm.protocols.profinet.cmdev_check import ConnectRequest
    from pnfarm.protocols.profinet.description import DeviceDescription, Plugged
    from pnfarm.protocols.profinet.events import CmEvent
    from pnfarm.protocols.profinet.record_store import RecordHandler
    from pnfarm.protocols.profinet.rpc_fragments import Peer
    from pnfarm.protocols.profinet.wire.blocks_any import Block
    from pnfarm.protocols.profinet.wire.blocks_connect import ArBlockReq
    from pnfarm.protocols.profinet.wire.rpc import PnioStatus

__all__ = ["CmDevice", "OutgoingCall"]

#: The device's RPC server port, for an ARRPCBlockRes.
_RPC_PORT = 34964


@dataclass(frozen=True, slots=True)
class OutgoingCall:
    """A call to the controller's interface; ``port`` is where an ARRPCBlock asked for it, None for the usual one."""

    ar_key: int
    peer_ip: IPv4Address
    opnum: int
    payload: bytes
    port: int | None = None


#: The blocks that the two calls may carry, with their ErrorCode1.
_CONTROL_BLOCKS: dict[int, ConnectFault] = {
    BlockType.PRM_END_REQ: ConnectFault.CONTROL_BLOCK,
    BlockType.PRM_END_PLUG_REQ: ConnectFault.CONTROL_BLOCK_PLUG,
    BlockType.PRM_BEGIN_REQ: ConnectFault.PRM_BEGIN_BLOCK,
}
_RELEASE_BLOCKS: dict[int, ConnectFault] = {BlockType.RELEASE_REQ: ConnectFault.RELEASE_BLOCK}


def _refuse_call(service: ErrorCode, code1: int, code2: int) -> NoReturn:
    raise RefusedError(pnio_error(service, code1, code2), "")


def _same_initiator(one: ArBlockReq, other: ArBlockReq) -> bool:
    """Both requests come from one controller and want the same kind of AR."""
    return (one.initiator_object_uuid, one.station_name, one.ar_type) == (
        other.initiator_object_uuid,
        other.station_name,
        other.ar_type,
    )


def _confirms(ar: Ar, payload: bytes) -> bool:
    """Is ``payload`` the controller's "done" to this AR's ApplicationReady?"""
    try:
        (raw,) = split_blocks(payload)
        block = parse_control_block(raw)
    except (DecodeError, ValueError):
        return False
    wanted = (BlockType.APPLICATION_READY_RES, ar.uuid, ar.session_key, ControlCommand.DONE)
    return (block.block_type, block.ar_uuid, block.session_key, block.command) == wanted


class CmDevice:
    """Context management of one device.  See the head of this file for who calls what.

    ``station_name`` may change while the machine lives.  ``refuse_connect``, when set, is asked about every
    readable Connect and answers a PNIOStatus to refuse it with, or None.  ``dropped`` counts what was thrown away,
    by reason.
    """

    def __init__(
        self,
        description: DeviceDescription,
        plugged: Plugged,
        records: RecordHandler,
        *,
        mac: bytes,
        station_name: str = "",
    ) -> None:
        self.description = description
        self.plugged = plugged
        self.station_name = station_name
        self.refuse_connect: Callable[[ArBlockReq], PnioStatus | None] | None = None
        self.dropped: Counter[str] = Counter()
        self._mac = mac
        self._records = records
        self._ars: dict[int, Ar] = {}
        self._deadlines: dict[int, int] = {}
        self._next_key = 1
        self._events: list[CmEvent] = []
        self._responses: list[tuple[Hashable, PnioStatus, bytes]] = []
        self._calls: list[OutgoingCall] = []
        self._rta: list[tuple[bytes, bytes]] = []

    # what the surroundings read

    @property
    def ars(self) -> tuple[Ar, ...]:
        """The ARs that stand, oldest first."""
        return tuple(self._ars.values())

    def ar(self, ar_key: int) -> Ar | None:
        return self._ars.get(ar_key)

    def events(self) -> list[CmEvent]:
        drained, self._events = self._events, []
        return drained

    def responses(self) -> list[tuple[Hashable, PnioStatus, bytes]]:
        """Answers to calls: (call, status, payload)."""
        drained, self._responses = self._responses, []
        return drained

    def calls(self) -> list[OutgoingCall]:
        drained, self._calls = self._calls, []
        return drained

    def rta_to_send(self) -> list[tuple[bytes, bytes]]:
        """Alarm frames: (destination MAC, octets behind EtherType 0x8892)."""
        drained, self._rta = self._rta, []
        return drained

    def next_deadline(self) -> int | None:
        return min(self._deadlines.values(), default=None)

    def handle_timeout(self, now: int) -> None:
        """Abort every AR whose controller was inactive too long during start-up."""
        for key in [k for k, deadline in self._deadlines.items() if deadline <= now]:
            self.abort(key, RtaError.CMI_TIMEOUT, now)

    # what arrives

    def receive_call(self, call: Hashable, opnum: int, payload: bytes, args_maximum: int, peer: Peer, now: int) -> None:
        """One complete call on the device interface; exactly one response follows from :meth:`responses`."""
        match opnum:
            case Opnum.CONNECT:
                status, answer = self._connect(payload, args_maximum, peer.ip, now)
            case Opnum.RELEASE:
                status, answer = self._release(payload)
            case Opnum.CONTROL:
                status, answer = self._control(payload)
            case Opnum.WRITE:
                served = serve_write(payload, self._by_uuid, self._records, now)
                status, answer = served.status, served.payload
                self._events += served.events
                self._touch(served.ar, now)
            case Opnum.READ | Opnum.READ_IMPLICIT:
                implicit = opnum == Opnum.READ_IMPLICIT
                served = serve_read(payload, args_maximum, self._by_uuid, self._records, now, implicit=implicit)
                status, answer = served.status, served.payload
                self._touch(served.ar, now)
            case _:
                status, answer = pnio_error(ErrorCode.PNIO, ConnectFault.CMRPC, CmrpcError.STATE_CONFLICT), b""
        self._responses.append((call, status, answer))

    def call_returned(self, ar_key: int, status: PnioStatus, payload: bytes, now: int) -> None:
        """The controller answered ApplicationReady."""
        ar = self._ars.get(ar_key)
        if ar is None or ar.state is not CmdevState.W_ARDYCNF:
            self.dropped["late-call-result"] += 1
            return
        if not status.ok:
            self.abort(ar_key, RtaError.RPC_CLIENT_CALL_FAILED, now)
            return
        if not _confirms(ar, payload):
            self.abort(ar_key, RtaError.PROTOCOL_VIOLATION, now)
            return
        self._events.append(ApplicationReadyConfirmed(ar_key))
        ready = len(ar.data_seen) == len(ar.output_crs)
        self._step(ar, CmdevEvent.APPLICATION_READY_CNF_DATA if ready else CmdevEvent.APPLICATION_READY_CNF)

    def call_failed(self, ar_key: int, reason: str, now: int) -> None:
        """ApplicationReady was not answered; ``reason`` is the RPC client's."""
        ar = self._ars.get(ar_key)
        if ar is None or ar.state is not CmdevState.W_ARDYCNF:
            self.dropped["late-call-result"] += 1
            return
        self._abort(ar, rta_status(RtaError.RPC_CLIENT_CALL_FAILED), now, f"ApplicationReady: {reason}")

    def data_received(self, ar_key: int, now: int, iocr_reference: int | None = None) -> None:
        """The first valid frame came, on one output CR or (None) on every one of them."""
        del now
        ar = self._ars.get(ar_key)
        if ar is None:
            return
        references = {c.iocr_reference for c in ar.output_crs}
        ar.data_seen |= references if iocr_reference is None else references & {iocr_reference}
        if ar.data_seen == references and ar.state is CmdevState.WDATA:
            self._step(ar, CmdevEvent.DATA_POSSIBLE)

    def watchdog_expired(self, ar_key: int, now: int) -> None:
        """An output CR's data hold timer ran out."""
        self.abort(ar_key, RtaError.CONSUMER_DHT_EXPIRED, now)

    def receive_rta(self, payload: bytes, source_mac: bytes, now: int) -> None:
        """An alarm frame's octets, from the frame id on; an ERR-RTA of an AR's controller ends that AR."""
        try:
            pdu = parse_rta_error(payload)
        except DecodeError as exc:
            self.dropped[f"rta-{exc.reason}"] += 1
            return
        for ar in self.ars:
            if (
                ar.alarm_cr is not None
                and ar.initiator_mac == source_mac
                and ar.local_alarm_reference == pdu.destination
                and ar.remote_alarm_reference == pdu.source
            ):
                self._abort(ar, pdu.status, now, by_peer=True)
                return
        self.dropped["rta-unknown-reference"] += 1

    # what the application does

    def application_ready(self, ar_key: int, now: int) -> bool:
        """Tell the controller that the application is ready.  False when the AR does not wait for that."""
        del now
        ar = self._ars.get(ar_key)
        if ar is None or ar.state is not CmdevState.W_ARDY:
            return False
        ar.module_diff = module_diff(ar.expected, self.plugged, self._locked(ar))
        blocks: list[Block] = [
            ControlBlock(BlockType.APPLICATION_READY_REQ, ar.uuid, ar.session_key, ControlCommand.APPLICATION_READY)
        ]
        if ar.module_diff is not None:
            blocks.append(ar.module_diff)
        self._calls.append(OutgoingCall(ar.key, ar.peer_ip, Opnum.CONTROL, emit_blocks(blocks), ar.initiator_rpc_port))
        self._step(ar, CmdevEvent.APPLICATION_READY_REQ)
        return True

    def abort(self, ar_key: int, reason: int, now: int) -> None:
        """End an AR with an ERR-RTA to its controller; ``reason`` is an :class:`RtaError` or any octet."""
        ar = self._ars.get(ar_key)
        if ar is not None:
            self._abort(ar, rta_status(reason), now)

    def abort_all(self, reason: int, now: int) -> None:
        for ar in self.ars:
            self.abort(ar.key, reason, now)

    # Connect

    def _connect(self, payload: bytes, args_maximum: int, peer_ip: IPv4Address, now: int) -> tuple[PnioStatus, bytes]:
        try:
            request = parse_connect(payload)
            self._check_free(request, now)
            layouts = check_connect(request, self.description)
            self._check_resources(request, now)
            self._follow(request)
            check_plugged(request, self.plugged)
        except RefusedError as exc:
            self._events.append(ConnectRefused(peer_ip, exc.status, exc.detail))
            return exc.status, b""
        ar = Ar(self._next_key, request.ar, peer_ip, CmdevState.W_CIND, connected_at=now)
        self._fill(ar, request, layouts)
        answer = self._connect_response(ar, request)
        if len(answer) > args_maximum:
            status = pnio_error(ErrorCode.CONNECT, ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID)
            detail = f"the response has {len(answer)} octets, the caller takes {args_maximum}"
            self._events.append(ConnectRefused(peer_ip, status, detail))
            return status, b""
        self._next_key += 1
        self._ars[ar.key] = ar
        self._step(ar, CmdevEvent.CONNECT_IND)
        self._events.append(
            ArConnected(
                ar_key=ar.key,
                uuid=ar.uuid,
                initiator_name=ar.initiator_name,
                initiator_ip=peer_ip,
                initiator_mac=ar.initiator_mac,
                iocrs=ar.iocrs,
                unusable=unusable_submodules(ar.expected, ar.module_diff),
                advanced_startup=ar.advanced_startup,
                device_access=ar.device_access,
            )
        )
        if ar.device_access:
            self._step(ar, CmdevEvent.CONNECT_RSP_DEVICE_ACCESS)
        else:
            self._step(ar, CmdevEvent.CONNECT_RSP)
            self._step(ar, CmdevEvent.STARTUP_CNF)
            self._touch(ar, now)
        return OK, answer

    def _check_free(self, request: ConnectRequest, now: int) -> None:
        """Is the UUID unused, and does nobody want this Connect refused?"""
        standing = self._by_uuid(request.ar.ar_uuid)
        if standing is not None:
            self.abort(standing.key, RtaError.RE_RUN_ABORTS_EXISTING, now)
            status = pnio_error(ErrorCode.CONNECT, ConnectFault.CMDEV, CmdevError.STATE_CONFLICT)
            raise RefusedError(status, "an AR with this UUID stood; it is aborted")
        status_wanted = self.refuse_connect(request.ar) if self.refuse_connect else None
        if status_wanted is not None:
            raise RefusedError(status_wanted, "refused on purpose")

    def _check_resources(self, request: ConnectRequest, now: int) -> None:
        """Is there room for one more AR of this kind?  The same controller's older one gives way."""
        for ar in self.ars:
            if _same_initiator(ar.request, request.ar):
                self.abort(ar.key, RtaError.RE_RUN_ABORTS_EXISTING, now)
        limits = self.description.limits
        access = bool(request.ar.properties & ArProperties.DEVICE_ACCESS)
        standing = sum(ar.device_access == access for ar in self.ars)
        if standing >= (limits.max_device_access_ars if access else limits.max_ars):
            status = pnio_error(ErrorCode.CONNECT, ConnectFault.CMRPC, CmrpcError.OUT_OF_AR_RESOURCES)
            raise RefusedError(status, f"ARs that stand already: {standing}")

    def _follow(self, request: ConnectRequest) -> None:
        """Slots that no other AR uses take the expected module, where they can."""
        owned = {e.slot for ar in self.ars for e in ar.expected}
        for entry in request.expected:
            if entry.slot not in owned:
                self.plugged.follow(entry.slot, entry.module_ident)

    def _fill(self, ar: Ar, request: ConnectRequest, layouts: tuple[IocrLayout, ...]) -> None:
        used = {c.frame_id for other in self.ars for c in other.iocrs} | {c.frame_id for c in layouts}
        given = []
        for layout in layouts:
            if layout.frame_id == FRAME_ID_ASSIGN:
                layout = replace(layout, frame_id=next(i for i in FRAME_ID_RANGES[layout.rt_class] if i not in used))
                used.add(layout.frame_id)
            given.append(layout)
        ar.iocrs = tuple(given)
        ar.expected = tuple(request.expected)
        ar.alarm_cr = request.alarm_crs[0] if request.alarm_crs else None
        taken = {other.local_alarm_reference for other in self.ars if other.alarm_cr}
        ar.local_alarm_reference = next(n for n in range(len(taken) + 1) if n not in taken)
        ar.initiator_rpc_port = request.rpc.server_port if request.rpc else None
        ar.module_diff = module_diff(ar.expected, self.plugged, self._locked(ar))

    def _connect_response(self, ar: Ar, request: ConnectRequest) -> bytes:
        blocks: list[Block] = [ArBlockRes(ar.ar_type, ar.uuid, ar.session_key, self._mac)]
        blocks += [IocrBlockRes(c.iocr_type, c.iocr_reference, c.frame_id) for c in ar.iocrs]
        if ar.alarm_cr is not None:
            length = self.description.limits.max_alarm_data_length
            blocks.append(AlarmCrBlockRes(ar.alarm_cr.alarm_cr_type, ar.local_alarm_reference, length))
        if ar.module_diff is not None:
            blocks.append(ar.module_diff)
        if request.rpc is not None:
            blocks.append(ArRpcBlockRes(_RPC_PORT))
        if self.station_name and not ar.device_access:
            blocks.append(ArServerBlock(self.station_name.encode("ascii", "replace")))
        blocks += [ArVendorBlockRes(v.ap_structure_identifier, v.api) for v in request.vendor]
        return emit_blocks(blocks)

    def _locked(self, ar: Ar) -> set[tuple[int, int, int]]:
        """Submodules that another controller's AR has."""
        return {
            (e.api, e.slot, s.subslot)
            for other in self.ars
            if other is not ar
            for e in other.expected
            for s in e.submodules
        }

    # Control, Release

    def _control(self, payload: bytes) -> tuple[PnioStatus, bytes]:
        try:
            block, ar = self._read_control(payload, ErrorCode.CONTROL)
            if block.block_type != BlockType.PRM_END_REQ:
                _refuse_call(ErrorCode.CONTROL, ConnectFault.CMRPC, CmrpcError.STATE_CONFLICT)
            if block.command != ControlCommand.PRM_END:
                _refuse_call(ErrorCode.CONTROL, ConnectFault.CONTROL_BLOCK, ControlField.CONTROL_COMMAND)
            if ar.state is not CmdevState.W_PEIND:
                _refuse_call(ErrorCode.CONTROL, ConnectFault.CMRPC, CmrpcError.STATE_CONFLICT)
        except RefusedError as exc:
            return exc.status, b""
        self._step(ar, CmdevEvent.PRM_END_IND)
        self._step(ar, CmdevEvent.PRM_END_RSP)
        return OK, emit_control_block(control_response(block))

    def _release(self, payload: bytes) -> tuple[PnioStatus, bytes]:
        try:
            block, ar = self._read_control(payload, ErrorCode.RELEASE)
            if block.command != ControlCommand.RELEASE:
                _refuse_call(ErrorCode.RELEASE, ConnectFault.RELEASE_BLOCK, ControlField.CONTROL_COMMAND)
        except RefusedError as exc:
            return exc.status, b""
        self._step(ar, CmdevEvent.RELEASE_IND)
        self._forget(ar)
        self._events.append(ArReleased(ar.key))
        return OK, emit_control_block(control_response(block))

    def _read_control(self, payload: bytes, service: ErrorCode) -> tuple[ControlBlock, Ar]:
        """The one control block of a call and the AR that it names."""
        wanted = _RELEASE_BLOCKS if service == ErrorCode.RELEASE else _CONTROL_BLOCKS
        try:
            raws = split_blocks(payload)
        except DecodeError:
            _refuse_call(service, ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID)
        if not raws:
            _refuse_call(service, ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID)
        raw = raws[0]
        # a PrmBegin carries a submodule list besides; every other call is one block
        if raw.block_type not in wanted or (len(raws) > 1 and raw.block_type != BlockType.PRM_BEGIN_REQ):
            _refuse_call(service, ConnectFault.CMRPC, CmrpcError.UNKNOWN_BLOCKS)
        fault = wanted[raw.block_type]
        if raw.version_high != VERSION_1_0 >> 8:
            _refuse_call(service, fault, ControlField.BLOCK_VERSION_HIGH)
        if raw.version != VERSION_1_0:
            _refuse_call(service, fault, ControlField.BLOCK_VERSION_LOW)
        try:
            block = parse_control_block(raw)
        except DecodeError:
            _refuse_call(service, fault, ControlField.BLOCK_LENGTH)
        ar = self._by_uuid(block.ar_uuid)
        if ar is None:
            _refuse_call(service, ConnectFault.CMRPC, CmrpcError.AR_UUID_UNKNOWN)
        if block.session_key != ar.session_key:
            _refuse_call(service, fault, ControlField.SESSION_KEY)
        return block, ar

    # the machine

    def _step(self, ar: Ar, event: CmdevEvent) -> None:
        """The one place that writes an AR's state."""
        ar.state, reported = TRANSITIONS[ar.state, event]
        if ar.state is CmdevState.DATA:
            self._deadlines.pop(ar.key, None)
        if reported is not None:
            self._events.append(reported(ar.key))

    def _touch(self, ar: Ar | None, now: int) -> None:
        """The controller was active: its timeout starts anew, while the AR is not in DATA yet."""
        if ar is not None and ar.key in self._ars and ar.state is not CmdevState.DATA:
            self._deadlines[ar.key] = now + ar.activity_timeout_ns

    def _abort(self, ar: Ar, status: PnioStatus, now: int, words: str = "", *, by_peer: bool = False) -> None:
        del now
        self._step(ar, CmdevEvent.ABORT)
        self._forget(ar)
        if ar.alarm_cr is not None and not by_peer:
            pdu = rta_error(ar.remote_alarm_reference, ar.local_alarm_reference, status.error_code2)
            self._rta.append((ar.initiator_mac, emit_rta_error(pdu)))
        reason = words or describe_status(status)
        self._events.append(ArAborted(ar.key, status.error_code1, status.error_code2, reason, by_peer))

    def _forget(self, ar: Ar) -> None:
        self._ars.pop(ar.key, None)
        self._deadlines.pop(ar.key, None)
        self._calls = [call for call in self._calls if call.ar_key != ar.key]

    def _by_uuid(self, uuid: UUID) -> Ar | None:
        return next((ar for ar in self._ars.values() if ar.uuid == uuid), None)
