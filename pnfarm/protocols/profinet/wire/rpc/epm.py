"""The endpoint mapper that a PROFINET device answers on its context management port.

Sources: C706 appendix O (the ``ept`` interface), appendix L (protocol towers) and chapter 14 (NDR); IEC 61158-6-10
4.10.3 (RPC substitutions, annotation), which makes lookup and lookup-handle-free mandatory.

The arguments follow the header's data representation.  A tower is little-endian always, save for the port and
the address, which are in network order.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from ipaddress import IPv4Address
from typing import Final
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.rpc.pdu import NIL_UUID
from pnfarm.wire.layout import List16, Octets16, Structure, UInt32, Uuid
from pnfarm.wire.octets import Reader, Writer

__all__ = [
    "EPM_VERSION",
    "MAX_ENTRIES",
    "NIL_HANDLE",
    "NOT_REGISTERED",
    "EntryHandle",
    "EpmOpnum",
    "EptEntry",
    "HandleFreed",
    "Inquiry",
    "LookupRequest",
    "LookupResponse",
    "Tower",
    "VersionOption",
    "annotation",
    "emit_lookup_request",
    "emit_lookup_response",
    "emit_tower",
    "parse_lookup_request",
    "parse_lookup_response",
    "parse_tower",
]

EPM_VERSION: Final = 3
NDR_UUID: Final = UUID("8a885d04-1ceb-11c9-9fe8-08002b104860")
NDR_VERSION: Final = 2
NOT_REGISTERED: Final = 0x16C9A0D6
"""ept_s_not_registered: nothing (more) to list."""

ANNOTATION_LENGTH: Final = 64
MAX_ENTRIES: Final = 500
"""C706 appendix O, ept_max_lookup_results."""


class EpmOpnum(IntEnum):
    """C706 appendix O; a PROFINET device serves LOOKUP and LOOKUP_HANDLE_FREE."""

    INSERT = 0
    DELETE = 1
    LOOKUP = 2
    MAP = 3
    LOOKUP_HANDLE_FREE = 4
    INQ_OBJECT = 5
    MGMT_DELETE = 6


class Inquiry(IntEnum):
    """C706 appendix O, rpc_c_ep_*."""

    ALL = 0
    BY_INTERFACE = 1
    BY_OBJECT = 2
    BY_BOTH = 3


class VersionOption(IntEnum):
    """C706 appendix O, rpc_c_vers_*."""

    ALL = 1
    COMPATIBLE = 2
    EXACT = 3
    MAJOR_ONLY = 4
    UP_TO = 5


class _Protocol(IntEnum):
    """First octet of a floor's left side (C706 appendix I)."""

    DOD_UDP = 0x08
    DOD_IP = 0x09
    NCADG = 0x0A
    UUID = 0x0D


# --- annotation (IEC 61158-6-10, 4.10.3.3) -------------------------------------------------------------------


def annotation(
    device_type: str,
    order_id: str,
    hardware_revision: int,
    software_prefix: str,
    software_revision: tuple[int, int, int],
) -> str:
    """The 63 characters a tool shows: type (25), order id (20), hardware (5), prefix (1) and software revision (9).

    Longer texts are cut to their field.
    """
    version = "".join(f"{part:3d}"[:3] for part in software_revision)
    return f"{device_type:<25.25} {order_id:<20.20} {hardware_revision:>5} {software_prefix:1.1}{version}"[:63]


def _annotation_octets(text: str) -> bytes:
    return text.encode("latin-1", "replace")[: ANNOTATION_LENGTH - 1].ljust(ANNOTATION_LENGTH, b"\0")


# --- protocol tower (C706 appendix L) ------------------------------------------------------------------------


class _Floor(Structure):
    """One floor as on the wire: ``left`` begins with the protocol's octet."""

    left: Octets16
    right: Octets16


class _Floors(Structure, little=True):
    floors: List16[_Floor]


