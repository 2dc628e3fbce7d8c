"""A record of the table as a plain Python object: the interpreter reads a number of it thirty times as fast.

Attributes are Python's own integers and floats, arrays hold them (dtype ``object``, so that slices, shapes and bounds
are an array's), nested records are objects in turn.  :func:`octets` makes a record's octets of it again; what a field
does not hold raises.
"""

from __future__ import annotations

import functools
import math
import struct
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np

__all__ = ["PlainRecord", "keep_rows", "octets", "plain", "plain_rows"]

_CODES = {"u1": "B", "u2": "H", "u4": "I", "u8": "Q", "i1": "b", "i2": "h", "i4": "i", "i8": "q", "f8": "d"}


class PlainRecord:
    """Attributes as the record's fields, read once."""


@functools.cache
def _format(kind: np.dtype[Any]) -> str:
    """A type's octets as :mod:`struct` has them, padding too."""
    if kind.subdtype is not None:
        base, shape = kind.subdtype
        if base.names is None:
            return f"{math.prod(shape)}{_format(base)}"
        return _format(base) * math.prod(shape)
    if kind.names is None:
        return _CODES[kind.str[1:]]
    told, at = "", 0
    for name in kind.names:
        part, offset = kind.fields[name][:2]
        told += f"{offset - at}x{_format(part)}"
        at = offset + part.itemsize
    return f"{told}{kind.itemsize - at}x"


@functools.cache
def _codec(kind: np.dtype[Any]) -> struct.Struct:
    return struct.Struct(f"={_format(kind)}")


@functools.cache
def _fields(kind: np.dtype[Any]) -> tuple[tuple[str, np.dtype[Any], bool], ...]:
    """Name, type, and whether it is one number, of each field."""
    parts = ((name, kind.fields[name][0]) for name in kind.names)
    return tuple((name, part, part.names is None and part.subdtype is None) for name, part in parts)


def plain(record: Any) -> PlainRecord:
    """The values of a structured scalar."""
    return _record(record.dtype, iter(_codec(record.dtype).unpack(record.tobytes())))


def _record(kind: np.dtype[Any], values: Iterator[Any]) -> PlainRecord:
    stand_in = PlainRecord()
    told = vars(stand_in)
    for name, part, single in _fields(kind):
        told[name] = next(values) if single else _part(part, values)
    return stand_in


def _part(kind: np.dtype[Any], values: Iterator[Any]) -> Any:
    if kind.subdtype is None:
        return _record(kind, values)
    base, shape = kind.subdtype
    held = np.empty(math.prod(shape), object)
    held[:] = [*islice(values, held.size)] if base.names is None else [_record(base, values) for _ in range(held.size)]
    return held.reshape(shape)


def octets(stand_in: PlainRecord, kind: np.dtype[Any]) -> bytes:
    """The octets of a record of this type, which ``stand_in`` was read from; padding is zero.

    Raises:
        AttributeError: a field that the record does not have, or one that is gone.
        struct.error: a number that its field's type does not hold.
    """
    flat: list[Any] = []
    _flatten(kind, stand_in, flat)
    return _codec(kind).pack(*flat)


def plain_rows(rows: Any) -> np.ndarray:
    """The rows of a record array: objects in an array, so that ``rows[i].field`` and ``rows.shape`` work as ever."""
    held = np.empty(len(rows), object)
    held[:] = [plain(row) for row in rows]
    return held


def keep_rows(stand_ins: np.ndarray, rows: Any) -> None:
    """Put what became of :func:`plain_rows` into the record array that they were read from.

    Raises:
        AttributeError, struct.error: see :func:`octets`.
    """
    held = b"".join(octets(stand_in, rows.dtype) for stand_in in stand_ins)
    rows[:] = np.frombuffer(held, rows.dtype)


def _flatten(kind: np.dtype[Any], stand_in: PlainRecord, flat: list[Any]) -> None:
    told = vars(stand_in)
    if told.keys() != kind.fields.keys():
        raise AttributeError(f"fields that differ: {', '.join(sorted(told.keys() ^ kind.fields.keys()))}")
    for name, part, single in _fields(kind):
        value = told[name]
        if single:
            flat.append(value)
        elif part.subdtype is None:
            _flatten(part, value, flat)
        elif part.subdtype[0].names is None:
            flat.extend(value.ravel().tolist())
        else:
            for row in value.flat:
                _flatten(part.subdtype[0], row, flat)
