"""How late the farm itself was in some time, and whether that is more than it may be.

A farm that does not run cannot receive, answer or see a silence end: what a watchdog finds then may be its own doing.
So what happens to a connection is judged by the farm's *budget* (:func:`budget_ns`): beyond it the farm is the cause,
else the controller.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

__all__ = ["Cause", "Lateness", "budget_ns"]

#: Who caused the loss of a connection: the ``cause`` of events and metrics.
Cause = Literal["controller", "farm"]


def budget_ns(cycle_ns: int, hold_ns: int) -> int:
    """How late the farm may be on a connection with this cycle and data hold time, ns.

    A controller that is on time sends a frame each cycle, so that a delay of ``hold_ns - cycle_ns`` expires the timer.
    Half of that is the farm's: if it used more, it has the larger share. With the shortest data hold time, one cycle,
    nothing is left, and half a cycle is allowed.
    """
    return max(cycle_ns, hold_ns - cycle_ns) // 2


@dataclass(frozen=True, slots=True)
class Lateness:
    """The farm's own lateness within some time; all durations in ns.

    ``engine_ns``: ticks began late, together; ``receive_ns``: the longest time for which a received frame waited beyond
    a tick; ``loop_ns``: the longest delay of the event loop; ``stolen_ns``: the engine's thread was ready to run and
    got no CPU, or the host gave the machine none, where the kernel reports it. Stolen time is the reason for the others
    and is not judged by itself.  ``lines_ns``: the longest time for which the kernel kept an octet of a serial line, if
    that counts; ``plant_ns``: the longest time by which a model of the plant was ready late, if that counts.
    ``by_loop``: the event loop's delay counts too, because acyclic frames decide.
    """

    budget_ns: int
    engine_ns: int = 0
    receive_ns: int = 0
    loop_ns: int = 0
    stolen_ns: int = 0
    lines_ns: int = 0
    plant_ns: int = 0
    by_loop: bool = False

    @property
    def worst_ns(self) -> int:
        """What is compared with the budget."""
        loop_ns = self.loop_ns if self.by_loop else 0
        return max(self.engine_ns, self.receive_ns, self.lines_ns, self.plant_ns, loop_ns)

    @property
    def late(self) -> bool:
        """Whether the farm was later than it may be."""
        return self.worst_ns > self.budget_ns

    @property
    def cause(self) -> Cause:
        """Who caused what happened then."""
        return "farm" if self.late else "controller"

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, for events."""
        return {
            "cause": self.cause,
            "farm_late_seconds": self.worst_ns / 1e9,
            "farm_budget_seconds": self.budget_ns / 1e9,
            "engine_late_seconds": self.engine_ns / 1e9,
            "receive_late_seconds": self.receive_ns / 1e9,
            "loop_late_seconds": self.loop_ns / 1e9,
            "lines_late_seconds": self.lines_ns / 1e9,
            "plant_late_seconds": self.plant_ns / 1e9,
            "stolen_seconds": self.stolen_ns / 1e9,
        }
