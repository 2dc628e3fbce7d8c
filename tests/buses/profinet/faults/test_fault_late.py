"""Answers that come late and timers that run out, as the controller sees them."""

import pytest
from fault_line import FaultLine
from profinet_state import at_rest, read, station


def timed_read(line) -> float:
    """Seconds that a parameter took: a write and a read."""
    start = line.world.now
    assert read(line) == "answered"
    return (line.world.now - start) / 1e9


def test_watchdog_expire_ends_the_connection_as_the_drives_own_timer_would(line):
    fault = line.add("watchdog-expire")
    line.run(0.05)
    assert line.losses() == 1
    assert "DHT/WDT expired" in line.session().measures.last_reason
    assert "watchdog expired" in line.events("axis-01")
    assert station(line).device.watchdog_expirations == 1
    assert station(line).fault_counts, "the drive takes its fault for a lost fieldbus"
    assert fault.state == "ended"
    assert fault.evidence().confirmed
    line.enable()
    assert line.losses() == 1
    assert at_rest(line)


def test_watchdog_expire_waits_for_a_connection_and_comes_as_often_as_asked():
    line = FaultLine()
    fault = line.add("watchdog-expire", count=2)
    assert line.until(lambda: fault.state == "ended", 5.0)
    assert line.losses() == 2
    line.connect()


@pytest.mark.parametrize("kind", ["watchdog-expire", "ar-abort", "timeout", "alarm-unacknowledged"])
def test_a_connection_after_a_reboot_is_another_one(line, kind):
    fault = line.add(kind, count=2)
    assert line.until(lambda: line.losses() == 1)
    station(line).station.power_cycle(line.world.now)
    line.farm.settle(station(line).station, line.world.now)
    assert line.until(lambda: fault.state == "ended")
    assert fault.evidence().activations == 2
    line.enable()
    assert at_rest(line)


@pytest.mark.parametrize("kind", ["rpc-delay", "record-delay"])
def test_a_record_takes_as_much_longer_as_asked_and_no_longer_than_the_fault(line, kind):
    assert timed_read(line) < 0.05
    fault = line.add(kind, params={"delay": "300ms"})
    assert timed_read(line) == pytest.approx(0.6, abs=0.05)
    seen = fault.evidence()
    assert seen.activations >= 2
    assert seen.confirmed
    line.clear(fault.id)
    assert timed_read(line) < 0.05
    assert at_rest(line)


@pytest.mark.parametrize("kind", ["rpc-delay", "record-delay"])
def test_jitter_is_added_and_the_same_with_the_same_seed(kind):
    taken = []
    for _ in range(2):
        line = FaultLine()
        line.connect()
        line.add(kind, params={"delay": "100ms", "jitter": "200ms"}, seed=3)
        taken.append([timed_read(line) for _ in range(4)])
    assert taken[0] == taken[1]
    assert len(set(taken[0])) > 1
    assert all(0.2 <= seconds <= 0.65 for seconds in taken[0])


@pytest.mark.parametrize("kind", ["rpc-delay", "record-delay"])
def test_two_delays_add_up(line, kind):
    line.add(kind, params={"delay": "100ms"})
    line.add(kind, params={"delay": "150ms"})
    assert timed_read(line) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("kind", ["rpc-delay", "record-delay"])
def test_a_delay_ends_after_its_count_and_its_last_one_is_late_too(line, kind):
    fault = line.add(kind, params={"delay": "200ms"}, count=2)
    assert timed_read(line) == pytest.approx(0.4, abs=0.05)
    line.run(0.1)
    assert fault.state == "ended"
    assert fault.evidence().activations == 2
    assert timed_read(line) < 0.05


def start_read(line) -> None:
    session = line.session()
    line.plc.records.clear()
    session.machine.read_record("r", 0, 0, 1, 0xAFF0, 240)
    line.plc.touch(session, line.world.now)


@pytest.mark.parametrize("kind", ["rpc-delay", "record-delay"])
def test_what_is_held_back_leaves_when_the_fault_is_cleared(line, kind):
    fault = line.add(kind, params={"delay": "1h"})
    start_read(line)
    line.run(0.2)
    assert not line.plc.records
    line.clear(fault.id)
    line.run(0.05)
    assert len(line.plc.records) == 1
    assert fault.evidence().confirmed
    assert at_rest(line)


@pytest.mark.parametrize("kind", ["rpc-delay", "record-delay"])
def test_frames_held_back_are_lost_with_the_drives_supply(line, kind):
    fault = line.add(kind, params={"delay": "400ms"}, count=1)
    start_read(line)
    line.run(0.1)
    line.add("power-cycle", params={"off": "100ms"})
    line.run(1.0)
    assert fault.state == "ended"
    assert not fault.evidence().confirmed
    line.enable(10.0)
    assert at_rest(line)


def test_a_slow_application_says_that_it_works_on_the_call(line):
    line.add("record-delay", params={"delay": "4s"})
    start_read(line)
    line.run(3.0)
    assert not line.plc.records
    line.run(1.5)
    ((_, answer),) = line.plc.records
    assert answer.status.ok
    assert line.losses() == 0


def test_record_delay_leaves_connect_and_control_alone_and_rpc_delay_does_not():
    taken = {}
    for kind in ("record-delay", "rpc-delay"):
        line = FaultLine()
        line.add(kind, params={"delay": "250ms"})
        start = line.world.now
        line.connect(10.0)
        taken[kind] = (line.world.now - start) / 1e9
    # the answers to Connect and PrmEnd, right behind which ApplicationReady leaves
    assert taken["rpc-delay"] >= 0.5
    assert taken["record-delay"] < 0.1


def test_rpc_delay_changes_no_order(line):
    """Every datagram of a later call waits behind one that is held back."""
    line.add("rpc-delay", params={"delay": "100ms", "jitter": "300ms"}, probability=0.5, seed=1)
    for _ in range(5):
        timed_read(line)
    assert line.losses() == 0


def test_a_drive_whose_start_up_is_too_slow_never_connects_until_the_delay_is_cleared():
    line = FaultLine()
    fault = line.add("rpc-delay", params={"delay": "60s"})
    line.run(20.0)
    assert not line.plc.all_connected
    line.clear(fault.id)
    line.connect(20.0)
    assert at_rest(line)
