"""Fixed loops: how fast the interpreter, and compiled code, are on this machine at this time."""

from __future__ import annotations

import time

__all__ = ["compiled_loop", "interpreter_loop", "wake_ups"]


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


def wake_ups(seconds: float, step_ns: int) -> float:
    """Cores that this thread takes if it does nothing but wake at each step, for so many seconds."""
    begin, used = time.monotonic_ns(), time.thread_time_ns()
    end, due = begin + int(seconds * 1e9), begin
    while due < end:
        due += step_ns
        time.sleep(max(0, due - time.monotonic_ns()) / 1e9)  # the end of this wait is the wake-up that is measured
    return (time.thread_time_ns() - used) / (time.monotonic_ns() - begin)
