"""Parses the device's responses and calls for a controller, with texts about what is wrong.

Every function here takes untrusted octets of a peer: the result is a value, or an error with a
message.  Blocks that a controller does not need (ARServerBlockRes, ARRPCBlockRes, ARVendorBlockRes, unknown ones) may
be in the Connect response and are skipped.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from pnfarm.errors import DecodeError, RemoteError
from pnfarm.protocols.profinet.errors import CmrpcError, ConnectFault, ControlField, ErrorCode, pnio_error
from pnfarm.protocols.profinet.wire.block import BlockType, RawBlock, split_blocks
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockRes, ArBlockRes
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand, control_response
from pnfarm.protocols.profinet.wire.cm.expected import (
    ArInfo,
    DiffModule,
    DiffSubmodule,
    IdentInfo,
    ModuleDiffBlock,
    ModuleState,
)
from pnfarm.protocols.profinet.wire.cm.iocr import IocrBlockRes, IocrType
from pnfarm.protocols.profinet.wire.frame_id import classify_frame_id
from pnfarm.protocols.profinet.wire.records.iod import parse_read_response, parse_write_response
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from uuid import UUID

    from pnfarm.protocols.profinet.cm.ar import IocrLayout
    from pnfarm.protocols.profinet.cm.controller.plan import ArPlan
    from pnfarm.protocols.profinet.cm.controller.request import RecordAddress
    from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

__all__ = [
    "CallRefusedError",
    "ConnectAnswer",
    "ModuleDeviation",
    "ReadyCall",
    "addressed_ar",
    "check_access",
    "check_connect",
    "check_control",
    "check_ready",
    "deviations",
]

#: ErrorCode2 of CMCTL (IEC 61158-6-10): the AR is not in a state in which the device may call.
_CMCTL_STATE_CONFLICT = 0
STATE_CONFLICT = pnio_error(ErrorCode.CONTROL, ConnectFault.CMCTL, _CMCTL_STATE_CONFLICT)


@dataclass(frozen=True, slots=True)
class ModuleDeviation:
    """One way in which the device differs from the plan.

    ``subslot`` is None for a whole module.  ``fits``: data exchange is as planned nevertheless: a substitute,
    a diagnosis, an ApplicationReady that follows later.
    """

    api: int
    slot: int
    subslot: int | None
    text: str
    fits: bool

    @property
    def what(self) -> str:
        """``text`` without the place."""
        return self.text.partition(": ")[2]


@dataclass(frozen=True, slots=True)
class ConnectAnswer:
    """The content of a valid Connect response; ``frame_ids`` are those of the CRs in the order of their layouts."""

    frame_ids: tuple[int, ...]
    device_mac: bytes
    alarm_reference: int
    max_alarm_data_length: int
    module_diff: tuple[ModuleDeviation, ...]


@dataclass(frozen=True, slots=True)
class ReadyCall:
    """A good ApplicationReady call and the payload that confirms it; ``sequence`` is the alarm's, after a plug."""

    module_diff: tuple[ModuleDeviation, ...]
    after_plug: bool
    answer: bytes
    sequence: int = 0


class CallRefusedError(RemoteError):
    """A call of the device that is answered with an error; ``reason`` is a slug for counters."""

    def __init__(self, reason: str, code1: int, code2: int) -> None:
        super().__init__(f"the device's call is refused: {reason}")
        self.reason = reason
        self.status = pnio_error(ErrorCode.CONTROL, code1, code2)


# Module differences


_Text = tuple[str, bool]  # text, and whether data exchange is as planned nevertheless

