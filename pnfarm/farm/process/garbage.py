"""How often Python searches for unreachable objects, which takes time in proportion to those that it looks at."""

from __future__ import annotations

import gc

__all__ = ["keep_what_is_loaded", "search_seldom"]

#: New objects until the next search among them, which takes less than 1 ms.  With Python's own 700 searches are a tenth
#: of the start of 1,024 drives (docs/performance.md).
NEW_OBJECTS = 20_000


def search_seldom() -> None:
    """From now on, in this process."""
    gc.set_threshold(NEW_OBJECTS, *gc.get_threshold()[1:])


def keep_what_is_loaded() -> None:
    """Leave the objects that exist now out of the searches, from now on.

    A start makes several 100,000 that stay.  A search of all of them stops the event loop for a fifth of a second, so
    that the interpreter puts it off until there is a quarter more: closed connections would stay in memory until then.
    """
    gc.collect()
    gc.freeze()
