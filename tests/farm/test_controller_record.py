"""What the controller did, seen from the drive: start-up by phase, reaction bit by bit, punctuality."""

from __future__ import annotations

import pytest
from virtual_line import VirtualLine

from pnfarm.farm.controller_record import KEPT, ControllerRecord
from pnfarm.farm.controller_view import controller_view
from pnfarm.station.events import ConnectionOpened, ConnectionRefused, FaultRaised, FaultsCleared


def view(line: VirtualLine) -> dict:
    return controller_view(line.farm, line.farm.station("axis-01"), line.world.now)


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
    line.farm.stations[0].raise_fault("undervoltage", hold=False)
    line.run(0.5)
    assert view(line)["faults"][-1]["kind"] == "none"


@pytest.mark.parametrize(("model", "telegram"), [("moog-msd", 1), ("hiwin-e1", 3)])
def test_bits_have_the_names_of_the_drive_s_own_manual(model, telegram):
    line = running(model=model, telegram=telegram, cycle="4ms")
    station = line.farm.stations[0]
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
