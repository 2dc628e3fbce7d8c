"""What a device's endpoint mapper answers: which interfaces it has and where.

A client lists the endpoints: each answer carries as many entries as it asked for (PROFINET's clients ask for one) and a
handle that says how far the list was read, until ``ept_s_not_registered`` and the nil handle end it.  The handle
carries the lookup's number and the position itself; only the numbers of the lookups freed last are kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final
from uuid import UUID

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.rpc.epm import (
    EPM_VERSION,
    MAX_ENTRIES,
    NIL_HANDLE,
    NOT_REGISTERED,
    EntryHandle,
    EpmOpnum,
    EptEntry,
    HandleFreed,
    Inquiry,
    LookupRequest,
    LookupResponse,
    Tower,
    VersionOption,
    emit_lookup_response,
    parse_lookup_request,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    NIL_UUID,
    UUID_EPM,
    UUID_PNIO_DEVICE,
    NcaStatus,
    PacketType,
    emit_status,
)

if TYPE_CHECKING:
    from ipaddress import IPv4Address

__all__ = ["Endpoint", "EndpointMapper"]

_HANDLE_VERSION: Final = 0x1000  # the version nibble of a time-based UUID
_HANDLE_VARIANT: Final = 0x80
#: Lookups are numbered by 28 bits, which a handle has room for.
_LOOKUP_MAX: Final = 0x0FFF_FFFF
#: Freed lookups that are remembered.
_FREED_MAX: Final = 256


@dataclass(frozen=True, slots=True)
class Endpoint:
    """One registered interface: ``annotation`` as :func:`pnfarm.protocols.profinet.wire.rpc.epm.annotation` makes
    it."""

    object_uuid: UUID
    annotation: str
    interface: UUID = UUID_PNIO_DEVICE
    version: int = 1


class EndpointMapper:
    """Lists itself first, then ``endpoints``; all on ``port`` of ``address``, which may change at any time."""

    opnums = frozenset({EpmOpnum.LOOKUP, EpmOpnum.LOOKUP_HANDLE_FREE})
    version = EPM_VERSION

    def __init__(self, endpoints: tuple[Endpoint, ...], port: int, address: IPv4Address) -> None:
        own = Endpoint(NIL_UUID, endpoints[0].annotation, UUID_EPM, EPM_VERSION)
        self._endpoints = (own, *endpoints)
        self._node = endpoints[0].object_uuid.node
        self._port = port
        self._last_lookup = 0
        self._freed: list[int] = []
        self.address = address

    def answer(self, opnum: int, stub: bytes, *, little_endian: bool) -> tuple[PacketType, bytes]:
        """The PDU type and the stub that answer a call of one of :attr:`opnums`."""
        try:
            if opnum == EpmOpnum.LOOKUP:
                request = parse_lookup_request(stub, little_endian=little_endian)
                response = self._lookup(request, *self._place(request.handle))
                return PacketType.RESPONSE, emit_lookup_response(response, little_endian=little_endian)
            lookup, _ = self._place(EntryHandle.parse(stub, little_endian=little_endian))
            if lookup:
                self._freed = [*self._freed, lookup][-_FREED_MAX:]
            return PacketType.RESPONSE, HandleFreed(NIL_HANDLE, 0).emit(little_endian=little_endian)
        except DecodeError:
            return PacketType.REJECT, emit_status(NcaStatus.PROTO_ERROR, little_endian=little_endian)
        except _ForeignHandleError:
            return PacketType.FAULT, emit_status(NcaStatus.FAULT_CONTEXT_MISMATCH, little_endian=little_endian)

    def _lookup(self, request: LookupRequest, lookup: int, position: int) -> LookupResponse:
        matches = [endpoint for endpoint in self._endpoints if _matches(endpoint, request)]
        if request.max_entries == 0 or position >= len(matches):
            return LookupResponse(NIL_HANDLE, (), request.max_entries, NOT_REGISTERED)
        asked = matches[position : position + min(request.max_entries, MAX_ENTRIES)]
        entries = tuple(self._entry(endpoint) for endpoint in asked)
        if not lookup:
            lookup = self._last_lookup = self._last_lookup % _LOOKUP_MAX + 1
        return LookupResponse(self._handle(lookup, position + len(entries)), entries, request.max_entries)

    def _entry(self, endpoint: Endpoint) -> EptEntry:
        tower = Tower(endpoint.interface, endpoint.version, self._port, self.address)
        return EptEntry(endpoint.object_uuid, tower, endpoint.annotation)

    def _handle(self, lookup: int, position: int) -> EntryHandle:
        high, middle = divmod(lookup, 1 << 16)
        return EntryHandle(0, UUID(fields=(position, middle, _HANDLE_VERSION | high, _HANDLE_VARIANT, 0, self._node)))

    def _place(self, handle: EntryHandle) -> tuple[int, int]:
        """The number of a handle's lookup, 0 for one that begins, and its position."""
        if handle == NIL_HANDLE:
            return 0, 0
        position, middle, high, *_ = handle.uuid.fields
        lookup = (high & ~_HANDLE_VERSION) << 16 | middle
        if not 0 < lookup <= self._last_lookup or lookup in self._freed or handle != self._handle(lookup, position):
            raise _ForeignHandleError
        return lookup, position


class _ForeignHandleError(Exception):
    """A handle that this mapper never issued, or that was freed."""


def _matches(endpoint: Endpoint, request: LookupRequest) -> bool:
    match request.inquiry:
        case Inquiry.ALL:
            return True
        case Inquiry.BY_INTERFACE:
            return _matches_interface(endpoint, request)
        case Inquiry.BY_OBJECT:
            return endpoint.object_uuid == request.object_uuid
        case Inquiry.BY_BOTH:
            return endpoint.object_uuid == request.object_uuid and _matches_interface(endpoint, request)
        case _:
            return False


def _matches_interface(endpoint: Endpoint, request: LookupRequest) -> bool:
    """C706 appendix O, vers_option; every interface here has minor version 0."""
    if endpoint.interface != request.interface:
        return False
    wanted = (request.version_major, request.version_minor)
    match request.version_option:
        case VersionOption.COMPATIBLE | VersionOption.EXACT:
            return wanted == (endpoint.version, 0)
        case VersionOption.MAJOR_ONLY:
            return wanted[0] == endpoint.version
        case VersionOption.UP_TO:
            return (endpoint.version, 0) <= wanted
        case _:
            return True
