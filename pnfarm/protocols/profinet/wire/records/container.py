"""CombinedObjectContainer, record 0x80B0: many records in one (IEC 61158-6-10, COContainerContent).

Each record is in its own block, which names its place and index; each block begins on a multiple of four octets.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.wire.block import (
    VERSION_1_0,
    BlockType,
    RawBlock,
    check_type,
    emit_raw_block,
    parse_raw_block,
)
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["ContainerContent", "emit_container", "emit_container_content", "parse_container", "parse_container_content"]


@dataclass(frozen=True, slots=True)
class ContainerContent:
    """0x0401: one record to write."""

    api: int
    slot: int
    subslot: int
    index: int
    data: bytes
    version: int = VERSION_1_0


def parse_container_content(block: RawBlock) -> ContainerContent:
    r = check_type(block, BlockType.CONTAINER_CONTENT)
    r.skip(2)
    api, slot, subslot = r.u32(), r.u16(), r.u16()
    r.skip(2)
    return ContainerContent(api, slot, subslot, r.u16(), r.rest(), block.version)


def emit_container_content(value: ContainerContent) -> bytes:
    w = Writer().zeros(2).u32(value.api).u16(value.slot).u16(value.subslot).zeros(2).u16(value.index).bytes(value.data)
    return emit_raw_block(RawBlock(BlockType.CONTAINER_CONTENT, w.getvalue(), value.version))


def parse_container(data: bytes) -> tuple[ContainerContent, ...]:
    """The records of the container, in their order.  Raises :class:`DecodeError`."""
    reader = Reader(data)
    found = []
    while reader.remaining:
        found.append(parse_container_content(parse_raw_block(reader)))
        reader.align(4)
    return tuple(found)


def emit_container(contents: Iterable[ContainerContent]) -> bytes:
    """The record's octets: padding between the blocks, none behind the last."""
    w = Writer()
    for content in contents:
        w.align(4).bytes(emit_container_content(content))
    return w.getvalue()
