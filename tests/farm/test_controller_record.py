"""What the controller did, seen from the drive: start-up by phase, reaction bit by bit, punctuality."""

from __future__ import annotations

import pytest
from virtual_line import VirtualLine

from pnfarm.farm.views.controller_record import KEPT, ControllerRecord
from pnfarm.farm.views.controller_view import controller_view
from pnfarm.station.events import (
    ConnectionEstablished,
    ConnectionLost,
    ConnectionOpened,
    ConnectionRefused,
    ConnectionReleased,
    FaultRaised,
    FaultsCleared,
    PowerLost,
    StartUpPhase,
    WatchdogExpired,
)


def view(line: VirtualLine) -> dict:
    return controller_view(line.farm, line.farm.axis("axis-01"), line.world.now)


def running(**options) -> VirtualLine:
    line = VirtualLine(1, **options)
    line.connect()
    line.enable()
    return line


def test_start_up_is_shown_by_phase():
    (start,) = view(running())["start_ups"]
    assert start["complete"]
    assert start["attempts"] == 1
    assert [*start["phases"]][-4:] == ["connect", "parameters", "ready", "data"]
    assert all(0 <= seconds < 2 for seconds in start["phases"].values())
    assert start["after_loss_seconds"] is None


def test_reconnect_after_a_loss_is_timed_from_the_loss():
    line = running()
    line.farm.injections.inject({"kind": "timeout", "on": "axis-01"}, line.world.now)
    line.run(1.0)
    line.enable(10.0)
    first, again = view(line)["start_ups"]
    assert first["after_loss_seconds"] is None
    assert 0.1 < again["after_loss_seconds"] < 3.0
    assert sum(again["phases"].values()) == pytest.approx(again["after_loss_seconds"])
    assert view(line)["connects"] == 2
    assert view(line)["attempts"] >= 2


def test_reaction_names_each_bit_of_stw1_that_changed_and_when():
    line = running()
    line.farm.injections.inject({"kind": "undervoltage", "on": "axis-01", "for": "100ms"}, line.world.now)
    line.run(3.0)
    (fault,) = view(line)["faults"]
    assert (fault["code"], fault["kind"]) == ("502", "undervoltage")
    bits = {bit["name"]: (bit["value"], bit["after_seconds"]) for bit in fault["stw1"]}
    assert bits["fault_acknowledge"][0] == 1
    # the program acknowledges 200 ms after the fault
    assert 0.19 < bits["fault_acknowledge"][1] < 0.4
    assert 0.0 < fault["reaction_seconds"] < 0.064
    assert bits["fault_acknowledge"][1] - 0.02 <= fault["acknowledged_seconds"] < 0.5


def test_fault_of_the_drive_s_own_is_not_said_to_be_injected():
    line = running()
    line.farm.axes[0].raise_fault("undervoltage", hold=False)
    line.run(0.5)
    assert view(line)["faults"][-1]["kind"] == "none"


@pytest.mark.parametrize(("model", "telegram"), [("moog-msd", 1), ("hiwin-e1", 3)])
def test_bits_have_the_names_of_the_drive_s_own_manual(model, telegram):
    line = running(model=model, telegram=telegram, cycle="4ms")
    station = line.farm.axes[0]
    station.raise_fault(next(iter(sorted(station.model.faults))), hold=False)
    line.run(1.0)
    names = station.model.profidrive.bit_names("STW1", telegram)
    bits = view(line)["faults"][-1]["stw1"]
    assert bits
    if names:
        assert {bit["name"] for bit in bits} <= {name or f"bit_{place}" for place, name in enumerate(names)}


def test_punctual_controller_has_no_jitter_and_misses_nothing():
    line = running()
    line.run(1.0)
    seen = view(line)
    assert seen["cycle_seconds"] == seen["intervals"]["mean_seconds"] == 0.016
    assert seen["jitter"]["mean_seconds"] == 0
    assert len(seen["jitter"]["buckets"]) == 1
    assert (seen["missed_updates"], seen["last_late_frame"]) == (0, None)
    assert seen["late_frames"] == seen["watchdog_expirations"] == {"controller": 0, "farm": 0}


def test_sign_of_life_is_shown_where_the_telegram_has_one():
    assert view(running())["sign_of_life"] is None
    line = running(model="hiwin-e1", telegram=3, cycle="4ms")
    line.run(1.0)
    assert view(line)["sign_of_life"]["errors"] == 0


def test_drive_without_a_controller_has_an_empty_record():
    seen = view(VirtualLine(1, controller=False))
    assert (seen["start_ups"], seen["faults"], seen["attempts"], seen["cycle_seconds"]) == ([], [], 0, None)
    assert seen["intervals"] == {"mean_seconds": None, "buckets": []}


