"""Which processor machine code is made for: a level of the x86-64 psABI, so that other machines can run the same code.

A level is a named set of instructions (x86-64 psABI, "Micro-Architecture Levels").  A farm on another architecture is
compiled for LLVM's ``generic`` processor of it.  ``NUMBA_CPU_NAME`` chooses another one; its name is part of the key by
which Numba finds machine code, so that code of a foreign processor is never loaded.
"""

from __future__ import annotations

import os
import platform

import numba
from llvmlite import binding

__all__ = ["LEVELS", "choose_processor", "fitting"]

_V2 = frozenset({"cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3"})
#: Levels by their name in LLVM, the highest first, with the instructions beyond those of every x86-64.
LEVELS = {
    "x86-64-v3": _V2 | {"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave"},
    "x86-64-v2": _V2,
}
_GENERIC = "generic"


def fitting(machine: str, features: dict[str, bool]) -> str:
    """The highest level whose instructions ``features`` (LLVM's names) has; ``generic`` where none fits."""
    if machine != "x86_64":
        return _GENERIC
    return next((name for name, needed in LEVELS.items() if all(features.get(one) for one in needed)), _GENERIC)


def choose_processor() -> None:
    """Have Numba compile for this machine's level, unless its settings name a processor."""
    if "NUMBA_CPU_NAME" not in os.environ:
        numba.config.CPU_NAME = fitting(platform.machine(), dict(binding.get_host_cpu_features()))
        numba.config.CPU_FEATURES = os.environ.get("NUMBA_CPU_FEATURES", "")
