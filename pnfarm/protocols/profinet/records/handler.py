"""The AR machine's interface for records, and the two handlers that need no device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.wire.block import split_blocks

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.cm.ar import Ar

__all__ = ["KeptRecords", "NoRecords", "RecordHandler"]

#: What a controller writes at start-up and a device without ports to adjust can ignore: PDPortDataCheck,
#: PDPortDataAdjust, PDInterfaceMrpDataCheck and -Adjust, PDPortMrpDataAdjust, PDNCDataCheck, PDInterfaceAdjust,
#: PDInterfaceFSUDataAdjust, and two of Siemens' device driver (:mod:`directory`).
_KEPT = frozenset({0x802B, 0x802F, 0x8051, 0x8052, 0x8053, 0x8070, 0x8071, 0x8090, 0xB050, 0xB060})


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


#: The last index of a record that is a maker's own (IEC 61158-6-10, Index).
_LAST_OWN = 0x7FFF


class KeptRecords:
    """A physical device without data of its own: what a controller writes at start-up is kept and read back.

    The records about a real interface are invalid, and so are those that request IRT.  ``indexes``: others that are
    kept instead.
    """

    def __init__(self, indexes: frozenset[int] = _KEPT) -> None:
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
            # a maker's own records are no blocks
            if index > _LAST_OWN:
                split_blocks(data)
        except DecodeError:
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        self._kept[slot, subslot, index] = data
        return None