@dataclass(frozen=True, slots=True)
class Tower:
    """The five floors of connectionless RPC over UDP: interface, NDR, RPC, port, address."""

    interface: UUID
    version: int
    port: int
    address: IPv4Address
    version_minor: int = 0


def emit_tower(tower: Tower) -> bytes:
    """75 octets."""
    interface = tower.interface.bytes_le + tower.version.to_bytes(2, "little")
    rows = (
        (_Protocol.UUID, interface, tower.version_minor.to_bytes(2, "little")),
        (_Protocol.UUID, NDR_UUID.bytes_le + NDR_VERSION.to_bytes(2, "little"), bytes(2)),
        (_Protocol.NCADG, b"", bytes(2)),
        (_Protocol.DOD_UDP, b"", tower.port.to_bytes(2, "big")),
        (_Protocol.DOD_IP, b"", tower.address.packed),
    )
    return _Floors(tuple(_Floor(bytes((protocol,)) + left, right) for protocol, left, right in rows)).emit()


def parse_tower(octets: bytes) -> Tower:
    """Read a tower of connectionless RPC over UDP; any other is a :class:`DecodeError` (``bad-tower``)."""
    floors = _Floors.parse(octets).floors
    if not all(floor.left for floor in floors):
        raise DecodeError("bad-tower", "a floor without a protocol")
    shape = [(floor.left[0], len(floor.left) - 1, len(floor.right)) for floor in floors]
    wanted = [
        (_Protocol.UUID, 18, 2),
        (_Protocol.UUID, 18, 2),
        (_Protocol.NCADG, 0, 2),
        (_Protocol.DOD_UDP, 0, 2),
        (_Protocol.DOD_IP, 0, 4),
    ]
    if shape != wanted:
        raise DecodeError("bad-tower", f"floors {shape}")
    interface, transfer = (UUID(bytes_le=floors[row].left[1:17]) for row in (0, 1))
    if transfer != NDR_UUID:
        raise DecodeError("bad-tower", f"transfer syntax {transfer} is not NDR")
    return Tower(
        interface,
        int.from_bytes(floors[0].left[17:], "little"),
        int.from_bytes(floors[3].right, "big"),
        IPv4Address(floors[4].right),
        int.from_bytes(floors[0].right, "little"),
    )


# --- lookup (C706 appendix O, ept_lookup) ----------------------------------------------------------------------


class EntryHandle(Structure):
    """A context handle: the position of the listing."""

    attributes: UInt32
    uuid: Uuid


NIL_HANDLE: Final = EntryHandle(0, NIL_UUID)


@dataclass(frozen=True, slots=True)
class LookupRequest:
    """What to list.  An absent UUID (``None``) is a null pointer on the wire."""

    inquiry: int = Inquiry.ALL
    object_uuid: UUID | None = NIL_UUID
    interface: UUID | None = NIL_UUID
    version_major: int = 0
    version_minor: int = 0
    version_option: int = VersionOption.ALL
    handle: EntryHandle = NIL_HANDLE
    max_entries: int = 1


@dataclass(frozen=True, slots=True)
class EptEntry:
    """One registered endpoint."""

    object_uuid: UUID
    tower: Tower
    annotation: str


@dataclass(frozen=True, slots=True)
class LookupResponse:
    """A part of the listing; ``status`` is :data:`NOT_REGISTERED` when there is nothing (more)."""

    handle: EntryHandle
    entries: tuple[EptEntry, ...]
    max_entries: int
    status: int = 0


_FIXED_LENGTH: Final = 76
_OBJECT_REFERENCE, _INTERFACE_REFERENCE, _TOWER_REFERENCE = 1, 2, 3


