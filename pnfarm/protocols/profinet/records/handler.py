"""The AR machine's interface for records, and the handler of records without effect."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.wire.block import split_blocks

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.cm.ar import Ar

__all__ = ["KeptRecords", "RecordHandler"]


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


class KeptRecords:
    """The records of these indexes have no effect: what a controller writes is kept and read back."""

    def __init__(self, indexes: frozenset[int]) -> None:
        self._indexes = indexes
        self._kept: dict[tuple[int, int, int], bytes] = {}

    @property
    def written(self) -> list[int]:
        """The indexes of those that were written, in rising order."""
        return sorted({index for _, _, index in self._kept})

    def read(
        self, ar: Ar | None, api: int, slot: int, subslot: int, index: int, max_length: int, now: int
    ) -> bytes | RecordError:
        del ar, api, max_length, now
        if index not in self._indexes:
            return RecordError(AccessError.INVALID_INDEX)
        return self._kept.get((slot, subslot, index), b"")

    def write(self, ar: Ar, api: int, slot: int, subslot: int, index: int, data: bytes, now: int) -> RecordError | None:
        del ar, api, now
        if index not in self._indexes:
            return RecordError(AccessError.INVALID_INDEX)
        try:
            split_blocks(data)
        except DecodeError:
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        self._kept[slot, subslot, index] = data
        return None
