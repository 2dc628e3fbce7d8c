"""How late the farm itself was: what makes a failed expectation inconclusive.

A failure is inconclusive if the farm was later than its budget at some time from the beginning of the step to its end:
that of the scenario, else that of the farm's connections (:func:`pnfarm.farm.lateness.farm_budget_ns`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.farm.lateness import farm_budget_ns, farm_lateness
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.farm.core import FarmCore
    from pnfarm.station.lateness import Lateness

__all__ = ["FarmLateness"]


class FarmLateness:
    """Of one farm in real time, from ``now`` on."""

    def __init__(self, core: FarmCore, budget_ns: int | None, now: int) -> None:
        self._core = core
        self._budget_ns = budget_ns
        self._began_ns = now
        self._told = ""

    def was_late(self, begin: int, now: int) -> bool:
        """Whether it was later than its budget in that time, or its engine still stands."""
        found, stands = self._between(begin, now)
        plant = self._core.lateness.plant.longest(begin, now)
        worst = max(found.worst_ns, stands, plant)
        if worst <= found.budget_ns:
            return False
        parts = {
            "engine": max(found.engine_ns, stands),
            "frames waited": found.receive_ns,
            "event loop": found.loop_ns,
            "serial lines in the kernel": found.lines_ns,
            "plant": plant,
            "time stolen by other programs or the host": found.stolen_ns,
        }
        said = ", ".join(f"{name} {_rounded(ns)}" for name, ns in parts.items() if ns > 0)
        self._told = f"{_rounded(worst)} late, and may be {_rounded(found.budget_ns)} ({said})"
        return True

    def worst_ns(self, begin: int, now: int) -> int:
        """The largest lateness in that time."""
        found, stands = self._between(begin, now)
        return max(found.worst_ns, stands, self._core.lateness.plant.longest(begin, now))

    def _between(self, begin: int, now: int) -> tuple[Lateness, int]:
        found = farm_lateness(self._core, begin, now, budget=self._budget_ns)
        return found, now - int(self._core.columns.engine[0].now_ns)

    @property
    def budget_ns(self) -> int:
        """How late it may be now."""
        return farm_budget_ns(self._core) if self._budget_ns is None else self._budget_ns

    @property
    def told(self) -> str:
        """The lateness that :meth:`was_late` found and the parts of it, for a message."""
        return self._told

    def report(self, now: int) -> Mapping[str, Any]:
        """The farm's health over the run."""
        engine = self._core.columns.engine[0]
        found = farm_lateness(self._core, self._began_ns, now, budget=self._budget_ns)
        return {**found.as_dict(), "overruns": int(engine.overruns), "cycles": int(engine.cycles)}


def _rounded(ns: int) -> str:
    """In microseconds: more is noise."""
    return format_duration(round(ns, -3) or ns)
