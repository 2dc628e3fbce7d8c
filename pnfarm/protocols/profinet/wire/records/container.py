"""CombinedObjectContainer, record 0x80B0: many records in one (IEC 61158-6-10, COContainerContent).

Each record is in its own block, which names its place and index; each block begins on a multiple of four octets.
"""

from collections.abc import Iterable
from typing import Annotated

from pnfarm.protocols.profinet.wire.block import VERSION_1_0, Block, BlockType
from pnfarm.wire.layout import Outside, Pad, Rest, UInt16, UInt32
from pnfarm.wire.octets import Reader, Writer

__all__ = ["ContainerContent", "emit_container", "parse_container"]


class ContainerContent(Block, types=BlockType.CONTAINER_CONTENT):
    """0x0401: one record to write."""

    api: Annotated[UInt32, Pad(2)]
    slot: UInt16
    subslot: UInt16
    index: Annotated[UInt16, Pad(2)]
    data: Rest
    version: Outside[int] = VERSION_1_0


def parse_container(data: bytes) -> tuple[ContainerContent, ...]:
    """The records of the container, in their order.  Raises :class:`DecodeError`."""
    reader = Reader(data)
    found = []
    while reader.remaining:
        found.append(ContainerContent.read(reader))
        reader.align(4)
    return tuple(found)


def emit_container(contents: Iterable[ContainerContent]) -> bytes:
    """The record's octets: padding between the blocks, none after the last."""
    w = Writer()
    for content in contents:
        content.write(w.align(4))
    return w.getvalue()
