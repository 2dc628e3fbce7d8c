"""Calls of functions that are only ever a part of compiled callers (``@inlined``)."""

from __future__ import annotations

from functools import cache
from typing import Any

import numba

__all__ = ["called"]


@cache
def called(function: Any) -> Any:
    """``function`` with machine code of its own, made at the first call; a plain function stays what it is."""
    if numba.config.DISABLE_JIT:
        return function

    def call(*arguments: Any) -> Any:
        return function(*arguments)

    return numba.njit(call, error_model="numpy", _nrt=False)
