"""Read and write of records: the 64-octet headers of IODRead, IODWrite and of the multiple write
(IEC 61158-6-10, IODWriteReqHeader, IODWriteMultipleReq, IODReadReqHeader and their responses).

The header's BlockLength covers the header alone (60); the record's octets follow it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import (
    VERSION_1_0,
    BlockType,
    RawBlock,
    emit_raw_block,
    expect_padding,
    read_uuid,
    write_uuid,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import OK, PnioStatus
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "API_NONE",
    "INDEX_MULTIPLE_WRITE",
    "IOD_HEADER_SIZE",
    "NIL_UUID",
    "IodReadReqHeader",
    "IodReadResHeader",
    "IodWriteReqHeader",
    "IodWriteResHeader",
    "RecordRead",
    "RecordWrite",
    "WriteRequest",
    "emit_multiple_write_request",
    "emit_read_request",
    "emit_read_response",
    "emit_write_request",
    "emit_write_response",
    "parse_read_request",
    "parse_read_response",
    "parse_write_request",
    "parse_write_response",
]

IOD_HEADER_SIZE = 64
_HEADER_LENGTH = 60
INDEX_MULTIPLE_WRITE = 0xE040
#: API, slot and subslot of a multiple write's outer header.
API_NONE = 0xFFFFFFFF
NIL_UUID = UUID(int=0)


@dataclass(frozen=True, slots=True)
class IodWriteReqHeader:
    """0x0008.  ``record_data_length`` octets follow the header."""

    sequence_number: int
    ar_uuid: UUID
    api: int
    slot: int
    subslot: int
    index: int
    record_data_length: int = 0
    version: int = VERSION_1_0


@dataclass(frozen=True, slots=True)
class IodWriteResHeader:
    """0x8008."""

    sequence_number: int
    ar_uuid: UUID
    api: int
    slot: int
    subslot: int
    index: int
    record_data_length: int = 0
    additional_value1: int = 0
    additional_value2: int = 0
    status: PnioStatus = OK
    version: int = VERSION_1_0


@dataclass(frozen=True, slots=True)
class IodReadReqHeader:
    """0x0009.  ``record_data_length`` is the most that the reader takes.

    An implicit read has no AR: ``ar_uuid`` is nil and ``target_ar_uuid`` may name the AR it asks about.
    """

    sequence_number: int
    ar_uuid: UUID
    api: int
    slot: int
    subslot: int
    index: int
    record_data_length: int
    target_ar_uuid: UUID = NIL_UUID
    version: int = VERSION_1_0


@dataclass(frozen=True, slots=True)
class IodReadResHeader:
    """0x8009.  ``record_data_length`` octets follow the header."""

    sequence_number: int
    ar_uuid: UUID
    api: int
    slot: int
    subslot: int
    index: int
    record_data_length: int = 0
    additional_value1: int = 0
    additional_value2: int = 0
    version: int = VERSION_1_0


@dataclass(frozen=True, slots=True)
class RecordWrite:
    """One record to write: its header and its octets."""

    header: IodWriteReqHeader
    data: bytes


@dataclass(frozen=True, slots=True)
class RecordRead:
    """A read record as a response carries it."""

    header: IodReadResHeader
    data: bytes


@dataclass(frozen=True, slots=True)
class WriteRequest:
    """A Write call: ``header`` is the call's, ``writes`` its one record or those of the multiple write."""

    header: IodWriteReqHeader
    writes: tuple[RecordWrite, ...]

    @property
    def multiple(self) -> bool:
        return self.header.index == INDEX_MULTIPLE_WRITE


def _open(reader: Reader, block_type: int) -> tuple[Reader, int]:
    """Body of the header at the reader's place, and its version."""
    found, length, version = reader.u16(), reader.u16(), reader.u16()
    if found != block_type:
        raise DecodeError("bad-type", f"block 0x{found:04X} where 0x{block_type:04X} is expected")
    if length != _HEADER_LENGTH:
        raise DecodeError("bad-length", f"record header claims {length} octets, {_HEADER_LENGTH} are expected")
    return reader.sub(_HEADER_LENGTH - 2), version


def _read_common(r: Reader) -> tuple[int, UUID, int, int, int, int, int]:
    sequence, ar_uuid, api, slot, subslot = r.u16(), read_uuid(r), r.u32(), r.u16(), r.u16()
    r.skip(2)
    return sequence, ar_uuid, api, slot, subslot, r.u16(), r.u32()


