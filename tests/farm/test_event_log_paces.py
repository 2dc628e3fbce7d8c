"""The event log: peers that try again without end, or change something in each cycle, do not fill it."""

import pytest

from pnfarm.buses.profibus.device.events import (
    ConfigurationRefused,
    DataExchangeBegan,
    DataExchangeLost,
    ParametersTaken,
)
from pnfarm.station.event import ATTEMPT, BY_PEER
from pnfarm.station.event_log import EventLog
from pnfarm.station.events import ControllerModeChanged, FaultRaised

SECOND = 1_000_000_000
REFUSED = ConfigurationRefused(1, b"\xf3\xf1")


@pytest.fixture
def log():
    return EventLog(quiet=True)


def told(log, event):
    return [(entry.now_ns // SECOND, entry.data.get("repeated", 1)) for entry in log.entries() if entry.event == event]


def test_attempts_to_connect_have_an_entry_each_and_then_one_a_minute_with_their_number(log):
    for number in range(3000):
        log.record(number * SECOND // 10, "msd", REFUSED)
    entries = told(log, "connection refused")
    assert entries[: ATTEMPT.at_once] == [(number // 10, 1) for number in range(ATTEMPT.at_once)]
    assert entries[ATTEMPT.at_once :] == [(60, 589), (120, 600), (180, 600), (240, 600)]


def test_a_connection_that_comes_to_data_tells_of_the_attempts_before_it(log):
    for number in range(100):
        log.record(number, "msd", ParametersTaken(1, 0))
        log.record(number, "msd", ConfigurationRefused(1, bytes((number,))))
    log.record(100, "msd", ParametersTaken(1, 0))
    log.record(200, "msd", DataExchangeBegan(1, 101))
    attempts, data = log.entries()[-3:-1], log.entries()[-1]
    assert [(entry.event, entry.now_ns, entry.data["repeated"]) for entry in attempts] == [
        ("connection refused", 99, 88),
        ("connection opened", 100, 89),
    ]
    assert attempts[0].data["identifiers"] == "63"
    assert data.event == "connection established"
    assert "repeated" not in data.as_dict()
    assert [entry.sequence for entry in log.entries()] == list(range(1, 28))


def test_each_connection_that_comes_to_data_has_its_begin_and_its_end_in_the_log(log):
    for number in range(300):
        log.record(number * 3 * SECOND, "msd", ParametersTaken(1, 0))
        log.record(number * 3 * SECOND + 1, "msd", DataExchangeBegan(1, 101))
        log.record(number * 3 * SECOND + 2, "msd", DataExchangeLost("watchdog", 1))
    assert len(log.entries()) == 900


def test_what_a_controller_changes_in_each_cycle_is_in_the_log_once_a_second_with_its_number(log):
    for number in range(10_000):
        log.record(number * SECOND // 1000, "msd", ControllerModeChanged(run=bool(number % 2)))
    entries = log.entries()
    assert len(entries) <= BY_PEER.at_once + 10
    assert sum(entry.stands_for for entry in entries) > 9000


def test_what_was_counted_last_has_its_entry_as_soon_as_the_pace_permits_it(log):
    woken = []
    log.follow(lambda: woken.append(1))
    for number in range(100):
        log.record(number, "msd", REFUSED)
    assert len(woken) == ATTEMPT.at_once
    due = log.next_deadline()
    assert due == ATTEMPT.every_ns
    log.service(due - 1)
    assert len(woken) == ATTEMPT.at_once
    log.service(due)
    assert len(woken) == ATTEMPT.at_once + 1
    assert (log.entries()[-1].now_ns, log.entries()[-1].data["repeated"]) == (99, 88)
    assert log.next_deadline() is None


def test_behind_a_flapping_connection_the_last_entry_is_how_it_ended(log):
    for established in (True, False):
        for number in range(400):
            now = number * SECOND // 20
            log.record(now, "msd", ParametersTaken(1, 0))
            log.record(now + 1, "msd", DataExchangeBegan(1, 101))
            if number < 399 or not established:
                log.record(now + 2, "msd", DataExchangeLost("watchdog", 1))
        log.service(now + 2 * SECOND)
        last = "connection established" if established else "connection lost"
        assert log.entries()[-1].event == last
        assert len(log.entries()) < 300
        log.service(now + 300 * SECOND)


def test_another_drive_and_another_event_have_their_own_pace(log):
    for _ in range(100):
        log.record(0, "one", REFUSED)
    log.record(0, "two", REFUSED)
    log.record(0, "one", ParametersTaken(1, 0))
    for number in range(100):
        log.record(0, "one", FaultRaised(number))
    assert [entry.drive for entry in log.entries("two")] == ["two"]
    assert len(log.entries()) == ATTEMPT.at_once + 1 + 1 + 100


def test_subscribers_hear_of_events_that_are_only_counted(log):
    heard = []
    log.subscribe(heard.append)
    for number in range(100):
        log.record(number, "msd", REFUSED)
    assert [entry.now_ns for entry in heard] == list(range(100))


def test_a_clock_that_is_put_back_holds_no_entry_back_for_longer_than_its_pace(log):
    for _ in range(100):
        log.record(3600 * SECOND, "msd", REFUSED)
    log.record(0, "msd", REFUSED)
    log.record(ATTEMPT.every_ns, "msd", REFUSED)
    assert told(log, "connection refused")[-1] == (60, 90)
