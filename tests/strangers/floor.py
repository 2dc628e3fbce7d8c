"""A minimal loop beside the farm: how late a thread of this machine is that does nothing but wake each millisecond.

``python -m tests.strangers.floor FIFO`` asks the kernel for what the engine asks for, with this priority. A line on its
standard input is the name of the time that has just passed; at its end it prints the p99 of each name in seconds, as a
JSON object.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from array import array

import numpy as np

from pnfarm.engine.realtime import RealTimeReport, RealTimeSettings, ask_kernel

__all__ = ["main"]

TICK_NS = 1_000_000


def main() -> int:
    seen: list[int] = []
    found: dict[str, array[int]] = {}
    ended = threading.Event()

    def read() -> None:
        for line in sys.stdin:
            # what the loop adds meanwhile is of the next time
            count = len(seen)
            found.setdefault(line.strip(), array("q")).extend(seen[:count])
            del seen[:count]
        ended.set()

    threading.Thread(target=read, daemon=True).start()
    ask_kernel(RealTimeSettings(fifo_priority=int(sys.argv[1])), RealTimeReport())
    due = time.monotonic_ns()
    while not ended.is_set():
        due += TICK_NS
        if (wait := due - time.monotonic_ns()) > 0:
            time.sleep(wait / 1e9)  # the loop that is measured is this wait
        late = time.monotonic_ns() - due
        seen.append(late // 1000)
        if late > TICK_NS:
            # ticks that are over are left out, as the engine does
            due += late // TICK_NS * TICK_NS
    late_by = {name: float(np.percentile(times, 99)) / 1e6 for name, times in found.items()}
    print(json.dumps(late_by))  # noqa: T201 - its answer
    return 0


if __name__ == "__main__":
    sys.exit(main())
