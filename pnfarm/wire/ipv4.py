"""IPv4 headers (RFC 791) and the internet checksum (RFC 1071).

Options are skipped on reception and never sent.
"""

from __future__ import annotations

import struct
from functools import lru_cache
from ipaddress import IPv4Address

from pnfarm.errors import DecodeError
from pnfarm.wire.octets import Reader, pack
from pnfarm.wire.value import value_class

__all__ = [
    "HEADER_LENGTH",
    "MAXIMUM_LENGTH",
    "PROTOCOL_ICMP",
    "PROTOCOL_UDP",
    "Ipv4Packet",
    "emit_ipv4",
    "internet_checksum",
    "parse_ipv4",
]

PROTOCOL_ICMP = 1
PROTOCOL_UDP = 17

#: Octets of a header without options.
HEADER_LENGTH = 20
#: Octets of the longest packet, header included.
MAXIMUM_LENGTH = 0xFFFF

#: Version and header length, TOS, total length, identification, flags, TTL, protocol, checksum, the two addresses.
_HEADER = struct.Struct(">BBHHHBBHII")
#: Addresses as objects; those of one network come again and again.
_address = lru_cache(4096)(IPv4Address)

_DONT_FRAGMENT = 0x4000
_MORE_FRAGMENTS = 0x2000


@value_class
class Ipv4Packet:
    """One packet; ``fragment_offset`` counts octets and is a multiple of 8, ``tos`` is the DSCP and ECN octet."""

    source: IPv4Address
    destination: IPv4Address
    protocol: int
    payload: bytes
    ttl: int = 64
    identification: int = 0
    dont_fragment: bool = False
    more_fragments: bool = False
    fragment_offset: int = 0
    tos: int = 0


def internet_checksum(data: bytes | bytearray | memoryview) -> int:
    """One's complement of the one's complement sum of 16-bit words; 0 over data that includes its correct checksum."""
    padded = bytes(data) + b"\0" * (len(data) % 2)
    # 2**16 is 1 modulo 0xFFFF: the remainder of the whole number is the end-around-carry sum of its words.
    total = int.from_bytes(padded, "big")
    remainder = total % 0xFFFF
    return 0 if total and not remainder else 0xFFFF - remainder


def parse_ipv4(data: bytes | bytearray | memoryview, *, verify_checksum: bool = False) -> Ipv4Packet:
    """Packet from an Ethernet payload, padding cut off.

    Reasons: ``short``, ``bad-version``, ``bad-length``, and ``bad-checksum`` when it is to be checked.
    """
    view = memoryview(data)
    reader = Reader(view)
    first = reader.u8()
    header_length = (first & 0x0F) * 4
    if first >> 4 != 4:
        raise DecodeError("bad-version", f"version {first >> 4}")
    reader.skip(1)
    total_length = reader.u16()
    if header_length < HEADER_LENGTH or total_length < header_length:
        raise DecodeError("bad-length", f"header {header_length}, total {total_length} octets")
    reader.skip(header_length - reader.position)
    _, tos, _, identification, flags, ttl, protocol, _, source, destination = _HEADER.unpack_from(view)
    payload = reader.bytes(total_length - header_length)
    if verify_checksum and internet_checksum(view[:header_length]):
        raise DecodeError("bad-checksum", "IPv4 header")
    return Ipv4Packet(
        source=_address(source),
        destination=_address(destination),
        protocol=protocol,
        payload=payload,
        ttl=ttl,
        identification=identification,
        dont_fragment=bool(flags & _DONT_FRAGMENT),
        more_fragments=bool(flags & _MORE_FRAGMENTS),
        fragment_offset=(flags & 0x1FFF) * 8,
        tos=tos,
    )


def emit_ipv4(packet: Ipv4Packet) -> bytes:
    """Octets of a packet with its checksum; :class:`ValueError` when a field does not fit."""
    if packet.fragment_offset % 8 or not 0 <= packet.fragment_offset <= 0xFFF8:
        raise ValueError(f"a fragment offset is a multiple of 8 up to 65528, not {packet.fragment_offset}")
    flags = packet.fragment_offset // 8
    flags |= _DONT_FRAGMENT * packet.dont_fragment | _MORE_FRAGMENTS * packet.more_fragments
    length, addresses = HEADER_LENGTH + len(packet.payload), (int(packet.source), int(packet.destination))
    about = 0x45, packet.tos, length, packet.identification, flags, packet.ttl, packet.protocol
    checksum = internet_checksum(pack(_HEADER, *about, 0, *addresses))
    return pack(_HEADER, *about, checksum, *addresses) + packet.payload