def _common(value: IodWriteReqHeader | IodWriteResHeader | IodReadReqHeader | IodReadResHeader, length: int) -> Writer:
    w = write_uuid(Writer().u16(value.sequence_number), value.ar_uuid).u32(value.api).u16(value.slot)
    return w.u16(value.subslot).u16(0).u16(value.index).u32(length)


def _close(block_type: int, writer: Writer, version: int) -> bytes:
    writer.zeros(_HEADER_LENGTH - 2 - len(writer))
    return emit_raw_block(RawBlock(block_type, writer.getvalue(), version))


def _parse_write_header(reader: Reader) -> IodWriteReqHeader:
    r, version = _open(reader, BlockType.IOD_WRITE_REQ)
    return IodWriteReqHeader(*_read_common(r), version)


def _emit_write_header(header: IodWriteReqHeader, length: int) -> bytes:
    return _close(BlockType.IOD_WRITE_REQ, _common(header, length), header.version)


def parse_write_request(data: bytes) -> WriteRequest:
    """The payload of a Write call, single or multiple."""
    r = Reader(data)
    header = _parse_write_header(r)
    body = r.sub(header.record_data_length)
    expect_padding(r)
    if header.index != INDEX_MULTIPLE_WRITE:
        return WriteRequest(header, (RecordWrite(header, body.rest()),))
    writes = []
    while body.remaining:
        inner = _parse_write_header(body)
        writes.append(RecordWrite(inner, body.bytes(inner.record_data_length)))
        # each record starts on a multiple of four; the last one need not be padded
        body.align(4)
    return WriteRequest(header, tuple(writes))


def emit_write_request(header: IodWriteReqHeader, data: bytes) -> bytes:
    """A single write; ``record_data_length`` is taken from ``data``."""
    return _emit_write_header(header, len(data)) + data


def emit_multiple_write_request(header: IodWriteReqHeader, writes: Iterable[RecordWrite]) -> bytes:
    """A multiple write: padding to four octets between the records, none behind the last."""
    body = Writer()
    for write in writes:
        body.align(4).bytes(emit_write_request(write.header, write.data))
    return emit_write_request(replace(header, index=INDEX_MULTIPLE_WRITE), body.getvalue())


def _parse_write_res_header(reader: Reader) -> IodWriteResHeader:
    r, version = _open(reader, BlockType.IOD_WRITE_RES)
    common = _read_common(r)
    values = r.u16(), r.u16()
    return IodWriteResHeader(*common, *values, PnioStatus.from_int(r.u32()), version)


def parse_write_response(data: bytes) -> tuple[IodWriteResHeader, ...]:
    """The headers of a Write response: one, or the outer one of a multiple write and one for each record."""
    r = Reader(data)
    headers = []
    while r.remaining:
        headers.append(_parse_write_res_header(r))
    if not headers:
        raise DecodeError("short", "a Write response without a header")
    return tuple(headers)


def emit_write_response(headers: Iterable[IodWriteResHeader]) -> bytes:
    out = b""
    for header in headers:
        w = _common(header, header.record_data_length).u16(header.additional_value1).u16(header.additional_value2)
        w.u32(int(header.status))
        out += _close(BlockType.IOD_WRITE_RES, w, header.version)
    return out


def parse_read_request(data: bytes) -> IodReadReqHeader:
    reader = Reader(data)
    r, version = _open(reader, BlockType.IOD_READ_REQ)
    reader.expect_end()
    common = _read_common(r)
    # the place of the target's UUID is padding unless the read is implicit
    target = read_uuid(r) if common[1] == NIL_UUID else NIL_UUID
    return IodReadReqHeader(*common, target, version)


def emit_read_request(header: IodReadReqHeader) -> bytes:
    w = _common(header, header.record_data_length)
    if header.ar_uuid == NIL_UUID:
        write_uuid(w, header.target_ar_uuid)
    return _close(BlockType.IOD_READ_REQ, w, header.version)


def parse_read_response(data: bytes) -> RecordRead:
    reader = Reader(data)
    r, version = _open(reader, BlockType.IOD_READ_RES)
    header = IodReadResHeader(*_read_common(r), r.u16(), r.u16(), version)
    record = reader.bytes(header.record_data_length)
    expect_padding(reader)
    return RecordRead(header, record)


def emit_read_response(header: IodReadResHeader, data: bytes = b"") -> bytes:
    """``record_data_length`` is taken from ``data``."""
    w = _common(header, len(data)).u16(header.additional_value1).u16(header.additional_value2)
    return _close(BlockType.IOD_READ_RES, w, header.version) + data
