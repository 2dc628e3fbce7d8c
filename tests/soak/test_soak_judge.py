"""What the soak run's verdict finds: each judgement is shown data that it must refuse, and the like that is right."""

from __future__ import annotations

import json
from collections import Counter
from random import Random

import pytest

from tests.soak.judge import (
    Check,
    LogReader,
    Stream,
    answered,
    growth,
    longest_pause,
    lowest,
    memory_checks,
    same_as_before,
    shown,
)
from tests.soak.virtual import Rest, grown

MIB = 1 << 20
HOURS = 2 * 3600
SAMPLES = range(0, HOURS + 1, 10)


def samples(value):
    rng = Random(1)
    return [{"seconds": float(at), "rss": value(at) * (1 + rng.uniform(-0.002, 0.002))} for at in SAMPLES]


def verdict(value):
    (check,) = memory_checks(samples(value), ["rss"])
    return check.ok


def test_memory_that_grew_in_the_first_hour_only_is_flat():
    assert verdict(lambda at: 200 * MIB + 80 * MIB * min(1.0, at / 3000))


@pytest.mark.parametrize("share", [0.02, 0.05])
def test_memory_that_grows_steadily_is_found(share):
    check = verdict(lambda at: 200 * MIB * (1 + share * at / (HOURS / 2)))
    assert check is False


def test_memory_that_jumps_in_the_last_minutes_is_found():
    assert verdict(lambda at: 200 * MIB * (1.03 if at > HOURS - 400 else 1.0)) is False


def test_a_growth_below_one_percent_is_flat():
    assert verdict(lambda at: 200 * MIB * (1 + 0.005 * at / (HOURS / 2))) is True


def test_a_second_half_of_five_minutes_is_not_judged_and_a_series_without_samples_fails():
    short = [{"seconds": float(at), "rss": 1.0 * at} for at in range(0, 600, 10)]
    (check,) = memory_checks(short, ["rss"])
    assert check.ok is None
    assert "too short to judge" in check.told
    (check,) = memory_checks(short, ["blocks"])
    assert check.ok is False


def test_the_growth_is_that_of_the_second_half():
    seen = growth([(float(at), 100.0 if at <= 50 else 100.0 + (at - 50) * 0.2) for at in range(101)])
    assert seen.fitted == pytest.approx(0.10, abs=0.01)
    assert (seen.seconds, seen.samples) == (50.0, 51)


def test_of_a_saw_tooth_the_lowest_points_count():
    tooth = [(float(at), 100.0 + at % 60) for at in range(0, 600, 10)]
    assert lowest(tooth, 120.0) == [(float(at), 100.0) for at in range(0, 600, 120)]
    rising = [{"seconds": at, "blocks": value + at * 0.01} for at, value in tooth]
    (check,) = memory_checks([{**one, "seconds": one["seconds"] * 12} for one in rising], ["blocks"], stretch=120.0)
    assert check.ok is False


# -- the event stream


def entry(number, event="state changed", **data):
    return "", str(number), json.dumps({"sequence": number, "drive": "axis-01", "event": event, **data})


def stream_of(*messages, newest=None, asked=()):
    stream = Stream()
    for fault in asked:
        stream.acknowledged(fault)
    for message in messages:
        stream.message(*message)
    return [check.ok for check in stream.checks(stream.last if newest is None else newest)]


WHOLE = (
    entry(1),
    entry(2, "fault requested", id="fault-1"),
    entry(3, "fault injected", id="fault-1"),
    entry(4, "injected fault ended", id="fault-1"),
)


def test_a_whole_stream_is_complete():
    assert stream_of(*WHOLE, asked=["fault-1"]) == [True, True]


def test_an_acknowledgement_may_come_behind_its_entry():
    stream = Stream()
    for message in WHOLE:
        stream.message(*message)
    stream.acknowledged("fault-1")
    assert [check.ok for check in stream.checks(4)] == [True, True]


@pytest.mark.parametrize(
    ("messages", "newest", "asked"),
    [
        ((entry(1), entry(3)), None, ()),
        ((entry(1), entry(2), entry(2)), None, ()),
        ((entry(1), entry(3), entry(2)), None, ()),
        ((entry(2), entry(3)), None, ()),
        ((entry(1), ("gap", "", '{"lost": 3}'), entry(5)), None, ()),
        ((entry(1), entry(2)), 3, ()),
        ((entry(1), entry(2)), None, ("fault-7",)),
        ((entry(1), ("", "2", entry(3)[2])), None, ()),
        ((), 0, ()),
    ],
    ids=["hole", "twice", "disorder", "late begin", "gap", "early end", "fault missing", "wrong number", "empty"],
)
def test_a_stream_that_lost_something_is_found(messages, newest, asked):
    assert stream_of(*messages, newest=newest, asked=asked)[0] is False


