"""How late the farm itself was: what makes a failed expectation inconclusive.

The engine counts in a histogram how late each tick began.  A failure is inconclusive if, from the beginning of its step
to its end, a tick was later than the budget: that of the scenario, else the shortest agreed cycle of the farm's
connections, but at least a millisecond.  A controller may then have missed a frame because of the farm.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.table.engine_row import LATENESS_EDGES_NS
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.farm.core import FarmCore

__all__ = ["Lateness"]

#: A tick later than this is late whatever the cycle.
LEAST_NS = 1_000_000


class Lateness:
    """Of one farm in real time."""

    def __init__(self, core: FarmCore, budget_ns: int | None) -> None:
        self._core = core
        self._budget_ns = budget_ns
        self._first = self._counts()
        self._last_ns = 0

    def _counts(self) -> list[int]:
        return [int(count) for count in self._core.columns.engine[0].lateness]

    @property
    def budget_ns(self) -> int:
        """How late a tick may be."""
        if self._budget_ns is not None:
            return self._budget_ns
        connections = (station.device.connection() for station in self._core.stations)
        cycles = [found.cycle_ns for found in connections if found is not None and found.cycle_ns]
        return max(LEAST_NS, min(cycles, default=LEAST_NS))

    def mark(self, now: int) -> object:
        """The present counts, for :meth:`was_late`."""
        del now
        return self._counts()

    def was_late(self, mark: object, now: int) -> bool:
        """Whether a tick since ``mark`` was later than the budget, or the engine stands still for longer."""
        assert isinstance(mark, list)
        standing = now - int(self._core.columns.engine[0].now_ns)
        self._last_ns = max(_latest(mark, self._counts()), standing)
        return self._last_ns > self.budget_ns

    @property
    def told(self) -> str:
        """The lateness that :meth:`was_late` found, for a message."""
        return f"at least {format_duration(self._last_ns)}"

    def report(self) -> Mapping[str, Any]:
        """The engine's health over the run."""
        engine = self._core.columns.engine[0]
        return {
            "budget_seconds": self.budget_ns / 1e9,
            "latest_at_least_seconds": _latest(self._first, self._counts()) / 1e9,
            "overruns": int(engine.overruns),
            "cycles": int(engine.cycles),
        }


def _latest(before: list[int], after: list[int]) -> int:
    """Lower bound of the highest bucket that grew."""
    for place in range(len(after) - 1, -1, -1):
        if after[place] > before[place]:
            return LATENESS_EDGES_NS[place - 1] if place else 0
    return 0
