"""Values of many fields of a row, written at once.

A field of a part is reached through a record for each part on the way, a microsecond each; a row has hundreds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pnfarm.table.access.record_fields import row_octets

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pnfarm.table.layout import Layout

__all__ = ["Patch"]


class Patch:
    """``values`` are fields of ``layout`` by their keys; where one is given twice, the latter counts."""

    def __init__(self, layout: Layout, values: Iterable[tuple[str, float]]) -> None:
        row = np.zeros(1, layout.dtype)
        octets = row.view(np.uint8)
        places: set[int] = set()
        for key, value in values:
            layout.write(row, key, value)
            begin, kind = layout.place(key)
            places.update(range(begin, begin + kind.itemsize))
        self._places = np.array(sorted(places), np.intp)
        self._octets = octets[self._places]
        self._bytes = self._octets.tobytes()

    def apply(self, record: Any) -> None:
        """Write into ``record``, a row of a table (``table[i]``); other fields stay."""
        row_octets(record)[self._places] = self._octets

    def stands_in(self, record: Any) -> bool:
        """Whether ``record``, a row of a table (``table[i]``), has these values already."""
        return row_octets(record)[self._places].tobytes() == self._bytes
