"""What a controller expects of a port and sets there: the blocks inside of PDPortDataCheck and PDPortDataAdjust.

IEC 61158-6-10, PDev.  Fields align to four octets from the start of their block's header; what pads a block up to four
octets may lie inside or behind it, senders differ.  A block of a type without codec stays a :class:`RawBlock`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, TypeAlias

from pnfarm.protocols.profinet.wire.block import (
    BLOCK_HEADER_SIZE,
    VERSION_1_0,
    VERSION_1_1,
    RawBlock,
    emit_raw_block,
    expect_padding,
)
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Callable

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
    "SubBlock",
    "align",
    "emit_sub_block",
    "pad",
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


@dataclass(frozen=True, slots=True)
class ExpectedPeer:
    """One neighbour of CheckPeers."""

    port_name: bytes
    station_name: bytes


@dataclass(frozen=True, slots=True)
class CheckPeers:
    """0x020A."""

    peers: tuple[ExpectedPeer, ...]


@dataclass(frozen=True, slots=True)
class CheckLineDelay:
    """0x020B; nanoseconds, or with bit 31 the delay of the cable alone."""

    line_delay: int


@dataclass(frozen=True, slots=True)
class CheckMauType:
    """0x020C."""

    mau_type: int


@dataclass(frozen=True, slots=True)
class CheckLinkState:
    """0x021C: :class:`LinkStatePort` and :class:`LinkStateLink`."""

    port: int
    link: int


@dataclass(frozen=True, slots=True)
class CheckSyncDifference:
    """0x021E; bit 0 cable delay, bit 1 sync master."""

    mode: int


@dataclass(frozen=True, slots=True)
class CheckMauTypeDifference:
    """0x021F; bit 0: the neighbour's MAU type is to be ours."""

    mode: int


@dataclass(frozen=True, slots=True)
class AdjustDomainBoundary:
    """0x0209.  Version 1.0 has one boundary for both directions: ``egress`` is None."""

    ingress: int
    egress: int | None = None
    properties: int = 0


@dataclass(frozen=True, slots=True)
class AdjustMulticastBoundary:
    """0x0210."""

    boundary: int
    properties: int = 0


@dataclass(frozen=True, slots=True)
class AdjustMauType:
    """0x020E; 0 for autonegotiation."""

    mau_type: int
    properties: int = 0


@dataclass(frozen=True, slots=True)
class AdjustLinkState:
    """0x021B."""

    port: int
    link: int
    properties: int = 0


@dataclass(frozen=True, slots=True)
class AdjustPeerToPeerBoundary:
    """0x0224; bit 0: send no LLDP, bit 1: no PTCP delay requests, bit 2: no path delay requests."""

    boundary: int
    properties: int = 0


@dataclass(frozen=True, slots=True)
class AdjustDcpBoundary:
    """0x0225; bit 0: forward no DCP Identify, bit 1: no Hello."""

    boundary: int
    properties: int = 0


@dataclass(frozen=True, slots=True)
class AdjustPreambleLength:
    """0x0226; 0 for seven octets, 1 for one."""

    length: int
    properties: int = 0


SubBlock: TypeAlias = (
    CheckPeers
    | CheckLineDelay
    | CheckMauType
    | CheckLinkState
    | CheckSyncDifference
    | CheckMauTypeDifference
    | AdjustDomainBoundary
    | AdjustMulticastBoundary
    | AdjustMauType
    | AdjustLinkState
    | AdjustPeerToPeerBoundary
    | AdjustDcpBoundary
    | AdjustPreambleLength
    | RawBlock
)


def _read_peers(r: Reader, _version: int) -> SubBlock:
    return CheckPeers(tuple(ExpectedPeer(r.bytes(r.u8()), r.bytes(r.u8())) for _ in range(r.u8())))


def _read_domain(r: Reader, version: int) -> SubBlock:
    align(r)
    ingress = r.u32()
    return AdjustDomainBoundary(ingress, None if version == VERSION_1_0 else r.u32(), r.u16())


def _aligned(kind: Callable[[int, int], SubBlock], wide: bool) -> Callable[[Reader, int], SubBlock]:
    def read(r: Reader, _version: int) -> SubBlock:
        align(r)
        return kind(r.u32() if wide else r.u16(), r.u16())

    return read


def _read_adjust_link(r: Reader, _version: int) -> SubBlock:
    align(r)
    return AdjustLinkState(r.u8(), r.u8(), r.u16())


def _read_line_delay(r: Reader, _version: int) -> SubBlock:
    align(r)
    return CheckLineDelay(r.u32())


