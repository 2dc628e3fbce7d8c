"""Blocks of the physical device: an interface and its ports (IEC 61158-6-10, PDev; services: IEC 61158-5-10).

``PDPortDataCheck`` and ``PDPortDataAdjust`` hold blocks themselves (:mod:`pdev_port`).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from ipaddress import IPv4Address
from typing import TYPE_CHECKING, Any

from pnfarm.protocols.profinet.wire.block import (
    BLOCK_HEADER_SIZE,
    VERSION_1_0,
    VERSION_1_1,
    RawBlock,
    check_type,
    emit_raw_block,
    parse_raw_block,
)
from pnfarm.protocols.profinet.wire.records.pdev_port import (
    LinkStateLink,
    LinkStatePort,
    PdevBlockType,
    align,
    emit_sub_block,
    pad,
    read_sub_block,
)
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.protocols.profinet.wire.records.pdev_port import SubBlock

__all__ = [
    "PARSERS",
    "InterfaceAdjust",
    "InterfaceDataReal",
    "MediaType",
    "MultipleBlock",
    "PeerReal",
    "PortDataAdjust",
    "PortDataCheck",
    "PortDataReal",
    "PortStatistic",
    "emit_interface_adjust",
    "emit_interface_data_real",
    "emit_multiple_block",
    "emit_port_data",
    "emit_port_data_real",
    "emit_port_statistic",
    "parse_interface_adjust",
    "parse_interface_data_real",
    "parse_multiple_block",
    "parse_port_data",
    "parse_port_data_real",
    "parse_port_statistic",
]


#: First octet of the type of every block that a port's record holds.
_SUB_BLOCKS = 0x02


class MediaType(IntEnum):
    """IEC 61158-6-10, coding of the field MediaType."""

    UNKNOWN = 0
    COPPER = 1
    FIBER = 2
    RADIO = 3


@dataclass(frozen=True, slots=True)
class PeerReal:
    """A neighbour in PDPortDataReal; ``line_delay`` in nanoseconds, 0 for not measured."""

    port_name: bytes
    station_name: bytes
    line_delay: int
    mac: bytes


@dataclass(frozen=True, slots=True)
class PortDataReal:
    """0x020F: a port as it is."""

    slot: int
    subslot: int
    own_port_name: bytes
    peers: tuple[PeerReal, ...] = ()
    mau_type: int = 0
    domain_boundary: int = 0
    multicast_boundary: int = 0
    link_state_port: int = LinkStatePort.UNKNOWN
    link_state_link: int = LinkStateLink.UP
    media_type: int = MediaType.COPPER
    version: int = VERSION_1_0


def parse_port_data_real(block: RawBlock) -> PortDataReal:
    r = check_type(block, PdevBlockType.PORT_DATA_REAL)
    align(r)
    slot, subslot = r.u16(), r.u16()
    own = r.bytes(r.u8())
    count = r.u8()
    align(r)
    peers = []
    for _ in range(count):
        port, station = r.bytes(r.u8()), r.bytes(r.u8())
        align(r)
        peers.append(PeerReal(port, station, r.u32(), r.bytes(6)))
        align(r)
    mau_type = r.u16()
    align(r)
    domain, multicast, port_state, link_state = r.u32(), r.u32(), r.u8(), r.u8()
    align(r)
    media_type = r.u32()
    r.expect_end()
    return PortDataReal(
        slot, subslot, own, tuple(peers), mau_type, domain, multicast, port_state, link_state, media_type, block.version
    )


def emit_port_data_real(value: PortDataReal) -> bytes:
    w = pad(Writer()).u16(value.slot).u16(value.subslot)
    w.u8(len(value.own_port_name)).bytes(value.own_port_name).u8(len(value.peers))
    pad(w)
    for peer in value.peers:
        if len(peer.mac) != 6:
            raise ValueError("a MAC address has six octets")
        w.u8(len(peer.port_name)).bytes(peer.port_name).u8(len(peer.station_name)).bytes(peer.station_name)
        pad(w).u32(peer.line_delay).bytes(peer.mac)
        pad(w)
    pad(w.u16(value.mau_type)).u32(value.domain_boundary).u32(value.multicast_boundary)
    pad(w.u8(value.link_state_port).u8(value.link_state_link)).u32(value.media_type)
    return emit_raw_block(RawBlock(PdevBlockType.PORT_DATA_REAL, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class InterfaceDataReal:
    """0x0240: an interface as it is; 0.0.0.0 for no address."""

    name: bytes
    mac: bytes
    ip: IPv4Address
    mask: IPv4Address
    gateway: IPv4Address
    version: int = VERSION_1_0


def parse_interface_data_real(block: RawBlock) -> InterfaceDataReal:
    r = check_type(block, PdevBlockType.INTERFACE_DATA_REAL)
    name = r.bytes(r.u8())
    align(r)
    mac = r.bytes(6)
    align(r)
    ip, mask, gateway = (IPv4Address(r.u32()) for _ in range(3))
    r.expect_end()
    return InterfaceDataReal(name, mac, ip, mask, gateway, block.version)


def emit_interface_data_real(value: InterfaceDataReal) -> bytes:
    if len(value.mac) != 6:
        raise ValueError("a MAC address has six octets")
    w = pad(Writer().u8(len(value.name)).bytes(value.name)).bytes(value.mac)
    pad(w).bytes(value.ip.packed).bytes(value.mask.packed).bytes(value.gateway.packed)
    return emit_raw_block(RawBlock(PdevBlockType.INTERFACE_DATA_REAL, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class PortStatistic:
    """0x0251: counters of a port or of all ports of an interface, modulo 2**32.

    ``status`` (from version 1.1 on, else 0): bit n set when counter n, in this order, is invalid.
    """

    in_octets: int = 0
    out_octets: int = 0
    in_discards: int = 0
    out_discards: int = 0
    in_errors: int = 0
    out_errors: int = 0
    status: int = 0
    version: int = VERSION_1_0


def parse_port_statistic(block: RawBlock) -> PortStatistic:
    r = check_type(block, PdevBlockType.PORT_STATISTIC)
    status = r.u16()
    value = PortStatistic(
        r.u32(),
        r.u32(),
        r.u32(),
        r.u32(),
        r.u32(),
        r.u32(),
        status if block.version >= VERSION_1_1 else 0,
        block.version,
    )
    r.expect_end()
    return value


def emit_port_statistic(value: PortStatistic) -> bytes:
    w = Writer().u16(value.status if value.version >= VERSION_1_1 else 0)
    w.u32(value.in_octets).u32(value.out_octets).u32(value.in_discards).u32(value.out_discards)
    w.u32(value.in_errors).u32(value.out_errors)
    return emit_raw_block(RawBlock(PdevBlockType.PORT_STATISTIC, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class PortDataCheck:
    """0x0200: what the port is to be compared with."""

    slot: int
    subslot: int
    blocks: tuple[SubBlock, ...] = ()
    version: int = VERSION_1_0


@dataclass(frozen=True, slots=True)
class PortDataAdjust:
    """0x0202: how the port is to be set."""

    slot: int
    subslot: int
    blocks: tuple[SubBlock, ...] = ()
    version: int = VERSION_1_0


def parse_port_data(block: RawBlock) -> PortDataCheck | PortDataAdjust:
    """Either of the two; reasons ``bad-type``, ``short``, ``bad-length``, ``trailing``."""
    r = check_type(block, PdevBlockType.PORT_DATA_CHECK, PdevBlockType.PORT_DATA_ADJUST)
    r.skip(2)
    slot, subslot = r.u16(), r.u16()
    blocks: list[SubBlock] = []
    rest = memoryview(r.rest())
    place = 0
    while place < len(rest):
        # no block in here has a type that begins with zero
        if rest[place] == 0 or (place % 4 and not _begins_block(rest[place:])):
            place += 1
            continue
        inner = Reader(rest[place:])
        blocks.append(read_sub_block(parse_raw_block(inner)))
        place += inner.position
    kind = PortDataCheck if block.block_type == PdevBlockType.PORT_DATA_CHECK else PortDataAdjust
    return kind(slot, subslot, tuple(blocks), block.version)


def _begins_block(octets: memoryview) -> bool:
    """Whether a block begins without padding before it; padding may hold any value, but hardly a matching header."""
    if len(octets) < BLOCK_HEADER_SIZE:
        return False
    return octets[0] == _SUB_BLOCKS and 4 + (octets[2] << 8 | octets[3]) <= len(octets)


def emit_port_data(value: PortDataCheck | PortDataAdjust) -> bytes:
    w = Writer().zeros(2).u16(value.slot).u16(value.subslot)
    for sub in value.blocks:
        pad(w.bytes(emit_sub_block(sub)))
    kind = PdevBlockType.PORT_DATA_CHECK if isinstance(value, PortDataCheck) else PdevBlockType.PORT_DATA_ADJUST
    return emit_raw_block(RawBlock(kind, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class InterfaceAdjust:
    """0x0250.  MultipleInterfaceMode: bit 0 is NameOfDevice (:class:`NameMode`)."""

    multiple_interface_mode: int
    version: int = VERSION_1_0


def parse_interface_adjust(block: RawBlock) -> InterfaceAdjust:
    r = check_type(block, PdevBlockType.INTERFACE_ADJUST)
    align(r)
    value = InterfaceAdjust(r.u32(), block.version)
    r.expect_end()
    return value


def emit_interface_adjust(value: InterfaceAdjust) -> bytes:
    w = pad(Writer()).u32(value.multiple_interface_mode)
    return emit_raw_block(RawBlock(PdevBlockType.INTERFACE_ADJUST, w.getvalue(), value.version))


@dataclass(frozen=True, slots=True)
class MultipleBlock:
    """0x0400, MultipleBlockHeader: the blocks of one submodule, in PDRealData and PDExpectedData."""

    api: int
    slot: int
    subslot: int
    blocks: tuple[RawBlock, ...] = ()
    version: int = VERSION_1_0


def parse_multiple_block(block: RawBlock) -> MultipleBlock:
    """Blocks follow each other, each padded to four octets; the last one's padding may be missing."""
    r = check_type(block, PdevBlockType.MULTIPLE_BLOCK_HEADER)
    align(r)
    api, slot, subslot = r.u32(), r.u16(), r.u16()
    blocks = []
    while r.remaining:
        blocks.append(parse_raw_block(r))
        align(r)
    return MultipleBlock(api, slot, subslot, tuple(blocks), block.version)


def emit_multiple_block(value: MultipleBlock) -> bytes:
    w = pad(Writer()).u32(value.api).u16(value.slot).u16(value.subslot)
    for block in value.blocks:
        pad(w.bytes(emit_raw_block(block)))
    return emit_raw_block(RawBlock(PdevBlockType.MULTIPLE_BLOCK_HEADER, w.getvalue(), value.version))


#: Parsers by block type, for :mod:`pnfarm.protocols.profinet.wire.any_block`.
PARSERS: dict[int, Callable[[RawBlock], Any]] = {
    PdevBlockType.PORT_DATA_CHECK: parse_port_data,
    PdevBlockType.PORT_DATA_ADJUST: parse_port_data,
    PdevBlockType.PORT_DATA_REAL: parse_port_data_real,
    PdevBlockType.INTERFACE_DATA_REAL: parse_interface_data_real,
    PdevBlockType.INTERFACE_ADJUST: parse_interface_adjust,
    PdevBlockType.PORT_STATISTIC: parse_port_statistic,
    PdevBlockType.MULTIPLE_BLOCK_HEADER: parse_multiple_block,
}