def test_record_keeps_the_newest_situations_only():
    record = ControllerRecord()
    for turn in range(3 * KEPT):
        record.take(FaultRaised(702), turn * 10)
        record.take(FaultsCleared(5), turn * 10 + 5)
        record.take(ConnectionRefused(), turn * 10 + 6)
    record.take(ConnectionOpened(), 10_000)
    assert len(record.situations) == KEPT
    assert len(record.start_ups) == 1
    assert (record.start_ups[0].attempts, record.refused) == (3 * KEPT + 1, 3 * KEPT)


# -- start-ups of every kind -------------------------------------------------------------------------------------------


class Opened(ConnectionOpened):
    """A connection of a controller with a name."""

    peer = "b"


def start(record: ControllerRecord, connection: int, now: int, kind: type = ConnectionOpened) -> None:
    record.take(kind(connection=connection), now)
    record.take(StartUpPhase("parameters", connection), now + 1)
    record.take(StartUpPhase("ready", connection), now + 2)
    record.take(ConnectionEstablished(connection=connection), now + 3)


@pytest.mark.parametrize(
    ("model", "telegram", "cycle"),
    [("akd-profinet", 1, "16ms"), ("akd-profinet-2012", 1, "16ms"), ("hiwin-e1", 3, "4ms"), ("moog-msd", 1, "4ms")],
)
def test_every_model_shows_its_start_up_and_comes_back_after_a_power_cycle(model, telegram, cycle):
    line = running(model=model, telegram=telegram, cycle=cycle)
    lost = line.world.now
    line.farm.axes[0].station.power_cycle(line.world.now)
    assert line.world.run(60.0, until=lambda: line.farm.axes[0].device.connects == 2)
    first, again = view(line)["start_ups"]
    for one in (first, again):
        assert (one["complete"], one["controller"]) == (True, "plc")
        assert [*one["phases"]][-4:] == ["connect", "parameters", "ready", "data"]
        assert "identify" in one["phases"] or one is first
    assert again["after_loss_seconds"] == pytest.approx((line.world.now - lost) / 1e9, abs=0.002)
    assert all(seconds >= 0 for one in (first, again) for seconds in one["phases"].values())


def test_drive_without_an_address_is_looked_for_and_given_one():
    line = VirtualLine(1)
    station = line.farm.axes[0]
    station.device.addressing.set_address(None, None, line.world.now)
    station.device.dcp.address = None
    line.connect()
    (one,) = view(line)["start_ups"]
    assert [*one["phases"]] == ["address", "connect", "parameters", "ready", "data"]


def test_controller_that_looks_for_all_stations_has_looked_for_the_drive():
    record = VirtualLine(1, controller=False)
    (station,) = record.farm.axes
    record.run(5.0)
    looked = record.world.now
    station.device.connections.sought(looked, by_name=False)
    record.run(1.0)
    again = record.world.now
    station.device.connections.sought(again, by_name=False)
    station.device.connections.begins(again + 5)
    found = [entry for entry in record.log.entries("axis-01") if isinstance(entry.what, StartUpPhase)]
    assert [entry.now_ns for entry in found] == [looked, again]
    (one,) = record.farm.controllers.of("axis-01").start_ups
    assert one.phases == {"identify": again}
    # a scan does not hide that a controller asks for the name
    station.device.connections.sought(again + 10, by_name=True)
    station.device.connections.sought(again + 20, by_name=False)
    station.device.connections.begins(again + 30)
    assert one.phases == {"identify": again + 10}


def test_another_controller_that_is_refused_leaves_the_start_up_after_a_loss_alone():
    record = ControllerRecord()
    start(record, 1, 0)
    for turn in range(50):
        record.take(ConnectionRefused(), 100 + turn)
    record.take(StartUpPhase("address"), 160)
    record.take(WatchdogExpired(5, connection=1), 200)
    record.take(ConnectionLost(connection=1), 201)
    record.take(ConnectionRefused(), 210)
    start(record, 2, 300)
    first, again = record.start_ups
    assert (first.attempts, first.lost_ns) == (1, None)
    assert (again.attempts, again.lost_ns, again.phases["data"]) == (2, 200, 303)
    assert (record.attempts, record.refused) == (53, 51)


def test_connection_without_cyclic_data_is_no_loss_and_no_end():
    record = ControllerRecord()
    start(record, 1, 0)
    record.take(ConnectionLost(connection=9), 50)
    record.take(ConnectionLost(connection=1), 100)
    record.take(ConnectionReleased(connection=9), 110)
    start(record, 2, 200)
    assert record.start_ups[-1].lost_ns == 100


