"""The drives' memory in a real PostgreSQL: kept, lost and found again, and held meanwhile."""

import socket
import sys
import threading
import time

import pytest
from postgres_server import PASSWORD, started
from waiting import until

from pnfarm.config.database import redacted
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.lease import Lease, LeaseChanged, LeaseState
from pnfarm.farm.memory import postgres
from pnfarm.farm.memory.postgres import ABSENT_FACTOR, SAVE_SECONDS, PostgresState

VALUES = {
    "ip": {"address": "10.77.0.11", "gateway": None},
    "parameters": {2135: 1, 2108: 10_000_170},
    "im": {"im1": b"plant", "im3": b""},
    "share": 0.1,
}
NAMES = ["axis-01", "axis-02"]
TTL = 2_000_000_000


@pytest.fixture(scope="module")
def server():
    yield from started()


@pytest.fixture
def fresh(server):
    """The server without a schema of pnfarm's."""
    server.ask("DROP SCHEMA IF EXISTS pnfarm CASCADE")
    return server


@pytest.fixture
def open_state():
    opened = []

    def make(server, names=NAMES, farm="line-1", **given):
        state = PostgresState(server.url, farm, names, **given)
        opened.append(state)
        state.start()
        return state

    yield make
    for state in opened:
        state.close()


def test_what_is_saved_is_there_elsewhere_and_farms_do_not_meet(fresh, open_state):
    state = open_state(fresh)
    assert state.load("axis-01") is None
    state.save("axis-01", {"gone": 1, "ip": 2})
    state.save("axis-01", VALUES)
    state.save("axis-02", {})
    other = open_state(fresh, farm="line-2")
    assert other.load("axis-01") is None
    other.save("axis-01", {"name": "x\0"})
    state.close()
    again = open_state(fresh)
    assert again.load("axis-01") == VALUES
    assert again.load("axis-02") == {}
    loaded = again.load("axis-01")
    loaded["name"] = "other"
    assert again.load("axis-01") == VALUES
    assert open_state(fresh, farm="line-2").load("axis-01") == {"name": "x\0"}


def test_the_first_two_make_the_schema_once_and_leave_other_tables_alone(fresh, open_state):
    fresh.ask("CREATE TABLE IF NOT EXISTS memory (theirs text)")
    states = [PostgresState(fresh.url, "line-1", NAMES) for _ in range(4)]
    try:
        for state in states:
            state.conninfo()
        import threading

        threads = [threading.Thread(target=state.start) for state in states]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert all(state.ready for state in states)
    finally:
        for state in states:
            state.close()
    assert fresh.ask("SELECT version FROM pnfarm.format") == [(1,)]
    assert fresh.ask("SELECT count(*) FROM memory") == [(0,)]


@pytest.mark.parametrize(
    ("statements", "sentence"),
    [
        ("CREATE SCHEMA pnfarm; CREATE TABLE pnfarm.theirs (a int)", "is another program's"),
        ("CREATE SCHEMA pnfarm; CREATE TABLE pnfarm.format AS SELECT 2 AS version", "written by a newer pnfarm"),
    ],
)
def test_a_schema_that_is_not_this_versions_is_refused_and_left_alone(fresh, open_state, statements, sentence):
    fresh.ask(statements)
    with pytest.raises(EnvironmentError_, match=sentence):
        open_state(fresh)
    assert fresh.ask("SELECT count(*) FROM pg_tables WHERE schemaname = 'pnfarm'") == [(1,)]


def test_a_user_who_may_not_make_a_schema_is_told_what_would_help(fresh):
    fresh.ask("DROP ROLE IF EXISTS guest")
    fresh.ask("CREATE ROLE guest LOGIN PASSWORD 'besuch-1'")
    state = PostgresState(fresh.url.replace(f"farm:{PASSWORD}", "guest:besuch-1"), "line-1", NAMES)
    with pytest.raises(EnvironmentError_, match="CREATE SCHEMA pnfarm AUTHORIZATION") as caught:
        state.start()
    assert "besuch" not in str(caught.value)
    state.close()


