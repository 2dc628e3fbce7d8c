"""How often Python searches for unreachable objects, which takes time in proportion to those that it checks."""

from __future__ import annotations

import asyncio
import gc

__all__ = ["keep_what_is_loaded", "search_seldom"]

#: New objects until the next search among them, which takes less than 1 ms.  With Python's own 700 searches are a tenth
#: of the start of 1,024 drives (docs/performance.md).
NEW_OBJECTS = 20_000
#: What a drive that boots or loses its connection leaves refers to itself, and is old by then: only a search among all
#: objects finds it.  Python would begin one after two million new ones; here a check each minute finds whether there
#: are so many.
LOOK_SECONDS, ENOUGH_OBJECTS = 60.0, 10_000


def search_seldom() -> None:
    """From now on, in this process."""
    gc.set_threshold(NEW_OBJECTS, *gc.get_threshold()[1:])


def keep_what_is_loaded() -> None:
    """Leave the objects that exist now out of the searches, from now on; search among the others now and then.

    A start makes several 100,000 that stay.  A search of all of them stops the event loop, which runs here, for a fifth
    of a second.
    """
    gc.collect()
    gc.freeze()
    _look(asyncio.get_running_loop())


def _look(loop: asyncio.AbstractEventLoop) -> None:
    new, searches, _ = gc.get_count()
    if new + searches * gc.get_threshold()[0] >= ENOUGH_OBJECTS:
        gc.collect()
    loop.call_later(LOOK_SECONDS, _look, loop)
