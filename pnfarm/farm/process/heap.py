"""How the C library's allocator keeps memory, for processes that run for weeks."""

from __future__ import annotations

import contextlib
import ctypes

__all__ = ["keep_heap_small"]

#: ``M_MMAP_THRESHOLD`` and ``M_ARENA_MAX`` of mallopt(3).
_MMAP_THRESHOLD, _ARENA_MAX = -3, -8
#: Octets from which on a buffer has pages of its own, which its end gives back.  glibc raises this to 32 MiB by and by:
#: an answer of the API then leaves a hole in the heap, and what is allocated next comes after it.
OWN_PAGES = 256 << 10
#: Heaps that threads share: one for each thread, as by default, holds what its busiest moment needed.
HEAPS = 2


def keep_heap_small() -> None:
    """From now on, in this process; nothing where the C library has no ``mallopt``."""
    with contextlib.suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_MMAP_THRESHOLD, OWN_PAGES)
        mallopt(_ARENA_MAX, HEAPS)
