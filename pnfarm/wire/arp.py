"""Address resolution of IPv4 over Ethernet (RFC 826; probes and announcements: RFC 5227)."""

from pnfarm.errors import DecodeError
from pnfarm.wire.ethernet import ETHERTYPE_IPV4
from pnfarm.wire.layout import Ip, Mac, Structure, UInt16
from pnfarm.wire.octets import Reader, Writer

__all__ = ["OPERATION_REPLY", "OPERATION_REQUEST", "ArpPacket", "emit_arp", "parse_arp"]

OPERATION_REQUEST = 1
OPERATION_REPLY = 2

_HARDWARE_ETHERNET = 1
_LENGTHS = (6, 4)


class ArpPacket(Structure):
    """Who has ``target_ip``, or: ``sender_ip`` is at ``sender_mac``.

    A probe has sender 0.0.0.0; an announcement names the same address as sender and target.
    """

    operation: UInt16
    sender_mac: Mac
    sender_ip: Ip
    target_mac: Mac
    target_ip: Ip


def parse_arp(data: bytes | bytearray | memoryview) -> ArpPacket:
    """Packet from an Ethernet payload; ``bad-type`` for anything but IPv4 over Ethernet. Padding may follow."""
    reader = Reader(data)
    hardware, protocol = reader.u16(), reader.u16()
    lengths = (reader.u8(), reader.u8())
    if hardware != _HARDWARE_ETHERNET or protocol != ETHERTYPE_IPV4 or lengths != _LENGTHS:
        raise DecodeError("bad-type", f"hardware {hardware}, protocol {protocol:#06x}, address lengths {lengths}")
    return ArpPacket.read(reader)


def emit_arp(packet: ArpPacket) -> bytes:
    """The 28 octets of a packet."""
    writer = Writer().u16(_HARDWARE_ETHERNET).u16(ETHERTYPE_IPV4).bytes(bytes(_LENGTHS))
    packet.write(writer)
    return writer.getvalue()
