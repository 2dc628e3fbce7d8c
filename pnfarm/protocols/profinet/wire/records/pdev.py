"""Blocks of the physical device: an interface and its ports (IEC 61158-6-10, PDev; services: IEC 61158-5-10).

``PDPortDataCheck`` and ``PDPortDataAdjust`` hold blocks themselves (:mod:`pdev_port`).
"""

from collections.abc import Mapping
from dataclasses import replace
from enum import IntEnum
from typing import Annotated, Any, Self

from pnfarm.protocols.profinet.wire.block import (
    ALIGNED,
    BLOCK_HEADER_SIZE,
    VERSION_1_0,
    VERSION_1_1,
    Block,
    Blocks,
    RawBlock,
)
from pnfarm.protocols.profinet.wire.records.pdev_port import LinkStateLink, LinkStatePort, PdevBlockType, read_sub_block
from pnfarm.wire.layout import Count, Ip, Mac, Octets8, Outside, Pad, Structure, UInt8, UInt16, UInt32
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "InterfaceAdjust",
    "InterfaceDataReal",
    "MediaType",
    "MultipleBlock",
    "PeerReal",
    "PortDataAdjust",
    "PortDataCheck",
    "PortDataReal",
    "PortStatistic",
]

#: First octet of the type of every block that a port's record holds.
_SUB_BLOCKS = 0x02


class MediaType(IntEnum):
    """IEC 61158-6-10, coding of the field MediaType."""

    UNKNOWN = 0
    COPPER = 1
    FIBER = 2
    RADIO = 3


class PeerReal(Structure):
    """A neighbour in PDPortDataReal; ``line_delay`` in nanoseconds, 0 for not measured."""

    port_name: Annotated[Octets8, ALIGNED]
    station_name: Octets8
    line_delay: Annotated[UInt32, ALIGNED]
    mac: Mac


class PortDataReal(Block, types=PdevBlockType.PORT_DATA_REAL):
    """0x020F: a port as it is."""

    slot: Annotated[UInt16, ALIGNED]
    subslot: UInt16
    own_port_name: Octets8
    peers: Annotated[tuple[PeerReal, ...], Count("B", ALIGNED)] = ()
    mau_type: Annotated[UInt16, ALIGNED] = 0
    domain_boundary: Annotated[UInt32, ALIGNED] = 0
    multicast_boundary: UInt32 = 0
    link_state_port: UInt8 = LinkStatePort.UNKNOWN
    link_state_link: UInt8 = LinkStateLink.UP
    media_type: Annotated[UInt32, ALIGNED] = MediaType.COPPER
    version: Outside[int] = VERSION_1_0


class InterfaceDataReal(Block, types=PdevBlockType.INTERFACE_DATA_REAL):
    """0x0240: an interface as it is; 0.0.0.0 for no address."""

    name: Octets8
    mac: Annotated[Mac, ALIGNED]
    ip: Annotated[Ip, ALIGNED]
    mask: Ip
    gateway: Ip
    version: Outside[int] = VERSION_1_0


class PortStatistic(
    Block,
    types=PdevBlockType.PORT_STATISTIC,
    wire="status in_octets out_octets in_discards out_discards in_errors out_errors",
):
    """0x0251: counters of a port or of all ports of an interface, modulo 2**32.

    ``status`` (from version 1.1 on, else 0): bit n set when counter n, in this order, is invalid.
    """

    in_octets: UInt32 = 0
    out_octets: UInt32 = 0
    in_discards: UInt32 = 0
    out_discards: UInt32 = 0
    in_errors: UInt32 = 0
    out_errors: UInt32 = 0
    status: UInt16 = 0
    version: Outside[int] = VERSION_1_0

    @classmethod
    def read_body(cls, r: Reader, block: RawBlock) -> Self:
        return super().read_body(r, block).of_version()

    def write_body(self, w: Writer) -> None:
        Block.write_body(self.of_version(), w)

    def of_version(self) -> Self:
        """With the status that this version has."""
        return self if self.version >= VERSION_1_1 else replace(self, status=0)


class _SubBlocks(Blocks):
    """Blocks up to the end, with padding between them."""

    def read(self, r: Reader, _values: Mapping[str, Any]) -> tuple[Block, ...]:
        blocks: list[Block] = []
        rest = memoryview(r.rest())
        place = 0
        while place < len(rest):
            # no block in here has a type that begins with zero
            if rest[place] == 0 or (place % 4 and not _begins_block(rest[place:])):
                place += 1
                continue
            inner = Reader(rest[place:])
            blocks.append(read_sub_block(RawBlock.read(inner)))
            place += inner.position
        return tuple(blocks)


def _begins_block(octets: memoryview) -> bool:
    """Whether a block begins without padding before it; padding may hold any value, but hardly a matching header."""
    if len(octets) < BLOCK_HEADER_SIZE:
        return False
    return octets[0] == _SUB_BLOCKS and 4 + (octets[2] << 8 | octets[3]) <= len(octets)


class PortDataCheck(Block, types=PdevBlockType.PORT_DATA_CHECK):
    """0x0200: what the port is to be compared with."""

    slot: Annotated[UInt16, Pad(2)]
    subslot: UInt16
    blocks: Annotated[tuple[Block, ...], _SubBlocks(align=ALIGNED)] = ()
    version: Outside[int] = VERSION_1_0


class PortDataAdjust(Block, types=PdevBlockType.PORT_DATA_ADJUST):
    """0x0202: how the port is to be set."""

    slot: Annotated[UInt16, Pad(2)]
    subslot: UInt16
    blocks: Annotated[tuple[Block, ...], _SubBlocks(align=ALIGNED)] = ()
    version: Outside[int] = VERSION_1_0


class InterfaceAdjust(Block, types=PdevBlockType.INTERFACE_ADJUST):
    """0x0250.  MultipleInterfaceMode: bit 0 is NameOfDevice (:class:`NameMode`)."""

    multiple_interface_mode: Annotated[UInt32, ALIGNED]
    version: Outside[int] = VERSION_1_0


class MultipleBlock(Block, types=PdevBlockType.MULTIPLE_BLOCK_HEADER):
    """0x0400, MultipleBlockHeader: the blocks of one submodule, in PDRealData and PDExpectedData.

    Each is padded to four octets; the last one's padding may be missing.
    """

    api: Annotated[UInt32, ALIGNED]
    slot: UInt16
    subslot: UInt16
    blocks: Annotated[tuple[RawBlock, ...], Blocks(align=ALIGNED)] = ()
    version: Outside[int] = VERSION_1_0
