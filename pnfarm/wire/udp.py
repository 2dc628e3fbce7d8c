"""UDP datagrams over IPv4 (RFC 768).

Parsing ignores the checksum: a sender on the same machine hands a datagram over before its checksum
is finished (the network card would have done it).  :func:`udp_checksum` distinguishes the cases, so that
a caller can drop damaged datagrams.
"""

from __future__ import annotations

import struct
from enum import Enum
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.wire.ipv4 import PROTOCOL_UDP, internet_checksum
from pnfarm.wire.octets import Reader, pack
from pnfarm.wire.value import value_class

if TYPE_CHECKING:
    from ipaddress import IPv4Address

__all__ = ["HEADER_LENGTH", "ChecksumState", "UdpDatagram", "emit_udp", "parse_udp", "udp_checksum"]

HEADER_LENGTH = 8
#: Source and destination port, length, checksum.
_HEADER = struct.Struct(">HHHH")
#: The two addresses, a zero, the protocol, the length.
_PSEUDO_HEADER = struct.Struct(">II2BH")


class ChecksumState(Enum):
    """What the checksum field of a received datagram says."""

    ABSENT = "absent"
    GOOD = "good"
    #: Only the pseudo header is summed: the rest was left to a network card that the datagram never passed.
    UNFINISHED = "unfinished"
    BAD = "bad"


@value_class
class UdpDatagram:
    source_port: int
    destination_port: int
    data: bytes


def parse_udp(data: bytes | bytearray | memoryview) -> UdpDatagram:
    """Datagram from an IPv4 payload; reasons ``short`` and ``bad-length``. The checksum is not checked."""
    reader = Reader(data)
    reader.skip(HEADER_LENGTH)
    source_port, destination_port, length, _ = _HEADER.unpack_from(data)
    if length < HEADER_LENGTH:
        raise DecodeError("bad-length", f"{length} octets, a header alone has {HEADER_LENGTH}")
    return UdpDatagram(source_port, destination_port, reader.bytes(length - HEADER_LENGTH))


def emit_udp(datagram: UdpDatagram, source: IPv4Address, destination: IPv4Address) -> bytes:
    """Octets of a datagram with its checksum, which covers the two IPv4 addresses as well."""
    length = HEADER_LENGTH + len(datagram.data)
    about = datagram.source_port, datagram.destination_port, length
    summed = _pseudo_header(length, source, destination) + pack(_HEADER, *about, 0) + datagram.data
    # 0 on the wire means: no checksum
    return pack(_HEADER, *about, internet_checksum(summed) or 0xFFFF) + datagram.data


def udp_checksum(data: bytes | bytearray | memoryview, source: IPv4Address, destination: IPv4Address) -> ChecksumState:
    """Judge the checksum of an IPv4 payload that :func:`parse_udp` accepts."""
    octets = bytes(data)
    length = int.from_bytes(octets[4:6], "big")
    field = int.from_bytes(octets[6:8], "big")
    if not field:
        return ChecksumState.ABSENT
    pseudo_header = _pseudo_header(length, source, destination)
    if not internet_checksum(pseudo_header + octets[:length]):
        return ChecksumState.GOOD
    if field == 0xFFFF - internet_checksum(pseudo_header):
        return ChecksumState.UNFINISHED
    return ChecksumState.BAD


def _pseudo_header(length: int, source: IPv4Address, destination: IPv4Address) -> bytes:
    return pack(_PSEUDO_HEADER, int(source), int(destination), 0, PROTOCOL_UDP, length)
