"""The one decorator of everything that runs each tick.

``@compiled`` is ``numba.njit(nogil=True, cache=True)``.  Numba's own cache looks only at the file of
the decorated function and would keep stale machine code when a *callee* in another file changes.
So the cache lives in a folder whose name is a digest of every compiled source file together with the
versions of Python, Numba and NumPy: a change anywhere gives a fresh folder, and an installation in a read-only
place caches as well.  ``NUMBA_DISABLE_JIT=1`` leaves the plain functions in place, for a debugger and for coverage.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite.binding
import numba
import numpy as np

_F = TypeVar("_F", bound=Callable[..., Any])

#: Rooms whose files hold compiled functions; all of them go into the digest.
_COMPILED_ROOMS = ("table", "firmware", "engine")

__all__ = ["IS_COMPILED", "cache_directory", "compiled", "function_count", "is_cached", "mark_cached"]


def _digest() -> str:
    root = Path(__file__).resolve().parent.parent
    # the place counts too: Numba keeps the code of each copy of a file apart
    state = hashlib.sha256(f"{root} {sys.version} {numba.__version__} {np.__version__}".encode())
    for room in _COMPILED_ROOMS:
        for path in sorted((root / room).glob("*.py")):
            state.update(path.name.encode())
            state.update(path.read_bytes())
    state.update(os.environ.get("NUMBA_BOUNDSCHECK", "").encode())
    return state.hexdigest()[:16]


def cache_directory() -> Path:
    """Where machine code is kept: ``NUMBA_CACHE_DIR``, or ``$XDG_CACHE_HOME/pnfarm/<digest>``."""
    explicit = os.environ.get("NUMBA_CACHE_DIR")
    if explicit:
        return Path(explicit)
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "pnfarm" / _digest()


def _prepare() -> bool:
    if numba.config.DISABLE_JIT:
        return False
    directory = cache_directory()
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError:
        # no writable home (a container's arbitrary user): this run compiles again, correctly
        directory = Path(tempfile.mkdtemp(prefix="pnfarm-cache-"))
    numba.config.CACHE_DIR = str(directory)
    return True


#: False under ``NUMBA_DISABLE_JIT=1``.
IS_COMPILED: bool = _prepare()


def _mark() -> Path:
    """Stands where all machine code of these sources, this Numba and this kind of processor lies."""
    processor = numba.config.CPU_NAME or llvmlite.binding.get_host_cpu_name()
    return cache_directory() / f"complete-{_digest()}-{processor}"


def is_cached() -> bool:
    """Whether the machine code lies ready, all of it, so that a start takes no compilation."""
    return _mark().exists()


def mark_cached() -> None:
    """Say that everything was compiled; where the folder cannot be written there is nothing to say it of."""
    with contextlib.suppress(OSError):
        _mark().touch()


_functions = 0


def function_count() -> int:
    """How many compiled functions the modules hold that were imported until now."""
    return _functions


def compiled(function: _F) -> _F:
    """Compile on first call, without the interpreter's lock, and keep the machine code."""
    global _functions  # noqa: PLW0603 - a count of what this decorator was given
    _functions += 1
    return cast("_F", numba.njit(function, nogil=True, cache=True, error_model="numpy"))
