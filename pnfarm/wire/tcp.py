"""TCP segments over IPv4 (RFC 9293), as a capture shows them: parsed only, as the kernel sends them.

Options are skipped, and checksums are not checked: a capture at the sender has them unfinished.
"""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.errors import DecodeError
from pnfarm.wire.octets import Reader

__all__ = ["HEADER_LENGTH", "PROTOCOL_TCP", "TcpSegment", "parse_tcp"]

PROTOCOL_TCP = 6
HEADER_LENGTH = 20

_FIN, _SYN, _RST, _ACK = 0x01, 0x02, 0x04, 0x10


@dataclass(frozen=True, slots=True)
class TcpSegment:
    """One segment; ``sequence`` is the number of its first octet, ``acknowledged`` means nothing without ACK."""

    source_port: int
    destination_port: int
    sequence: int
    acknowledged: int
    flags: int
    data: bytes

    @property
    def opens(self) -> bool:
        return bool(self.flags & _SYN)

    @property
    def ends(self) -> bool:
        return bool(self.flags & _FIN)

    @property
    def resets(self) -> bool:
        return bool(self.flags & _RST)

    @property
    def acknowledges(self) -> bool:
        return bool(self.flags & _ACK)


def parse_tcp(data: bytes | bytearray | memoryview) -> TcpSegment:
    """Segment from an IPv4 payload; reasons ``short`` and ``bad-length``."""
    reader = Reader(data)
    source_port, destination_port = reader.u16(), reader.u16()
    sequence, acknowledged = reader.u32(), reader.u32()
    length = (reader.u8() >> 4) * 4
    flags = reader.u8()
    if length < HEADER_LENGTH:
        raise DecodeError("bad-length", f"a header of {length} octets, the shortest has {HEADER_LENGTH}")
    reader.skip(length - reader.position)
    return TcpSegment(source_port, destination_port, sequence, acknowledged, flags, reader.rest())
