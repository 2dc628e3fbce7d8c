"""How a column of the table is declared: name, type, unit, writer, meaning.

Exactly one party writes each field (the *writer*); everybody may read.  The writers:

=============  ============================================================================
``station``    the event loop, when it sets a row up or tears it down
``parameter``  the event loop, when a parameter is written (PROFINET record, API, power-on)
``fault``      the event loop, when an impairment is switched
``receive``    the engine, receiving half of a tick
``firmware``   the engine, the drive's step
``program``    the engine, a controller's axis program
``transmit``   the engine, sending half of a tick
``engine``     the engine, anywhere in its loop
=============  ============================================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["Field", "Layout"]

WRITERS = ("station", "parameter", "fault", "receive", "firmware", "program", "transmit", "engine")


@dataclass(frozen=True, slots=True)
class Field:
    """One column.

    ``kind`` is a NumPy type string; ``shape`` makes a small array inside the row; ``unit`` is
    ``""`` for flags, codes and counts; ``default`` is what a row has that nobody wrote yet.
    """

    name: str
    kind: str
    unit: str
    writer: str
    doc: str
    shape: tuple[int, ...] = ()
    default: float = 0


class Layout:
    """A named, documented row type."""

    def __init__(self, name: str, doc: str, fields: list[Field]) -> None:
        names = [field.name for field in fields]
        if len(set(names)) != len(names):
            raise ValueError(f"a field stands twice in layout {name}")
        for field in fields:
            if field.writer not in WRITERS:
                raise ValueError(f"{name}.{field.name}: unknown writer {field.writer!r}")
        self.name = name
        self.doc = doc
        self.fields = {field.name: field for field in fields}
        self.dtype = np.dtype(
            [(f.name, f.kind, f.shape) if f.shape else (f.name, f.kind) for f in fields],
            align=True,
        )

    def allocate(self, rows: int) -> Any:
        """``rows`` fresh rows as a record array: ``row.field`` works compiled and interpreted alike."""
        table: Any = np.zeros(rows, self.dtype).view(np.recarray)
        for field in self.fields.values():
            if field.default:
                table[field.name] = field.default
        return table

    def markdown(self) -> str:
        """The layout as a table for the documentation."""
        lines = [
            f"### {self.name}",
            "",
            self.doc,
            "",
            "| field | type | unit | writer | meaning |",
            "|---|---|---|---|---|",
        ]
        for f in self.fields.values():
            shape = f"[{','.join(map(str, f.shape))}]" if f.shape else ""
            lines.append(f"| `{f.name}` | {f.kind}{shape} | {f.unit} | {f.writer} | {f.doc} |")
        return "\n".join(lines) + "\n"
