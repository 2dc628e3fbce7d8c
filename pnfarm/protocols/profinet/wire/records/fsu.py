"""Fast start-up: PDInterfaceFSUDataAdjust, record 0x8090, and ARFSUDataAdjust, record 0xE050 (IEC 61158-6-10).

The block of either holds others.  Those that say when to send Hello (FSHelloBlock) and which set of parameters a
controller writes (FSParameterBlock) are decoded; the rest is kept as it stands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import (
    VERSION_1_0,
    BlockType,
    RawBlock,
    check_type,
    emit_raw_block,
    parse_raw_block,
    read_uuid,
    split_blocks,
    write_uuid,
)
from pnfarm.wire.octets import Writer

if TYPE_CHECKING:
    from uuid import UUID

__all__ = [
    "FSU_DATA_ADJUST_INDEX",
    "ArFsuDataAdjust",
    "FsHello",
    "FsParameter",
    "FsuDataAdjust",
    "emit_ar_fsu_data_adjust",
    "emit_fsu_data_adjust",
    "parse_ar_fsu_data_adjust",
    "parse_fsu_data_adjust",
]

#: Record index of PDInterfaceFSUDataAdjust.
FSU_DATA_ADJUST_INDEX = 0x8090
_FS_HELLO = 0x0600
_FS_PARAMETER = 0x0601
_FSU_DATA_ADJUST = 0x0608


@dataclass(frozen=True, slots=True)
class FsHello:
    """FSHelloBlock: ``mode`` 0 off, 1 at link-up, 2 at link-up after the delay; times in milliseconds."""

    mode: int
    interval_ms: int
    retry: int
    delay_ms: int
    version: int = VERSION_1_0


@dataclass(frozen=True, slots=True)
class FsuDataAdjust:
    """The record; ``blocks`` in their order."""

    blocks: tuple[FsHello | RawBlock, ...]
    version: int = VERSION_1_0

    @property
    def hello(self) -> FsHello | None:
        """The first FSHelloBlock."""
        return next((block for block in self.blocks if isinstance(block, FsHello)), None)


def parse_fsu_data_adjust(data: bytes) -> FsuDataAdjust:
    """From the record's octets.  Raises :class:`DecodeError` (``short``, ``bad-type``, ``bad-length``)."""
    raw = split_blocks(data)
    if len(raw) != 1:
        raise DecodeError("bad-length", f"{len(raw)} blocks in a record of one")
    block = raw[0]
    reader = check_type(block, _FSU_DATA_ADJUST)
    reader.skip(2)
    blocks: list[FsHello | RawBlock] = []
    while reader.remaining:
        inner = parse_raw_block(reader)
        blocks.append(_parse_fs_hello(inner) if inner.block_type == _FS_HELLO else inner)
    return FsuDataAdjust(tuple(blocks), block.version)


def emit_fsu_data_adjust(record: FsuDataAdjust) -> bytes:
    """The record's octets; :class:`ValueError` when a field does not fit."""
    body = Writer().u16(0)
    for block in record.blocks:
        body.bytes(emit_raw_block(_emit_fs_hello(block) if isinstance(block, FsHello) else block))
    return emit_raw_block(RawBlock(_FSU_DATA_ADJUST, body.getvalue(), record.version))


def _parse_fs_hello(block: RawBlock) -> FsHello:
    reader = check_type(block, _FS_HELLO)
    reader.skip(2)
    return FsHello(reader.u32(), reader.u32(), reader.u32(), reader.u32(), block.version)


def _emit_fs_hello(hello: FsHello) -> RawBlock:
    body = Writer().u16(0).u32(hello.mode).u32(hello.interval_ms).u32(hello.retry).u32(hello.delay_ms)
    return RawBlock(_FS_HELLO, body.getvalue(), hello.version)


@dataclass(frozen=True, slots=True)
class FsParameter:
    """FSParameterBlock: ``mode`` 1 = on; ``uuid`` changes with the parameters."""

    mode: int
    uuid: UUID
    version: int = VERSION_1_0


@dataclass(frozen=True, slots=True)
class ArFsuDataAdjust:
    """0x0609, on its own the record 0xE050; ``blocks`` in their order."""

    blocks: tuple[FsParameter | RawBlock, ...]
    version: int = VERSION_1_0


def parse_ar_fsu_data_adjust(block: RawBlock) -> ArFsuDataAdjust:
    reader = check_type(block, BlockType.AR_FSU_DATA_ADJUST)
    reader.skip(2)
    blocks: list[FsParameter | RawBlock] = []
    while reader.remaining:
        inner = parse_raw_block(reader)
        blocks.append(_parse_fs_parameter(inner) if inner.block_type == _FS_PARAMETER else inner)
    return ArFsuDataAdjust(tuple(blocks), block.version)


def emit_ar_fsu_data_adjust(value: ArFsuDataAdjust) -> bytes:
    body = Writer().zeros(2)
    for block in value.blocks:
        body.bytes(emit_raw_block(_emit_fs_parameter(block) if isinstance(block, FsParameter) else block))
    return emit_raw_block(RawBlock(BlockType.AR_FSU_DATA_ADJUST, body.getvalue(), value.version))


def _parse_fs_parameter(block: RawBlock) -> FsParameter:
    reader = check_type(block, _FS_PARAMETER)
    reader.skip(2)
    value = FsParameter(reader.u32(), read_uuid(reader), block.version)
    reader.expect_end()
    return value


def _emit_fs_parameter(value: FsParameter) -> RawBlock:
    body = write_uuid(Writer().zeros(2).u32(value.mode), value.uuid)
    return RawBlock(_FS_PARAMETER, body.getvalue(), value.version)
