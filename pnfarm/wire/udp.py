"""UDP datagrams over IPv4 (RFC 768).

Parsing ignores the checksum: a sender on the same machine hands a datagram over before its checksum
is finished (the network card would have done it).  :func:`udp_checksum` distinguishes the cases, so that
a caller can drop damaged datagrams.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.wire.ipv4 import PROTOCOL_UDP, internet_checksum
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from ipaddress import IPv4Address

__all__ = ["HEADER_LENGTH", "ChecksumState", "UdpDatagram", "emit_udp", "parse_udp", "udp_checksum"]

HEADER_LENGTH = 8


class ChecksumState(Enum):
    """What the checksum field of a received datagram says."""

    ABSENT = "absent"
    GOOD = "good"
    #: Only the pseudo header is summed: the rest was left to a network card that the datagram never passed.
    UNFINISHED = "unfinished"
    BAD = "bad"


@dataclass(frozen=True, slots=True)
class UdpDatagram:
    """One datagram."""

    source_port: int
    destination_port: int
    data: bytes


def parse_udp(data: bytes | bytearray | memoryview) -> UdpDatagram:
    """Datagram from an IPv4 payload; reasons ``short`` and ``bad-length``. The checksum is not checked."""
    reader = Reader(data)
    source_port, destination_port = reader.u16(), reader.u16()
    length = reader.u16()
    reader.skip(2)
    if length < HEADER_LENGTH:
        raise DecodeError("bad-length", f"{length} octets, a header alone has {HEADER_LENGTH}")
    return UdpDatagram(source_port, destination_port, reader.bytes(length - HEADER_LENGTH))


def emit_udp(datagram: UdpDatagram, source: IPv4Address, destination: IPv4Address) -> bytes:
    """Octets of a datagram with its checksum, which covers the two IPv4 addresses as well."""
    length = HEADER_LENGTH + len(datagram.data)
    writer = Writer().u16(datagram.source_port).u16(datagram.destination_port).u16(length).u16(0).bytes(datagram.data)
    checksum = internet_checksum(_pseudo_header(length, source, destination) + writer.getvalue())
    return writer.patch_u16(6, checksum or 0xFFFF).getvalue()  # 0 on the wire means: no checksum


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
    return Writer().bytes(source.packed).bytes(destination.packed).u8(0).u8(PROTOCOL_UDP).u16(length).getvalue()
