"""Control and Release calls of a controller: which AR, which command, and what is wrong with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.cm.device.check import RefusedError
from pnfarm.protocols.profinet.errors import (
    CmrpcError,
    ConnectFault,
    ControlField,
    ErrorCode,
    SubmoduleListField,
    pnio_error,
)
from pnfarm.protocols.profinet.wire.block import VERSION_1_0, BlockType, split_blocks
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand, SubmoduleList

if TYPE_CHECKING:
    from collections.abc import Callable
    from uuid import UUID

    from pnfarm.protocols.profinet.cm.ar import Ar
    from pnfarm.protocols.profinet.wire.block import RawBlock

__all__ = ["ControlCall", "check_list", "confirms", "read_control", "refuse_call"]

#: The blocks that the two calls may carry, with their ErrorCode1 and the one command that fits.
_CONTROL_BLOCKS: dict[int, tuple[ConnectFault, int]] = {
    BlockType.PRM_END_REQ: (ConnectFault.CONTROL_BLOCK, ControlCommand.PRM_END),
    BlockType.PRM_END_PLUG_REQ: (ConnectFault.CONTROL_BLOCK_PLUG, ControlCommand.PRM_END),
    BlockType.PRM_BEGIN_REQ: (ConnectFault.PRM_BEGIN_BLOCK, ControlCommand.PRM_BEGIN),
}
_RELEASE_BLOCKS: dict[int, tuple[ConnectFault, int]] = {
    BlockType.RELEASE_REQ: (ConnectFault.RELEASE_BLOCK, ControlCommand.RELEASE)
}


def refuse_call(service: ErrorCode, code1: int, code2: int) -> NoReturn:
    """Answer a call with a refusal: raises :class:`RefusedError`."""
    raise RefusedError(pnio_error(service, code1, code2), "")


@dataclass(frozen=True, slots=True)
class ControlCall:
    """A call that can be carried out; ``submodules`` is a PrmBegin's list."""

    block: ControlBlock
    ar: Ar
    submodules: SubmoduleList | None = None


def _check_version(service: ErrorCode, raw: RawBlock, fault: ConnectFault) -> None:
    if raw.version_high != VERSION_1_0 >> 8:
        refuse_call(service, fault, ControlField.BLOCK_VERSION_HIGH)
    if raw.version != VERSION_1_0:
        refuse_call(service, fault, ControlField.BLOCK_VERSION_LOW)


def read_control(payload: bytes, service: ErrorCode, by_uuid: Callable[[UUID], Ar | None]) -> ControlCall:
    """``service`` is CONTROL or RELEASE.  Raises :class:`RefusedError` with the standard's codes."""
    wanted = _RELEASE_BLOCKS if service == ErrorCode.RELEASE else _CONTROL_BLOCKS
    try:
        raws = split_blocks(payload)
    except DecodeError:
        refuse_call(service, ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID)
    if not raws:
        refuse_call(service, ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID)
    raw = raws[0]
    # a PrmBegin carries a submodule list as well; every other call is one block
    begins = raw.block_type == BlockType.PRM_BEGIN_REQ
    if raw.block_type not in wanted or len(raws) != 1 + begins:
        refuse_call(service, ConnectFault.CMRPC, CmrpcError.UNKNOWN_BLOCKS)
    fault, command = wanted[raw.block_type]
    _check_version(service, raw, fault)
    try:
        block = ControlBlock.of(raw)
    except DecodeError:
        refuse_call(service, fault, ControlField.BLOCK_LENGTH)
    ar = by_uuid(block.ar_uuid)
    if ar is None:
        refuse_call(service, ConnectFault.CMRPC, CmrpcError.AR_UUID_UNKNOWN)
    if block.session_key != ar.session_key:
        refuse_call(service, fault, ControlField.SESSION_KEY)
    if block.command != command:
        refuse_call(service, fault, ControlField.CONTROL_COMMAND)
    return ControlCall(block, ar, _read_list(service, raws[1]) if begins else None)


def _read_list(service: ErrorCode, raw: RawBlock) -> SubmoduleList:
    fault = ConnectFault.SUBMODULE_LIST_BLOCK
    if raw.block_type != BlockType.SUBMODULE_LIST:
        refuse_call(service, fault, SubmoduleListField.BLOCK_TYPE)
    _check_version(service, raw, fault)
    try:
        return SubmoduleList.of(raw)
    except DecodeError:
        refuse_call(service, fault, SubmoduleListField.BLOCK_LENGTH)


def check_list(listed: SubmoduleList, ar: Ar) -> None:
    """Every submodule of a PrmBegin must be the AR's own; raises :class:`RefusedError` naming the field."""

    def refuse(field: SubmoduleListField) -> NoReturn:
        refuse_call(ErrorCode.CONTROL, ConnectFault.SUBMODULE_LIST_BLOCK, field)

    if not listed.entries:
        refuse(SubmoduleListField.NUMBER_OF_ENTRIES)
    for key in listed.entries:
        if key in ar.owned:
            continue
        api, slot, _ = key
        if not any(a == api for a, _, _ in ar.owned):
            refuse(SubmoduleListField.API)
        if not any((a, s) == (api, slot) for a, s, _ in ar.owned):
            refuse(SubmoduleListField.SLOT)
        refuse(SubmoduleListField.SUBSLOT)


#: What the controller answers to each of the device's own control calls.
_ANSWERS = {
    BlockType.APPLICATION_READY_REQ: BlockType.APPLICATION_READY_RES,
    BlockType.APPLICATION_READY_PLUG_REQ: BlockType.APPLICATION_READY_PLUG_RES,
}


def confirms(ar: Ar, payload: bytes, block_type: BlockType, sequence: int = 0) -> bool:
    """Is ``payload`` the controller's "done" to this AR's ApplicationReady of ``block_type``?"""
    try:
        (raw,) = split_blocks(payload)
        block = ControlBlock.of(raw)
    except (DecodeError, ValueError):
        return False
    # some controllers leave the alarm's sequence number out of the answer
    if block.alarm_sequence_number not in {0, sequence}:
        return False
    wanted = (_ANSWERS[block_type], ar.uuid, ar.session_key, ControlCommand.DONE)
    return (block.block_type, block.ar_uuid, block.session_key, block.command) == wanted