def parse_lookup_request(stub: bytes, *, little_endian: bool) -> LookupRequest:
    """Read the arguments of lookup.

    In the 76 octets that IEC 61158-6-10 lists, both UUIDs are present whatever their references say; any other
    length is plain NDR, where a null reference leaves its UUID out.
    """
    reader = Reader(stub, little_endian)
    fixed = len(stub) == _FIXED_LENGTH
    inquiry = reader.u32()
    object_ = reader.uuid() if reader.u32() or fixed else None
    interface, major, minor = None, 0, 0
    if reader.u32() or fixed:
        interface = reader.uuid()
        major, minor = reader.u16(), reader.u16()
    option = reader.u32()
    handle = EntryHandle.read(reader)
    max_entries = reader.u32()
    reader.expect_end()
    return LookupRequest(inquiry, object_, interface, major, minor, option, handle, max_entries)


def emit_lookup_request(request: LookupRequest, *, little_endian: bool) -> bytes:
    writer = Writer(little_endian).u32(request.inquiry)
    writer.u32(0 if request.object_uuid is None else _OBJECT_REFERENCE)
    if request.object_uuid is not None:
        writer.uuid(request.object_uuid)
    writer.u32(0 if request.interface is None else _INTERFACE_REFERENCE)
    if request.interface is not None:
        writer.uuid(request.interface).u16(request.version_major).u16(request.version_minor)
    writer.u32(request.version_option)
    request.handle.write(writer)
    return writer.u32(request.max_entries).getvalue()


def parse_lookup_response(stub: bytes, *, little_endian: bool) -> LookupResponse:
    """Read the answer to lookup; towers follow the array of entries, as NDR defers what pointers point to."""
    reader = Reader(stub, little_endian)
    handle = EntryHandle.read(reader)
    number, maximum, offset, actual = (reader.u32() for _ in range(4))
    if offset or actual != number or actual > min(maximum, MAX_ENTRIES):
        raise DecodeError("bad-length", f"{number} entries, counts {maximum}, {offset}, {actual}")
    heads = [_read_entry(reader) for _ in range(actual)]
    entries = tuple(EptEntry(object_, _read_tower(reader), text) for object_, text in heads)
    reader.align(4)
    status = reader.u32()
    reader.expect_end()
    return LookupResponse(handle, entries, maximum, status)


def emit_lookup_response(response: LookupResponse, *, little_endian: bool) -> bytes:
    writer = Writer(little_endian)
    response.handle.write(writer)
    number = len(response.entries)
    writer.u32(number).u32(response.max_entries).u32(0).u32(number)
    _write_entries(writer, response.entries)
    return writer.align(4).u32(response.status).getvalue()


def _read_entry(reader: Reader) -> tuple[UUID, str]:
    reader.align(4)
    object_ = reader.uuid()
    reference, offset, length = (reader.u32() for _ in range(3))
    if not reference:
        raise DecodeError("bad-tower", "an entry without a tower")
    if offset or length > ANNOTATION_LENGTH:
        raise DecodeError("bad-length", f"annotation of {length} octets at {offset}")
    return object_, reader.bytes(length).split(b"\0", 1)[0].decode("latin-1")


def _read_tower(reader: Reader) -> Tower:
    reader.align(4)
    maximum, length = reader.u32(), reader.u32()
    if maximum != length:
        raise DecodeError("bad-length", f"tower of {length} octets, {maximum} announced")
    return parse_tower(reader.bytes(length))


def _write_entries(writer: Writer, entries: Sequence[EptEntry]) -> None:
    for row, entry in enumerate(entries):
        writer.align(4).uuid(entry.object_uuid).u32(_TOWER_REFERENCE + row).u32(0).u32(ANNOTATION_LENGTH)
        writer.bytes(_annotation_octets(entry.annotation))
    for entry in entries:
        octets = emit_tower(entry.tower)
        writer.align(4).u32(len(octets)).u32(len(octets)).bytes(octets)


# --- lookup-handle-free (C706 appendix O), whose arguments are the handle alone ----------------------------------


class HandleFreed(Structure):
    """The answer to lookup-handle-free: the handle, now nil, and the status."""

    handle: EntryHandle
    status: UInt32
