"""Which shards there are, how they are judged, whose drives are whose; clocks; the merged log.  No I/O."""

import itertools
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.api.events import format_position, gap, parse_position
from pnfarm.errors import ConfigError
from pnfarm.hub.clocks import ClockOffset
from pnfarm.hub.events import MOST_ORIGINS, Reader
from pnfarm.hub.log import HOLD_NS, KEPT, MergedLog
from pnfarm.hub.settings import api_of, name_of, url_of
from pnfarm.hub.shards import KEEP_NS, AwayError, Shards
from pnfarm.hub.states import TRANSITIONS, ShardEvent, ShardState
from pnfarm.web.errors import NotFoundError, RequestError

SECOND = 1_000_000_000


def view(*names):
    return {"drives": [{"name": name, "model": "akd-profinet"} for name in names], "engine": {}, "lines": []}


def up(shards, url, *names, now=0):
    shard = shards.give(url)
    shards.note(shard, ShardEvent.ANSWERED, "", now, 0.0)
    shards.take(shard, view(*names))
    return shard


def test_every_state_has_an_answer_to_every_event():
    assert set(TRANSITIONS) == set(itertools.product(ShardState, ShardEvent))


def test_one_late_answer_is_no_loss_and_two_are():
    shards = Shards()
    one = up(shards, "http://a:1", "x")
    shards.note(one, ShardEvent.MISSED, "late", 5, 5.0)
    assert (one.state, one.asked) == (ShardState.SILENT, True)
    shards.note(one, ShardEvent.MISSED, "late", 7, 7.0)
    assert (one.state, one.asked, one.since_wall) == (ShardState.AWAY, False, 7.0)
    shards.note(one, ShardEvent.MISSED, "late", 9, 9.0)
    assert one.since_wall == 7.0
    with pytest.raises(AwayError, match="x is unreachable: a:1 does not answer: late"):
        shards.owner("x")
    assert shards.note(one, ShardEvent.ANSWERED, "", 10, 10.0)
    assert shards.owner("x") is one


def test_drives_are_in_natural_order_whatever_the_shards():
    shards = Shards()
    up(shards, "http://b:1", "axis-10", "axis-2")
    up(shards, "http://a:1", "axis-1", "axis-3", "pump")
    assert shards.names == ("axis-1", "axis-2", "axis-3", "axis-10", "pump")
    with pytest.raises(NotFoundError, match=r"did you mean pump\?"):
        shards.owner("pumb")
    # a digit that is no part of a number
    up(shards, "http://c:1", "axis-1²")
    assert shards.names[:3] == ("axis-1", "axis-1²", "axis-2")


def test_a_drive_that_two_claim_is_nobodys_until_one_is_away():
    shards = Shards()
    one, other = up(shards, "http://a:1", "x", "y"), up(shards, "http://b:1", "x")
    assert list(shards.conflicts()) == ["x"]
    with pytest.raises(RequestError, match="x is claimed by a:1 and b:1") as caught:
        shards.owner("x")
    assert caught.value.status == 409
    assert shards.owner("y") is one
    shards.note(other, ShardEvent.REFUSED, "gone", 1, 1.0)
    assert shards.conflicts() == {}
    assert shards.owner("x") is one


def test_a_drive_that_nobody_has_may_be_of_a_shard_that_is_away():
    shards = Shards()
    up(shards, "http://a:1", "x")
    shards.give("http://b:1")
    with pytest.raises(AwayError, match="no shard that answers has a drive 'z'; not asked: b:1"):
        shards.owner("z")


def test_a_shard_that_left_dns_is_kept_for_a_time_and_one_that_moved_is_not():
    shards = Shards()
    shards.found(["http://a:1", "http://b:1"], 0)
    one, other = list(shards)
    for shard, name in ((one, "x"), (other, "y")):
        shards.note(shard, ShardEvent.ANSWERED, "", 0, 0.0)
        shards.take(shard, view(name))
    shards.found(["http://b:1"], SECOND)
    # it still answers: it is still asked
    assert shards.owner("x") is one
    assert shards.forget(2 * SECOND) == []
    shards.note(one, ShardEvent.REFUSED, "gone", 2 * SECOND, 2.0)
    assert shards.forget(SECOND + KEEP_NS) == []
    assert shards.unreachable == [one]
    assert shards.names == ("x", "y")
    assert shards.forget(SECOND + KEEP_NS + 1) == [one]
    assert shards.names == ("y",)
    # its drives are back at another address
    shards.note(other, ShardEvent.REFUSED, "gone", 0, 0.0)
    shards.found(["http://c:1"], 5 * SECOND)
    third = next(shard for shard in shards if shard.url == "http://c:1")
    shards.note(third, ShardEvent.ANSWERED, "", 0, 0.0)
    shards.take(third, view("y"))
    assert shards.forget(6 * SECOND) == [other]
    assert shards.owner("y") is third