_MODULE_TEXTS: dict[int, _Text] = {
    ModuleState.NO_MODULE: ("no module", False),
    ModuleState.WRONG_MODULE: ("wrong module, device has {ident}", False),
    ModuleState.SUBSTITUTE: ("substitute module, device has {ident}", True),
}
_IDENT_TEXTS: dict[int, _Text] = {
    IdentInfo.SUBSTITUTE: ("substitute submodule, device has {ident}", True),
    IdentInfo.WRONG: ("wrong submodule, device has {ident}", False),
    IdentInfo.NO_SUBMODULE: ("no submodule", False),
}
_AR_TEXTS: dict[int, _Text] = {
    ArInfo.APPLICATION_READY_PENDING: ("application not ready yet", True),
    ArInfo.SUPERORDINATED_LOCKED: ("locked by a superordinated instance", False),
    ArInfo.LOCKED_BY_IO_CONTROLLER: ("locked by another IO controller", False),
    ArInfo.LOCKED_BY_IO_SUPERVISOR: ("locked by an IO supervisor", False),
}
_STATE_BITS = ((6, "has a diagnosis"), (5, "demands maintenance"), (4, "requires maintenance"))
_FORMAT_INDICATOR = 0x8000
#: SubmoduleState with FormatIndicator 0, coding of .Detail.
_DETAIL_TEXTS: dict[int, _Text] = {
    0: ("no submodule", False),
    1: ("wrong submodule, device has {ident}", False),
    2: ("locked by another IO controller", False),
    4: ("application not ready yet", True),
    7: ("substitute submodule, device has {ident}", True),
}


def _submodule_texts(sub: DiffSubmodule) -> Iterator[_Text]:
    if not sub.state & _FORMAT_INDICATOR:
        yield _DETAIL_TEXTS.get(sub.state, (f"unknown state 0x{sub.state:04X}", False))
        return
    if sub.ident_info != IdentInfo.OK:
        yield _IDENT_TEXTS.get(sub.ident_info, (f"unknown IdentInfo {sub.ident_info}", False))
    if sub.ar_info != ArInfo.OWN:
        yield _AR_TEXTS.get(sub.ar_info, (f"unknown ARInfo {sub.ar_info}", False))
    for bit, text in _STATE_BITS:
        if sub.state >> bit & 1:
            yield text, True


def _module_deviations(api: int, module: DiffModule) -> Iterator[ModuleDeviation]:
    if module.state != ModuleState.PROPER_MODULE:
        what, fits = _MODULE_TEXTS.get(module.state, (f"unknown module state {module.state}", False))
        text = f"slot {module.slot}: " + what.format(ident=f"0x{module.module_ident:08X}")
        yield ModuleDeviation(api, module.slot, None, text, fits)
    for sub in module.submodules:
        for what, fits in _submodule_texts(sub):
            text = f"slot {module.slot} subslot 0x{sub.subslot:04X}: " + what.format(
                ident=f"0x{sub.submodule_ident:08X}"
            )
            yield ModuleDeviation(api, module.slot, sub.subslot, text, fits)


def deviations(block: ModuleDiffBlock) -> tuple[ModuleDeviation, ...]:
    """Each deviation that a ModuleDiffBlock names, in the block's order."""
    return tuple(d for api in block.apis for module in api.modules for d in _module_deviations(api.api, module))


# Connect


_T = TypeVar("_T")


def _parsed(parse: Callable[[RawBlock], _T], blocks: Sequence[RawBlock], name: str) -> _T:
    if len(blocks) != 1:
        raise RemoteError(f"the Connect response has {len(blocks)} {name}, it has to have one")
    try:
        return parse(blocks[0])
    except DecodeError as exc:
        raise RemoteError(f"{name} of the Connect response is malformed ({exc})") from exc


def _same(name: str, field: str, answered: object, asked: object) -> None:
    if answered != asked:
        raise RemoteError(f"{name} of the Connect response has {field} {answered}, asked was {asked}")


def _frame_id(blocks: Sequence[IocrBlockRes], iocr_type: IocrType, reference: int) -> int:
    name = f"IOCRBlockRes of the {iocr_type.name.lower()} CR"
    found = [block for block in blocks if (block.iocr_type, block.iocr_reference) == (iocr_type, reference)]
    if len(found) != 1:
        raise RemoteError(f"the Connect response has {len(found)} {name} (reference {reference}), it has to have one")
    frame_id = found[0].frame_id
    if not classify_frame_id(frame_id).is_cyclic:
        raise RemoteError(f"{name} has frame id 0x{frame_id:04X}, which is not for cyclic data")
    return frame_id


def _module_diff(blocks: Sequence[RawBlock]) -> tuple[ModuleDeviation, ...]:
    return tuple(d for block in blocks for d in deviations(ModuleDiffBlock.of(block)))


