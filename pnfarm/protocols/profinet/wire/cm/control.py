"""Control blocks: the end of parametrisation, application ready, release and the like
(IEC 61158-6-10, IODControlReq, IOXControlReq, IODReleaseReq).  One shape for all of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.block import (
    RESPONSE,
    VERSION_1_0,
    BlockType,
    RawBlock,
    check_type,
    emit_raw_block,
    read_uuid,
    write_uuid,
)
from pnfarm.wire.octets import Writer

if TYPE_CHECKING:
    from uuid import UUID

__all__ = [
    "CONTROL_BLOCK_TYPES",
    "ControlBlock",
    "ControlCommand",
    "SubmoduleList",
    "control_response",
    "emit_control_block",
    "emit_submodule_list",
    "parse_control_block",
    "parse_submodule_list",
]

CONTROL_BLOCK_TYPES = tuple(
    code | bit
    for bit in (0, RESPONSE)
    for code in (
        BlockType.PRM_END_REQ,
        BlockType.PRM_END_PLUG_REQ,
        BlockType.APPLICATION_READY_REQ,
        BlockType.APPLICATION_READY_PLUG_REQ,
        BlockType.RELEASE_REQ,
        BlockType.READY_FOR_COMPANION_REQ,
        BlockType.READY_FOR_RT_CLASS_3_REQ,
        BlockType.PRM_BEGIN_REQ,
    )
)


class ControlCommand:
    """Bits of the field ControlCommand (u16); a block sets exactly one."""

    PRM_END = 1 << 0
    APPLICATION_READY = 1 << 1
    RELEASE = 1 << 2
    DONE = 1 << 3
    READY_FOR_COMPANION = 1 << 4
    READY_FOR_RT_CLASS_3 = 1 << 5
    PRM_BEGIN = 1 << 6


@dataclass(frozen=True, slots=True)
class ControlBlock:
    """0x0110 - 0x0118 and their responses.

    ``alarm_sequence_number`` is used by the two plug blocks and is reserved in the others.
    """

    block_type: int
    ar_uuid: UUID
    session_key: int
    command: int
    alarm_sequence_number: int = 0
    properties: int = 0
    padding: int = 0
    version: int = VERSION_1_0


def parse_control_block(block: RawBlock) -> ControlBlock:
    r = check_type(block, *CONTROL_BLOCK_TYPES)
    padding, ar_uuid, session_key, sequence, command, properties = (
        r.u16(),
        read_uuid(r),
        r.u16(),
        r.u16(),
        r.u16(),
        r.u16(),
    )
    r.expect_end()
    return ControlBlock(block.block_type, ar_uuid, session_key, command, sequence, properties, padding, block.version)


def emit_control_block(value: ControlBlock) -> bytes:
    w = write_uuid(Writer().u16(value.padding), value.ar_uuid).u16(value.session_key)
    w.u16(value.alarm_sequence_number).u16(value.command).u16(value.properties)
    return emit_raw_block(RawBlock(value.block_type, w.getvalue(), value.version))


def control_response(request: ControlBlock) -> ControlBlock:
    """The positive answer to ``request``: the same AR and session, command Done."""
    return ControlBlock(
        request.block_type | RESPONSE,
        request.ar_uuid,
        request.session_key,
        ControlCommand.DONE,
        request.alarm_sequence_number,
    )


@dataclass(frozen=True, slots=True)
class SubmoduleList:
    """0x0119: the submodules, each (api, slot, subslot), that a PrmBegin is about."""

    entries: tuple[tuple[int, int, int], ...]
    version: int = VERSION_1_0


def parse_submodule_list(block: RawBlock) -> SubmoduleList:
    r = check_type(block, BlockType.SUBMODULE_LIST)
    value = SubmoduleList(tuple((r.u32(), r.u16(), r.u16()) for _ in range(r.u16())), block.version)
    r.expect_end()
    return value


def emit_submodule_list(value: SubmoduleList) -> bytes:
    w = Writer().u16(len(value.entries))
    for api, slot, subslot in value.entries:
        w.u32(api).u16(slot).u16(subslot)
    return emit_raw_block(RawBlock(BlockType.SUBMODULE_LIST, w.getvalue(), value.version))