_SUB_READERS: dict[int, Callable[[Reader, int], SubBlock]] = {
    PdevBlockType.CHECK_PEERS: _read_peers,
    PdevBlockType.CHECK_LINE_DELAY: _read_line_delay,
    PdevBlockType.CHECK_MAU_TYPE: lambda r, _: CheckMauType(r.u16()),
    PdevBlockType.CHECK_LINK_STATE: lambda r, _: CheckLinkState(r.u8(), r.u8()),
    PdevBlockType.CHECK_SYNC_DIFFERENCE: lambda r, _: CheckSyncDifference(r.u16()),
    PdevBlockType.CHECK_MAU_TYPE_DIFFERENCE: lambda r, _: CheckMauTypeDifference(r.u16()),
    PdevBlockType.ADJUST_DOMAIN_BOUNDARY: _read_domain,
    PdevBlockType.ADJUST_MULTICAST_BOUNDARY: _aligned(AdjustMulticastBoundary, wide=True),
    PdevBlockType.ADJUST_MAU_TYPE: _aligned(AdjustMauType, wide=False),
    PdevBlockType.ADJUST_LINK_STATE: _read_adjust_link,
    PdevBlockType.ADJUST_PEER_TO_PEER_BOUNDARY: _aligned(AdjustPeerToPeerBoundary, wide=True),
    PdevBlockType.ADJUST_DCP_BOUNDARY: _aligned(AdjustDcpBoundary, wide=True),
    PdevBlockType.ADJUST_PREAMBLE_LENGTH: _aligned(AdjustPreambleLength, wide=False),
}


def read_sub_block(raw: RawBlock) -> SubBlock:
    """Reasons: ``short``, ``trailing`` (more than padding behind the block's fields)."""
    read = _SUB_READERS.get(raw.block_type)
    if read is None:
        return raw
    r = Reader(raw.body)
    value = read(r, raw.version)
    expect_padding(r)
    return value


def emit_sub_block(value: SubBlock) -> bytes:
    w, version = Writer(), VERSION_1_0
    match value:
        case RawBlock():
            return emit_raw_block(value)
        case CheckPeers(peers):
            kind = PdevBlockType.CHECK_PEERS
            w.u8(len(peers))
            for peer in peers:
                w.u8(len(peer.port_name)).bytes(peer.port_name).u8(len(peer.station_name)).bytes(peer.station_name)
        case CheckLineDelay(delay):
            kind = PdevBlockType.CHECK_LINE_DELAY
            pad(w).u32(delay)
        case CheckMauType(mau_type):
            kind = PdevBlockType.CHECK_MAU_TYPE
            w.u16(mau_type)
        case CheckLinkState(port, link):
            kind = PdevBlockType.CHECK_LINK_STATE
            w.u8(port).u8(link)
        case CheckSyncDifference(mode):
            kind = PdevBlockType.CHECK_SYNC_DIFFERENCE
            w.u16(mode)
        case CheckMauTypeDifference(mode):
            kind = PdevBlockType.CHECK_MAU_TYPE_DIFFERENCE
            w.u16(mode)
        case AdjustDomainBoundary(ingress, egress, properties):
            kind = PdevBlockType.ADJUST_DOMAIN_BOUNDARY
            pad(w).u32(ingress)
            if egress is not None:
                version = VERSION_1_1
                w.u32(egress)
            w.u16(properties)
        case AdjustMulticastBoundary(boundary, properties):
            kind = PdevBlockType.ADJUST_MULTICAST_BOUNDARY
            pad(w).u32(boundary).u16(properties)
        case AdjustMauType(mau_type, properties):
            kind = PdevBlockType.ADJUST_MAU_TYPE
            pad(w).u16(mau_type).u16(properties)
        case AdjustLinkState(port, link, properties):
            kind = PdevBlockType.ADJUST_LINK_STATE
            pad(w).u8(port).u8(link).u16(properties)
        case AdjustPeerToPeerBoundary(boundary, properties):
            kind = PdevBlockType.ADJUST_PEER_TO_PEER_BOUNDARY
            pad(w).u32(boundary).u16(properties)
        case AdjustDcpBoundary(boundary, properties):
            kind = PdevBlockType.ADJUST_DCP_BOUNDARY
            pad(w).u32(boundary).u16(properties)
        case AdjustPreambleLength(length, properties):
            kind = PdevBlockType.ADJUST_PREAMBLE_LENGTH
            pad(w).u16(length).u16(properties)
    return emit_raw_block(RawBlock(kind, pad(w).getvalue(), version))


def align(reader: Reader) -> Reader:
    """Skip padding up to four octets from the block's header on; the end may come first."""
    reader.skip(min(-(reader.position + BLOCK_HEADER_SIZE) % 4, reader.remaining))
    return reader


def pad(writer: Writer) -> Writer:
    """Zeros up to four octets from the block's header on."""
    return writer.zeros(-(len(writer) + BLOCK_HEADER_SIZE) % 4)