def test_a_frozen_database_costs_a_save_a_moment_and_then_nothing(fresh, open_state):
    news = []
    state = open_state(fresh, news=lambda: news.append(1))
    state.save("axis-01", {"name": "before"})
    fresh.freeze()
    try:
        began = time.monotonic()
        with pytest.raises(EnvironmentError_, match=r"did not answer within 0\.25 s"):
            state.save("axis-01", {"name": "uncertain"})
        state.hold("axis-01", {"name": "before"})
        assert time.monotonic() - began < 10 * SAVE_SECONDS
        began = time.monotonic()
        for _ in range(100):
            with pytest.raises(EnvironmentError_, match="is away"):
                state.save("axis-01", {"name": "refused"})
        assert time.monotonic() - began < SAVE_SECONDS
        assert not state.ready
        # reads go on from what is held
        assert state.load("axis-01") == {"name": "before"}
        state.hold("axis-02", {"faults": [1]})
    finally:
        fresh.thaw()
    assert until(lambda: state.ready)
    assert news
    assert state.standing.losses == 1
    # the save without an answer may have been done: what is held stands in the database all the same
    rows = fresh.ask("SELECT station, key, value FROM pnfarm.memory WHERE key <> '' ORDER BY 1")
    assert rows == [("axis-01", "name", '"before"'), ("axis-02", "faults", "[1]")]
    state.save("axis-01", {"name": "after"})
    assert open_state(fresh).load("axis-01") == {"name": "after"}


def test_a_database_that_is_restarted_is_found_again(fresh, open_state):
    state = open_state(fresh)
    state.save("axis-01", {"name": "a"})
    fresh.stop()
    try:
        assert until(lambda: not state.ready)
        with pytest.raises(EnvironmentError_, match="is away") as caught:
            state.save("axis-01", {"name": "b"})
        assert PASSWORD not in str(caught.value)
    finally:
        fresh.start()
    assert until(lambda: state.ready)
    state.save("axis-01", {"name": "c"})
    assert open_state(fresh).load("axis-01") == {"name": "c"}


def test_a_machine_without_a_thread_for_a_while_loses_the_database_and_finds_it_again(fresh, open_state, monkeypatch):
    state = open_state(fresh)

    class NoThread(threading.Timer):
        def start(self):
            raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patched:
        patched.setattr(postgres.threading, "Timer", NoThread)
        with pytest.raises(EnvironmentError_, match="can't start new thread"):
            state.save("axis-01", {"name": "b"})
        assert not state.ready
    assert until(lambda: state.ready)
    state.save("axis-01", {"name": "c"})
    assert open_state(fresh).load("axis-01") == {"name": "c"}


def test_a_database_that_is_away_at_the_start_is_waited_for_a_bounded_time(fresh, monkeypatch):
    monkeypatch.setattr(postgres, "START_SECONDS", 0.6)
    state = PostgresState(f"{fresh.url}-nowhere", "line-1", NAMES)
    began = time.monotonic()
    with pytest.raises(EnvironmentError_, match=r"did not answer within 1 s: .*No such file") as caught:
        state.start()
    assert time.monotonic() - began < 10
    assert PASSWORD not in str(caught.value)


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("postgresql://a:b@h:5/d?password=c", "postgresql://a@h:5/d"),
        ("postgres://h/d", "postgresql://h/d"),
        ("postgresql:///d?host=/tmp&user=x", "postgresql:///d"),
        ("postgresql://u:p%@[::1/d", "postgresql://..."),
        ("postgresql://u:p@q@h1,h2:2/d", "postgresql://u@h1,h2:2/d"),
        ("postgresql://u:se/cret@h/d", "postgresql://..."),
        ("postgresql://u:se#cret@h/d", "postgresql://..."),
        ("postgresql://u:a@b/secret@h/d", "postgresql://..."),
    ],
)
def test_a_url_is_shown_without_its_password(url, shown):
    assert redacted(url) == shown


def test_a_url_that_libpq_does_not_take_is_refused_without_its_words():
    pytest.importorskip("psycopg")
    state = PostgresState("postgresql://u:ge%heim@h/d", "line-1", NAMES)
    with pytest.raises(EnvironmentError_, match="is not the URL of a database") as caught:
        state.start()
    assert "ge%heim" not in str(caught.value)


def test_without_the_driver_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(EnvironmentError_, match=r"pip install 'pnfarm\[postgres\]'"):
        PostgresState("postgresql://h/d", "line-1", NAMES)


# -- claims


def leased(make, server, names=NAMES, shard="1/2", **given):
    return make(server, names, lease=Lease(TTL), shard=shard, **given)


