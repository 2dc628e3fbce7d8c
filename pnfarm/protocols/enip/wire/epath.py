"""Padded EPATHs: where in a device, and on which way, a message is for (CIP volume 1, appendix C-1).

A path is segments, each of an even number of octets; its type are the three highest bits of its first octet.

===  ============  ========================================================================================
000  port          the way to another link: port number and link address
001  logical       class, instance, member, connection point, attribute, service id; the electronic key
010  network       parameters of a link, such as the production inhibit time
011  symbol        a name
100  data          data for the application (the configuration of a Forward_Open), extended symbols
===  ============  ========================================================================================

A logical value of 16 or 32 bits has a pad octet before it.  Values keep the width in which they came.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.wire.octets import Reader, Writer

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = [
    "DataSegment",
    "ElectronicKey",
    "Logical",
    "LogicalSegment",
    "NetworkSegment",
    "PortSegment",
    "Segment",
    "SymbolSegment",
    "emit_epath",
    "logical_path",
    "parse_epath",
]

_PORT, _LOGICAL, _NETWORK, _SYMBOL = 0x00, 0x20, 0x40, 0x60
_KEY: Final = 0x34
_KEY_FORMAT: Final = 4
_SIMPLE_DATA: Final = 0x80
_ANSI_SYMBOL: Final = 0x91
_EXTENDED_LINK: Final = 0x10
_EXTENDED_PORT: Final = 0x0F
#: Network segments whose subtype has this bit say their length; others have one octet of data.
_NETWORK_ARRAY: Final = 0x10


class Logical(IntEnum):
    """Logical type, bits 2 to 4 of a logical segment."""

    CLASS = 0
    INSTANCE = 1
    MEMBER = 2
    CONNECTION_POINT = 3
    ATTRIBUTE = 4
    SPECIAL = 5
    SERVICE = 6
    EXTENDED = 7


@dataclass(frozen=True, slots=True)
class LogicalSegment:
    """One number of a path; ``width`` is that of its value, 1, 2 or 4 octets, 0 for the smallest that holds it."""

    kind: int
    value: int
    width: int = 0


@dataclass(frozen=True, slots=True)
class ElectronicKey:
    """Which device the sender expects; 0 stands for any.  ``compatible`` is bit 7 of the major revision."""

    vendor_id: int = 0
    device_type: int = 0
    product_code: int = 0
    major_revision: int = 0
    minor_revision: int = 0
    compatible: bool = False


@dataclass(frozen=True, slots=True)
class PortSegment:
    """A port of the device, and the link address behind it."""

    port: int
    link_address: bytes


@dataclass(frozen=True, slots=True)
class NetworkSegment:
    """``subtype`` are the 5 low bits; 3 is the production inhibit time in ms."""

    subtype: int
    data: bytes


@dataclass(frozen=True, slots=True)
class SymbolSegment:
    """A name; ``extended`` in the form of a data segment, which holds up to 255 octets."""

    name: bytes
    extended: bool = True


@dataclass(frozen=True, slots=True)
class DataSegment:
    """Data of an even number of octets, at most 510."""

    data: bytes


Segment = LogicalSegment | ElectronicKey | PortSegment | NetworkSegment | SymbolSegment | DataSegment


def logical_path(
    class_id: int, instance_id: int | None = None, attribute_id: int | None = None, *points: int
) -> tuple[LogicalSegment, ...]:
    """The segments of an object's path; ``points`` are connection points after it."""
    parts = [(Logical.CLASS, class_id), (Logical.INSTANCE, instance_id), (Logical.ATTRIBUTE, attribute_id)]
    segments = [LogicalSegment(kind, value) for kind, value in parts if value is not None]
    return (*segments, *(LogicalSegment(Logical.CONNECTION_POINT, point) for point in points))


# Parse


def _parse_logical(first: int, r: Reader) -> Segment:
    kind, form = first >> 2 & 7, first & 3
    if first == _KEY:
        if (key_format := r.u8()) != _KEY_FORMAT:
            raise DecodeError("bad-segment", f"electronic key of format {key_format}")
        vendor, device_type, product, major, minor = r.u16(), r.u16(), r.u16(), r.u8(), r.u8()
        return ElectronicKey(vendor, device_type, product, major & 0x7F, minor, bool(major & 0x80))
    if kind in {Logical.SPECIAL, Logical.EXTENDED} or form == 3 or (kind == Logical.SERVICE and form):
        raise DecodeError("bad-segment", f"logical segment 0x{first:02X}")
    if form == 0:
        return LogicalSegment(kind, r.u8(), 1)
    r.skip(1)
    return LogicalSegment(kind, r.u16(), 2) if form == 1 else LogicalSegment(kind, r.u32(), 4)


