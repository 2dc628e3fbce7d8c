"""States of an injection on one drive.

========  =================================================================================================
WAITING   for its start: a condition, a time, healthy cycles, a connection whose cycles are to be counted
ACTIVE    in force
ENDED     everything is as it was; the evidence stays
========  =================================================================================================
"""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["TRANSITIONS", "RunEvent", "RunState"]


class RunState(StrEnum):
    """State of an injection on one drive."""

    WAITING = "waiting"
    ACTIVE = "active"
    ENDED = "ended"


class RunEvent(StrEnum):
    """What happens to it; the values of those that end it are the reasons that users see."""

    DUE = "due"
    FINISHED = "count"
    EXPIRED = "time"
    CLEARED = "cleared"
    LAPSED = "ttl"
    AGAIN = "again"
    FAILED = "failed"


#: (state, what happened) -> state.  Other transitions do not occur.
TRANSITIONS: Mapping[tuple[RunState, RunEvent], RunState] = {
    (RunState.WAITING, RunEvent.DUE): RunState.ACTIVE,
    (RunState.WAITING, RunEvent.CLEARED): RunState.ENDED,
    (RunState.WAITING, RunEvent.FAILED): RunState.ENDED,
    (RunState.ACTIVE, RunEvent.FAILED): RunState.ENDED,
    (RunState.ACTIVE, RunEvent.FINISHED): RunState.ENDED,
    (RunState.ACTIVE, RunEvent.EXPIRED): RunState.ENDED,
    (RunState.ACTIVE, RunEvent.CLEARED): RunState.ENDED,
    (RunState.WAITING, RunEvent.LAPSED): RunState.ENDED,
    (RunState.ACTIVE, RunEvent.LAPSED): RunState.ENDED,
    # with a rate, until `times` are over
    (RunState.ACTIVE, RunEvent.AGAIN): RunState.WAITING,
}
