"""How the AR machine asks for a record, and the two handlers that know nothing of the device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.record_directory import Access, Scope, find_record
from pnfarm.protocols.profinet.wire.blocks import split_blocks

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.ar import Ar

__all__ = ["KeptRecords", "NoRecords", "RecordHandler"]


class RecordHandler(Protocol):
    """Answers at once.  ``ar`` is None for an implicit read that names no AR.

    ``read`` returns at most ``max_length`` octets.  Neither method raises.
    """

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError: ...

    def write(
        self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int
    ) -> RecordError | None: ...


class NoRecords:
    """An application without any record: every index is invalid."""

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        del ar, api, slot, subslot, index, max_length, now
        return RecordError(AccessError.INVALID_INDEX)

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        del ar, api, slot, subslot, index, data, now
        return RecordError(AccessError.INVALID_INDEX)


class KeptRecords:
    """A physical device without ports to adjust: what a controller writes at start-up is kept and read back.

    Nothing is known of the real interface, so the records that would tell of it are invalid.
    """

    def __init__(self) -> None:
        self._kept: dict[tuple[int, int, int], bytes] = {}

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        del ar, api, max_length, now
        record = find_record(index)
        if record is None or record.scope is not Scope.SUBSLOT or not record.access & Access.WRITE:
            return RecordError(AccessError.INVALID_INDEX)
        return self._kept.get((slot, subslot, index), b"")

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        del ar, api, now
        try:
            split_blocks(data)
        except DecodeError:
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        self._kept[slot, subslot, index] = data
        return None
