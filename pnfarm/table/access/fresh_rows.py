"""What is written into new rows of a table: worked out once, and copied into each further row that comes to the same.

The drives of a farm are mostly alike, and a drive's parameters are two hundred fields, a few microseconds each.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from pnfarm.table.access.record_fields import row_octets

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

__all__ = ["FreshRows", "Same"]

T = TypeVar("T")


class Same:
    """A part of a key: this very object, which stays alive with it."""

    __slots__ = ("_object",)

    def __init__(self, of: object) -> None:
        self._object = of

    def __hash__(self) -> int:
        return id(self._object)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and other._object is self._object


class FreshRows(Generic[T]):
    """``most``: so many different rows are kept; then the one that was not used for longest goes."""

    def __init__(self, most: int = 64) -> None:
        self._most = most
        self._known: OrderedDict[tuple[Hashable, bytes], tuple[Any, Any, T]] = OrderedDict()

    def write(self, record: Any, key: Hashable, write: Callable[[], T]) -> T:
        """Do what ``write`` does to ``record``, a row of a table (``table[i]``), and return what it returns.

        ``key`` has to tell all that this depends on, except what stands in the row.  Nobody else may write to the row
        meanwhile.
        """
        octets = row_octets(record)
        before = octets.tobytes()
        known = self._known.get((key, before))
        if known is None:
            told = write()
            places = np.flatnonzero(octets != np.frombuffer(before, np.uint8))
            known = self._known[key, before] = places, octets[places], told
            if len(self._known) > self._most:
                self._known.popitem(last=False)
        else:
            self._known.move_to_end((key, before))
            places, written, _ = known
            octets[places] = written
        return known[2]
