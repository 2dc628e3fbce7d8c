"""Open files of this process: a farm uses as many as the machine's limit allows."""

from __future__ import annotations

import contextlib
import resource
from pathlib import Path

__all__ = ["MOST_FILES", "open_files", "raise_file_limit"]

#: More than any farm with its API needs; with a huge limit, programs that close all possible files get slow.
MOST_FILES = 65_536


def raise_file_limit() -> int:
    """Raise the soft limit of open files to the hard one, at most to what a farm needs; returns the limit in force."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, MOST_FILES)
    if soft == resource.RLIM_INFINITY or soft >= most:
        return soft
    # a sandbox may refuse what the limits allow; the farm runs with what it has
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


def open_files() -> int:
    """How many files this process has open; where that cannot be read, as many as it may have."""
    try:
        return sum(1 for _ in Path("/proc/self/fd").iterdir())
    except OSError:
        return resource.getrlimit(resource.RLIMIT_NOFILE)[0]
