"""How late the farm itself was: what makes a failed expectation inconclusive.

A failure is inconclusive if the farm was later than its budget at some time from the beginning of the step to its end:
that of the scenario, else that of the farm's connections (:func:`pnfarm.farm.lateness.farm_budget_ns`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.farm.lateness import farm_lateness
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.farm.core import FarmCore

__all__ = ["Lateness"]


class Lateness:
    """Of one farm in real time, from ``now`` on."""

    def __init__(self, core: FarmCore, budget_ns: int | None, now: int) -> None:
        self._core = core
        self._budget_ns = budget_ns
        self._began_ns = now
        self._worst_ns = 0

    def was_late(self, begin: int, now: int) -> bool:
        """Whether it was later than its budget in that time, or its engine still stands."""
        found = farm_lateness(self._core, begin, now, budget=self._budget_ns)
        self._worst_ns = max(found.worst_ns, now - int(self._core.columns.engine[0].now_ns))
        return self._worst_ns > found.budget_ns

    @property
    def told(self) -> str:
        """The lateness that :meth:`was_late` found, for a message."""
        return format_duration(self._worst_ns)

    def report(self, now: int) -> Mapping[str, Any]:
        """The farm's health over the run."""
        engine = self._core.columns.engine[0]
        found = farm_lateness(self._core, self._began_ns, now, budget=self._budget_ns)
        return {**found.as_dict(), "overruns": int(engine.overruns), "cycles": int(engine.cycles)}
