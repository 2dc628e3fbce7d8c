"""Which processor machine code is made for: a level of the x86-64 psABI, so that other machines can run the same code.

A level is a named set of instructions (x86-64 psABI, "Micro-Architecture Levels").  The third level, and the machine's
own processor, make the engine no faster than the second one.  A farm on another architecture is compiled for LLVM's
``generic`` processor of it.  ``NUMBA_CPU_NAME`` chooses another one; its name is part of the key by which machine code
is found, so that code of a foreign processor is never loaded.
"""

from __future__ import annotations

import os
import platform

import numba
from llvmlite import binding

__all__ = ["GENERIC", "LEVEL", "NEEDED", "choose_processor", "fitting"]

LEVEL, GENERIC = "x86-64-v2", "generic"
#: The level's instructions beyond those of every x86-64, by LLVM's names.
NEEDED = frozenset({"cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3"})


def fitting(machine: str, features: dict[str, bool]) -> str:
    """The level if ``features`` (LLVM's names) has all of its instructions; otherwise ``generic``."""
    return LEVEL if machine == "x86_64" and all(features.get(one) for one in NEEDED) else GENERIC


def choose_processor() -> None:
    """Have Numba compile for the level, unless its settings name a processor."""
    if "NUMBA_CPU_NAME" not in os.environ:
        numba.config.CPU_NAME = fitting(platform.machine(), dict(binding.get_host_cpu_features()))
        numba.config.CPU_FEATURES = os.environ.get("NUMBA_CPU_FEATURES", "")
