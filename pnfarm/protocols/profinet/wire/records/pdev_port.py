"""What a controller expects of a port and sets there: the blocks inside of PDPortDataCheck and PDPortDataAdjust.

IEC 61158-6-10, PDev.  Fields align to four octets from the start of their block's header; what pads a block up to four
octets may lie inside or after it, senders differ.  A block of a type without codec stays a :class:`RawBlock`.
"""

from enum import IntEnum
from typing import Annotated, Any, ClassVar, Self

from pnfarm.protocols.profinet.wire.block import ALIGNED, VERSION_1_0, VERSION_1_1, Block, RawBlock
from pnfarm.wire.layout import List8, Octets8, Outside, Structure, UInt8, UInt16, UInt32
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "AdjustDcpBoundary",
    "AdjustDomainBoundary",
    "AdjustLinkState",
    "AdjustMauType",
    "AdjustMulticastBoundary",
    "AdjustPeerToPeerBoundary",
    "AdjustPreambleLength",
    "CheckLineDelay",
    "CheckLinkState",
    "CheckMauType",
    "CheckMauTypeDifference",
    "CheckPeers",
    "CheckSyncDifference",
    "ExpectedPeer",
    "LinkStateLink",
    "LinkStatePort",
    "PdevBlockType",
    "read_sub_block",
]


class PdevBlockType(IntEnum):
    """IEC 61158-6-10, coding of the field BlockType: those of the physical device."""

    PORT_DATA_CHECK = 0x0200
    PORT_DATA_ADJUST = 0x0202
    ADJUST_DOMAIN_BOUNDARY = 0x0209
    CHECK_PEERS = 0x020A
    CHECK_LINE_DELAY = 0x020B
    CHECK_MAU_TYPE = 0x020C
    ADJUST_MAU_TYPE = 0x020E
    PORT_DATA_REAL = 0x020F
    ADJUST_MULTICAST_BOUNDARY = 0x0210
    INTERFACE_MRP_DATA_ADJUST = 0x0211
    INTERFACE_MRP_DATA_CHECK = 0x0213
    PORT_MRP_DATA_ADJUST = 0x0214
    ADJUST_LINK_STATE = 0x021B
    CHECK_LINK_STATE = 0x021C
    CHECK_SYNC_DIFFERENCE = 0x021E
    CHECK_MAU_TYPE_DIFFERENCE = 0x021F
    ADJUST_PEER_TO_PEER_BOUNDARY = 0x0224
    ADJUST_DCP_BOUNDARY = 0x0225
    ADJUST_PREAMBLE_LENGTH = 0x0226
    NC_DATA_CHECK = 0x0230
    INTERFACE_DATA_REAL = 0x0240
    INTERFACE_ADJUST = 0x0250
    PORT_STATISTIC = 0x0251
    MULTIPLE_BLOCK_HEADER = 0x0400
    INTERFACE_FSU_DATA_ADJUST = 0x0608
    PLL_CONTROL = 0xB050
    TRACE_UNIT = 0xB060


class LinkStateLink(IntEnum):
    """Low octet of LinkState."""

    UP = 1
    DOWN = 2
    TESTING = 3
    UNKNOWN = 4
    DORMANT = 5
    NOT_PRESENT = 6
    LOWER_LAYER_DOWN = 7


class LinkStatePort(IntEnum):
    """High octet of LinkState."""

    UNKNOWN = 0
    DISABLED = 1
    BLOCKING = 2
    LISTENING = 3
    LEARNING = 4
    FORWARDING = 5
    BROKEN = 6


class SubBlock(Block):
    """A block inside of these two records."""

    KINDS: ClassVar[dict[int, type[Block]]] = {}

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(padded=True, **more)


class ExpectedPeer(Structure):
    """One neighbour of CheckPeers."""

    port_name: Octets8
    station_name: Octets8


class CheckPeers(SubBlock, types=PdevBlockType.CHECK_PEERS):
    """0x020A."""

    peers: List8[ExpectedPeer]


