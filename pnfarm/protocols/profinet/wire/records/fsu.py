"""Fast start-up: PDInterfaceFSUDataAdjust, record 0x8090, and ARFSUDataAdjust, record 0xE050 (IEC 61158-6-10).

The block of either holds others.  Those that say when to send Hello (FSHelloBlock) and which set of parameters a
controller writes (FSParameterBlock) are decoded; the rest is kept unchanged.
"""

from typing import Annotated

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.block import VERSION_1_0, Block, Blocks, BlockType, RawBlock, split_blocks
from pnfarm.wire.layout import Outside, Pad, UInt32, Uuid

__all__ = [
    "ArFsuDataAdjust",
    "FsHello",
    "FsParameter",
    "FsuDataAdjust",
    "parse_fsu_data_adjust",
]


class FsHello(Block, types=0x0600, inner=True):
    """FSHelloBlock: ``mode`` 0 off, 1 at link-up, 2 at link-up after the delay; times in milliseconds."""

    mode: Annotated[UInt32, Pad(2)]
    interval_ms: UInt32
    retry: UInt32
    delay_ms: UInt32
    version: Outside[int] = VERSION_1_0


class FsuDataAdjust(Block, types=0x0608, inner=True):
    """The record; ``blocks`` in their order."""

    blocks: Annotated[tuple[FsHello | RawBlock, ...], Pad(2), Blocks(FsHello)]
    version: Outside[int] = VERSION_1_0

    @property
    def hello(self) -> FsHello | None:
        """The first FSHelloBlock."""
        return next((block for block in self.blocks if isinstance(block, FsHello)), None)


def parse_fsu_data_adjust(data: bytes) -> FsuDataAdjust:
    """From the record's octets.  Raises :class:`DecodeError` (``short``, ``bad-type``, ``bad-length``)."""
    raw = split_blocks(data)
    if len(raw) != 1:
        raise DecodeError("bad-length", f"{len(raw)} blocks in a record of one")
    return FsuDataAdjust.of(raw[0])


class FsParameter(Block, types=0x0601, inner=True):
    """FSParameterBlock: ``mode`` 1 = on; ``uuid`` changes with the parameters."""

    mode: Annotated[UInt32, Pad(2)]
    uuid: Uuid
    version: Outside[int] = VERSION_1_0


class ArFsuDataAdjust(Block, types=BlockType.AR_FSU_DATA_ADJUST):
    """0x0609, on its own the record 0xE050; ``blocks`` in their order."""

    blocks: Annotated[tuple[FsParameter | RawBlock, ...], Pad(2), Blocks(FsParameter)]
    version: Outside[int] = VERSION_1_0
