"""The block: the unit that PDUs of PROFINET context management consist of (IEC 61158-6-10, BlockHeader).

A block is ``BlockType u16, BlockLength u16, BlockVersionHigh u8, BlockVersionLow u8, body``; the
length counts everything behind itself, so it is the body's plus two.  This file holds what all
families share; the families are in :mod:`~pnfarm.protocols.profinet.wire.cm` and
:mod:`~pnfarm.protocols.profinet.wire.records`, and :mod:`any_block` joins them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "BLOCK_HEADER_SIZE",
    "RESPONSE",
    "VERSION_1_0",
    "VERSION_1_1",
    "BlockType",
    "RawBlock",
    "check_type",
    "emit_raw_block",
    "expect_padding",
    "parse_raw_block",
    "read_uuid",
    "split_blocks",
    "write_uuid",
]

BLOCK_HEADER_SIZE = 6
#: BlockVersionHigh << 8 | BlockVersionLow.
VERSION_1_0 = 0x0100
VERSION_1_1 = 0x0101
#: A response's BlockType is its request's with this bit.
RESPONSE = 0x8000


class BlockType(IntEnum):
    """IEC 61158-6-10, coding of the field BlockType: the ones this package knows by name."""

    IOD_WRITE_REQ = 0x0008
    IOD_READ_REQ = 0x0009
    DIAGNOSIS_DATA = 0x0010
    EXPECTED_IDENTIFICATION_DATA = 0x0012
    REAL_IDENTIFICATION_DATA = 0x0013
    SUBSTITUTE_VALUE = 0x0014
    RECORD_INPUT_DATA_OBJECT = 0x0015
    RECORD_OUTPUT_DATA_OBJECT = 0x0016
    AR_DATA = 0x0018
    LOG_DATA = 0x0019
    API_DATA = 0x001A
    IM0 = 0x0020
    IM1 = 0x0021
    IM2 = 0x0022
    IM3 = 0x0023
    IM4 = 0x0024
    IM0_FILTER_DATA_SUBMODULE = 0x0030
    IM0_FILTER_DATA_MODULE = 0x0031
    IM0_FILTER_DATA_DEVICE = 0x0032
    CONTAINER_CONTENT = 0x0401
    AR_REQ = 0x0101
    IOCR_REQ = 0x0102
    ALARM_CR_REQ = 0x0103
    EXPECTED_SUBMODULE_REQ = 0x0104
    PRM_SERVER_REQ = 0x0105
    MCR_REQ = 0x0106
    AR_RPC_REQ = 0x0107
    AR_VENDOR_REQ = 0x0108
    IR_INFO_REQ = 0x0109
    SR_INFO_REQ = 0x010A
    AR_FSU_REQ = 0x010B
    RS_INFO_REQ = 0x010C
    PRM_END_REQ = 0x0110
    PRM_END_PLUG_REQ = 0x0111
    APPLICATION_READY_REQ = 0x0112
    APPLICATION_READY_PLUG_REQ = 0x0113
    RELEASE_REQ = 0x0114
    READY_FOR_COMPANION_REQ = 0x0116
    READY_FOR_RT_CLASS_3_REQ = 0x0117
    PRM_BEGIN_REQ = 0x0118
    SUBMODULE_LIST = 0x0119
    AR_FSU_DATA_ADJUST = 0x0609
    MAINTENANCE_ITEM = 0x0F00
    IOD_WRITE_RES = 0x8008
    IOD_READ_RES = 0x8009
    AR_RES = 0x8101
    IOCR_RES = 0x8102
    ALARM_CR_RES = 0x8103
    MODULE_DIFF = 0x8104
    PRM_SERVER_RES = 0x8105
    AR_SERVER_RES = 0x8106
    AR_RPC_RES = 0x8107
    AR_VENDOR_RES = 0x8108
    PRM_END_RES = 0x8110
    PRM_END_PLUG_RES = 0x8111
    APPLICATION_READY_RES = 0x8112
    APPLICATION_READY_PLUG_RES = 0x8113
    RELEASE_RES = 0x8114
    READY_FOR_COMPANION_RES = 0x8116
    READY_FOR_RT_CLASS_3_RES = 0x8117
    PRM_BEGIN_RES = 0x8118


@dataclass(frozen=True, slots=True)
class RawBlock:
    """A block as on the wire; ``body`` is what follows the six octets of its header."""

    block_type: int
    body: bytes
    version: int = VERSION_1_0

    @property
    def length(self) -> int:
        """BlockLength: the body and the two octets of the version."""
        return len(self.body) + 2

    @property
    def version_high(self) -> int:
        return self.version >> 8

    @property
    def version_low(self) -> int:
        return self.version & 0xFF


def parse_raw_block(reader: Reader) -> RawBlock:
    """The next block of ``reader``.  Raises :class:`DecodeError` (``short``, ``bad-length``)."""
    block_type = reader.u16()
    length = reader.u16()
    if length < 2:
        raise DecodeError("bad-length", f"block 0x{block_type:04X} claims a length of {length}")
    version = reader.u16()
    return RawBlock(block_type, reader.bytes(length - 2), version)


def emit_raw_block(block: RawBlock) -> bytes:
    return Writer().u16(block.block_type).u16(block.length).u16(block.version).bytes(block.body).getvalue()


def split_blocks(data: bytes) -> tuple[RawBlock, ...]:
    """Cut ``data`` into blocks; they follow each other without padding, up to the last octet."""
    reader = Reader(data)
    blocks = []
    while reader.remaining:
        blocks.append(parse_raw_block(reader))
    return tuple(blocks)


def check_type(block: RawBlock, *allowed: int) -> Reader:
    """A reader over the body of a block whose type must be one of ``allowed``."""
    if block.block_type not in allowed:
        raise DecodeError("bad-type", f"block 0x{block.block_type:04X} where 0x{allowed[0]:04X} is expected")
    return Reader(block.body)


def expect_padding(reader: Reader) -> None:
    """Skip what is left, padding to four octets, of any value: some devices do not clear it.

    Raises ``trailing`` where more is left than padding can be.
    """
    if reader.remaining > 3:
        raise DecodeError("trailing", f"{reader.remaining} octets after the end, padding has at most 3")
    reader.skip(reader.remaining)


def read_uuid(reader: Reader) -> UUID:
    """A UUID inside of a block: always big-endian, whatever the RPC header says."""
    return UUID(bytes=reader.bytes(16))


def write_uuid(writer: Writer, value: UUID) -> Writer:
    return writer.bytes(value.bytes)
