"""The controller's punctuality, measured at each valid frame but the first of a connection.

The *jitter* is the deviation of an interval from the agreed cycle. Where frames are missing, which the sender's cycle
counter says, it is the deviation from as many cycles as have passed, and the missing frames are counted; those that an
impairment dropped are not the controller's. A frame more than half a cycle late is counted as late, and as late by the
farm's own fault if the engine had been as late since the frame before.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pnfarm.engine.search import first_not_below_near
from pnfarm.table.channel import INTERVAL_EDGES_NS, JITTER_EDGES_NS
from pnfarm.table.compiling.compiled import inlined

__all__ = ["measure_interval"]

#: Upper edges; the last bucket has none.  Arrays, because indexing a tuple in compiled code copies it.
_INTERVALS = np.array(INTERVAL_EDGES_NS, np.int64)
_JITTERS = np.array(JITTER_EDGES_NS, np.int64)
#: A counter that is this many cycles off the clock is not believed: it has wrapped, or does not count the cycles.
BELIEVED_CYCLES = 4


@inlined
def measure_interval(engine: Any, consumer: Any, arrival: int, counted: int) -> None:
    """A valid frame came at ``arrival``; ``counted`` is the time that has passed by the sender's counter, ns."""
    interval = arrival - consumer.last_ns
    consumer.interval_sum_ns += interval
    bucket = first_not_below_near(_INTERVALS, interval, int(consumer.interval_bucket))
    consumer.interval_bucket = bucket
    consumer.intervals[bucket] += 1
    cycle = consumer.cycle_ns
    if cycle <= 0:
        return
    cycles = 1
    if counted != cycle or abs(interval - cycle) > BELIEVED_CYCLES * cycle:
        cycles = counted // cycle
        if cycles < 1 or abs(interval - cycles * cycle) > BELIEVED_CYCLES * cycle:
            cycles = max(1, (interval + cycle // 2) // cycle)
        consumer.missed += max(0, cycles - 1 - int(consumer.impaired))
    deviation = interval - cycles * cycle
    size = abs(deviation)
    bucket = first_not_below_near(_JITTERS, size, int(consumer.jitter_bucket))
    consumer.jitter_bucket = bucket
    consumer.jitters[bucket] += 1
    consumer.jitter_sum_ns += size
    if 2 * deviation > cycle:
        own = engine.late_for_ns if engine.late_until_ns > consumer.last_ns else 0
        consumer.late += 1
        if 2 * own > cycle:
            consumer.late_own += 1
        consumer.late_at_ns = arrival
        consumer.late_by_ns = deviation
        consumer.late_engine_ns = own
