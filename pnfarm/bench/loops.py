"""Fixed loops: how fast the interpreter, and compiled code, are on this machine at this time."""

from __future__ import annotations

import time

__all__ = ["compiled_loop", "interpreter_loop"]


def interpreter_loop(passes: int = 1) -> float:
    """Milliseconds of CPU for a fixed loop in Python, the best of so many."""
    best = float("inf")
    for _ in range(passes):
        begin = time.thread_time()
        value = 0
        for i in range(1_000_000):
            value = (value * 31 + i) & 0xFFFF
        best = min(best, time.thread_time() - begin)
    return best * 1000


def compiled_loop(rounds: int) -> float:
    """Seconds of CPU for copying and reading 64 frames of 64 octets in both directions, so often.

    The first call may compile.
    """
    import numpy as np

    from pnfarm.engine.floor import copy_floor

    sent = np.zeros((128, 64), np.uint8)
    taken = np.zeros_like(sent)
    begin = time.thread_time()
    copy_floor(sent, taken, rounds)
    return time.thread_time() - begin
