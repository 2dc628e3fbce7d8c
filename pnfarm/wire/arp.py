"""Address resolution of IPv4 over Ethernet (RFC 826; probes and announcements: RFC 5227)."""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import IPv4Address

from pnfarm.errors import DecodeError
from pnfarm.wire.ethernet import ETHERTYPE_IPV4
from pnfarm.wire.octets import Reader, Writer

__all__ = ["OPERATION_REPLY", "OPERATION_REQUEST", "ArpPacket", "emit_arp", "parse_arp"]

OPERATION_REQUEST = 1
OPERATION_REPLY = 2

_HARDWARE_ETHERNET = 1
_LENGTHS = (6, 4)


@dataclass(frozen=True, slots=True)
class ArpPacket:
    """Who has ``target_ip``, or: ``sender_ip`` is at ``sender_mac``.

    A probe has sender 0.0.0.0; an announcement names the same address as sender and target.
    """

    operation: int
    sender_mac: bytes
    sender_ip: IPv4Address
    target_mac: bytes
    target_ip: IPv4Address


def parse_arp(data: bytes | bytearray | memoryview) -> ArpPacket:
    """Packet from an Ethernet payload; ``bad-type`` for anything but IPv4 over Ethernet. Padding may follow."""
    reader = Reader(data)
    hardware, protocol = reader.u16(), reader.u16()
    lengths = (reader.u8(), reader.u8())
    if hardware != _HARDWARE_ETHERNET or protocol != ETHERTYPE_IPV4 or lengths != _LENGTHS:
        raise DecodeError("bad-type", f"hardware {hardware}, protocol {protocol:#06x}, address lengths {lengths}")
    return ArpPacket(
        operation=reader.u16(),
        sender_mac=reader.bytes(6),
        sender_ip=IPv4Address(reader.u32()),
        target_mac=reader.bytes(6),
        target_ip=IPv4Address(reader.u32()),
    )


def emit_arp(packet: ArpPacket) -> bytes:
    """The 28 octets of a packet."""
    if len(packet.sender_mac) != 6 or len(packet.target_mac) != 6:
        raise ValueError("a MAC address has six octets")
    writer = Writer().u16(_HARDWARE_ETHERNET).u16(ETHERTYPE_IPV4).u8(_LENGTHS[0]).u8(_LENGTHS[1])
    writer.u16(packet.operation).bytes(packet.sender_mac).bytes(packet.sender_ip.packed)
    return writer.bytes(packet.target_mac).bytes(packet.target_ip.packed).getvalue()
