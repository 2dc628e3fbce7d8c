"""Declaration of a column of the table: name, type, unit, writer, meaning.

Exactly one party writes each field (the *writer*); all may read.  The writers:

=============  ============================================================================
``station``    the event loop, when it sets a row up or tears it down
``parameter``  the event loop, when a parameter is written (PROFINET record, API, power-on)
``fault``      the event loop, when an impairment is switched
``receive``    the engine, receiving half of a tick
``firmware``   the engine, the drive's step
``program``    the engine, a controller's axis program
``transmit``   the engine, sending half of a tick
``engine``     the engine, anywhere in its loop
``lease``      the thread that renews the lease of a farm's shard
=============  ============================================================================

A row may have parts, which are nested records: ``axis.motor.velocity``.  A part's settings, which the event loop
writes, are a nested record again: ``axis.motor.settings.inertia``.  Data and messages name a field by its *key*, which
leaves out ``settings``: ``motor.velocity``, ``motor.inertia``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["SETTINGS", "Field", "Layout", "subject"]

WRITERS = ("station", "parameter", "fault", "receive", "firmware", "program", "transmit", "engine", "lease")
#: The part of a subject that holds what the event loop writes.
SETTINGS = "settings"
#: Octets of a cache line.
CACHE_LINE = 64
#: Interpreted, a field of such a name would be hidden.
_TAKEN = frozenset(dir(np.recarray)) | frozenset(dir(np.record))


@dataclass(frozen=True, slots=True)
class Field:
    """One column.

    ``kind`` is a NumPy type string; ``shape`` makes a small array inside the row; ``unit`` is
    ``""`` for flags, codes and counts; ``default`` is the value in a new row.
    """

    name: str
    kind: str
    unit: str
    writer: str
    doc: str
    shape: tuple[int, ...] = ()
    default: float = 0


class Layout:
    """A named, documented row type: its own fields, then parts.

    ``fields`` has all fields by their keys, including those of the parts.  With ``cache_lines`` each row of a table
    begins with a cache line.
    """

    def __init__(
        self, name: str, doc: str, fields: list[Field], parts: tuple[Layout, ...] = (), *, cache_lines: bool = False
    ) -> None:
        names = [*(field.name for field in fields), *(part.name for part in parts)]
        if len(set(names)) != len(names):
            raise ValueError(f"a name is twice in layout {name}")
        if taken := sorted(_TAKEN.intersection(names)):
            raise ValueError(f"{name}.{taken[0]}: arrays have an attribute of that name")
        for field in fields:
            if field.writer not in WRITERS:
                raise ValueError(f"{name}.{field.name}: unknown writer {field.writer!r}")
        self.name: str = name
        self.doc = doc
        self.own = tuple(fields)
        self.parts = parts
        self.fields: dict[str, Field] = {field.name: field for field in fields}
        self._paths: dict[str, tuple[str, ...]] = {field.name: (field.name,) for field in fields}
        for part in parts:
            for key, field in part.fields.items():
                whole = key if part.name == SETTINGS else f"{part.name}.{key}"
                if whole in self.fields:
                    raise ValueError(f"{name}.{whole} is a setting and a state")
                self.fields[whole] = field
                self._paths[whole] = (part.name, *part.path(key))
        self.dtype: np.dtype[Any] = np.dtype(
            [
                *((f.name, f.kind, f.shape) if f.shape else (f.name, f.kind) for f in fields),
                *((part.name, part.dtype) for part in parts),
            ],
            align=True,
        )
        if cache_lines:
            self.dtype = _of_whole_cache_lines(self.dtype)
        # one object for all tables, so that Numba need not compare fields when it checks argument types at each call
        self._record = np.dtype((np.record, self.dtype))
        #: A row that nobody wrote to yet.
        self._blank: Any = np.zeros(1, self._record)
        for key, field in self.fields.items():
            if field.default:
                self.write(self._blank, key, field.default)

    def path(self, key: str) -> tuple[str, ...]:
        """The names that lead from a row to the field ``key``."""
        return self._paths[key]

    def place(self, key: str) -> tuple[int, np.dtype[Any]]:
        """Octets from the start of a row to the field ``key``, and its type."""
        offset, kind = 0, self.dtype
        for name in self._paths[key]:
            assert kind.fields is not None
            kind, further = kind.fields[name][:2]
            offset += further
        return offset, kind

    def read(self, rows: Any, key: str) -> Any:
        """The field ``key`` of a row, or of all rows of a table."""
        for name in self._paths[key]:
            rows = rows[name]
        return rows

    def write(self, rows: Any, key: str, value: Any) -> None:
        """Write the field ``key`` of a row, or of all rows of a table; all elements of an array at once."""
        *parts, name = self._paths[key]
        for part in parts:
            rows = rows[part]
        rows[name] = value

    def allocate(self, rows: int) -> Any:
        """``rows`` fresh rows as a record array: ``row.field`` works compiled and interpreted alike."""
        return self.copies(self._blank, rows)

    def copies(self, row: Any, rows: int = 1) -> Any:
        """A table of ``rows`` rows like the one of the table ``row``."""
        # from the start of a cache line: the fields that come first in a row are in its first lines
        size = rows * self.dtype.itemsize
        memory = np.zeros(size + CACHE_LINE, np.uint8)
        begin = -memory.ctypes.data % CACHE_LINE
        table = memory[begin : begin + size].view(self._record)
        octets = row.view(np.uint8)
        # zeros are there already: memory that nobody writes is none of the process's
        if octets.any():
            # octet by octet: NumPy copies a record with gaps field by field
            memory[begin : begin + size].reshape(rows, self.dtype.itemsize)[:] = octets
        return table.view(np.recarray)

    def markdown(self) -> str:
        """The layout as tables for the documentation: its own fields, then each part's by their names in code."""
        lines = [f"### {self.name}", "", self.doc, "", *_table((field.name, field) for field in self.own)]
        for part in self.parts:
            paths = ((".".join(part.path(key)), field) for key, field in part.fields.items())
            lines += ["", f"#### {self.name}.{part.name}", "", part.doc, "", *_table(paths)]
        return "\n".join(lines) + "\n"


def _of_whole_cache_lines(kind: np.dtype[Any]) -> np.dtype[Any]:
    """The record with room after it up to the next cache line."""
    names, by_name = kind.names or (), dict(kind.fields or {})
    fields = [by_name[name] for name in names]
    return np.dtype(
        {
            "names": list(names),
            "formats": [field[0] for field in fields],
            "offsets": [field[1] for field in fields],
            "itemsize": kind.itemsize + -kind.itemsize % CACHE_LINE,
        },
        align=True,
    )


def _table(fields: Iterable[tuple[str, Field]]) -> list[str]:
    lines = ["| field | type | unit | writer | meaning |", "|---|---|---|---|---|"]
    for name, f in fields:
        shape = f"[{','.join(map(str, f.shape))}]" if f.shape else ""
        lines.append(f"| `{name}` | {f.kind}{shape} | {f.unit} | {f.writer} | {f.doc} |")
    return lines


def subject(name: str, doc: str, *, settings: list[Field] | None = None, state: list[Field] | None = None) -> Layout:
    """A part of a row about one subject: its state, and its settings in a nested record."""
    parts = (Layout(SETTINGS, "What the event loop writes.", settings),) if settings else ()
    return Layout(name, doc, state or [], parts)