def _parse_port(first: int, r: Reader) -> PortSegment:
    start = r.position - 1
    size = r.u8() if first & _EXTENDED_LINK else 1
    port = first & 0x0F
    if port == 0:
        raise DecodeError("bad-segment", "port 0 is reserved")
    if port == _EXTENDED_PORT:
        port = r.u16()
    address = r.bytes(size)
    r.skip((r.position - start) % 2)
    return PortSegment(port, address)


def _parse_symbol(first: int, r: Reader) -> SymbolSegment:
    size = first & 0x1F
    if size == 0:
        raise DecodeError("bad-segment", "symbol of an extended format")
    name = r.bytes(size)
    r.skip((1 + size) % 2)
    return SymbolSegment(name, extended=False)


def _parse_data(first: int, r: Reader) -> Segment:
    if first == _SIMPLE_DATA:
        return DataSegment(r.bytes(2 * r.u8()))
    if first == _ANSI_SYMBOL:
        size = r.u8()
        name = r.bytes(size)
        r.skip(size % 2)
        return SymbolSegment(name)
    raise DecodeError("bad-segment", f"data segment 0x{first:02X}")


def parse_epath(data: bytes) -> tuple[Segment, ...]:
    """The segments of a whole path.  Raises ``short``, ``bad-segment`` for a segment whose length is not known."""
    r = Reader(data, little=True)
    segments: list[Segment] = []
    while r.remaining:
        first = r.u8()
        match first & 0xE0:
            case 0x00:
                segments.append(_parse_port(first, r))
            case 0x20:
                segments.append(_parse_logical(first, r))
            case 0x40:
                subtype = first & 0x1F
                segments.append(NetworkSegment(subtype, r.bytes(2 * r.u8() if subtype & _NETWORK_ARRAY else 1)))
            case 0x60:
                segments.append(_parse_symbol(first, r))
            case 0x80:
                segments.append(_parse_data(first, r))
            case _:
                raise DecodeError("bad-segment", f"segment 0x{first:02X}")
    return tuple(segments)


# Emit


def _emit_logical(segment: LogicalSegment, w: Writer) -> None:
    value = segment.value
    width = segment.width or (1 if value <= 0xFF else 2 if value <= 0xFFFF else 4)
    first = _LOGICAL | segment.kind << 2
    if width == 1:
        w.u8(first).u8(value)
    elif width == 2:
        w.u8(first | 1).u8(0).u16(value)
    else:
        w.u8(first | 2).u8(0).u32(value)


def _emit_port(segment: PortSegment, w: Writer) -> None:
    start = len(w)
    long = len(segment.link_address) != 1
    low = min(_EXTENDED_PORT, segment.port)
    w.u8(_PORT | low | (_EXTENDED_LINK if long else 0))
    if long:
        w.u8(len(segment.link_address))
    if low == _EXTENDED_PORT:
        w.u16(segment.port)
    w.bytes(segment.link_address)
    w.zeros((len(w) - start) % 2)


def emit_epath(segments: Iterable[Segment]) -> bytes:
    """The octets of a path.  Raises :class:`ValueError` for data that its segment cannot hold."""
    w = Writer(little=True)
    for segment in segments:
        match segment:
            case LogicalSegment():
                _emit_logical(segment, w)
            case ElectronicKey():
                w.u8(_KEY).u8(_KEY_FORMAT).u16(segment.vendor_id).u16(segment.device_type)
                w.u16(segment.product_code)
                w.u8(segment.major_revision | segment.compatible << 7).u8(segment.minor_revision)
            case PortSegment():
                _emit_port(segment, w)
            case NetworkSegment(subtype, data):
                w.u8(_NETWORK | subtype)
                if subtype & _NETWORK_ARRAY:
                    w.u8(_words(data))
                elif len(data) != 1:
                    raise ValueError(f"network segment {subtype} has one octet, not {len(data)}")
                w.bytes(data)
            case SymbolSegment(name, extended=True):
                w.u8(_ANSI_SYMBOL).u8(len(name)).bytes(name).zeros(len(name) % 2)
            case SymbolSegment(name):
                if not 0 < len(name) < 0x20:
                    raise ValueError(f"a short symbol has 1 to 31 octets, not {len(name)}")
                w.u8(_SYMBOL | len(name)).bytes(name).zeros((1 + len(name)) % 2)
            case DataSegment(data):
                w.u8(_SIMPLE_DATA).u8(_words(data)).bytes(data)
    return w.getvalue()


def _words(data: bytes) -> int:
    if len(data) % 2:
        raise ValueError(f"{len(data)} octets are not whole words")
    return len(data) // 2
