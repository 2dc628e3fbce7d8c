"""A minimal loop beside the farm: how late a thread of this machine is that does nothing but wake each millisecond.

``python -m tests.strangers.floor`` asks the kernel for what the engine asks for.  A line on its standard input is the
name of the time that has just passed; at its end it prints the p99 of each name in seconds, as a JSON object.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections import Counter

from pnfarm.engine.realtime import RealTimeReport, RealTimeSettings, ask_kernel

__all__ = ["main", "p99"]

TICK_NS = 1_000_000


def p99(microseconds: Counter[int]) -> float:
    """In seconds, of how often each lateness was seen."""
    left = microseconds.total() * 99 // 100
    for late in sorted(microseconds):
        left -= microseconds[late]
        if left < 0:
            return late / 1e6
    return 0.0


def main() -> int:
    seen: list[int] = []
    found: dict[str, Counter[int]] = {}
    ended = threading.Event()

    def read() -> None:
        for line in sys.stdin:
            # what the loop adds meanwhile is of the next time
            count = len(seen)
            found.setdefault(line.strip(), Counter()).update(seen[:count])
            del seen[:count]
        ended.set()

    threading.Thread(target=read, daemon=True).start()
    ask_kernel(RealTimeSettings(), RealTimeReport())
    due = time.monotonic_ns()
    while not ended.is_set():
        due += TICK_NS
        if (wait := due - time.monotonic_ns()) > 0:
            time.sleep(wait / 1e9)
        late = time.monotonic_ns() - due
        seen.append(late // 1000)
        if late > TICK_NS:
            # ticks that are over are left out, as the engine does
            due += late // TICK_NS * TICK_NS
    print(json.dumps({name: p99(counts) for name, counts in found.items()}))  # noqa: T201 - its answer
    return 0


if __name__ == "__main__":
    sys.exit(main())
