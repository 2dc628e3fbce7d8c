"""The engine's own counters, and the ring of events by which it reports to the event loop."""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import compiled
from pnfarm.table.layout import Field, Layout

__all__ = ["ENGINE", "EVENT", "EVENTS", "LATENESS_EDGES_NS", "emit"]

#: Entries of the event ring.
EVENTS = 8192

# Kinds of events (``EVENT.kind``) and what ``row`` and ``value`` hold.
FIRST_FRAME = 1  # cpm row; -
EXPIRED = 2  # cpm row; ns since the last valid frame
PROVIDER_CHANGED = 3  # cpm row; 1 = peer in RUN, 0 = in STOP
IOPS_CHANGED = 4  # cpm row; 1 = good, 0 = bad
STATE_CHANGED = 5  # axis row; old << 8 | new
FAULT_RAISED = 6  # axis row; fault number
FAULTS_CLEARED = 7  # axis row; ns from the fault to its acknowledgement
FAULT_REACTED = 8  # axis row; ns from the fault to the withdrawal of the enable
PHASE_CHANGED = 9  # program row; old << 8 | new
WARNING_CHANGED = 10  # axis row; warning number, 0 = none
PARAMETER_TASK = 11  # axis row; the eight octets of the parameter channel, most significant first
CONTROL_BIT_CHANGED = 12  # axis row; bit of STW1 << 56 | its new value << 55 | ns since the fault
ACKNOWLEDGE_REFUSED = 13  # axis row; how many requests to acknowledge an injection has refused so far
TRACE_TRIGGERED = 15  # trace row; when it was triggered, ns
TRACE_ENDED = 16  # trace row; samples taken
CONDITION_HELD = 17  # condition row; its serial number
PLANT_CHANGED = 18  # -; how often inputs of stations were reported as changed

#: Upper bounds of the lateness histogram, nanoseconds; a last bucket takes the rest.
LATENESS_EDGES_NS = (
    10_000, 20_000, 30_000, 40_000, 50_000, 60_000, 70_000, 80_000, 90_000, 100_000, 110_000, 120_000, 140_000, 160_000,
    180_000, 200_000, 250_000, 300_000, 400_000, 500_000, 700_000, 1_000_000, 2_000_000, 4_000_000, 8_000_000,
    16_000_000, 32_000_000, 64_000_000,
)  # fmt: skip

ENGINE = Layout(
    "engine",
    "One row: the engine itself.",
    [
        Field("ppm_rows", "i4", "", "station", "rows of the provider table in use (high-water mark)"),
        Field("cpm_rows", "i4", "", "station", "rows of the consumer table in use"),
        Field("axis_rows", "i4", "", "station", "rows of the axis table in use"),
        Field("program_rows", "i4", "", "station", "rows of the program table in use"),
        Field("trace_rows", "i4", "", "station", "rows of the trace table in use, 0 = no trace runs"),
        Field(
            "condition_rows", "i4", "", "fault", "rows of the condition table in use, 0 = no injection waits for one"
        ),
        Field("lookup", "i4", "", "station", "which of the look-up tables is in force"),
        Field("tick_ns", "i8", "ns", "station", "longest time between two ticks"),
        Field("plant_call", "i8", "", "station", "address of the plant's step, 0 = no plant"),
        Field("plant_row", "i8", "", "station", "address of the plant's row"),
        Field("plant_step_ns", "i8", "ns", "station", "time between two steps of the plant"),
        Field("plant_due_ns", "i8", "ns", "engine", "when the plant's next step is due"),
        Field(
            "plant_late", "i8", "", "engine", "steps of the plant that were due while no tick ran, and were left out"
        ),
        Field("stop", "u1", "", "station", "1 asks the engine's thread to return"),
        Field(
            "lease_until_ns",
            "i8",
            "ns",
            "lease",
            "until when frames may be sent, by the clock that also runs while the machine sleeps; 0 = for ever",
        ),
        Field("ended", "u4", "", "fault", "impairments that have ended: what they hold goes on at once"),
        Field("now_ns", "i8", "ns", "engine", "time of the last tick"),
        Field("cycles", "i8", "", "engine", "ticks so far"),
        Field("overruns", "i8", "", "engine", "ticks that came so late that at least one frame's cycle was skipped"),
        Field("lateness", "i8", "", "engine", "histogram of how late a tick began", (len(LATENESS_EDGES_NS) + 1,)),
        Field("lateness_sum_ns", "i8", "ns", "engine", "sum of all lateness"),
        Field("lateness_max_ns", "i8", "ns", "engine", "largest lateness"),
        Field("busy_ns", "i8", "ns", "engine", "time spent in ticks"),
        Field("due_ns", "i8", "ns", "engine", "when the next tick is due, or the present one began; 0 = no real time"),
        Field("late_head", "i8", "", "engine", "rows of the ring of late times written so far"),
        Field("late_until_ns", "i8", "ns", "engine", "end of the newest late time"),
        Field("late_for_ns", "i8", "ns", "engine", "lateness of the newest late tick"),
        Field("received", "i8", "frames", "engine", "cyclic frames taken from the link"),
        Field("unknown", "i8", "frames", "engine", "frames that belong to no channel"),
        Field("malformed", "i8", "frames", "engine", "frames too short, too long or of another type"),
        Field("sent", "i8", "frames", "engine", "frames given to the link"),
        Field("send_errors", "i8", "frames", "engine", "frames that the link refused"),
        Field("muted", "i8", "frames", "engine", "frames that were not sent because the lease had ended"),
        Field("ended_seen", "u4", "", "engine", "``ended`` as the last tick saw it"),
        Field("held_out", "i4", "frames", "engine", "frames that impairments hold on their way out"),
        Field("held_in", "i4", "frames", "engine", "frames that impairments hold on their way in"),
        Field("busy_out", "i4", "frames", "engine", "held frames that this tick sends"),
        Field("held", "i8", "frames", "engine", "frames held so far"),
        Field("event_head", "i8", "", "engine", "events written so far"),
        Field("wakes", "i8", "", "engine", "times that the event loop was woken"),
    ],
)

EVENT = Layout(
    "event",
    "The ring of events; the reader keeps its own tail and detects what it lost by the difference.",
    [
        Field("kind", "u1", "", "engine", ""),
        Field("row", "i4", "", "engine", ""),
        Field("now_ns", "i8", "ns", "engine", ""),
        Field("value", "i8", "", "engine", ""),
    ],
)


@compiled
def emit(engine: Any, events: Any, kind: int, row: int, now: int, value: int) -> None:
    """Append one event; ``engine`` is the engine's row."""
    head = engine.event_head
    entry = events[head % EVENTS]
    entry.kind = kind
    entry.row = row
    entry.now_ns = now
    entry.value = value
    engine.event_head = head + 1
