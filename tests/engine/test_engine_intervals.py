"""The controller's punctuality at each frame: jitter, missed updates, late frames and whose they are."""

from bisect import bisect_left
from collections import Counter

import pytest
from from_python import called
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.engine.channels.intervals import measure_interval
from pnfarm.table.channel import CPM, INTERVAL_EDGES_NS, JITTER_EDGES_NS
from pnfarm.table.engine_row import ENGINE

MS = 1_000_000
CYCLE = 16 * MS


def frames(*arrivals, counted=(), impaired=0, late=(0, 0)):
    """The consumer's row after frames at these times, ms; ``counted``: cycles by the controller's counter."""
    engine, row = ENGINE.allocate(1)[0], CPM.allocate(1)[0]
    engine.late_until_ns, engine.late_for_ns = (round(value * MS) for value in late)
    row.cycle_ns, row.impaired = CYCLE, impaired
    row.last_ns = round(arrivals[0] * MS)
    for place, arrival in enumerate(arrivals[1:]):
        cycles = counted[place] if counted else 1
        called(measure_interval)(engine, row, round(arrival * MS), cycles * CYCLE)
        row.last_ns = round(arrival * MS)
    return row


def test_deviation_is_counted_in_microseconds_whatever_the_cycle():
    row = frames(0, 16.16, 32.16)
    assert row.jitter_sum_ns == 160_000
    assert row.jitters[JITTER_EDGES_NS.index(200_000)] == 1
    assert row.jitters[0] == 1
    assert row.jitters.sum() == row.intervals.sum() == 2


@given(
    st.lists(
        st.sampled_from([edge + more for edge in INTERVAL_EDGES_NS for more in (0, 1)])
        | st.integers(CYCLE - 20_000, CYCLE + 20_000)
        | st.integers(1, 2 * INTERVAL_EDGES_NS[-1]),
        min_size=1,
        max_size=12,
    )
)
def test_each_interval_and_deviation_is_counted_in_its_bucket_whatever_came_before(intervals):
    engine, row = ENGINE.allocate(1)[0], CPM.allocate(1)[0]
    row.cycle_ns = CYCLE
    now, deviations = 0, Counter()
    for interval in intervals:
        now += interval
        before = int(row.jitter_sum_ns)
        called(measure_interval)(engine, row, now, CYCLE)
        deviations[bisect_left(JITTER_EDGES_NS, int(row.jitter_sum_ns) - before)] += 1
        row.last_ns = now
    expected = Counter(bisect_left(INTERVAL_EDGES_NS, interval) for interval in intervals)
    assert {bucket: int(count) for bucket, count in enumerate(row.intervals) if count} == expected
    assert {bucket: int(count) for bucket, count in enumerate(row.jitters) if count} == deviations


def test_early_frame_deviates_as_much_as_a_late_one():
    row = frames(0, 14, 32)
    assert row.jitter_sum_ns == 2 * 2 * MS
    assert row.late == 0


def test_frame_that_the_counter_says_is_missing_is_no_jitter():
    row = frames(0, 48.1, counted=[3])
    assert (row.missed, row.jitter_sum_ns, row.late) == (2, 100_000, 0)


def test_frame_that_an_impairment_dropped_is_not_missed_by_the_controller():
    assert frames(0, 48, counted=[3], impaired=2).missed == 0
    assert frames(0, 48, counted=[3], impaired=1).missed == 1
    assert frames(0, 16, impaired=1).missed == 0


def test_late_frame_is_late_and_not_missing():
    row = frames(0, 26, 42)
    assert (row.late, row.late_own, row.missed) == (1, 0, 0)
    assert (row.late_at_ns, row.late_by_ns) == (26 * MS, 10 * MS)


@pytest.mark.parametrize(("until", "lasted", "own"), [(20, 10, 1), (20, 7, 0), (-1, 10, 0)])
def test_frame_is_late_by_the_farm_s_fault_if_the_engine_had_been_as_late(until, lasted, own):
    row = frames(0, 26, late=(until, lasted))
    assert (row.late, row.late_own) == (1, own)


@pytest.mark.parametrize("counter", [0, 60, 127])
def test_counter_that_does_not_count_the_cycles_is_not_believed(counter):
    row = frames(0, 32.2, counted=[counter])
    assert (row.missed, row.jitter_sum_ns) == (1, 200_000)


def test_gap_longer_than_the_counter_can_tell_is_missed_updates():
    row = frames(0, 16 * 200, counted=[200 % 128])
    assert (row.missed, row.jitter_sum_ns) == (199, 0)


def test_channel_without_a_cycle_has_intervals_only():
    engine, row = ENGINE.allocate(1)[0], CPM.allocate(1)[0]
    called(measure_interval)(engine, row, MS, 0)
    assert (row.intervals.sum(), row.jitters.sum()) == (1, 0)
