"""Whether the farm itself was late: for verdicts, and the sources of stolen time.

A scenario asks :func:`farm_lateness` about the time of an expectation that failed; if the farm was later than its
budget then, the verdict is "inconclusive".
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.station.lateness import Lateness, budget_ns

if TYPE_CHECKING:
    from pnfarm.farm.core import FarmCore

__all__ = ["StolenTime", "farm_budget_ns", "farm_lateness"]

#: Budget of a farm that never had a connection: what a controller waits for at a start-up is ten times as long.
IDLE_BUDGET_NS = 50_000_000
#: Late ticks count together within so many budgets: a budget is about half a data hold time.
TOGETHER = 4
#: Field of the line ``cpu`` in /proc/stat that counts stolen time (proc(5)).
STEAL = 8


def farm_budget_ns(core: FarmCore, drive: str | None = None, idle_ns: int = IDLE_BUDGET_NS) -> int:
    """How late the farm may be, ns: the smallest budget of the open connections, of ``drive`` or of all.

    Without one it is ``idle_ns``.  Raises :class:`~pnfarm.errors.ConfigError` for an unknown drive.
    """
    stations = core.stations if drive is None else [core.station(drive)]
    views = (station.device.connection() for station in stations)
    budgets = (budget_ns(view.cycle_ns, view.watchdog_ns) for view in views if view is not None and view.cyclic)
    return min(budgets, default=idle_ns)


def farm_lateness(
    core: FarmCore, begin_ns: int, end_ns: int, *, drive: str | None = None, budget: int | None = None
) -> Lateness:
    """How late the farm was between two times of its clock; ``late`` says whether that is more than its budget.

    ``budget`` in ns replaces :func:`farm_budget_ns`.  The event loop's delay counts, because it delays acyclic frames,
    faults and readings, and so does that of serial lines in the kernel; late ticks count together within
    :data:`TOGETHER` budgets, about a silence that expires a connection.  In virtual time the farm is never late.
    """
    allowed = farm_budget_ns(core, drive) if budget is None else budget
    together = max(1, TOGETHER * allowed)
    return core.lateness.between(begin_ns, end_ns, allowed, by_loop=True, by_lines=True, together_ns=together)


class StolenTime:
    """Reads how long a thread was ready to run without a CPU, and how long the host gave the machine none."""

    def __init__(self, thread: int) -> None:
        self._schedule = Path(f"/proc/self/task/{thread}/schedstat")
        self._stat = Path("/proc/stat")
        self._tick_ns = 1_000_000_000 // os.sysconf("SC_CLK_TCK")
        self._waited = self._taken = 0

    def total_ns(self) -> int:
        """Both together so far; 0 where the kernel has neither (they are compile-time options).

        What cannot be read now, as without a free file descriptor, is as it was.
        """
        with contextlib.suppress(OSError, IndexError, ValueError):
            self._waited = int(self._schedule.read_text(encoding="ascii").split()[1])
        with contextlib.suppress(OSError, IndexError, ValueError), self._stat.open(encoding="ascii") as lines:
            self._taken = int(lines.readline().split()[STEAL]) * self._tick_ns
        return self._waited + self._taken
