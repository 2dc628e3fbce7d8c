"""Basic Encoding Rules as far as SNMP uses them (ITU-T X.690; RFC 3417, clause 8).

SNMP narrows BER: lengths are definite, simple types are primitive, tags have one octet.  What is received may have more
octets of length and of sign than it needs, within bounds, because managers write both; what is sent is the shortest
form.  Nothing here recurses: the caller walks the few levels that a message has.

A codec of our own, because it is asked by hundreds of drives in one event loop: a GetBulk that fills a frame takes 0.2
to 0.5 ms to decode, and 1.8 to 5.5 ms with pyasn1, which the tests use to check this one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from pnfarm.errors import DecodeError

if TYPE_CHECKING:
    from pnfarm.wire.octets import Reader

__all__ = ["Oid", "emit_integer", "emit_oid", "emit_tlv", "parse_integer", "parse_oid", "read_constructed", "read_tlv"]

#: The arcs of an object identifier.
Oid: TypeAlias = tuple[int, ...]

#: RFC 2578, 3.5: sub-identifiers of one OBJECT IDENTIFIER, and the largest of them.
MAXIMUM_ARCS = 128
MAXIMUM_ARC = 2**32 - 1

#: Low five bits that announce a tag of several octets, which SNMP does not use.
_LONG_TAG = 0x1F
_INDEFINITE = 0x80
#: Octets of the longest length that is taken; 2**32 is more than any datagram holds.
_LENGTH_OCTETS = 4
#: X.690, 8.19.4: the first two arcs share one sub-identifier, 40 * first + second.
_FIRST_ARC = 40


def _read_header(reader: Reader) -> tuple[int, int]:
    """Tag and length.  Reasons: ``bad-tag``, ``bad-length``, ``short``."""
    tag = reader.u8()
    if tag & _LONG_TAG == _LONG_TAG:
        raise DecodeError("bad-tag", f"0x{tag:02X} begins a tag of several octets")
    length = reader.u8()
    if length < _INDEFINITE:
        return tag, length
    count = length - _INDEFINITE
    if not 0 < count <= _LENGTH_OCTETS:
        raise DecodeError("bad-length", f"length octet 0x{length:02X}")
    return tag, int.from_bytes(reader.bytes(count), "big")


def read_tlv(reader: Reader) -> tuple[int, bytes]:
    """Tag and content of the next element."""
    tag, length = _read_header(reader)
    return tag, reader.bytes(length)


def read_constructed(reader: Reader, expected: int) -> Reader:
    """A reader over the content of the next element, which must have the tag ``expected``."""
    tag, length = _read_header(reader)
    if tag != expected:
        raise DecodeError("bad-tag", f"0x{tag:02X} in place of 0x{expected:02X}")
    return reader.sub(length)


def parse_integer(data: bytes, octets: int = 4) -> int:
    """Two's complement of at most ``octets`` octets, at least one; reason ``bad-length`` otherwise."""
    if not 0 < len(data) <= octets:
        raise DecodeError("bad-length", f"integer of {len(data)} octets, allowed are 1 to {octets}")
    return int.from_bytes(data, "big", signed=True)


def emit_integer(value: int) -> bytes:
    """The content octets, as few as can be."""
    return value.to_bytes((value + (value < 0)).bit_length() // 8 + 1, "big", signed=True)


def parse_oid(data: bytes) -> Oid:
    """Arcs from the content octets, at least two.

    Reasons: ``bad-length`` (empty, ends within an arc, too many arcs), ``bad-value`` (an arc beyond 32 bits, or with
    leading zeros).
    """
    if not data or data[-1] & 0x80:
        raise DecodeError("bad-length", "object identifier without an end")
    arcs: list[int] = []
    value = 0
    for octet in data:
        if octet == 0x80 and not value:
            raise DecodeError("bad-value", "arc with leading zeros")
        value = value << 7 | octet & 0x7F
        if octet & 0x80:
            if value > MAXIMUM_ARC:  # checked here, so that no number grows with the message
                raise DecodeError("bad-value", "arc of more than 32 bits")
            continue
        if not arcs:
            first = min(value // _FIRST_ARC, 2)
            arcs.append(first)
            value -= first * _FIRST_ARC
        if value > MAXIMUM_ARC:
            raise DecodeError("bad-value", "arc of more than 32 bits")
        arcs.append(value)
        value = 0
    if len(arcs) > MAXIMUM_ARCS:
        raise DecodeError("bad-length", f"{len(arcs)} arcs")
    return tuple(arcs)


def emit_oid(oid: Oid) -> bytes:
    """Content octets; :class:`ValueError` for anything but an object identifier (fewer than two arcs, or too large)."""
    if not 2 <= len(oid) <= MAXIMUM_ARCS or oid[0] > 2 or (oid[0] < 2 and oid[1] >= _FIRST_ARC):
        raise ValueError(f"{oid} is not an object identifier")
    if min(oid) < 0 or max(oid) > MAXIMUM_ARC:
        raise ValueError(f"{oid} has an arc that is not a 32-bit number")
    out = bytearray()
    for arc in (oid[0] * _FIRST_ARC + oid[1], *oid[2:]):
        if arc < 0x80:
            out.append(arc)
            continue
        groups = range((arc.bit_length() - 1) // 7 * 7, 0, -7)
        out += bytes(arc >> shift & 0x7F | 0x80 for shift in groups)
        out.append(arc & 0x7F)
    return bytes(out)


def emit_tlv(tag: int, content: bytes) -> bytes:
    """One element with the shortest length."""
    length = len(content)
    if length < _INDEFINITE:
        return bytes((tag, length)) + content
    octets = length.to_bytes((length.bit_length() + 7) // 8, "big")
    return bytes((tag, _INDEFINITE + len(octets))) + octets + content
