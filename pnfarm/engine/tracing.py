"""Samples of the running traces, at the end of each tick's firmware steps.

Without a trace this is one comparison a tick.
"""

from __future__ import annotations

from typing import Any

from pnfarm.engine.probes import read_plain, read_plant, read_words
from pnfarm.table.compiling.compiled import inlined
from pnfarm.table.engine_row import TRACE_ENDED, TRACE_TRIGGERED, emit
from pnfarm.table.trace import (
    ARMED,
    ENDED,
    IDLE,
    TRIGGER_ABOVE,
    TRIGGER_AT_LEAST,
    TRIGGER_AT_MOST,
    TRIGGER_BELOW,
    TRIGGER_CHANGES,
    TRIGGER_EQUAL,
    TRIGGER_EVENT,
    TRIGGER_FALLING,
    TRIGGER_NOW,
    TRIGGER_RISING,
    TRIGGER_UNEQUAL,
    TRIGGERED,
)

__all__ = ["sample"]


@inlined
def _fulfils(trigger: int, before: float, seen: int, value: float, level: float) -> bool:
    """Whether this step's value triggers; an edge needs the value of the step before."""
    if trigger == TRIGGER_RISING:
        return seen != 0 and before < level <= value
    if trigger == TRIGGER_FALLING:
        return seen != 0 and before > level >= value
    if trigger == TRIGGER_CHANGES:
        return seen != 0 and before != value
    if trigger == TRIGGER_ABOVE:
        return value > level
    if trigger == TRIGGER_AT_LEAST:
        return value >= level
    if trigger == TRIGGER_BELOW:
        return value < level
    if trigger == TRIGGER_AT_MOST:
        return value <= level
    if trigger == TRIGGER_EQUAL:
        return value == level
    return trigger == TRIGGER_UNEQUAL and value != level


@inlined
def _read(
    trace: Any, probes: Any, first: int, count: int, axis_reals: Any, axis_words: Any, image_words: Any, provided: Any,
    consumed: Any, plant: int, now: int,
) -> None:  # fmt: skip
    """The present values of some of a trace's probes."""
    read_words(probes, first, count, axis_reals, axis_words, image_words, now)
    if trace.plain:
        read_plain(probes, first, count, provided, consumed)
    if trace.plant:
        read_plant(probes, first, count, plant)


@inlined
def _watch_trigger(
    trace: Any, probes: Any, axis_reals: Any, axis_words: Any, image_words: Any, provided: Any, consumed: Any,
    plant: int, now: int,
) -> bool:  # fmt: skip
    """Whether the trigger's condition holds now; the time and the probe are then in the trace's row."""
    if trace.fire_ns != 0:
        trace.trigger_ns = trace.fire_ns
        return True
    trigger = int(trace.trigger)
    if trigger == TRIGGER_NOW:
        trace.trigger_ns = now
        return True
    if trigger == TRIGGER_EVENT:
        return False
    found = -1
    first, watched = int(trace.first_watched), int(trace.watched)
    _read(trace, probes, first, watched, axis_reals, axis_words, image_words, provided, consumed, plant, now)
    for number in range(first, first + watched):
        probe = probes[number]
        value = float(probe.value)
        if found < 0 and _fulfils(trigger, float(probe.before), int(probe.seen), value, float(trace.level)):
            found = number
        probe.before = value
        probe.seen = 1
    if found < 0:
        return False
    trace.trigger_ns = now
    trace.trigger_probe = found
    return True


@inlined
def _take_sample(
    trace: Any, probes: Any, ring: Any, axis_reals: Any, axis_words: Any, image_words: Any, provided: Any,
    consumed: Any, plant: int, now: int,
) -> None:  # fmt: skip
    """One sample, in the place of the oldest if the trace's part of the ring is full."""
    width = int(trace.probes) + 1
    place = int(trace.ring_start) + (int(trace.head) % int(trace.capacity)) * width
    if place < 0 or place + width > ring.shape[0]:
        return
    ring[place] = float(now - trace.started_ns)
    first = int(trace.first_probe)
    _read(trace, probes, first, width - 1, axis_reals, axis_words, image_words, provided, consumed, plant, now)
    for number in range(width - 1):
        ring[place + 1 + number] = probes[first + number].value
    if now - trace.next_ns >= trace.interval_ns:
        trace.missed += (now - trace.next_ns) // trace.interval_ns
    trace.next_ns = now - now % trace.interval_ns + trace.interval_ns
    # after the values, so that a reader finds only whole samples below it
    trace.head += 1


@inlined
def sample(  # the arrays one by one: a named tuple of all columns costs 200 ns to hand over
    engine: Any,
    events: Any,
    traces: Any,
    probes: Any,
    ring: Any,
    axis_reals: Any,
    axis_words: Any,
    image_words: Any,
    provided: Any,
    consumed: Any,
    now: int,
) -> None:
    """Sample every running trace for which a sample is due at ``now``, and watch its trigger in each tick."""
    plant = int(engine.plant_row)
    for number in range(engine.trace_rows):
        trace = traces[number]
        if trace.active == 0:
            trace.state = IDLE
            continue
        if trace.state == ENDED:
            continue
        if trace.state == IDLE:
            trace.state = ARMED
            trace.head = 0
            trace.missed = 0
            trace.trigger_ns = 0
            trace.trigger_probe = -1
            trace.next_ns = now
        fires = trace.state == ARMED and _watch_trigger(
            trace, probes, axis_reals, axis_words, image_words, provided, consumed, plant, now
        )
        if fires:
            trace.state = TRIGGERED
            emit(engine, events, TRACE_TRIGGERED, number, now, trace.trigger_ns)
        end = trace.trigger_ns + trace.length_ns
        over = trace.state == TRIGGERED and now >= end
        if (now >= trace.next_ns or fires) and not (over and now > end):
            _take_sample(trace, probes, ring, axis_reals, axis_words, image_words, provided, consumed, plant, now)
        if over:
            trace.state = ENDED
            emit(engine, events, TRACE_ENDED, number, now, trace.head)
