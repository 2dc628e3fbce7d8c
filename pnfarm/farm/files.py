"""Files that this process may have open: a farm takes as many as the machine's limit for it grants."""

from __future__ import annotations

import contextlib
import resource
from pathlib import Path

__all__ = ["MOST_FILES", "open_files", "raise_file_limit"]

#: More than any farm with its API needs; a limit of a thousand million costs others that walk over all of them.
MOST_FILES = 65_536


def raise_file_limit() -> int:
    """Raise the soft limit of open files to the hard one, or to what a farm may ever need; the limit in force."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, MOST_FILES)
    if soft == resource.RLIM_INFINITY or soft >= most:
        return soft
    # a sandbox may refuse what the limits grant; the farm runs with what it has
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


def open_files() -> int:
    """How many files this process has open; where even that cannot be looked up, as many as it may have."""
    try:
        return sum(1 for _ in Path("/proc/self/fd").iterdir())
    except OSError:
        return resource.getrlimit(resource.RLIMIT_NOFILE)[0]
