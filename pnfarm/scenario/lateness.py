"""How late the farm itself was: what makes a failed expectation inconclusive.

A failure is inconclusive if the farm was later than its budget at some time from the beginning of the step to its end:
that of the scenario, else that of the farm's connections (:func:`pnfarm.farm.lateness.farm_budget_ns`).  The record of
delays keeps the newest ones only, so a run looks at it all the time, and keeps the largest.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from pnfarm.farm.lateness import IDLE_BUDGET_NS, TOGETHER, farm_budget_ns, farm_lateness
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.farm.core import FarmCore
    from pnfarm.station.lateness import Lateness

__all__ = ["FarmLateness"]

#: Between two checks of the record, which keeps some seconds of a machine that is late all the time.
LOOK_NS = 100_000_000
#: Longest time between two readings of a signal without events, beyond which its value is not known; and from its last
#: reading to the end of its time.
UNSEEN_NS, END_NS = 20_000_000, 5_000_000
#: Kept largest ones of each kind.
KEPT = 256


@dataclass(frozen=True, slots=True)
class _Kept:
    """What a check found: nothing of it is before ``begin``, ns."""

    begin: int
    own: Lateness

    @property
    def ratio(self) -> float:
        """To its budget."""
        return self.own.worst_ns / max(1, self.own.budget_ns)


class _Largest:
    """The largest one since any time: each that is kept is larger than all after it."""

    def __init__(self, size: Callable[[_Kept], float]) -> None:
        self._size = size
        self._kept: deque[_Kept] = deque()

    def note(self, found: _Kept) -> None:
        while self._kept and self._size(self._kept[-1]) <= self._size(found):
            self._kept.pop()
        self._kept.append(found)
        if len(self._kept) > KEPT:
            first, second = self._kept.popleft(), self._kept.popleft()
            # the larger one for both: a farm that was late is not to be blamed for less
            self._kept.appendleft(replace(first, begin=second.begin))

    def since(self, begin: int, last: _Kept) -> Lateness:
        """The largest one that lies after ``begin``, ``last`` included."""
        found = next((kept for kept in self._kept if kept.begin >= begin), last)
        return max(found, last, key=self._size).own


class FarmLateness:
    """Of one farm in real time, from ``now`` on; :meth:`look` is to be called at least each second."""

    def __init__(self, core: FarmCore, budget_ns: int | None, now: int) -> None:
        self._core = core
        self._given_ns = budget_ns
        self._known_ns = IDLE_BUDGET_NS
        self._began_ns = self._step_ns = self._looked_ns = now
        self._last_budget_ns = self.budget_ns
        self._by_ratio = _Largest(attrgetter("ratio"))
        self._by_size = _Largest(attrgetter("own.worst_ns"))
        #: The lateness that :meth:`was_late` found and the parts of it, for a message.
        self.told = ""

    def step(self, now: int) -> None:
        """A step begins: what is found from now on is of it."""
        if now > self._looked_ns:
            self._keep(now)
        self._step_ns = now

    def look(self, now: int) -> None:
        """Keep how late it was since the last check, before the record forgets it."""
        if now - self._looked_ns >= LOOK_NS:
            self._keep(now)

    def _keep(self, now: int) -> None:
        budget = self.budget_ns
        # a tick may be late together with some before the last check
        kept = self._found(max(self._step_ns, self._looked_ns - TOGETHER * budget), now)
        for largest in (self._by_ratio, self._by_size):
            largest.note(kept)
        self._looked_ns, self._last_budget_ns = now, budget

    def was_late(self, begin: int, now: int) -> bool:
        """Whether it was later than its budget in that time, or its engine still stalls."""
        found = self._by_ratio.since(begin, self._found(begin, now))
        if not found.late:
            return False
        parts = {
            "engine": found.engine_ns,
            "frames waited": found.receive_ns,
            "event loop": found.loop_ns,
            "serial lines in the kernel": found.lines_ns,
            "plant": found.plant_ns,
            "time stolen by other programs or the host": found.stolen_ns,
        }
        said = ", ".join(f"{name} {_rounded(ns)}" for name, ns in parts.items() if ns > 0)
        self.told = f"{_rounded(found.worst_ns)} late, and may be {_rounded(found.budget_ns)} ({said})"
        return True

    def is_unseen(self, gap_ns: int, before_end_ns: int) -> bool:
        """Whether a signal without events was not looked at for too long, or its last check in time was too early."""
        if not self._core.lateness.loop.due_ns:
            # no heartbeat: the clock is one that others move
            return False
        return before_end_ns > END_NS or gap_ns > max(UNSEEN_NS, self.budget_ns)

    def worst_ns(self, begin: int, now: int) -> int:
        """The largest lateness in that time."""
        return self._by_size.since(begin, self._found(begin, now)).worst_ns

    def _found(self, begin: int, now: int) -> _Kept:
        """By the record, which may not reach back to ``begin``."""
        engine = self._core.columns.engine[0]
        # a connection that is over had its budget up to then
        own = farm_lateness(self._core, begin, now, budget=min(self.budget_ns, self._last_budget_ns))
        stands = now - int(engine.now_ns) - int(engine.tick_ns)
        plant = self._core.lateness.plant.longest(begin, now)
        return _Kept(begin, replace(own, engine_ns=max(own.engine_ns, stands), plant_ns=plant))

    @property
    def budget_ns(self) -> int:
        """How late it may be now, by the connections that are open, or were last."""
        if self._given_ns is None:
            self._known_ns = farm_budget_ns(self._core, idle_ns=self._known_ns)
            return self._known_ns
        return self._given_ns

    def report(self, now: int) -> Mapping[str, Any]:
        """The farm's health over the run: where it was latest by its budget."""
        engine = self._core.columns.engine[0]
        found = self._by_ratio.since(self._began_ns, self._found(self._began_ns, now))
        return {**found.as_dict(), "overruns": int(engine.overruns), "cycles": int(engine.cycles)}


def _rounded(ns: int) -> str:
    """In microseconds: more is noise."""
    return format_duration(round(ns, -3) or ns)
