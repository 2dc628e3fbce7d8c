"""Whom an injection hits, when it begins again, and what ends it without its client."""

import contextlib
import itertools

import pytest
from fault_line import FaultLine
from hypothesis import given
from hypothesis import strategies as st
from storm import LINES, left_behind

from pnfarm.errors import ConfigError
from pnfarm.faults.errors import InjectionError
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.rates import format_rate, format_share, read_rate, read_share


@pytest.fixture(scope="module")
def eight() -> FaultLine:
    line = FaultLine(8)
    line.connect(10.0)
    return line


@pytest.fixture(autouse=True)
def _nothing_left(request):
    yield
    if "eight" in request.fixturenames:
        line = request.getfixturevalue("eight")
        line.clear()
        line.run(0.1)
        assert not line.faults.list()


def hit(line: FaultLine, **fields) -> tuple[str, ...]:
    drives = line.add("load", **fields).drives
    line.clear()
    return drives


# -- whom


@pytest.mark.parametrize(
    ("share", "count"), [("25%", 2), ("50%", 4), ("1%", 1), ("100%", 8), ("31.5 %", 3), ("0.001%", 1)]
)
def test_a_share_hits_that_part_of_the_matching_drives_and_at_least_one(eight, share, count):
    assert len(hit(eight, share=share, seed=5)) == count


def test_the_same_seed_hits_the_same_drives_in_the_farms_order_and_a_larger_share_contains_the_smaller(eight):
    few = hit(eight, share="25%", seed=5)
    assert few == hit(eight, share="25%", seed=5)
    many = hit(eight, share="75%", seed=5)
    assert set(few) < set(many)
    assert list(many) == sorted(many)
    assert len({hit(eight, share="25%", seed=seed) for seed in range(20)}) > 5, "another seed, other drives"


def test_most_bounds_the_number_of_drives_and_the_seed_that_chose_them_is_kept(eight):
    fault = eight.add("load", most=3)
    assert len(fault.drives) == 3
    assert fault.as_dict()["spec"]["most"] == 3
    eight.clear()
    assert hit(eight, most=3, seed=fault.spec.seed) == fault.drives
    assert len(hit(eight, most=100)) == 8
    assert len(hit(eight, share="50%", most=2)) == 2
    assert len(hit(eight, on="axis-0[12]", share="50%")) == 1


@pytest.mark.parametrize("share", ["0%", "101%", "25", 25, 0.25, "-1%", "%", "", None, True, "1e1%", "nan%"])
def test_a_share_that_is_no_percentage_is_refused(eight, share):
    if share is None:
        assert len(hit(eight, share=None)) == 8
        return
    with pytest.raises(InjectionError, match=r"fault\.share: is .*; allowed: a percentage"):
        eight.add("load", share=share)


@pytest.mark.parametrize("most", [0, -1, 1.5, "3", 1 << 32])
def test_a_maximum_that_is_no_count_is_refused(eight, most):
    with pytest.raises(InjectionError, match=r"fault\.most: .*whole number from 1"):
        eight.add("load", most=most)


@given(st.floats(0.000001, 100.0))
def test_a_share_is_read_as_it_is_shown(share):
    share = round(share, 6)
    if share > 0:
        assert read_share(format_share(share)) == share


@given(st.text(max_size=12))
def test_any_text_is_a_share_and_a_rate_or_a_problem(text):
    for read in (read_share, read_rate):
        with contextlib.suppress(Problem):
            read(text)


@pytest.mark.parametrize(("text", "rate"), [("2/min", 2 / 60), ("1000/s", 1000.0), ("0.001/h", 0.001 / 3600)])
def test_a_rate_is_read_as_it_is_shown(text, rate):
    assert read_rate(text)[0] == pytest.approx(rate)
    assert format_rate(read_rate(text)) == text


def test_a_dry_run_lists_who_would_be_hit_and_changes_nothing(eight):
    before = left_behind(eight)
    reach = eight.faults.reach({"kind": "load", "on": "all", "share": "25%", "seed": 5})
    assert reach.drives == hit(eight, share="25%", seed=5)
    assert len(reach.left_out) == 6
    assert reach.cannot == {}
    assert left_behind(eight) == before
    assert reach.as_dict()["spec"] == {"kind": "load", "on": ["all"], "share": "25%", "seed": 5}


def test_a_dry_run_says_why_a_drive_cannot_and_raises_for_what_is_wrong():
    line = FaultLine(2, model="hiwin-e1", **LINES["hiwin-e1"])
    reach = line.faults.reach({"kind": "slow-ramp", "on": "all"})
    assert reach.drives == ()
    assert set(reach.cannot) == {"axis-01", "axis-02"}
    assert "has no ramp generator" in reach.cannot["axis-01"]
    with pytest.raises(InjectionError, match="no drive matches"):
        line.faults.reach({"kind": "load", "on": "nobody"})
    with pytest.raises(InjectionError, match=r"fault\.most"):
        line.faults.reach({"kind": "load", "on": "all", "most": 0})
    line.add("load", as_="mine")
    with pytest.raises(InjectionError, match=r"fault\.as: there is an injection mine already"):
        line.faults.reach({"kind": "load", "on": "all", "as": "mine"})


