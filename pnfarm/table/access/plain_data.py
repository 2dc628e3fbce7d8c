"""One station's plain data of one direction, for the event loop: read and written without tearing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.errors import InternalError
from pnfarm.table.access.plain import plain
from pnfarm.table.channel import IOXS_BAD, IOXS_GOOD
from pnfarm.table.plain_data import PLAIN_OCTETS, PlainRows

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["ConsumedData", "ProvidedData", "copy_plain"]

#: Copies before a reader gives up; the engine writes once in a cycle, a copy takes a few microseconds.
_MOST_COPIES = 1_000


def copy_plain(stored: PlainRows, number: int) -> bytes:
    """Data and statuses of a row as they were at one time."""
    row = plain(stored.rows)[number]
    begin, length = int(row["begin"]), int(row["length"])
    return _copied(row, stored.octets[begin : begin + 2 * length].reshape(2, length))


def _copied(row: Any, halves: Any) -> bytes:
    for _ in range(_MOST_COPIES):
        before = int(row["sequence"])
        octets: bytes = halves[before & 1].tobytes()
        if int(row["sequence"]) == before:
            return octets
    raise InternalError("plain data changed while they were read, again and again")


class _PlainData:
    """A row of ``PROVIDED`` or ``CONSUMED`` (:mod:`pnfarm.table.plain_data`) with so many octets and submodules."""

    def __init__(self, stored: PlainRows, number: int, octets: int, statuses: int) -> None:
        length = octets + statuses
        if length > PLAIN_OCTETS:
            raise InternalError(f"{octets} octets of plain data and {statuses} statuses are above {PLAIN_OCTETS}")
        self.number = number
        self.octets = octets
        rows = plain(stored.rows)
        self._row = rows[number]
        if self._row["length"] != length:
            self._row["length"] = 0
            self._row["begin"] = begin = int((rows["begin"] + 2 * rows["length"]).max())
            if begin + 2 * length > len(stored.octets):
                raise InternalError(f"{len(stored.octets)} octets of plain data are in use")
            self._row["length"] = length
        begin = int(self._row["begin"])
        self._halves = stored.octets[begin : begin + 2 * length].reshape(2, length)

    def status_place(self, submodule: int) -> int:
        """Where the provider status of a submodule is, by its number."""
        return self.octets + submodule

    def read(self) -> bytes:
        """The data of all submodules, as they were at one time."""
        return self.whole()[0]

    def whole(self) -> tuple[bytes, bytes]:
        """The data, and the provider status of each submodule, as they were at one time."""
        octets = _copied(self._row, self._halves)
        return octets[: self.octets], octets[self.octets :]

    def good(self, submodule: int) -> bool:
        """Whether the provider status of a submodule is GOOD."""
        return bool(_copied(self._row, self._halves)[self.status_place(submodule)] & IOXS_GOOD)

    @property
    def changes(self) -> int:
        """Counts the changes, modulo 2 ** 32."""
        return int(self._row["sequence"])

    def _put(self, octets: bytearray) -> None:
        following = (int(self._row["sequence"]) + 1) & 0xFFFFFFFF
        self._halves[following & 1] = octets
        self._row["sequence"] = following


class ConsumedData(_PlainData):
    """What the engine receives; on a polled bus, what :meth:`take` is given."""

    def __init__(self, stored: PlainRows, number: int, octets: int, statuses: int) -> None:
        super().__init__(stored, number, octets, statuses)
        self._good, self._bad = bytes((IOXS_GOOD,)) * statuses, bytes((IOXS_BAD,)) * statuses

    def take(self, octets: bytes, *, good: bool) -> None:
        """All data at once, and the provider status of all submodules."""
        if len(octets) != self.octets:
            raise InternalError(f"{len(octets)} of {self.octets} octets of plain data")
        self._put(bytearray(octets + (self._good if good else self._bad)))


class ProvidedData(_PlainData):
    """What the engine sends; new rows have zeros, with status GOOD."""

    def __init__(self, stored: PlainRows, number: int, octets: int, statuses: int) -> None:
        super().__init__(stored, number, octets, statuses)
        self._halves[:, octets:] = IOXS_GOOD

    def write(self, changes: Mapping[int, bytes]) -> None:
        """Write octets at places, all in force at once."""
        octets = bytearray(_copied(self._row, self._halves))
        for place, values in changes.items():
            if not 0 <= place <= place + len(values) <= self.octets:
                raise InternalError(f"octets {place} to {place + len(values)} of {self.octets} octets of plain data")
            octets[place : place + len(values)] = values
        self._put(octets)

    def set_good(self, submodule: int, *, good: bool) -> None:
        """Set the provider status of a submodule."""
        octets = bytearray(_copied(self._row, self._halves))
        octets[self.status_place(submodule)] = IOXS_GOOD if good else IOXS_BAD
        self._put(octets)