def test_a_shard_with_devices_alone_is_kept_for_the_same_time():
    shards = Shards()
    shards.found(["http://a:1"], 0)
    (one,) = shards
    shards.note(one, ShardEvent.ANSWERED, "", 0, 0.0)
    shards.take(one, view(), [{"name": "island", "models": ["EX-ISL-100"]}])
    shards.found([], SECOND)
    shards.note(one, ShardEvent.REFUSED, "gone", 2 * SECOND, 2.0)
    assert shards.forget(SECOND + KEEP_NS) == []
    with pytest.raises(AwayError, match="island is unreachable"):
        shards.device_owner("island")
    assert shards.forget(SECOND + KEEP_NS + 1) == [one]


def test_a_shard_that_was_given_is_never_forgotten():
    shards = Shards()
    one = shards.give("http://a:1")
    shards.note(one, ShardEvent.REFUSED, "gone", 0, 0.0)
    shards.found([], 0)
    assert shards.forget(10 * KEEP_NS) == []


@given(
    offset=st.integers(-(10**15), 10**15),
    trips=st.lists(st.tuples(st.integers(0, 10**9), st.integers(0, 10**9)), min_size=1, max_size=40),
)
def test_the_true_offset_is_always_within_the_uncertainty(offset, trips):
    clock, now = ClockOffset(), 10**12
    for there, back in trips:
        clock.note(now, now + there + offset, now + there + back)
        now += there + back + SECOND
        assert abs(clock.offset_ns - offset) <= clock.uncertainty_ns(now) + 1
    assert clock.to_hub(clock.to_shard(now)) == pytest.approx(now / 1e9)


def test_the_best_round_trip_counts_and_ages():
    clock = ClockOffset()
    clock.note(0, 5_000, 1_000)
    best = clock.uncertainty_ns(1_000)
    clock.note(SECOND, SECOND + 500_000, SECOND + 1_000_000)
    assert clock.offset_ns == 4_500
    assert best == 500 < clock.uncertainty_ns(SECOND + 1_000_000) < 500_000
    clock.forget()
    assert not clock.known


def test_a_clock_that_stood_still_is_measured_anew():
    clock = ClockOffset()
    for second in range(5):
        clock.note(second * SECOND, second * SECOND + 1_500, second * SECOND + 1_000)
    stall = 700_000_000
    clock.note(6 * SECOND, 6 * SECOND - stall + 50_000, 6 * SECOND + 100_000)
    assert clock.offset_ns == pytest.approx(-stall, abs=50_001)
    assert clock.uncertainty_ns(6 * SECOND + 100_000) == 50_000


def entry(drive="x", event="e"):
    return {"drive": drive, "event": event}


def test_entries_come_in_the_order_of_time_also_if_they_arrive_otherwise():
    log = MergedLog()
    log.take("a" * 8, 1, 300, entry(event="second"))
    log.take("b" * 8, 1, 200, entry(event="first"))
    log.release(299 + HOLD_NS)
    log.take("b" * 8, 2, 250, entry(event="too late"))
    log.release(10**12)
    assert [one.data["event"] for one in log.entries()] == ["first", "too late", "second"]
    assert [one.sequence for one in log.entries()] == [1, 2, 3]
    # the same again is nothing new
    log.take("b" * 8, 2, 250, entry())
    log.release(10**12)
    assert log.newest == 3


def test_entries_of_one_run_stay_in_order_where_their_times_do_not_rise_so_that_no_position_skips_one():
    log = MergedLog()
    for number, at in enumerate((500, 520, 300, 530), 1):
        log.take("a" * 8, number, at, entry())
    log.take("b" * 8, 1, 400, entry())
    log.release(10**12)
    assert [(one.origin[0], one.number) for one in log.entries()] == [("b", 1), ("a", 1), ("a", 2), ("a", 3), ("a", 4)]
    assert [one.at_ns for one in log.entries()] == [400, 500, 520, 300, 530]


def test_a_position_goes_over_a_restart_and_tells_what_is_lost():
    log = MergedLog()
    for number in range(1, 6):
        log.take("a" * 8, number, number, entry())
    log.release(10**12)
    position = log.position(3)
    assert parse_position(format_position(position)) == position == {"a" * 8: 3}
    other = MergedLog()
    # the shard itself has lost the first five
    other.take("a" * 8, 6, 6, entry())
    other.release(10**12)
    assert other.lost(position) == 2
    assert log.lost(position) == 0
    reader = Reader(other, format_position({"a" * 8: 6}), None)
    assert reader.first() == ""
    # and, while a client goes on, two more
    other.take("a" * 8, 9, 9, entry())
    other.release(10**12)
    assert other.lost({"a" * 8: 6}) == 2
    assert reader.text(other.entries(), 0).startswith(gap(2))


