"""ICMP messages with the shape of echo (RFC 792): type, code, identifier, sequence, data.

Other types have other contents in place of identifier and sequence; they are parsed, too.
"""

from typing import Annotated

from pnfarm.errors import DecodeError
from pnfarm.wire.ipv4 import internet_checksum
from pnfarm.wire.layout import Pad, Rest, Structure, UInt8, UInt16

__all__ = ["TYPE_ECHO_REPLY", "TYPE_ECHO_REQUEST", "IcmpMessage", "emit_icmp", "parse_icmp"]

TYPE_ECHO_REPLY = 0
TYPE_ECHO_REQUEST = 8


class IcmpMessage(Structure):
    """One message; ``message_type`` and ``code`` as on the wire, the checksum left out."""

    message_type: UInt8
    code: UInt8
    identifier: Annotated[UInt16, Pad(2)]
    sequence: UInt16
    data: Rest


def parse_icmp(data: bytes | bytearray | memoryview, *, verify_checksum: bool = False) -> IcmpMessage:
    """Message from an IPv4 payload; reasons ``short``, and ``bad-checksum`` when it is to be checked."""
    message = IcmpMessage.parse(data)
    if verify_checksum and internet_checksum(data):
        raise DecodeError("bad-checksum", "ICMP")
    return message


def emit_icmp(message: IcmpMessage) -> bytes:
    """Octets of a message with its checksum."""
    octets = message.emit()
    return octets[:2] + internet_checksum(octets).to_bytes(2, "big") + octets[4:]
