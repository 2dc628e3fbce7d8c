"""Encapsulation messages: the header of all that EtherNet/IP sends on port 44818 (CIP volume 2, chapter 2-3).

``Command u16, Length u16, SessionHandle u32, Status u32, SenderContext 8 octets, Options u32``, then ``Length`` octets
of the command's own; all numbers little-endian.  A reply repeats command, session handle and sender context.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Final

from pnfarm.errors import DecodeError
from pnfarm.wire.layout import Structure, UInt16, UInt32, octets
from pnfarm.wire.octets import Reader

__all__ = [
    "ENIP_PORT",
    "HEADER_OCTETS",
    "IO_PORT",
    "LONGEST_DATA",
    "NO_CONTEXT",
    "PROTOCOL_VERSION",
    "Command",
    "EncapsulationHeader",
    "EncapsulationPdu",
    "EncapsulationStatus",
    "RegisterSession",
    "emit_encapsulation",
    "parse_encapsulation",
    "parse_header",
]

#: TCP and UDP port of explicit messages, UDP port of class 0 and 1 connections.
ENIP_PORT: Final = 44818
IO_PORT: Final = 2222
HEADER_OCTETS: Final = 24
#: The longest message has 65,535 octets with its header (table 2-3.1).
LONGEST_DATA: Final = 65_511
PROTOCOL_VERSION: Final = 1
NO_CONTEXT: Final = bytes(8)


class Command(IntEnum):
    """Table 2-3.2; other values are reserved or other protocols'."""

    NOP = 0x0000
    LIST_SERVICES = 0x0004
    LIST_IDENTITY = 0x0063
    LIST_INTERFACES = 0x0064
    REGISTER_SESSION = 0x0065
    UNREGISTER_SESSION = 0x0066
    SEND_RR_DATA = 0x006F
    SEND_UNIT_DATA = 0x0070
    INDICATE_STATUS = 0x0072
    CANCEL = 0x0073


class EncapsulationStatus(IntEnum):
    """Table 2-3.3."""

    SUCCESS = 0x0000
    INVALID_COMMAND = 0x0001
    INSUFFICIENT_MEMORY = 0x0002
    INCORRECT_DATA = 0x0003
    INVALID_SESSION_HANDLE = 0x0064
    INVALID_LENGTH = 0x0065
    UNSUPPORTED_PROTOCOL_REVISION = 0x0069


class EncapsulationHeader(Structure, little=True):
    """A header alone, as the first octets of a stream hold it; ``length`` octets follow."""

    command: UInt16
    length: UInt16
    session: UInt32 = 0
    status: UInt32 = 0
    context: Annotated[bytes, octets(8)] = NO_CONTEXT
    options: UInt32 = 0


@dataclass(frozen=True, slots=True)
class EncapsulationPdu:
    """One message; ``context`` has 8 octets."""

    command: int
    data: bytes = b""
    session: int = 0
    status: int = 0
    context: bytes = NO_CONTEXT
    options: int = 0


def parse_header(data: bytes) -> EncapsulationHeader:
    """The first 24 octets.  Raises ``short``."""
    return EncapsulationHeader.read(Reader(data, little=True))


def parse_encapsulation(data: bytes) -> EncapsulationPdu:
    """A whole message, as a datagram holds it.  Raises ``short``, ``bad-length``."""
    header = parse_header(data)
    if header.length != len(data) - HEADER_OCTETS:
        raise DecodeError("bad-length", f"{header.length} octets announced, {len(data) - HEADER_OCTETS} there")
    return EncapsulationPdu(
        header.command, bytes(data[HEADER_OCTETS:]), header.session, header.status, header.context, header.options
    )


def emit_encapsulation(pdu: EncapsulationPdu) -> bytes:
    """The octets of a message."""
    if len(pdu.context) != len(NO_CONTEXT):
        raise ValueError(f"a sender context has 8 octets, not {len(pdu.context)}")
    header = EncapsulationHeader(pdu.command, len(pdu.data), pdu.session, pdu.status, pdu.context, pdu.options)
    return header.emit() + pdu.data


class RegisterSession(Structure, little=True):
    """What a RegisterSession message and its reply hold."""

    version: UInt16 = PROTOCOL_VERSION
    options: UInt16 = 0