def test_a_fault_that_never_ended_is_found():
    assert stream_of(*WHOLE[:3]) == [True, False]


def test_a_fault_that_began_twice_is_found():
    assert stream_of(entry(1, "fault injected", id="a"), entry(2, "fault injected", id="a"))[0] is False


# -- requests


def test_a_request_without_an_answer_is_the_farms_failure_unless_its_process_did_not_run():
    times = [0.0, 2.5, 5.0, 25.0, 27.5, 30.0]
    assert [longest_pause(times, *period) for period in ((0, 4), (4, 20), (6, 24), (26, 29), (28, 40))] == [
        2.5, 20.0, 20.0, 2.5, 10.0
    ]  # fmt: skip
    assert longest_pause([], 5.0, 9.0) == 4.0
    assert [check.ok for check in answered([], [], 5.0, "all")] == [True]
    assert [check.ok for check in answered(["500"], [], 5.0, "all")] == [False]
    assert [check.ok for check in answered([], [("GET /", 3.0)], 5.0, "all")] == [False]
    assert [check.ok for check in answered([], [("GET /", 20.0)], 5.0, "all")] == [True, None]


# -- logs, and what is held


@pytest.mark.parametrize(
    "line",
    [
        '{"level": "error", "event": "anything"}',
        "Traceback (most recent call last):",
        "Task exception was never retrieved",
        '{"level": "warning", "event": "internal error"}',
        "x.py:1: RuntimeWarning: coroutine 'y' was never awaited",
    ],
)
def test_a_log_with_an_internal_error_is_found(line):
    log = LogReader()
    log.line('{"level": "warning", "event": "fault injected", "kind": "drive-fault"}')
    assert log.check("farm").ok is True
    log.line(line)
    assert log.check("farm").ok is False


HELD = {"gate rules": 0, "threads": 6, "tasks": {"Server.serve": 1}, "connections": 64}


@pytest.mark.parametrize(
    "change",
    [
        {"gate rules": 1},
        {"threads": 12},
        {"tasks": {}},
        {"tasks": {"Server.serve": 2}},
        {"connections": 63},
        {"new": 1},
    ],
)
def test_what_is_held_beyond_the_start_or_no_more_is_found(change):
    assert same_as_before("farm", HELD, {**HELD, **change}, {"threads": 4}).ok is False


def test_threads_may_come_and_go():
    assert same_as_before("farm", HELD, {**HELD, "threads": 9}, {"threads": 4}).ok is True
    assert same_as_before("farm", HELD, {**HELD, "threads": 3}, {"threads": 4}).ok is True


def rests(octets, objects):
    return [
        Rest.of(50.0 * n, octets(n), traced=True, objects=Counter({"pnfarm.X": objects(n)}), holds={})
        for n in range(20)
    ]


@pytest.mark.parametrize(
    ("octets", "objects", "told"),
    [
        (lambda n: 75_000_000 + (n % 3) * 10_000, lambda n: 500 + n % 5, [True, True]),
        (lambda n: 70_000_000 + min(n, 5) * 1_000_000, lambda n: 100 * min(n, 5), [True, True]),
        (lambda n: 75_000_000 + n * 200_000, lambda n: 500, [False, True]),
        (lambda n: 75_000_000, lambda n: 500 + n * 12, [True, False]),
    ],
    ids=["flat", "filled", "octets", "objects"],
)
def test_memory_and_objects_that_grow_from_rest_to_rest_are_found(octets, objects, told):
    assert [check.ok for check in grown(rests(octets, objects))] == told


def test_few_rests_are_not_judged():
    assert {check.ok for check in grown(rests(lambda n: n, lambda n: n)[:4])} == {None}


def test_the_table_names_each_check_with_its_verdict():
    text = shown(
        [Check("memory flat", ok=True, told="a"), Check("b", ok=False, told="c"), Check("d", ok=None, told="")]
    )
    assert text.splitlines() == [
        "memory flat  ok          a",
        "b            FAILED      c",
        "d            not judged  ",
    ]
