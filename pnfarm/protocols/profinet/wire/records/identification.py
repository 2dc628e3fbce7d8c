"""Blocks that records carry: identification and maintenance, identification data, AR and API data,
the I/O data of one submodule (IEC 61158-6-10; I&M: PI profile guideline 1)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import (
    VERSION_1_0,
    VERSION_1_1,
    BlockType,
    RawBlock,
    check_type,
    emit_raw_block,
    read_uuid,
    write_uuid,
)
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from uuid import UUID

__all__ = [
    "IM_TEXT_SIZES",
    "ApiData",
    "ArData",
    "ArDataEntry",
    "ArDataIocr",
    "IdentificationApi",
    "IdentificationData",
    "IdentificationSlot",
    "Im0",
    "ImText",
    "RecordInputData",
    "RecordOutputData",
    "SubstituteValue",
    "SubstitutionMode",
    "emit_api_data",
    "emit_ar_data",
    "emit_identification_data",
    "emit_im0",
    "emit_im_text",
    "emit_record_input_data",
    "emit_record_output_data",
    "emit_substitute_value",
    "parse_api_data",
    "parse_ar_data",
    "parse_identification_data",
    "parse_im0",
    "parse_im_text",
    "parse_record_input_data",
    "parse_record_output_data",
    "parse_substitute_value",
]

_FILTER_TYPES = (
    BlockType.IM0_FILTER_DATA_SUBMODULE,
    BlockType.IM0_FILTER_DATA_MODULE,
    BlockType.IM0_FILTER_DATA_DEVICE,
)
_IDENTIFICATION_TYPES = (BlockType.EXPECTED_IDENTIFICATION_DATA, BlockType.REAL_IDENTIFICATION_DATA)

#: Octets of text in I&M1 (tag function 32, tag location 22), I&M2 (date), I&M3 (descriptor), I&M4 (signature).
IM_TEXT_SIZES = {BlockType.IM1: 54, BlockType.IM2: 16, BlockType.IM3: 54, BlockType.IM4: 54}


@dataclass(frozen=True, slots=True)
class Im0:
    """0x0020.  ``order_id`` is padded with blanks to 20 octets, ``serial_number`` to 16."""

    vendor_id: int
    order_id: bytes
    serial_number: bytes
    hardware_revision: int
    software_revision: tuple[str, int, int, int]
    revision_counter: int = 0
    profile_id: int = 0
    profile_specific_type: int = 0
    im_version: int = 0x0101
    im_supported: int = 0
    version: int = VERSION_1_0


def parse_im0(block: RawBlock) -> Im0:
    r = check_type(block, BlockType.IM0)
    value = Im0(
        r.u16(),
        r.bytes(20),
        r.bytes(16),
        r.u16(),
        (chr(r.u8()), r.u8(), r.u8(), r.u8()),
        r.u16(),
        r.u16(),
        r.u16(),
        r.u16(),
        r.u16(),
        block.version,
    )
    r.expect_end()
    return value


def emit_im0(value: Im0) -> bytes:
    prefix, *numbers = value.software_revision
    w = Writer().u16(value.vendor_id).bytes(value.order_id.ljust(20)[:20]).bytes(value.serial_number.ljust(16)[:16])
    w.u16(value.hardware_revision).u8(ord(prefix))
    for number in numbers:
        w.u8(number)
    w.u16(value.revision_counter).u16(value.profile_id).u16(value.profile_specific_type)
    w.u16(value.im_version).u16(value.im_supported)
    return emit_raw_block(RawBlock(BlockType.IM0, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class ImText:
    """0x0021 - 0x0024, I&M1 to I&M4: text of a fixed size, see :data:`IM_TEXT_SIZES`."""

    block_type: int
    text: bytes
    version: int = VERSION_1_0


def parse_im_text(block: RawBlock) -> ImText:
    r = check_type(block, *IM_TEXT_SIZES)
    text = r.bytes(IM_TEXT_SIZES[BlockType(block.block_type)])
    r.expect_end()
    return ImText(block.block_type, text, block.version)


def emit_im_text(value: ImText) -> bytes:
    return emit_raw_block(RawBlock(value.block_type, value.text, value.version))


@dataclass(frozen=True, slots=True)
class IdentificationSlot:
    """``submodules`` are (subslot, submodule ident)."""

    slot: int
    module_ident: int
    submodules: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class IdentificationApi:
    api: int
    slots: tuple[IdentificationSlot, ...]


@dataclass(frozen=True, slots=True)
class IdentificationData:
    """0x0012 expected, 0x0013 real identification, 0x0030 - 0x0032 I&M0 filter: all list submodules.

    Version 1.0 of the identification blocks names no API (there is one, API 0); 1.1 does, as the filters do.
    """

    block_type: int
    apis: tuple[IdentificationApi, ...]
    version: int = VERSION_1_1


def _names_api(block_type: int, version: int) -> bool:
    return block_type in _FILTER_TYPES or version != VERSION_1_0


def _read_slot(r: Reader) -> IdentificationSlot:
    slot, ident, count = r.u16(), r.u32(), r.u16()
    return IdentificationSlot(slot, ident, tuple((r.u16(), r.u32()) for _ in range(count)))


def parse_identification_data(block: RawBlock) -> IdentificationData:
    r = check_type(block, *_IDENTIFICATION_TYPES, *_FILTER_TYPES)
    apis = []
    named = _names_api(block.block_type, block.version)
    for _ in range(r.u16() if named else 1):
        api = r.u32() if named else 0
        count = r.u16()
        apis.append(IdentificationApi(api, tuple(_read_slot(r) for _ in range(count))))
    r.expect_end()
    return IdentificationData(block.block_type, tuple(apis), block.version)


def emit_identification_data(value: IdentificationData) -> bytes:
    """Raises :class:`ValueError` for a version 1.0 identification that names another API than 0."""
    w = Writer()
    named = _names_api(value.block_type, value.version)
    if named:
        w.u16(len(value.apis))
    elif [a.api for a in value.apis] != [0]:
        raise ValueError("version 1.0 of identification data holds exactly API 0")
    for api in value.apis:
        if named:
            w.u32(api.api)
        w.u16(len(api.slots))
        for slot in api.slots:
            w.u16(slot.slot).u32(slot.module_ident).u16(len(slot.submodules))
            for subslot, ident in slot.submodules:
                w.u16(subslot).u32(ident)
    return emit_raw_block(RawBlock(value.block_type, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class ApiData:
    """0x001A: the APIs that the device has."""

    apis: tuple[int, ...]
    version: int = VERSION_1_0


def parse_api_data(block: RawBlock) -> ApiData:
    r = check_type(block, BlockType.API_DATA)
    value = ApiData(tuple(r.u32() for _ in range(r.u16())), block.version)
    r.expect_end()
    return value


def emit_api_data(value: ApiData) -> bytes:
    w = Writer().u16(len(value.apis))
    for api in value.apis:
        w.u32(api)
    return emit_raw_block(RawBlock(BlockType.API_DATA, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class ArDataIocr:
    """``apdu_status`` is cycle counter, data status, transfer status, as a frame ends."""

    properties: int
    iocr_type: int
    frame_id: int
    apdu_status: int = 0


@dataclass(frozen=True, slots=True)
class ArDataEntry:
    """One AR of ARData, version 1.1."""

    ar_uuid: UUID
    initiator_object_uuid: UUID
    parameter_server_object_uuid: UUID
    properties: int
    ar_type: int
    alarm_cr_type: int
    local_alarm_reference: int
    remote_alarm_reference: int
    initiator_udp_rt_port: int
    responder_udp_rt_port: int
    initiator_station_name: bytes
    iocrs: tuple[ArDataIocr, ...]
    apis: tuple[int, ...]
    parameter_server_station_name: bytes = b""


@dataclass(frozen=True, slots=True)
class ArData:
    """0x0018, version 1.1: the established ARs; without the optional ARDataInfo blocks."""

    ars: tuple[ArDataEntry, ...]
    version: int = VERSION_1_1


# The header's six octets count for the alignment, the body's reader does not see them.
_ALIGN_SHIFT = 6


def _align_read(r: Reader) -> None:
    """Padding behind the last field may be missing."""
    r.skip(min(-(r.position + _ALIGN_SHIFT) % 4, r.remaining))


def _align_write(w: Writer) -> None:
    w.zeros(-(len(w) + _ALIGN_SHIFT) % 4)


def _read_aligned_u16(r: Reader) -> int:
    value = r.u16()
    _align_read(r)
    return value


def _read_ar(r: Reader) -> ArDataEntry:
    head = read_uuid(r), read_uuid(r), read_uuid(r), r.u32(), r.u16(), r.u16(), r.u16(), r.u16(), r.u16(), r.u16()
    name = r.bytes(r.u16())
    _align_read(r)
    server_name = r.bytes(r.u16())
    _align_read(r)
    iocrs = tuple(ArDataIocr(r.u32(), r.u16(), r.u16(), r.u32()) for _ in range(_read_aligned_u16(r)))
    apis = tuple(r.u32() for _ in range(_read_aligned_u16(r)))
    if _read_aligned_u16(r):
        raise DecodeError("unsupported", "ARData with ARDataInfo blocks")
    return ArDataEntry(*head, name, iocrs, apis, server_name)


def parse_ar_data(block: RawBlock) -> ArData:
    """Raises ``unsupported`` for another version than 1.1 and for ARDataInfo blocks."""
    r = check_type(block, BlockType.AR_DATA)
    if block.version != VERSION_1_1:
        raise DecodeError("unsupported", f"ARData of version 0x{block.version:04X}")
    value = ArData(tuple(_read_ar(r) for _ in range(r.u16())), block.version)
    r.expect_end()
    return value


def emit_ar_data(value: ArData) -> bytes:
    w = Writer().u16(len(value.ars))
    for ar in value.ars:
        for uuid in (ar.ar_uuid, ar.initiator_object_uuid, ar.parameter_server_object_uuid):
            write_uuid(w, uuid)
        w.u32(ar.properties).u16(ar.ar_type).u16(ar.alarm_cr_type).u16(ar.local_alarm_reference)
        w.u16(ar.remote_alarm_reference).u16(ar.initiator_udp_rt_port).u16(ar.responder_udp_rt_port)
        for name in (ar.initiator_station_name, ar.parameter_server_station_name):
            w.u16(len(name)).bytes(name)
            _align_write(w)
        w.u16(len(ar.iocrs))
        _align_write(w)
        for iocr in ar.iocrs:
            w.u32(iocr.properties).u16(iocr.iocr_type).u16(iocr.frame_id).u32(iocr.apdu_status)
        w.u16(len(ar.apis))
        _align_write(w)
        for api in ar.apis:
            w.u32(api)
        w.u16(0)
        _align_write(w)
    return emit_raw_block(RawBlock(BlockType.AR_DATA, w.getvalue(), value.version))


class SubstitutionMode(IntEnum):
    """Coding of the field SubstitutionMode."""

    ZERO = 0
    LAST_VALUE = 1
    REPLACEMENT_VALUE = 2


@dataclass(frozen=True, slots=True)
class SubstituteValue:
    """0x0014: what a submodule puts out when its outputs fail; both statuses have one octet."""

    mode: int
    iocs: int
    data: bytes
    iops: int
    version: int = VERSION_1_0


def parse_substitute_value(block: RawBlock) -> SubstituteValue:
    r = check_type(block, BlockType.SUBSTITUTE_VALUE)
    mode, iocs = r.u16(), r.u8()
    value = SubstituteValue(mode, iocs, r.bytes(max(0, r.remaining - 1)), r.u8(), block.version)
    r.expect_end()
    return value


def emit_substitute_value(value: SubstituteValue) -> bytes:
    w = Writer().u16(value.mode).u8(value.iocs).bytes(value.data).u8(value.iops)
    return emit_raw_block(RawBlock(BlockType.SUBSTITUTE_VALUE, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class RecordInputData:
    """0x0015, RecordInputDataObjectElement: inputs of one submodule with both statuses."""

    iocs: bytes
    iops: bytes
    data: bytes
    version: int = VERSION_1_0


def parse_record_input_data(block: RawBlock) -> RecordInputData:
    r = check_type(block, BlockType.RECORD_INPUT_DATA_OBJECT)
    value = RecordInputData(r.bytes(r.u8()), r.bytes(r.u8()), r.bytes(r.u16()), block.version)
    r.expect_end()
    return value


def emit_record_input_data(value: RecordInputData) -> bytes:
    w = Writer().u8(len(value.iocs)).bytes(value.iocs).u8(len(value.iops)).bytes(value.iops)
    w.u16(len(value.data)).bytes(value.data)
    return emit_raw_block(RawBlock(BlockType.RECORD_INPUT_DATA_OBJECT, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class RecordOutputData:
    """0x0016, RecordOutputDataObjectElement; ``substitute`` is the SubstituteValue block's octets, if any."""

    iocs: bytes
    iops: bytes
    data: bytes
    substitute_active: int = 0
    substitute: bytes = b""
    version: int = VERSION_1_0


def parse_record_output_data(block: RawBlock) -> RecordOutputData:
    r = check_type(block, BlockType.RECORD_OUTPUT_DATA_OBJECT)
    active, iocs_length, iops_length, data_length = r.u16(), r.u8(), r.u8(), r.u16()
    iocs, data, iops = r.bytes(iocs_length), r.bytes(data_length), r.bytes(iops_length)
    return RecordOutputData(iocs, iops, data, active, r.rest(), block.version)


def emit_record_output_data(value: RecordOutputData) -> bytes:
    w = Writer().u16(value.substitute_active).u8(len(value.iocs)).u8(len(value.iops)).u16(len(value.data))
    w.bytes(value.iocs).bytes(value.data).bytes(value.iops).bytes(value.substitute)
    return emit_raw_block(RawBlock(BlockType.RECORD_OUTPUT_DATA_OBJECT, w.getvalue(), value.version))