def test_a_client_that_resumes_is_told_once_what_a_hub_that_has_just_begun_no_longer_holds_when_it_reads(monkeypatch):
    monkeypatch.setattr("pnfarm.hub.log.KEPT", 4)
    log = MergedLog()
    # the hub has not heard of the shard yet
    reader = Reader(log, format_position({"a" * 8: 5}), None)
    said = reader.first()
    for number in range(1, 21):
        log.take("a" * 8, number, number, entry(event=f"a{number}"))
    log.release(10**12)
    entries = log.entries(after=reader.after, most=2)
    said += reader.text(entries, entries[0].sequence - 1)
    said += reader.text(log.entries(after=entries[-1].sequence), 0)
    assert said.startswith(gap(11))
    assert said.count("gap") == 1
    assert [json.loads(line[6:])["event"] for line in said.splitlines() if line.startswith('data: {"drive')] == [
        "a17", "a18", "a19", "a20",
    ]  # fmt: skip


def run_of(number):
    return f"{number:08x}"


def test_runs_that_are_over_are_forgotten_when_none_of_their_entries_is_kept():
    log = MergedLog()
    live = run_of(0)
    log.take(live, 1, 1, entry())
    for number in range(1, 2 * KEPT + 1):
        log.take(run_of(number), 1, number, entry())
        log.release(number + HOLD_NS)
        if number % 1000 == 0:
            log.forget_but({live, run_of(number)})
    log.forget_but({live})
    # a run that goes on is known, also if it has long been silent
    assert log.taken(live) == 1
    assert len(log.position(log.newest)) == KEPT + 1
    assert log.taken(run_of(1)) == 0
    assert log.taken(run_of(2 * KEPT)) == 1


def test_a_clients_position_stays_one_over_any_number_of_runs():
    log = MergedLog()
    reader = Reader(log, None, None)
    said = ""
    for number in range(1, 2 * MOST_ORIGINS):
        log.take(run_of(number), 1, number, entry())
        log.release(number + HOLD_NS)
        said = reader.text(log.entries(after=log.newest - 1), 0)
        for _ in range(KEPT if number == MOST_ORIGINS else 0):
            log.take(run_of(0), log.taken(run_of(0)) + 1, number, entry())
            log.release(number + HOLD_NS)
        log.forget_but({run_of(0), run_of(number)})
    assert parse_position(said.split("\n")[0].removeprefix("id: "))[run_of(number)] == 1


def test_a_client_gets_nothing_twice_from_a_new_hub_that_hears_of_a_shard_later_than_the_client_did():
    log = MergedLog()
    for number in (1, 2):
        log.take("a" * 8, number, number, entry(event=f"a{number}"))
    log.release(10**12)
    reader = Reader(log, format_position({"a" * 8: 4, "b" * 8: 7}), None)
    log.take("c" * 8, 1, 3, entry(event="shard answers"))
    for number in (3, 4, 5):
        log.take("a" * 8, number, number, entry(event=f"a{number}"))
    log.take("b" * 8, 7, 6, entry(event="b7"))
    log.release(10**12)
    said = reader.first() + reader.text(log.entries(after=reader.after), 0)
    messages = [message.split("\n") for message in said.strip().split("\n\n")]
    positions = [parse_position(identity.removeprefix("id: ")) for identity, _ in messages]
    assert [json.loads(data.removeprefix("data: "))["event"] for _, data in messages] == ["shard answers", "a5"]
    assert positions[0] == {"a" * 8: 4, "b" * 8: 7, "c" * 8: 1}
    assert positions[1] == {"a" * 8: 5, "b" * 8: 7, "c" * 8: 1}


def test_a_flood_takes_no_memory_without_bound():
    log = MergedLog()
    for number in range(1, KEPT + 20_000):
        log.take("a" * 8, number, number, entry())
        if number % 1000 == 0:
            log.release(0)
    log.release(10**15)
    assert len(log.entries()) == KEPT
    assert log.lost({"a" * 8: 0}) == 19_999


@given(st.text(max_size=60))
def test_any_text_is_a_position_or_none(text):
    found = parse_position(text)
    assert found is None or format_position(found).count("-") == len(found)


@pytest.mark.parametrize("text", ["", "12", "aaaaaaaa", "aaaaaaaa-", "aaaaaaaa-1.", "aaaaaaaa-1" + ".aaaaaaaa-1" * 900])
def test_what_is_no_position_is_none(text):
    assert parse_position(text) is None


def test_addresses_are_read_and_wrong_ones_refused_in_one_sentence():
    assert url_of("10.0.0.3") == "http://10.0.0.3:8702"
    assert url_of("https://Farm.local:99/") == "https://farm.local:99"
    assert url_of("[::1]:8702") == "http://[::1]:8702"
    assert name_of("tasks.farm:8702") == ("tasks.farm", 8702)
    for wrong in ("", "http://", "http://x/path", "x:0", "x:99999", "a b", "ftp://x"):
        with pytest.raises(ConfigError, match="--shard"):
            url_of(wrong)
    for wrong in ("farm", "farm:", ":8702", "farm:0", "http://farm:1"):
        with pytest.raises(ConfigError, match="--discover"):
            name_of(wrong)
    with pytest.raises(ConfigError, match="--api-token"):
        api_of("127.0.0.1:0", "short", None)
    with pytest.raises(ConfigError, match="--api: "):
        api_of("nowhere", None, None)