def held(state):
    state.check()
    return state.lease_state == "held"


def test_a_second_copy_waits_and_takes_over_what_the_first_one_saved(fresh, open_state):
    told = []
    first = leased(open_state, fresh, until=told.append)
    assert held(first)
    assert first.may_speak()
    assert told[-1] == first.lease.until_ns
    first.save("axis-01", {"name": "a"})
    second = leased(open_state, fresh)
    assert second.lease_state == "waiting"
    assert second.standing.waiting_for.shard == "1/2"
    assert not second.may_speak()
    with pytest.raises(EnvironmentError_, match="another shard has the drives"):
        second.save("axis-01", {"name": "b"})
    # another division of the same farm has a drive in common, and one drive is not enough
    third = leased(open_state, fresh, ["axis-02", "axis-03"], "2/3")
    assert third.lease_state == "waiting"
    assert fresh.ask("SELECT count(*) FROM pnfarm.claim") == [(2,)]
    first.close()
    assert until(lambda: held(second) or held(third), 3)
    winner = second if held(second) else third
    assert winner.check() == []
    if winner is second:
        assert second.load("axis-01") == {"name": "a"}


def test_a_holder_without_its_database_is_mute_in_time_and_comes_back(fresh, open_state):
    told = []
    state = leased(open_state, fresh, until=told.append)
    assert state.check() == [LeaseChanged(LeaseState.HELD, anew=True)]
    fresh.freeze()
    try:
        began = time.monotonic()
        assert until(lambda: not state.may_speak(), 5)
        assert time.monotonic() - began < TTL / 1e9
        assert state.check() == [LeaseChanged(LeaseState.LOST)]
    finally:
        fresh.thaw()
    assert until(state.may_speak)
    # nobody had them meanwhile
    assert state.check() == [LeaseChanged(LeaseState.HELD)]


def test_a_farm_whose_event_loop_stands_still_gives_its_claims_up(fresh, open_state):
    first = leased(open_state, fresh)
    first.attended()
    second = leased(open_state, fresh)
    assert second.lease_state == "waiting"
    # nobody calls `attended` any more; the thread that renews goes on
    assert until(lambda: held(second), ABSENT_FACTOR * TTL / 1e9 + 5)
    assert not first.may_speak()
    second.close()
    first.attended()
    assert until(lambda: held(first), 5)


def test_text_comes_back_as_text_from_a_database_without_an_encoding(fresh, open_state):
    fresh.ask("CREATE DATABASE plain ENCODING 'SQL_ASCII' LC_COLLATE 'C' LC_CTYPE 'C' TEMPLATE template0")
    plain = fresh.url.replace("/postgres?", "/plain?")
    first = PostgresState(plain, "line-1", NAMES, lease=Lease(TTL), shard="1/2")
    second = PostgresState(plain, "line-1", NAMES, lease=Lease(TTL), shard="1/2")
    try:
        first.start()
        first.save("axis-01", {"name": "Kälte"})
        second.start()
        assert second.standing.waiting_for.host == socket.gethostname()
        first.close()
        assert until(lambda: held(second), 5)
        assert second.load("axis-01") == {"name": "Kälte"}
    finally:
        first.close()
        second.close()
        fresh.ask("DROP DATABASE plain WITH (FORCE)")


def test_whoever_lost_its_claims_writes_nothing_more(fresh, open_state):
    state = leased(open_state, fresh)
    assert held(state)
    state.save("axis-01", {"name": "mine"})
    fresh.ask("UPDATE pnfarm.claim SET holder = 'other', expires = clock_timestamp() + interval '9 s', since = now()")
    with pytest.raises(EnvironmentError_, match="another shard"):
        state.save("axis-01", {"name": "late"})
    assert fresh.ask("SELECT value FROM pnfarm.memory WHERE key = 'name'") == [('"mine"',)]
    assert until(lambda: (state.check(), state.lease_state == "waiting")[1], 3)
    assert not state.may_speak()
    fresh.ask("UPDATE pnfarm.memory SET value = '\"theirs\"' WHERE key = 'name'")
    fresh.ask("DELETE FROM pnfarm.claim")
    assert until(lambda: LeaseChanged(LeaseState.HELD, anew=True) in state.check(), 3)
    assert state.load("axis-01") == {"name": "theirs"}
