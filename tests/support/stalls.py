"""How long this machine has kept a process waiting that was ready: what no test of real time can do anything about.

A process of its own sleeps for short times and notes when it woke up late, as the farm's own threads would have.  It
also writes to a pty and waits for the octet: a worker of the kernel carries it, as it carries those of a line on a pty
and the news that an interface is up again, and such workers can stand while processes run on.
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
#: The same of the kernel's workers: masters of lines here wait so long, and a carrier is awaited longer.
WORKER_SECONDS = 0.5
_WATCH = """
import os, pty, sys, threading, time, tty
step, most, worker_most = 0.005, float(sys.argv[1]), float(sys.argv[2])
telling = threading.Lock()

def tell(length, most):
    if length > most:
        with telling:
            print(f"{time.monotonic():.6f} {length:.6f}", flush=True)

def watch_workers():
    near, far = pty.openpty()
    tty.setraw(far)
    while True:
        begin = time.monotonic()
        os.write(near, b"-")
        os.read(far, 1)
        tell(time.monotonic() - begin, worker_most)
        # seldom: the watch is not to be a load
        time.sleep(4 * step)

threading.Thread(target=watch_workers, daemon=True).start()
due = time.monotonic()
while True:
    due += step
    time.sleep(max(0.0, due - time.monotonic()))
    now = time.monotonic()
    tell(now - due, most)
    due = max(due, now - step)
"""


class StallWatch:
    """Watches until :meth:`close`; times are those of ``time.monotonic``."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-c", _WATCH, str(STALL_SECONDS), str(WORKER_SECONDS)],
            stdout=subprocess.PIPE,
            stdin=subprocess.DEVNULL,
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
