"""Messages of SNMPv1 and SNMPv2c (RFC 1157, RFC 1901) and their PDUs and types (RFC 3416, RFC 2578).

A message is a SEQUENCE of version, community and PDU.  The five PDUs that managers and agents exchange share one shape
(:class:`Pdu`); GetBulk gives two of its fields other names.  All other PDUs, the traps among them, are kept octet for
octet (:class:`OtherPdu`), and so is a value of a type that SNMP does not name.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.snmp.ber import (
    Oid,
    emit_integer,
    emit_oid,
    emit_tlv,
    parse_integer,
    parse_oid,
    read_constructed,
    read_tlv,
)
from pnfarm.wire.octets import Reader

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "COUNTER32",
    "COUNTER64",
    "END_OF_MIB_VIEW",
    "GAUGE32",
    "GET",
    "GET_BULK",
    "GET_NEXT",
    "INTEGER",
    "IP_ADDRESS",
    "NO_SUCH_INSTANCE",
    "NO_SUCH_OBJECT",
    "NULL",
    "NULL_VALUE",
    "OBJECT_IDENTIFIER",
    "OCTET_STRING",
    "OPAQUE",
    "RESPONSE",
    "SET",
    "SNMP_PORT",
    "TIME_TICKS",
    "VERSION_1",
    "VERSION_2C",
    "ErrorStatus",
    "Oid",
    "OtherPdu",
    "Pdu",
    "SnmpMessage",
    "Value",
    "VarBind",
    "counter32",
    "counter64",
    "emit_response",
    "emit_snmp",
    "emit_varbind",
    "gauge32",
    "integer",
    "object_id",
    "octets",
    "parse_snmp",
    "time_ticks",
]

#: UDP port of an agent (RFC 3417, 3.1).
SNMP_PORT = 161

#: The version field.
VERSION_1 = 0
VERSION_2C = 1

# PDUs: context class, constructed (RFC 3416, clause 3).
GET = 0xA0
GET_NEXT = 0xA1
RESPONSE = 0xA2
SET = 0xA3
GET_BULK = 0xA5

# Types: universal and application class, primitive (RFC 2578, clause 2).
INTEGER = 0x02
OCTET_STRING = 0x04
NULL = 0x05
OBJECT_IDENTIFIER = 0x06
IP_ADDRESS = 0x40
COUNTER32 = 0x41
GAUGE32 = 0x42
TIME_TICKS = 0x43
OPAQUE = 0x44
COUNTER64 = 0x46
# Exceptions in place of a value, version 2 (RFC 3416, clause 3).
NO_SUCH_OBJECT = 0x80
NO_SUCH_INSTANCE = 0x81
END_OF_MIB_VIEW = 0x82

_SEQUENCE = 0x30
_ONE_SHAPE = frozenset({GET, GET_NEXT, RESPONSE, SET, GET_BULK})
_EMPTY = frozenset({NULL, NO_SUCH_OBJECT, NO_SUCH_INSTANCE, END_OF_MIB_VIEW})
_INT32_LOW, _INT32_HIGH = -(2**31), 2**31 - 1
#: Bits of the unsigned types; a sign octet goes before them.
_UNSIGNED_BITS = {COUNTER32: 32, GAUGE32: 32, TIME_TICKS: 32, COUNTER64: 64}


class ErrorStatus(IntEnum):
    """RFC 3416, clause 3; version 1 has the first six."""

    NO_ERROR = 0
    TOO_BIG = 1
    NO_SUCH_NAME = 2
    BAD_VALUE = 3
    READ_ONLY = 4
    GEN_ERR = 5
    NO_ACCESS = 6
    WRONG_TYPE = 7
    WRONG_LENGTH = 8
    WRONG_ENCODING = 9
    WRONG_VALUE = 10
    NO_CREATION = 11
    INCONSISTENT_VALUE = 12
    RESOURCE_UNAVAILABLE = 13
    COMMIT_FAILED = 14
    UNDO_FAILED = 15
    AUTHORIZATION_ERROR = 16
    NOT_WRITABLE = 17
    INCONSISTENT_NAME = 18


@dataclass(frozen=True, slots=True)
class Value:
    """A typed value.

    ``content`` is an int for INTEGER, Counter32, Gauge32 (Unsigned32), TimeTicks and Counter64; arcs for OBJECT
    IDENTIFIER; None for NULL and the exceptions; octets for everything else.
    """

    tag: int
    content: int | bytes | Oid | None = None


NULL_VALUE = Value(NULL)


def integer(value: int) -> Value:
    """INTEGER, 32 bits with sign."""
    return Value(INTEGER, value)


def octets(value: bytes) -> Value:
    return Value(OCTET_STRING, value)


def object_id(value: Oid) -> Value:
    return Value(OBJECT_IDENTIFIER, value)


def counter32(value: int) -> Value:
    """Counter32: wraps."""
    return Value(COUNTER32, value & 0xFFFF_FFFF)


def counter64(value: int) -> Value:
    """Counter64: wraps."""
    return Value(COUNTER64, value & 0xFFFF_FFFF_FFFF_FFFF)


def gauge32(value: int) -> Value:
    """Gauge32 and Unsigned32: stays at the largest value."""
    return Value(GAUGE32, min(value, 0xFFFF_FFFF))


def time_ticks(value_ns: int) -> Value:
    """TimeTicks, hundredths of a second, from nanoseconds: wraps after 497 days."""
    return Value(TIME_TICKS, value_ns // 10_000_000 & 0xFFFF_FFFF)


@dataclass(frozen=True, slots=True)
class VarBind:
    """A variable's name and its value."""

    name: Oid
    value: Value = NULL_VALUE


