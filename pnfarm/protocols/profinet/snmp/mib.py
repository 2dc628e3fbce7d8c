"""The management information base of a drive: which objects there are, and finding the next one.

Objects are data: a :class:`Scalar` or a :class:`Table` says its name (RFC 2578: the object type's arcs, and after them
0 or the row's index) and how to read its value from a :class:`~pnfarm.protocols.profinet.snmp.view.SnmpView`.  The
names in their order, a :class:`MibLayout`, are sorted once and stay until a row comes or goes; a request then costs one
view, and each of its variables one bisection and one read.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pnfarm.protocols.profinet.wire.snmp.message import Value, octets

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Callable, Sequence

    from pnfarm.protocols.profinet.snmp.view import SnmpView
    from pnfarm.protocols.profinet.wire.snmp.ber import Oid

__all__ = ["Mib", "MibLayout", "MibSnapshot", "Reading", "Scalar", "Table", "admin_text", "display_text", "truth"]

Row = TypeVar("Row")

#: RFC 2579: DisplayString; RFC 3411: SnmpAdminString.
TEXT_LIMIT = 255


@dataclass(frozen=True, slots=True)
class Reading:
    """What a scalar is read from: the station's view, and the agent's own counters by their arc below snmp."""

    view: SnmpView
    statistics: Counter[int]


@dataclass(frozen=True, slots=True)
class Scalar:
    """One object with the one instance 0."""

    name: Oid
    read: Callable[[Reading], Value]


@dataclass(frozen=True)  # no slots: a generic class notes its parameter in each object
class Table(Generic[Row]):
    """``rows`` of a view, each with the arcs of its ``index``; ``columns`` by their arc below ``entry``."""

    entry: Oid
    rows: Callable[[SnmpView], Sequence[Row]]
    index: Callable[[Row], Oid]
    columns: Sequence[tuple[int, Callable[[Row], Value]]]


def display_text(text: str) -> Value:
    """DisplayString: ASCII."""
    return octets(text.encode("ascii", "replace")[:TEXT_LIMIT])


def admin_text(text: str) -> Value:
    """SnmpAdminString: UTF-8."""
    return octets(text.encode("utf-8", "replace")[:TEXT_LIMIT])


def truth(value: bool) -> int:
    """TruthValue (RFC 2579)."""
    return 1 if value else 2


class MibLayout:
    """The instances that there are, in their order.

    A cell is the table's number (-1 for a scalar), the row's place in it, and the function that reads it.
    """

    def __init__(
        self, scalars: Sequence[Scalar], tables: Sequence[Table[Any]], indexes: Sequence[Sequence[Oid]]
    ) -> None:
        cells: dict[Oid, tuple[int, int, Callable[[Any], Value]]] = {}
        for scalar in scalars:
            cells[*scalar.name, 0] = (-1, 0, scalar.read)
        for number, (table, rows) in enumerate(zip(tables, indexes, strict=True)):
            for place, index in enumerate(rows):
                for arc, read in table.columns:
                    cells.setdefault((*table.entry, arc, *index), (number, place, read))
        self.names: list[Oid] = sorted(cells)
        self.cells = cells
        types = [scalar.name for scalar in scalars]
        types += [(*table.entry, arc) for table in tables for arc, _ in table.columns]
        self._types = sorted(types)

    def after(self, name: Oid) -> int:
        """Place of the first instance after ``name``; one past the last if there is none."""
        return bisect_right(self.names, name)

    def has_type(self, name: Oid) -> bool:
        """Whether ``name`` lies below an object type that is implemented, with or without such an instance."""
        place = bisect_right(self._types, name) - 1
        return place >= 0 and name[: len(self._types[place])] == self._types[place]


class MibSnapshot:
    """The objects at one moment; all its values are of that moment."""

    def __init__(self, layout: MibLayout, tables: Sequence[Sequence[Any]], reading: Reading) -> None:
        self.layout = layout
        self._tables = tables
        self._reading = reading

    def get(self, name: Oid) -> Value | None:
        """The instance of exactly that name."""
        cell = self.layout.cells.get(name)
        if cell is None:
            return None
        table, place, read = cell
        return read(self._reading if table < 0 else self._tables[table][place])


class Mib:
    """``view`` gives the station's state at a time; ``layouts`` counts how often the names were sorted."""

    def __init__(
        self, view: Callable[[int], SnmpView], scalars: Sequence[Scalar], tables: Sequence[Table[Any]]
    ) -> None:
        self.layouts = 0
        self._view = view
        self._scalars = scalars
        self._tables = tables
        self._indexes: list[list[Oid]] = []
        self._layout: MibLayout | None = None

    def at(self, now: int, statistics: Counter[int]) -> MibSnapshot:
        """The objects as they are at ``now``."""
        reading = Reading(self._view(now), statistics)
        rows = [table.rows(reading.view) for table in self._tables]
        indexes = [[table.index(row) for row in of] for table, of in zip(self._tables, rows, strict=True)]
        if self._layout is None or indexes != self._indexes:
            self._indexes = indexes
            self._layout = MibLayout(self._scalars, self._tables, indexes)
            self.layouts += 1
        return MibSnapshot(self._layout, rows, reading)
