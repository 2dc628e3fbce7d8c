"""The I/O data of one submodule as records: inputs, outputs, and the value that replaces outputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.records.directory import Index
from pnfarm.protocols.profinet.wire.block import split_blocks
from pnfarm.protocols.profinet.wire.records.identification import (
    RecordInputData,
    RecordOutputData,
    SubstituteValue,
    SubstitutionMode,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from pnfarm.protocols.profinet.cm.ar import Ar, ExpectedKey
    from pnfarm.protocols.profinet.description import SubmoduleDescription

__all__ = ["IoData", "IoRecords"]

_GOOD = 0x80
_MODES = frozenset(SubstitutionMode)


@dataclass(frozen=True, slots=True)
class IoData:
    """One submodule's data in one direction, as last sent or received."""

    data: bytes
    iops: int
    iocs: int


class IoRecords:
    """``io_data(slot, subslot, output)`` gives a submodule's cyclic data, or None while there is none.

    Substitute values are kept as long as the AR that wrote them exists.
    """

    def __init__(self, ars: Callable[[], Iterable[Ar]], io_data: Callable[[int, int, bool], IoData | None]) -> None:
        self._ars = ars
        self._io_data = io_data
        self._substitutes: dict[tuple[int, ExpectedKey], SubstituteValue] = {}

    def read(self, ar: Ar | None, sub: SubmoduleDescription, index: int) -> bytes | RecordError:
        key = sub.api, sub.slot, sub.subslot
        if index == Index.SUBSTITUTE_VALUE:
            if not sub.output_bytes:
                return RecordError(AccessError.INVALID_INDEX)
            value = self._substitute(ar, key)
            return (value or _zeros(sub.output_bytes, _GOOD, _GOOD)).emit()
        output = index == Index.RECORD_OUTPUT_DATA
        # a submodule without data has input data of no length: its provider status
        if not (sub.output_bytes if output else sub.input_bytes or not sub.output_bytes):
            return RecordError(AccessError.INVALID_INDEX)
        found = self._io_data(sub.slot, sub.subslot, output)
        if found is None:
            return RecordError(AccessError.STATE_CONFLICT)
        iocs, iops = bytes([found.iocs]), bytes([found.iops])
        if not output:
            return RecordInputData(iocs, iops, found.data).emit()
        value = self._substitute(ar, key) or _zeros(len(found.data), found.iocs, found.iops)
        return RecordOutputData(iocs, iops, found.data, 0, value.emit()).emit()

    def write(self, ar: Ar, sub: SubmoduleDescription, data: bytes) -> RecordError | None:
        """SubstituteValue, the only one that can be written."""
        if not sub.output_bytes:
            return RecordError(AccessError.INVALID_INDEX)
        try:
            (raw,) = split_blocks(data)
            value = SubstituteValue.of(raw)
        except (DecodeError, ValueError):
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        if len(value.data) != sub.output_bytes:
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        if value.mode not in _MODES:
            return RecordError(AccessError.INVALID_PARAMETER)
        self._forget_the_gone()
        self._substitutes[ar.key, (sub.api, sub.slot, sub.subslot)] = value
        return None

    def _substitute(self, ar: Ar | None, key: ExpectedKey) -> SubstituteValue | None:
        """What the reader's AR wrote, else that of any other present AR."""
        keys = [a.key for a in ((ar,) if ar else ())] + [a.key for a in self._ars()]
        return next((self._substitutes[k, key] for k in keys if (k, key) in self._substitutes), None)

    def _forget_the_gone(self) -> None:
        standing = {ar.key for ar in self._ars()}
        self._substitutes = {k: v for k, v in self._substitutes.items() if k[0] in standing}


def _zeros(length: int, iocs: int, iops: int) -> SubstituteValue:
    return SubstituteValue(SubstitutionMode.ZERO, iocs, bytes(length), iops)