@dataclass(frozen=True, slots=True)
class Pdu:
    """Get, GetNext, Response, Set or GetBulk."""

    tag: int
    request_id: int
    error_status: int = 0
    error_index: int = 0
    varbinds: tuple[VarBind, ...] = ()

    @property
    def non_repeaters(self) -> int:
        """GetBulk's second field."""
        return self.error_status

    @property
    def max_repetitions(self) -> int:
        """GetBulk's third field."""
        return self.error_index


@dataclass(frozen=True, slots=True)
class OtherPdu:
    """A trap, an inform or whatever has another tag."""

    tag: int
    body: bytes


@dataclass(frozen=True, slots=True)
class SnmpMessage:
    """``version`` is :data:`VERSION_1` or :data:`VERSION_2C`."""

    version: int
    community: bytes
    pdu: Pdu | OtherPdu


def parse_snmp(data: bytes | bytearray | memoryview) -> SnmpMessage:
    """One message, which must end with ``data``.

    Reasons: ``bad-version`` (SNMPv3 is another format), ``bad-tag``, ``bad-length``, ``bad-value``, ``short``,
    ``trailing``.
    """
    whole = Reader(data)
    reader = read_constructed(whole, _SEQUENCE)
    whole.expect_end()
    version = _read_integer(reader)
    if version not in {VERSION_1, VERSION_2C}:
        raise DecodeError("bad-version", f"version {version}")
    tag, community = read_tlv(reader)
    if tag != OCTET_STRING:
        raise DecodeError("bad-tag", f"community with tag 0x{tag:02X}")
    tag, body = read_tlv(reader)
    reader.expect_end()
    return SnmpMessage(version, community, _parse_pdu(tag, body) if tag in _ONE_SHAPE else OtherPdu(tag, body))


def _parse_pdu(tag: int, body: bytes) -> Pdu:
    reader = Reader(body)
    request_id, status, index = _read_integer(reader), _read_integer(reader), _read_integer(reader)
    variables = read_constructed(reader, _SEQUENCE)
    reader.expect_end()
    varbinds = []
    while variables.remaining:
        inner = read_constructed(variables, _SEQUENCE)
        name_tag, name = read_tlv(inner)
        if name_tag != OBJECT_IDENTIFIER:
            raise DecodeError("bad-tag", f"name with tag 0x{name_tag:02X}")
        value = _parse_value(*read_tlv(inner))
        inner.expect_end()
        varbinds.append(VarBind(parse_oid(name), value))
    return Pdu(tag, request_id, status, index, tuple(varbinds))