def test_two_controllers_of_one_drive_have_start_ups_of_their_own():
    record = ControllerRecord()
    record.take(StartUpPhase("identify"), 5)
    record.take(ConnectionOpened(connection=1), 10)
    record.take(Opened(connection=2), 20)
    record.take(StartUpPhase("parameters", 1), 30)
    record.take(StartUpPhase("parameters", 2), 31)
    record.take(ConnectionEstablished(connection=2), 40)
    record.take(ConnectionEstablished(connection=1), 50)
    one, other = record.start_ups
    assert one.phases == {"identify": 5, "connect": 10, "parameters": 30, "data": 50}
    assert (other.controller, other.phases) == ("b", {"connect": 20, "parameters": 31, "data": 40})
    # one of them is lost and comes back while the other goes on
    record.take(ConnectionLost(connection=2), 100)
    start(record, 3, 200, Opened)
    assert (record.start_ups[-1].lost_ns, record.start_ups[-1].controller) == (100, "b")
    record.take(ConnectionReleased(connection=3), 300)
    start(record, 4, 400, Opened)
    assert record.start_ups[-1].lost_ns is None


def test_attempt_that_fails_is_gone_on_from():
    record = ControllerRecord()
    record.take(StartUpPhase("identify"), 1)
    for attempt in range(3):
        record.take(ConnectionOpened(connection=attempt), 10 + attempt)
        record.take(StartUpPhase("parameters", attempt), 11 + attempt)
        record.take(ConnectionLost(connection=attempt), 12 + attempt)
    start(record, 3, 100)
    (one,) = record.start_ups
    assert (one.attempts, one.phases) == (
        4,
        {"identify": 1, "connect": 100, "parameters": 101, "ready": 102, "data": 103},
    )


def test_address_that_was_given_long_before_is_of_no_start_up():
    record = ControllerRecord()
    record.take(StartUpPhase("address"), 5)
    record.take(StartUpPhase("identify"), 3600 * 10**9)
    start(record, 1, 3600 * 10**9 + 50)
    (one,) = record.start_ups
    assert [*one.phases] == ["identify", "connect", "parameters", "ready", "data"]


def test_faults_before_a_power_cycle_are_not_those_after_it():
    line = running()
    station = line.farm.axes[0]
    station.raise_fault("undervoltage", hold=False)
    line.run(0.05)
    station.station.power_cycle(line.world.now)
    assert line.world.run(60.0, until=lambda: station.device.connects == 2)
    line.run(0.2)
    line.enable(60.0)
    raised = line.world.now
    station.raise_fault("undervoltage", hold=False)
    line.run(0.1)
    seen = view(line)["faults"]
    assert len(seen) == 2
    assert seen[-1]["seconds_ago"] == pytest.approx((line.world.now - raised) / 1e9, abs=0.005)
    assert 0 < seen[-1]["reaction_seconds"] < 0.064


def test_record_is_bounded_whatever_happens():
    record = ControllerRecord()
    for turn in range(10 * KEPT):
        kind = type("Named", (ConnectionOpened,), {"peer": f"plc-{turn}"})
        start(record, turn, turn * 100, kind)
        record.take(PowerLost(), turn * 100 + 50)
    assert len(record.start_ups) == len(record._lost) == KEPT
    assert not record._open


def test_drive_with_another_name_keeps_its_record():
    line = running()
    station = line.farm.axes[0]
    station.device.dcp.name = "renamed"
    line.run(0.2)
    assert view(line)["start_ups"][0]["complete"]
    assert view(line)["drive"] == "axis-01"


def test_a_master_that_is_refused_again_and_again_has_one_start_up_with_its_attempts():
    """On PROFIBUS each attempt begins with parameters that are taken; what refuses it is the configuration."""
    line = VirtualLine(1, model="moog-msd-dp")
    line.connect()
    line.run(0.5)
    (axis,) = line.farm.axes
    record = line.farm.controllers.of("axis-01")
    axis.device.slave.refuse_configuration = True
    axis.device.slave.leave()
    line.run(30.0)
    assert record.start_ups[-1].attempts > 50
    assert len(record.start_ups) == 2
    (visit,) = axis.station.visits
    assert len(visit.connections) <= 1
    axis.device.slave.refuse_configuration = False
    line.run(3.0)
    assert record.start_ups[-1].complete
    assert len(record.start_ups) == 2
    # another loss begins another one
    axis.device.slave.leave()
    line.run(3.0)
    assert [start.complete for start in record.start_ups] == [True] * 3
