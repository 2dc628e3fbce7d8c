"""ARFSUDataAdjust: which set of parameters a controller writes (IEC 61158-6-10, FSParameterBlock).

A device that keeps its parameters for a fast start-up may skip those that follow when it has this set already.
This one accepts whatever is written, so that the record changes nothing; it is kept as long as its AR exists, and
read back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.wire.block import VERSION_1_0, BlockType, split_blocks
from pnfarm.protocols.profinet.wire.records.fsu import ArFsuDataAdjust

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from pnfarm.protocols.profinet.cm.ar import Ar

__all__ = ["FsuRecords"]


class FsuRecords:
    """``ars`` are the present ones.  Until the record is written, what the Connect request contained is read."""

    def __init__(self, ars: Callable[[], Iterable[Ar]]) -> None:
        self._ars = ars
        self._written: dict[int, bytes] = {}

    def read(self, ar: Ar) -> bytes:
        """Empty where the controller wrote nothing."""
        return self._written.get(ar.key, ar.fsu_adjust)

    def write(self, ar: Ar, data: bytes) -> RecordError | None:
        """None when the record was accepted, else the error."""
        try:
            (block,) = split_blocks(data)
            if block.block_type != BlockType.AR_FSU_DATA_ADJUST or block.version_high != VERSION_1_0 >> 8:
                return RecordError(AccessError.INVALID_PARAMETER)
            ArFsuDataAdjust.of(block)
        except (DecodeError, ValueError):  # of another shape; no block or several
            return RecordError(AccessError.WRITE_LENGTH_ERROR)
        standing = {other.key for other in self._ars()}
        self._written = {key: kept for key, kept in self._written.items() if key in standing}
        self._written[ar.key] = data
        return None
