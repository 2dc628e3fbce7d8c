"""Impairments of a station's cyclic channels: rows are allocated, chained, and linked to the open channels.

Connections may come and go while an impairment stays; so the chains belong to stations, and a channel that
opens is linked to its station's chain.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pnfarm.engine.columns import Columns
from pnfarm.errors import InternalError
from pnfarm.table.access.plain import plain
from pnfarm.table.impairment import threshold
from pnfarm.wire.direction import Direction

__all__ = ["CyclicEvidence", "ImpairmentTable"]

#: What an impairment that is given no settings, and has not acted yet, has in its row.
_AS_NEW: Mapping[str, float] = {
    "model": 0, "burst": 0, "enter": 0, "leave": 0, "hit_good": 0, "hit_bad": 0, "amount": 0, "whole": 0, "mends": 0,
    "slot": 0, "delay_ns": 0, "jitter_ns": 0, "octet_ns": 0.0, "overtakes": 0, "shares": 0,
    "left": 0, "kept": -1, "free_ns": 0, "waiting": 0, "overflows": 0,
    "checks": 0, "activations": 0, "first_ns": 0, "last_ns": 0,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class CyclicEvidence:
    """Frames checked, frames changed or dropped, and when (None: never)."""

    checks: int
    activations: int
    first_ns: int | None
    last_ns: int | None


class ImpairmentTable:
    """``direction`` is seen from the station: ``in`` acts on what it consumes, ``out`` on what it provides."""

    def __init__(self, columns: Columns) -> None:
        self._columns = columns
        self._rows = plain(columns.impairment)
        self._tables: Mapping[Direction, Any] = {"in": plain(columns.cpm), "out": plain(columns.ppm)}
        self._chains: dict[tuple[int, Direction], list[int]] = {}
        self._channels: dict[tuple[int, Direction], tuple[int, ...]] = {}
        #: Rows that were never in use begin here; those that were wait for their turn.
        self._fresh = 0
        self._free: deque[int] = deque()
        self._owner: dict[int, tuple[int, Direction]] = {}

    def add(
        self,
        station: int,
        direction: Direction,
        kind: int,
        *,
        probability: float = 1.0,
        seed: int = 1,
        count: int = 0,
        after: int = 0,
        start_ns: int = 0,
        stop_ns: int = 0,
        settings: Mapping[str, float] | None = None,
    ) -> int:
        """Put an impairment in force; returns its row.  ``count`` and ``stop_ns`` 0 mean without end.

        ``settings`` are further fields of the row, by the kind.

        Raises :class:`InternalError` when all rows are in use.
        """
        if self._fresh < self._columns.impairment.shape[0]:
            number = self._fresh
            self._fresh += 1
        elif self._free:
            number = self._free.popleft()
        else:
            raise InternalError(f"all {self._columns.impairment.shape[0]} impairment rows are in use")
        row = self._rows[number]
        row["threshold"] = threshold(probability)
        for name, value in {**_AS_NEW, **(settings or {})}.items():
            row[name] = value
        row["limit"], row["after"], row["start_ns"], row["stop_ns"] = count, after, start_ns, stop_ns
        # a generator that starts at zero would stay there
        row["random"] = (seed * 0x9E3779B97F4A7C15 + 0x1234567) & 0x7FFFFFFFFFFFFFFF or 1
        row["kind"] = kind
        chain = self._chains.setdefault((station, direction), [])
        chain.append(number)
        self._owner[number] = (station, direction)
        self._link(station, direction)
        return number

    def remove(self, number: int) -> CyclicEvidence:
        """Remove an impairment; returns its final evidence."""
        evidence = self.evidence(number)
        station, direction = self._owner.pop(number)
        self._chains[station, direction].remove(number)
        self._link(station, direction)
        row = self._rows[number]
        if row["shares"] > 0:
            self._rows[row["shares"] - 1]["shares"] = 0
        row["kind"] = 0
        # what it still holds goes on at the next tick
        row["uses"] = (int(row["uses"]) + 1) & 0xFFFFFFFF
        engine = self._columns.engine[0]
        engine.ended = (int(engine.ended) + 1) & 0xFFFFFFFF
        self._free.append(number)
        return evidence

    def has(self, station: int, direction: Direction, kind: int) -> bool:
        """Whether one of this kind is in force on a station."""
        return any(int(self._rows[row]["kind"]) == kind for row in self._chains.get((station, direction), ()))

    def of_station(self, station: int) -> list[int]:
        """Rows in force on a station."""
        return [row for (owner, _), chain in self._chains.items() if owner == station for row in chain]

    def share_limit(self, one: int, other: int) -> None:
        """Let two rows count against one limit: an injection into both directions has one number of activations."""
        self._rows[one]["shares"] = other + 1
        self._rows[other]["shares"] = one + 1

    def set_limit(self, number: int, count: int) -> None:
        """Change the number of activations; another row has used up a part of it."""
        # zero would mean no limit
        self._rows[number]["limit"] = count if count > 0 else -1

    def waiting(self, number: int) -> int:
        """Frames that it holds at present."""
        return int(self._rows[number]["waiting"])

    def evidence(self, number: int) -> CyclicEvidence:
        row = self._rows[number]
        return CyclicEvidence(
            int(row["checks"]), int(row["activations"]), int(row["first_ns"]) or None, int(row["last_ns"]) or None
        )

    def channel_opened(self, station: int, direction: Direction, row: int) -> None:
        """A provider (``out``) or consumer (``in``) of this station now runs in ``row``."""
        self._channels[station, direction] = (*self._channels.get((station, direction), ()), row)
        self._link(station, direction)

    def channel_closed(self, station: int, direction: Direction, row: int) -> None:
        self._tables[direction][row]["impairment"] = 0
        others = (other for other in self._channels.get((station, direction), ()) if other != row)
        self._channels[station, direction] = tuple(others)

    def _link(self, station: int, direction: Direction) -> None:
        """Rewrite the chain and its heads; a reader in the middle of it sees the old or the new order."""
        chain = self._chains.get((station, direction), [])
        for position, here in enumerate(chain):
            following = chain[position + 1] + 1 if position + 1 < len(chain) else 0
            self._rows[here]["next"] = following
        head = chain[0] + 1 if chain else 0
        table = self._tables[direction]
        for row in self._channels.get((station, direction), ()):
            table[row]["impairment"] = head
