"""Between two ticks: a moment in which the event loop may read and write what the engine writes.

The engine's thread runs without the interpreter's lock, and says in its row when it ticks next.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, TypeVar

from pnfarm.errors import EnvironmentError_

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.engine.columns import Columns

__all__ = ["between_ticks"]

_T = TypeVar("_T")
#: Time that has to be left up to the next tick, ns.
_LEFT_NS = 100_000
#: Between two looks, s, and how long they go on, ns.
_LOOK_SECONDS = 0.0002
_PATIENCE_NS = 2_000_000_000


def between_ticks(columns: Columns, action: Callable[[], _T]) -> _T:
    """Do something short while no tick runs; once more if one began meanwhile.

    Raises :class:`EnvironmentError_` where the engine comes to no rest.
    """
    engine = columns.engine[0]
    until = time.monotonic_ns() + _PATIENCE_NS
    while True:
        due, now = int(engine.due_ns), time.monotonic_ns()
        if due == 0:
            # it has no thread of its own
            return action()
        if due - now > _LEFT_NS:
            done = action()
            if time.monotonic_ns() < due == int(engine.due_ns):
                return done
        if now > until:
            raise EnvironmentError_(
                f"the engine had no rest between two ticks for {_PATIENCE_NS / 1e9:g} s: the machine is too busy"
            )
        # the engine's thread has nothing to wait for: its row says when it ticks
        time.sleep(_LOOK_SECONDS)
