"""How often a drive's firmware steps while a controller sends it data."""

from __future__ import annotations

__all__ = ["FASTEST_STEP_NS", "SLOWEST_STEP_NS", "longest_step_ns"]

#: Channels step four times a cycle, but not faster than the engine's usual tick of 1 ms.  After a late tick the next
#: may come slightly early and still counts, hence a quarter less.
FASTEST_STEP_NS = 750_000
SLOWEST_STEP_NS = 4_000_000


def longest_step_ns(cycle_ns: int) -> int:
    """Longest interval between two firmware steps: less than a cycle, so that it sees every frame of set points."""
    return min(SLOWEST_STEP_NS, max(FASTEST_STEP_NS, cycle_ns // 4), cycle_ns * 3 // 4)
