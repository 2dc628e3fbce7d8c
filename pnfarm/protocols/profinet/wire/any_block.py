"""Any block: from its type to its codec.  What has no codec stays a :class:`RawBlock`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import Block, RawBlock, split_blocks
from pnfarm.protocols.profinet.wire.cm import connect, control, expected, iocr  # noqa: F401 - each adds its kinds
from pnfarm.protocols.profinet.wire.records import container, diagnosis, fsu, identification, log_book, pdev  # noqa: F401
from pnfarm.wire.octets import Reader

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["emit_blocks", "parse_block", "parse_blocks", "read_blocks"]


def parse_block(block: RawBlock) -> Block:
    """The typed form of ``block``, or ``block`` itself when its type has no codec.

    Raises :class:`DecodeError` when the type is known and the body does not follow it.
    """
    kind = Block.KINDS.get(block.block_type)
    return block if kind is None else kind.of(block)


def parse_blocks(data: bytes) -> tuple[Block, ...]:
    """Every block of a Connect, Control or Release payload, or of a record."""
    return tuple(parse_block(raw) for raw in split_blocks(data))


def read_blocks(data: bytes) -> tuple[tuple[Block, ...], tuple[str, ...]]:
    """As many blocks as can be read, for display; and a sentence for each one that cannot.

    A block that does not follow its type stays a :class:`RawBlock`; after a wrong length nothing more is read.
    """
    reader = Reader(data)
    blocks: list[Block] = []
    wrong: list[str] = []
    while reader.remaining:
        try:
            raw = RawBlock.read(reader)
        except DecodeError as exc:
            wrong.append(f"after {len(blocks)} blocks: {exc}")
            break
        try:
            blocks.append(parse_block(raw))
        except DecodeError as exc:
            blocks.append(raw)
            wrong.append(f"block 0x{raw.block_type:04X}: {exc}")
    return tuple(blocks), tuple(wrong)


def emit_blocks(blocks: Iterable[Block]) -> bytes:
    return b"".join(block.emit() for block in blocks)