def _read_integer(reader: Reader) -> int:
    tag, content = read_tlv(reader)
    if tag != INTEGER:
        raise DecodeError("bad-tag", f"0x{tag:02X} in place of INTEGER")
    return _parse_int32(content)


def _parse_int32(content: bytes) -> int:
    """pyasn1, and so pysnmp, sends one sign octet too many for -2**31."""
    number = parse_integer(content, 5)
    if not _INT32_LOW <= number <= _INT32_HIGH:
        raise DecodeError("bad-value", f"{number} does not fit in 32 bits")
    return number


def _parse_value(tag: int, content: bytes) -> Value:
    if tag in _EMPTY:
        if content:
            raise DecodeError("bad-length", f"{len(content)} octets in a value without content")
        return Value(tag)
    if tag == INTEGER:
        return Value(tag, _parse_int32(content))
    if tag == OBJECT_IDENTIFIER:
        return Value(tag, parse_oid(content))
    bits = _UNSIGNED_BITS.get(tag)
    if bits is not None:
        number = parse_integer(content, bits // 8 + 1)
        if not 0 <= number < 1 << bits:
            raise DecodeError("bad-value", f"{number} does not fit in {bits} bits")
        return Value(tag, number)
    if tag == IP_ADDRESS and len(content) != 4:
        raise DecodeError("bad-length", f"IpAddress of {len(content)} octets")
    return Value(tag, content)


def emit_snmp(message: SnmpMessage) -> bytes:
    """Octets of a message; :class:`ValueError` where a value does not have its type's shape."""
    pdu = message.pdu
    if isinstance(pdu, OtherPdu):
        return _emit_message(message.version, message.community, emit_tlv(pdu.tag, pdu.body))
    varbinds = [emit_varbind(varbind) for varbind in pdu.varbinds]
    return _emit_message(message.version, message.community, _emit_pdu(pdu, varbinds))


def emit_response(request: SnmpMessage, pdu: Pdu, varbinds: Iterable[bytes]) -> bytes:
    """The response to ``request``: ``pdu`` with ``varbinds``, octets already, in place of its own."""
    return _emit_message(request.version, request.community, _emit_pdu(pdu, varbinds))


def _emit_message(version: int, community: bytes, pdu: bytes) -> bytes:
    head = emit_tlv(INTEGER, emit_integer(version)) + emit_tlv(OCTET_STRING, community)
    return emit_tlv(_SEQUENCE, head + pdu)


def _emit_pdu(pdu: Pdu, varbinds: Iterable[bytes]) -> bytes:
    head = b"".join(_emit_int32(field) for field in (pdu.request_id, pdu.error_status, pdu.error_index))
    return emit_tlv(pdu.tag, head + emit_tlv(_SEQUENCE, b"".join(varbinds)))


def _emit_int32(value: int) -> bytes:
    if not _INT32_LOW <= value <= _INT32_HIGH:
        raise ValueError(f"{value} is not an INTEGER of 32 bits")
    return emit_tlv(INTEGER, emit_integer(value))


def emit_varbind(varbind: VarBind) -> bytes:
    """One element of the list of variables."""
    return emit_tlv(_SEQUENCE, emit_tlv(OBJECT_IDENTIFIER, emit_oid(varbind.name)) + _emit_value(varbind.value))


def _emit_value(value: Value) -> bytes:
    tag, content = value.tag, value.content
    if tag == INTEGER:
        if isinstance(content, int):
            return _emit_int32(content)
    elif tag in _UNSIGNED_BITS:
        if isinstance(content, int) and 0 <= content < 1 << _UNSIGNED_BITS[tag]:
            return emit_tlv(tag, emit_integer(content))
    elif tag == OBJECT_IDENTIFIER:
        if isinstance(content, tuple):
            return emit_tlv(tag, emit_oid(content))
    elif tag in _EMPTY:
        if content is None:
            return emit_tlv(tag, b"")
    elif isinstance(content, bytes) and (tag != IP_ADDRESS or len(content) == 4):
        return emit_tlv(tag, content)
    raise ValueError(f"{content!r} is not the content of a value of tag 0x{tag:02X}")
