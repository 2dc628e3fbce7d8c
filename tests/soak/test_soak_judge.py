"""What the soak run's verdict finds: each judgement is shown data that it must refuse, and the like that is right."""

import json
from collections import Counter

import pytest

from tests.soak.judge import (
    Check,
    HubOrder,
    LogReader,
    Stream,
    answered,
    longest_pause,
    same_as_before,
    shown,
)
from tests.soak.virtual import Rest, grown

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
        ((entry(1), ("gap", "", '{"lost": 3}'), entry(2)), None, ()),
        ((entry(1), entry(2)), 3, ()),
        ((entry(1), entry(2)), None, ("fault-7",)),
        ((entry(1), ("", "2", entry(3)[2])), None, ()),
        ((), 0, ()),
    ],
    ids=[
        "hole",
        "twice",
        "disorder",
        "late begin",
        "gap",
        "gap alone",
        "early end",
        "fault missing",
        "wrong number",
        "empty",
    ],
)
def test_a_stream_that_lost_something_is_found(messages, newest, asked):
    assert stream_of(*messages, newest=newest, asked=asked)[0] is False


def test_a_fault_that_never_ended_is_found():
    assert stream_of(*WHOLE[:3]) == [True, False]


def test_a_fault_that_began_twice_is_found():
    assert stream_of(entry(1, "fault injected", id="a"), entry(2, "fault injected", id="a"))[0] is False


# -- the hub's stream: the position in each message's id, a few runs of shards

A, B, C = "0000000a", "0000000b", "0000000c"


def hub_order(*positions):
    order = HubOrder()
    for position in positions:
        order.message("", position, "{}")
    return order.check().ok


def test_a_hubs_stream_has_each_entry_of_each_run_once_also_those_of_a_new_run():
    assert hub_order(f"{A}-1", f"{A}-1.{B}-1", f"{A}-2.{B}-1", f"{A}-2.{B}-1.{C}-1") is True


@pytest.mark.parametrize(
    "positions",
    [
        (f"{A}-1", f"{A}-3"),
        (f"{A}-1", f"{A}-2", f"{A}-1"),
        (f"{A}-1", f"{A}-1"),
        (f"{A}-1", f"{A}-2.{B}-1"),
        (f"{A}-1", ""),
        (),
    ],
    ids=["hole", "back", "twice", "two at once", "no position", "empty"],
)
def test_a_hubs_stream_that_lost_or_repeated_something_is_found(positions):
    assert hub_order(*positions) is False


def test_a_hub_that_says_that_entries_are_lost_is_believed():
    order = HubOrder()
    order.message("", f"{A}-1", "{}")
    order.message("gap", "", '{"lost": 3}')
    assert order.check().ok is False


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
    assert answered([], [], 5.0, "all")[0].told == "all"
    wrong = answered(["GET /drives: 500"], [("GET /", 3.0)], 5.0, "all")
    assert wrong[0].told == "GET /drives: 500; GET /: no answer in time"


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


def test_what_differs_is_named_and_otherwise_what_is_held():
    assert same_as_before("farm", HELD, {**HELD, "connections": 63}, {}).told == "connections 64 -> 63"
    assert same_as_before("farm", HELD, HELD, {}).told == "gate rules 0, threads 6, connections 64"


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
