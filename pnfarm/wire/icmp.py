"""ICMP messages with the shape of echo (RFC 792): type, code, identifier, sequence, data.

Other types have other contents in place of identifier and sequence; they are parsed, too.
"""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.errors import DecodeError
from pnfarm.wire.ipv4 import internet_checksum
from pnfarm.wire.octets import Reader, Writer

__all__ = ["TYPE_ECHO_REPLY", "TYPE_ECHO_REQUEST", "IcmpMessage", "emit_icmp", "parse_icmp"]

TYPE_ECHO_REPLY = 0
TYPE_ECHO_REQUEST = 8


@dataclass(frozen=True, slots=True)
class IcmpMessage:
    """One message; ``message_type`` and ``code`` as on the wire."""

    message_type: int
    code: int
    identifier: int
    sequence: int
    data: bytes


def parse_icmp(data: bytes | bytearray | memoryview, *, verify_checksum: bool = False) -> IcmpMessage:
    """Message from an IPv4 payload; reasons ``short``, and ``bad-checksum`` when it is to be checked."""
    reader = Reader(data)
    message_type, code = reader.u8(), reader.u8()
    reader.skip(2)
    message = IcmpMessage(message_type, code, reader.u16(), reader.u16(), reader.rest())
    if verify_checksum and internet_checksum(data):
        raise DecodeError("bad-checksum", "ICMP")
    return message


def emit_icmp(message: IcmpMessage) -> bytes:
    """Octets of a message with its checksum."""
    writer = Writer().u8(message.message_type).u8(message.code).u16(0)
    writer.u16(message.identifier).u16(message.sequence).bytes(message.data)
    return writer.patch_u16(2, internet_checksum(writer.getvalue())).getvalue()
