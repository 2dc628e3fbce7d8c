"""Fields of one record as views, for code that reads or writes them for each telegram.

Attributes of a NumPy record take microseconds each, a view's only element takes 50 ns.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pnfarm.errors import InternalError

__all__ = ["field_views", "row_number", "row_octets"]


def row_octets(record: Any) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """The memory of ``record``, a row of a table (``table[i]``)."""
    size = record.dtype.itemsize
    begin = row_number(record) * size
    octets: np.ndarray[Any, np.dtype[np.uint8]] = record.base.view(np.ndarray).view(np.uint8)
    return octets[begin : begin + size]


def row_number(record: Any) -> int:
    """Which row of its table ``record`` is."""
    table = record.base
    # as octets: the address of a record comes with a description of all its fields, which takes half a millisecond
    address = np.frombuffer(record, np.uint8).ctypes.data
    return int((address - table.ctypes.data) // table.strides[0])


def field_views(record: Any, *names: str) -> tuple[memoryview, ...]:
    """A view of each field of ``record``, a row of a table (``table[i]``): of one element, or of the field's array.

    ``faults.code`` is a field of a field.  ``view[0] = value`` writes into the table, with the range of the field's
    type: a value beyond it raises.
    """
    table = record.base
    if not isinstance(table, np.ndarray) or table.ndim != 1:
        raise InternalError("this record is no row of a table")
    whole = table.view(np.ndarray)
    place = row_number(record)
    row = whole[place : place + 1]
    views = []
    for name in names:
        field = row
        for each in name.split("."):
            field = field[each]
        part: Any = field[0] if field.ndim > 1 else field
        views.append(memoryview(part))
    return tuple(views)