def _check_ar(plan: ArPlan, blocks: Sequence[RawBlock]) -> bytes:
    """The device's MAC address, out of an ARBlockRes that answers the plan's.

    CMResponderUDPRTPort is ignored: it belongs to RT over UDP, and real devices send 0.
    """
    ar = _parsed(ArBlockRes.of, blocks, "ARBlockRes")
    _same("ARBlockRes", "ARType", ar.ar_type, int(plan.ar_type))
    _same("ARBlockRes", "ARUUID", ar.ar_uuid, plan.ar_uuid)
    _same("ARBlockRes", "SessionKey", ar.session_key, plan.session_key)
    if ar.responder_mac[0] & 1 or not any(ar.responder_mac):
        raise RemoteError(
            f"ARBlockRes of the Connect response has the MAC {ar.responder_mac.hex(':')}, which is not a station's"
        )
    return ar.responder_mac


def check_access(plan: ArPlan, payload: bytes) -> bytes:
    """Read a positive Connect response to device access: the device's MAC address.  Raises RemoteError."""
    try:
        blocks = split_blocks(payload)
    except DecodeError as exc:
        raise RemoteError(f"the Connect response is malformed ({exc})") from exc
    return _check_ar(plan, [block for block in blocks if block.block_type == BlockType.AR_RES])


def check_connect(plan: ArPlan, layouts: Iterable[IocrLayout], payload: bytes) -> ConnectAnswer:
    """Read a positive Connect response; ``layouts`` are those of the request.

    Raises RemoteError with a sentence on the first thing that is wrong.

    The frame ids are taken as the device answers them: it assigns the output CR's, and some assign the input CR's too.
    """
    try:
        blocks = split_blocks(payload)
        module_diff = _module_diff([block for block in blocks if block.block_type == BlockType.MODULE_DIFF])
    except DecodeError as exc:
        raise RemoteError(f"the Connect response is malformed ({exc})") from exc
    of_type: dict[int, list[RawBlock]] = {}
    for block in blocks:
        of_type.setdefault(block.block_type, []).append(block)

    device_mac = _check_ar(plan, of_type.get(BlockType.AR_RES, []))
    iocrs = [_parsed(IocrBlockRes.of, [block], "IOCRBlockRes") for block in of_type.get(BlockType.IOCR_RES, [])]
    alarm = _parsed(AlarmCrBlockRes.of, of_type.get(BlockType.ALARM_CR_RES, []), "AlarmCRBlockRes")
    return ConnectAnswer(
        frame_ids=tuple(_frame_id(iocrs, IocrType(one.iocr_type), one.iocr_reference) for one in layouts),
        device_mac=device_mac,
        alarm_reference=alarm.local_alarm_reference,
        max_alarm_data_length=alarm.max_alarm_data_length,
        module_diff=module_diff,
    )


# Control


def check_control(plan: ArPlan, payload: bytes, block_type: int, name: str, sequence: int = 0) -> None:
    """Read the positive answer to PrmBegin, PrmEnd or PrmEnd.plug, or to Release.  Raises RemoteError with a sentence.

    ``sequence`` is the alarm's in an answer to PrmEnd.plug; a device may leave it out.
    """
    try:
        blocks = [ControlBlock.of(b) for b in split_blocks(payload) if b.block_type == block_type]
    except DecodeError as exc:
        raise RemoteError(f"the answer to {name} is malformed ({exc})") from exc
    if len(blocks) != 1:
        raise RemoteError(f"the answer to {name} has {len(blocks)} blocks 0x{block_type:04X}, it has to have one")
    answer = blocks[0]
    if answer.ar_uuid != plan.ar_uuid:
        raise RemoteError(f"the answer to {name} is for AR {answer.ar_uuid}")
    if answer.session_key != plan.session_key:
        raise RemoteError(f"the answer to {name} has session key {answer.session_key}, asked was {plan.session_key}")
    if answer.alarm_sequence_number not in {0, sequence}:
        raise RemoteError(
            f"the answer to {name} has alarm sequence number {answer.alarm_sequence_number}, asked was {sequence}"
        )
    if not answer.command & ControlCommand.DONE:
        raise RemoteError(f"the answer to {name} has ControlCommand 0x{answer.command:04X} instead of Done")