# -- again and again


def kept(line: FaultLine, event: str) -> list[int]:
    """When this event happens from now on: the log itself forgets."""
    times: list[int] = []
    record = line.log.record

    def keep(now, drive, what):
        if what.text == event:
            times.append(now)
        record(now, drive, what)

    line.log.record = keep
    return times


def test_a_rate_begins_again_at_random_and_counts_every_occurrence(line):
    ends = kept(line, "injected fault ended")
    fault = line.add("f702", rate="20/min", seed=7)
    assert fault.state == "waiting"
    line.run(60.0)
    run = fault.runs["axis-01"]
    assert 10 <= run.starts <= 30
    assert fault.evidence().activations == run.starts
    assert line.faults.activations()["f702", "axis-01"] == fault.evidence().activations
    assert len(ends) >= run.starts - 1
    line.clear()
    assert line.faults.activations()["f702", "axis-01"] == fault.evidence().activations
    line.enable(10.0)


def test_the_mean_time_between_occurrences_is_that_of_the_rate_and_the_seed_repeats_them():
    def starts(seed: int) -> list[int]:
        line = FaultLine(1)
        begins = kept(line, "fault injected")
        line.add("load", rate="10/s", for_="1ms", times=400, seed=seed)
        line.run(60.0)
        return begins

    first = starts(3)
    assert len(first) == 400
    assert first == starts(3)
    assert first != starts(4)
    gaps = [(after - before) / 1e9 - 0.001 for before, after in itertools.pairwise(first)]
    mean = sum(gaps) / len(gaps)
    # 399 exponential times: their mean is within 0.0165 of 0.1 s in 99.9 % of all runs
    assert mean == pytest.approx(0.1, abs=0.0165)
    assert max(gaps) > 3 * mean, "exponential, not regular"


def test_with_times_it_ends_after_so_many(line):
    fault = line.add("silence", rate="2/s", times=3, cycles=1)
    assert line.until(lambda: fault.state == "ended", 30.0)
    assert fault.runs["axis-01"].starts == 3
    assert fault.evidence().activations >= 3
    assert line.rows_free()


@pytest.mark.parametrize(
    ("kind", "fields", "field"),
    [
        ("silence", {"rate": "1/s"}, "rate: needs an end of each silence"),
        ("drive-fault", {"rate": "1/s", "params": {"fault": 702, "hold": True}}, "rate: needs an end"),
        ("silence", {"times": 3}, "times: means nothing without rate"),
        ("silence", {"rate": "1", "for": "1ms"}, "rate: is '1'"),
        ("silence", {"rate": "0/s", "for": "1ms"}, "rate: is '0/s'"),
        ("silence", {"rate": "9999/s", "for": "1ms"}, "rate: is '9999/s'"),
        ("silence", {"rate": 2, "for": "1ms"}, "rate: is 2"),
        ("silence", {"ttl": "1ms"}, "ttl: is 1ms; allowed: a duration of 100ms or more"),
        ("silence", {"ttl": 5}, "ttl: is 5, which has no unit"),
        ("load", {"seed": 5}, "seed: means nothing for load"),
    ],
)
def test_repetition_and_time_to_live_that_make_no_sense_are_refused(line, kind, fields, field):
    with pytest.raises(InjectionError) as caught:
        line.faults.inject({"kind": kind, "on": "all", **fields}, line.world.now)
    assert f"fault.{field}" in str(caught.value)


# -- time to live


def test_a_fault_ends_by_its_time_to_live_unless_it_is_renewed(line):
    fault = line.add("silence", ttl="500ms", as_="mine")
    line.run(0.4)
    line.faults.renew("mine", line.world.now)
    line.run(0.4)
    assert fault.state == "active"
    line.run(0.2)
    assert fault.state == "ended"
    assert fault.runs["axis-01"].reason == "ttl"
    assert line.rows_free()
    with pytest.raises(ConfigError, match="there is no fault 'mine'"):
        line.faults.renew("mine", line.world.now)


def test_a_fault_that_waits_lapses_too_and_one_without_ttl_cannot_be_renewed(line):
    fault = line.add("silence", ttl="200ms", after="10s")
    line.run(0.3)
    assert fault.state == "ended"
    line.add("silence", as_="for-ever", after="10s")
    with pytest.raises(InjectionError, match="for-ever has no time to live"):
        line.faults.renew("for-ever", line.world.now)