class CheckLineDelay(SubBlock, types=PdevBlockType.CHECK_LINE_DELAY):
    """0x020B; nanoseconds, or with bit 31 the delay of the cable alone."""

    line_delay: Annotated[UInt32, ALIGNED]


class CheckMauType(SubBlock, types=PdevBlockType.CHECK_MAU_TYPE):
    """0x020C."""

    mau_type: UInt16


class CheckLinkState(SubBlock, types=PdevBlockType.CHECK_LINK_STATE):
    """0x021C: :class:`LinkStatePort` and :class:`LinkStateLink`."""

    port: UInt8
    link: UInt8


class CheckSyncDifference(SubBlock, types=PdevBlockType.CHECK_SYNC_DIFFERENCE):
    """0x021E; bit 0 cable delay, bit 1 sync master."""

    mode: UInt16


class CheckMauTypeDifference(SubBlock, types=PdevBlockType.CHECK_MAU_TYPE_DIFFERENCE):
    """0x021F; bit 0: the neighbour's MAU type is to be ours."""

    mode: UInt16


class AdjustDomainBoundary(SubBlock, types=PdevBlockType.ADJUST_DOMAIN_BOUNDARY):
    """0x0209.  Version 1.0 has one boundary for both directions: ``egress`` is None."""

    ingress: Annotated[UInt32, ALIGNED]
    egress: Outside[int | None] = None
    properties: UInt16 = 0

    @classmethod
    def read_body(cls, r: Reader, block: RawBlock) -> Self:
        ALIGNED.read(r, {})
        return cls(r.u32(), None if block.version == VERSION_1_0 else r.u32(), r.u16())

    @property
    def version(self) -> int:
        return VERSION_1_0 if self.egress is None else VERSION_1_1

    def write_body(self, w: Writer) -> None:
        ALIGNED.write(w, {})
        w.u32(self.ingress)
        if self.egress is not None:
            w.u32(self.egress)
        w.u16(self.properties)


class AdjustMulticastBoundary(SubBlock, types=PdevBlockType.ADJUST_MULTICAST_BOUNDARY):
    """0x0210."""

    boundary: Annotated[UInt32, ALIGNED]
    properties: UInt16 = 0


class AdjustMauType(SubBlock, types=PdevBlockType.ADJUST_MAU_TYPE):
    """0x020E; 0 for autonegotiation."""

    mau_type: Annotated[UInt16, ALIGNED]
    properties: UInt16 = 0


class AdjustLinkState(SubBlock, types=PdevBlockType.ADJUST_LINK_STATE):
    """0x021B."""

    port: Annotated[UInt8, ALIGNED]
    link: UInt8
    properties: UInt16 = 0


class AdjustPeerToPeerBoundary(SubBlock, types=PdevBlockType.ADJUST_PEER_TO_PEER_BOUNDARY):
    """0x0224; bit 0: send no LLDP, bit 1: no PTCP delay requests, bit 2: no path delay requests."""

    boundary: Annotated[UInt32, ALIGNED]
    properties: UInt16 = 0


class AdjustDcpBoundary(SubBlock, types=PdevBlockType.ADJUST_DCP_BOUNDARY):
    """0x0225; bit 0: forward no DCP Identify, bit 1: no Hello."""

    boundary: Annotated[UInt32, ALIGNED]
    properties: UInt16 = 0


class AdjustPreambleLength(SubBlock, types=PdevBlockType.ADJUST_PREAMBLE_LENGTH):
    """0x0226; 0 for seven octets, 1 for one."""

    length: Annotated[UInt16, ALIGNED]
    properties: UInt16 = 0


def read_sub_block(raw: RawBlock) -> Block:
    """Reasons: ``short``, ``trailing`` (more than padding after the block's fields)."""
    kind = SubBlock.KINDS.get(raw.block_type)
    return raw if kind is None else kind.of(raw)
