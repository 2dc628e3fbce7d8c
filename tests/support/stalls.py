"""How long this machine has kept a process waiting that was ready: what no test of real time can do anything about.

A process of its own sleeps for short times and notes when it woke up late, as the farm's own threads would have.
"""

from __future__ import annotations

import os
import subprocess
import sys
from bisect import bisect_left
from itertools import pairwise

__all__ = ["StallWatch"]

#: Below this, a test of real time has no excuse: watchdogs here bear it.
STALL_SECONDS = 0.04
_WATCH = """
import sys, time
step, most = 0.005, float(sys.argv[1])
due = time.monotonic()
while True:
    due += step
    time.sleep(max(0.0, due - time.monotonic()))
    now = time.monotonic()
    if now - due > most:
        print(f"{now:.6f} {now - due:.6f}", flush=True)
    due = max(due, now - step)
"""


class StallWatch:
    """Watches until :meth:`close`; times are those of ``time.monotonic``."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-c", _WATCH, str(STALL_SECONDS)], stdout=subprocess.PIPE, stdin=subprocess.DEVNULL
        )
        assert self._process.stdout is not None
        os.set_blocking(self._process.stdout.fileno(), False)
        self._rest = b""
        self._ends: list[float] = []
        self._lengths: list[float] = []

    def longest(self, since: float) -> float:
        """The longest stall that ended at or after ``since``, seconds; 0.0 without one."""
        assert self._process.stdout is not None
        self._rest += self._process.stdout.read() or b""
        *lines, self._rest = self._rest.split(b"\n")
        for line in lines:
            end, length = line.split()
            self._ends.append(float(end))
            self._lengths.append(float(length))
        assert all(one <= other for one, other in pairwise(self._ends))
        return max(self._lengths[bisect_left(self._ends, since) :], default=0.0)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
