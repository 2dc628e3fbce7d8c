"""The payloads of a controller's calls: Connect, Write, PrmEnd, Release, Read (IEC 61158-6-10, IODConnectReq ...).

The order of the Connect request's blocks is that of the captured controllers: AR, input CRs, output CRs, expected
submodules, alarm CR.
"""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.any_block import emit_blocks
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand, SubmoduleList
from pnfarm.protocols.profinet.wire.cm.expected import (
    DataDescription,
    DataDirection,
    ExpectedApi,
    ExpectedSubmodule,
    ExpectedSubmoduleBlockReq,
)
from pnfarm.protocols.profinet.wire.cm.iocr import ETHERTYPE_PROFINET, FrameSlot, IocrApi, IocrBlockReq
from pnfarm.protocols.profinet.wire.records.iod import (
    API_NONE,
    INDEX_MULTIPLE_WRITE,
    IOD_HEADER_SIZE,
    IodReadReqHeader,
    IodWriteReqHeader,
    RecordWrite,
    emit_multiple_write_request,
    emit_write_request,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum
from pnfarm.wire.value import value_class

if TYPE_CHECKING:
    from collections.abc import Sequence
    from uuid import UUID

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout
    from pnfarm.protocols.profinet.cm.controller.plan import ArPlan, ParameterRecord, PlannedSubmodule
    from pnfarm.protocols.profinet.wire.block import Block

__all__ = [
    "RecordAddress",
    "args_maximum",
    "connect_payload",
    "groups_of_records",
    "multiple_write_payload",
    "parameter_begin_payload",
    "parameter_end_payload",
    "read_payload",
    "release_payload",
    "write_payload",
]

#: Octets that a Connect response may take: its fixed blocks, a station name and a ModuleDiffBlock.
_CONNECT_ARGS_MAXIMUM = 4096


@value_class
class RecordAddress:
    """A record's address, and the sequence number that matches response and request."""

    sequence_number: int
    api: int
    slot: int
    subslot: int
    index: int


# Connect


def _expected(submodule: PlannedSubmodule) -> ExpectedSubmodule:
    data = []
    if submodule.provides_input:
        data.append(DataDescription(DataDirection.INPUT, submodule.input_bytes))
    if submodule.output_bytes:
        data.append(DataDescription(DataDirection.OUTPUT, submodule.output_bytes))
    return ExpectedSubmodule(submodule.subslot, submodule.submodule_ident, submodule.wire_properties, tuple(data))


def _expected_blocks(plan: ArPlan) -> list[ExpectedSubmoduleBlockReq]:
    return [
        ExpectedSubmoduleBlockReq((ExpectedApi(api, slot, ident, tuple(_expected(submodule) for submodule in group)),))
        for (api, slot, ident), group in groupby(plan.sorted_submodules, lambda s: (s.api, s.slot, s.module_ident))
    ]


def _iocr_block(layout: IocrLayout) -> IocrBlockReq:
    apis = []
    for api in sorted({d.api for d in layout.data} | {c.api for c in layout.iocs}):
        data = tuple(FrameSlot(d.slot, d.subslot, d.data_offset) for d in layout.data if d.api == api)
        iocs = tuple(FrameSlot(c.slot, c.subslot, c.iocs_offset or 0) for c in layout.iocs if c.api == api)
        apis.append(IocrApi(api, data, iocs))
    return IocrBlockReq(
        iocr_type=layout.iocr_type,
        iocr_reference=layout.iocr_reference,
        properties=layout.properties,
        data_length=layout.data_length,
        frame_id=layout.frame_id,
        send_clock_factor=layout.send_clock_factor,
        reduction_ratio=layout.reduction_ratio,
        apis=tuple(apis),
        phase=layout.phase,
        frame_send_offset=layout.frame_send_offset,
        watchdog_factor=layout.watchdog_factor,
        data_hold_factor=layout.data_hold_factor,
        tag_header=layout.tag_header,
    )


def connect_payload(plan: ArPlan, *layouts: IocrLayout) -> bytes:
    """IODConnectReq; without cyclic data it is the AR's block alone."""
    ar = ArBlockReq(
        ar_type=plan.ar_type,
        ar_uuid=plan.ar_uuid,
        session_key=plan.session_key,
        initiator_mac=plan.controller_mac,
        initiator_object_uuid=plan.controller_object_uuid,
        properties=plan.ar_properties,
        activity_timeout_factor=plan.activity_timeout_factor,
        udp_rt_port=ETHERTYPE_PROFINET,
        station_name=plan.controller_name.encode("latin-1"),
    )
    if plan.device_access:
        return emit_blocks([ar])
    blocks: list[Block] = [
        ar,
        *(_iocr_block(layout) for layout in layouts),
        *_expected_blocks(plan),
        plan.alarm_cr,
    ]
    return emit_blocks(blocks)


# Control


def _control(plan: ArPlan, block_type: int, command: int, sequence: int = 0) -> bytes:
    return ControlBlock(block_type, plan.ar_uuid, plan.session_key, command, sequence).emit()


def parameter_begin_payload(plan: ArPlan, submodules: Sequence[ExpectedKey]) -> bytes:
    """IODControlReq with ControlCommand PrmBegin and the submodules that it is about."""
    begin = _control(plan, BlockType.PRM_BEGIN_REQ, ControlCommand.PRM_BEGIN)
    return begin + SubmoduleList(tuple(submodules)).emit()


def parameter_end_payload(plan: ArPlan, sequence: int | None = None) -> bytes:
    """IODControlReq with ControlCommand PrmEnd; with an alarm's sequence number it is the end after a plug."""
    if sequence is None:
        return _control(plan, BlockType.PRM_END_REQ, ControlCommand.PRM_END)
    return _control(plan, BlockType.PRM_END_PLUG_REQ, ControlCommand.PRM_END, sequence)


def release_payload(plan: ArPlan) -> bytes:
    """IODReleaseReq."""
    return _control(plan, BlockType.RELEASE_REQ, ControlCommand.RELEASE)


# Records


def _write_header(ar_uuid: UUID, at: RecordAddress, length: int) -> IodWriteReqHeader:
    return IodWriteReqHeader(at.sequence_number, ar_uuid, at.api, at.slot, at.subslot, at.index, length)


def write_payload(ar_uuid: UUID, at: RecordAddress, data: bytes) -> bytes:
    """IODWriteReq of one record."""
    return emit_write_request(_write_header(ar_uuid, at, len(data)), data)


def multiple_write_payload(ar_uuid: UUID, sequence_number: int, writes: list[tuple[RecordAddress, bytes]]) -> bytes:
    """IODWriteMultipleReq; the outer header names no API, slot and subslot."""
    outer = IodWriteReqHeader(sequence_number, ar_uuid, API_NONE, 0xFFFF, 0xFFFF, INDEX_MULTIPLE_WRITE)
    return emit_multiple_write_request(
        outer, [RecordWrite(_write_header(ar_uuid, at, len(data)), data) for at, data in writes]
    )


def groups_of_records(records: Sequence[ParameterRecord], limit: int) -> list[tuple[ParameterRecord, ...]]:
    """Cut ``records`` into multiple writes of at most ``limit`` octets; a longer record gets its own write."""
    groups: list[list[ParameterRecord]] = []
    size = 0
    for record in records:
        octets = IOD_HEADER_SIZE + len(record.data) + -len(record.data) % 4
        if not groups or size + octets > limit:
            groups.append([])
            size = 0
        groups[-1].append(record)
        size += octets
    return [tuple(group) for group in groups]


def read_payload(ar_uuid: UUID, at: RecordAddress, length: int) -> bytes:
    """IODReadReq for up to ``length`` octets; with the nil UUID it is the request of ReadImplicit."""
    return IodReadReqHeader(at.sequence_number, ar_uuid, at.api, at.slot, at.subslot, at.index, length).emit()


def args_maximum(opnum: Opnum, payload: bytes, records: int = 0, length: int = 0) -> int:
    """ArgsMaximum: longest response in octets, and never less than the request's length."""
    answer = {
        Opnum.CONNECT: _CONNECT_ARGS_MAXIMUM,
        Opnum.WRITE: IOD_HEADER_SIZE * (records + 1),
        Opnum.READ: IOD_HEADER_SIZE + length,
        Opnum.READ_IMPLICIT: IOD_HEADER_SIZE + length,
    }.get(opnum, 0)
    return max(answer, len(payload))
