"""Read and write of records: the 64-octet headers of IODRead, IODWrite and of the multiple write
(IEC 61158-6-10, IODWriteReqHeader, IODWriteMultipleReq, IODReadReqHeader and their responses).

The header's BlockLength covers the header alone (60); the record's octets follow it.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Self
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import VERSION_1_0, BlockType, expect_padding
from pnfarm.protocols.profinet.wire.rpc.pdu import NIL_UUID, OK, PnioStatus
from pnfarm.wire.layout import Outside, Pad, Structure, UInt16, UInt32, Uuid, When
from pnfarm.wire.octets import Reader, Writer

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
    "emit_read_response",
    "emit_write_request",
    "emit_write_response",
    "parse_read_response",
    "parse_write_request",
    "parse_write_response",
]

IOD_HEADER_SIZE = 64
_HEADER_LENGTH = 60
INDEX_MULTIPLE_WRITE = 0xE040
#: API, slot and subslot of a multiple write's outer header.
API_NONE = 0xFFFFFFFF


class _Header(Structure):
    """What all four begin with; the rest of the 64 octets is padding of any value."""

    TYPE: ClassVar[int] = 0
    sequence_number: UInt16
    ar_uuid: Uuid
    api: UInt32
    slot: UInt16
    subslot: UInt16
    index: Annotated[UInt16, Pad(2)]
    record_data_length: UInt32 = 0

    @property
    def about(self) -> tuple[int, UUID, int, int, int, int]:
        """What an answer's header repeats of its request's."""
        return self.sequence_number, self.ar_uuid, self.api, self.slot, self.subslot, self.index

    @classmethod
    def read(cls, r: Reader, **_outside: Any) -> Self:
        found, length, version = r.u16(), r.u16(), r.u16()
        if found != cls.TYPE:
            raise DecodeError("bad-type", f"block 0x{found:04X} where 0x{cls.TYPE:04X} is expected")
        if length != _HEADER_LENGTH:
            raise DecodeError("bad-length", f"record header claims {length} octets, {_HEADER_LENGTH} are expected")
        return super().read(r.sub(_HEADER_LENGTH - 2), version=version)

    def write(self, w: Writer) -> None:
        body = Writer()
        super().write(body)
        w.u16(self.TYPE).u16(_HEADER_LENGTH).u16(vars(self)["version"])
        w.bytes(body.getvalue()).zeros(_HEADER_LENGTH - 2 - len(body))


class IodWriteReqHeader(_Header):
    """0x0008.  ``record_data_length`` octets follow the header."""

    TYPE = BlockType.IOD_WRITE_REQ
    version: Outside[int] = VERSION_1_0


class IodWriteResHeader(_Header):
    """0x8008."""

    TYPE = BlockType.IOD_WRITE_RES
    additional_value1: UInt16 = 0
    additional_value2: UInt16 = 0
    status: PnioStatus = OK
    version: Outside[int] = VERSION_1_0


class IodReadReqHeader(_Header):
    """0x0009.  ``record_data_length`` is the most that the reader takes.

    An implicit read has no AR: ``ar_uuid`` is nil and ``target_ar_uuid`` may name the AR it asks about; in any other,
    the place of the target's UUID is padding.
    """

    TYPE = BlockType.IOD_READ_REQ
    target_ar_uuid: Annotated[Uuid, When(lambda read: read["ar_uuid"] == NIL_UUID, NIL_UUID)] = NIL_UUID
    version: Outside[int] = VERSION_1_0


class IodReadResHeader(_Header):
    """0x8009.  ``record_data_length`` octets follow the header."""

    TYPE = BlockType.IOD_READ_RES
    additional_value1: UInt16 = 0
    additional_value2: UInt16 = 0
    version: Outside[int] = VERSION_1_0


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


def parse_write_request(data: bytes) -> WriteRequest:
    """The payload of a Write call, single or multiple."""
    r = Reader(data)
    header = IodWriteReqHeader.read(r)
    body = r.sub(header.record_data_length)
    expect_padding(r)
    if header.index != INDEX_MULTIPLE_WRITE:
        return WriteRequest(header, (RecordWrite(header, body.rest()),))
    writes = []
    while body.remaining:
        inner = IodWriteReqHeader.read(body)
        writes.append(RecordWrite(inner, body.bytes(inner.record_data_length)))
        # each record starts on a multiple of four; the last one need not be padded
        body.align(4)
    return WriteRequest(header, tuple(writes))


def emit_write_request(header: IodWriteReqHeader, data: bytes) -> bytes:
    """A single write; ``record_data_length`` is taken from ``data``."""
    return replace(header, record_data_length=len(data)).emit() + data


def emit_multiple_write_request(header: IodWriteReqHeader, writes: Iterable[RecordWrite]) -> bytes:
    """A multiple write: padding to four octets between the records, none after the last."""
    body = Writer()
    for write in writes:
        body.align(4).bytes(emit_write_request(write.header, write.data))
    return emit_write_request(replace(header, index=INDEX_MULTIPLE_WRITE), body.getvalue())


def parse_write_response(data: bytes) -> tuple[IodWriteResHeader, ...]:
    """The headers of a Write response: one, or the outer one of a multiple write and one for each record."""
    r = Reader(data)
    headers = []
    while r.remaining:
        headers.append(IodWriteResHeader.read(r))
    if not headers:
        raise DecodeError("short", "a Write response without a header")
    return tuple(headers)


def emit_write_response(headers: Iterable[IodWriteResHeader]) -> bytes:
    return b"".join(header.emit() for header in headers)


def parse_read_response(data: bytes) -> RecordRead:
    reader = Reader(data)
    header = IodReadResHeader.read(reader)
    record = reader.bytes(header.record_data_length)
    expect_padding(reader)
    return RecordRead(header, record)


def emit_read_response(header: IodReadResHeader, data: bytes = b"") -> bytes:
    """``record_data_length`` is taken from ``data``."""
    return replace(header, record_data_length=len(data)).emit() + data