def _ready_block(payload: bytes) -> tuple[ControlBlock, list[RawBlock]]:
    try:
        blocks = split_blocks(payload)
        if not blocks:
            raise CallRefusedError("ready-without-block", ConnectFault.CMRPC, CmrpcError.UNKNOWN_BLOCKS)
        head = blocks[0]
        if head.block_type not in {BlockType.APPLICATION_READY_REQ, BlockType.APPLICATION_READY_PLUG_REQ}:
            raise CallRefusedError("ready-unknown-block", ConnectFault.CMRPC, CmrpcError.UNKNOWN_BLOCKS)
        return ControlBlock.of(head), list(blocks[1:])
    except DecodeError as exc:
        raise CallRefusedError("ready-malformed", ConnectFault.IOX_CONTROL_BLOCK, ControlField.BLOCK_LENGTH) from exc


def addressed_ar(payload: bytes) -> UUID | None:
    """The AR that a device's ApplicationReady call is for; None when the payload does not name it.

    One server takes the calls of all devices; this gives the machine of a call.
    """
    try:
        return _ready_block(payload)[0].ar_uuid
    except CallRefusedError:
        return None


def check_ready(plan: ArPlan, opnum: int, payload: bytes) -> ReadyCall:
    """Read an ApplicationReady call.  Raises CallRefusedError with the PNIOStatus that it is to be answered with."""
    if opnum != Opnum.CONTROL:
        raise CallRefusedError("ready-wrong-operation", ConnectFault.CMRPC, CmrpcError.UNKNOWN_BLOCKS)
    block, rest = _ready_block(payload)
    after_plug = block.block_type == BlockType.APPLICATION_READY_PLUG_REQ
    fault = ConnectFault.IOX_CONTROL_BLOCK_PLUG if after_plug else ConnectFault.IOX_CONTROL_BLOCK
    if block.ar_uuid != plan.ar_uuid:
        raise CallRefusedError("ready-unknown-ar", ConnectFault.CMRPC, CmrpcError.AR_UUID_UNKNOWN)
    if block.session_key != plan.session_key:
        raise CallRefusedError("ready-wrong-session", fault, ControlField.SESSION_KEY)
    if block.command != ControlCommand.APPLICATION_READY:
        raise CallRefusedError("ready-wrong-command", fault, ControlField.CONTROL_COMMAND)
    try:
        module_diff = _module_diff([b for b in rest if b.block_type == BlockType.MODULE_DIFF])
    except DecodeError as exc:
        raise CallRefusedError("ready-malformed-module-diff", ConnectFault.CMRPC, CmrpcError.UNKNOWN_BLOCKS) from exc
    answer = control_response(block).emit()
    return ReadyCall(module_diff, after_plug, answer, block.alarm_sequence_number)


# Records


def _fits(header: object, at: RecordAddress) -> bool:
    # Devices differ in how they fill the answer's ARUUID and API; these fields match it with the request.
    return all(getattr(header, name) == getattr(at, name) for name in ("sequence_number", "slot", "subslot", "index"))


def check_read(at: RecordAddress, payload: bytes, length: int) -> bytes:
    """The record of a positive Read response.  Raises RemoteError with a sentence."""
    try:
        record = parse_read_response(payload)
    except DecodeError as exc:
        raise RemoteError(f"the answer to Read is malformed ({exc})") from exc
    if not _fits(record.header, at):
        raise RemoteError("the answer to Read is for another record")
    if len(record.data) > length:
        raise RemoteError(f"the answer to Read has {len(record.data)} octets, at most {length} were asked for")
    return record.data


def check_write(wants: Sequence[RecordAddress], payload: bytes) -> list[PnioStatus | None]:
    """The status of each record of a positive Write response, None for one that the answer does not name.

    A multiple write's outer header comes first and is skipped.  Raises RemoteError with a sentence.
    """
    try:
        headers = parse_write_response(payload)
    except DecodeError as exc:
        raise RemoteError(f"the answer to Write is malformed ({exc})") from exc
    return [next((header.status for header in headers if _fits(header, at)), None) for at in wants]
