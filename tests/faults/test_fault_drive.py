"""Faults of the drive and loads on it, as the controller sees them, and what users see of injections."""

import math

import pytest
from fault_line import FaultLine
from hand_line import HandLine

from pnfarm.errors import ConfigError
from pnfarm.faults.errors import InjectionError
from pnfarm.table.axis_codes import FASTEST_RPM

CYCLE = 0.016
FAULT, WARNING = 0x0008, 0x0080


def active_fault(line, index=0) -> int:
    return int(line.farm.columns.axis[index].faults.code[0]) & 0xFFFFFF


# -- drive


def test_f702_shows_in_zsw1_within_a_cycle_and_the_controller_brings_the_drive_back(line):
    fault = line.add("f702", as_="trip")
    line.run(2 * CYCLE)
    assert line.seen_zsw1() & FAULT
    assert active_fault(line) == 702
    assert fault.evidence().confirmed
    assert line.until(lambda: fault.state == "ended", 2.0)
    line.enable()
    assert not line.seen_zsw1() & FAULT
    assert line.losses() == 0, "the connection stays"


def test_f702_comes_again_after_each_acknowledgement_as_often_as_asked(line):
    fault = line.add("f702", count=3)
    assert line.until(lambda: fault.state == "ended", 5.0)
    assert fault.evidence().activations == 3
    assert line.farm.axes[0].fault_counts[702] == 3
    line.enable()
    line.run(1.0)
    assert line.farm.axes[0].fault_counts[702] == 3


def test_a_held_fault_cannot_be_acknowledged_before_it_is_cleared(line):
    fault = line.add("drive-fault", params={"fault": "encoder-error", "hold": True})
    line.run(3.0)
    assert active_fault(line) == 417
    assert line.seen_zsw1() & FAULT
    line.clear(fault.id)
    line.enable()
    assert active_fault(line) == 0


def test_a_fault_held_by_two_injections_ends_with_the_last(line):
    line.add("undervoltage", as_="one")
    line.add("undervoltage", as_="two")
    line.run(0.5)
    line.clear("one")
    line.run(2.0)
    assert active_fault(line) == 502
    line.clear("two")
    line.enable()


@pytest.mark.parametrize(
    ("kind", "number"), [("undervoltage", 502), ("encoder-error", 417), ("following-error", 439), ("sto", 602)]
)
def test_a_cause_raises_the_models_fault_for_so_long(line, kind, number):
    fault = line.add(kind, for_="1s")
    line.run(0.5)
    assert active_fault(line) == number
    line.run(0.6)
    assert fault.state == "ended"
    assert fault.evidence().confirmed
    line.enable()


@pytest.mark.parametrize(("side", "number"), [("positive", 107), ("negative", 108)])
def test_a_limit_switch_warns_and_the_drive_goes_on(line, side, number):
    fault = line.add("limit-switch", params={"side": side})
    line.run(2 * CYCLE)
    assert line.seen_zsw1() & WARNING
    assert int(line.farm.columns.axis[0].warnings.code) == number
    assert int(line.farm.columns.axis[0].machine.limit_switch) == {"negative": 1, "positive": 2}[side]
    assert line.plc.all_running
    assert fault.evidence().confirmed
    line.clear(fault.id)
    line.run(2 * CYCLE)
    assert not line.seen_zsw1() & WARNING
    assert int(line.farm.columns.axis[0].machine.limit_switch) == 0


def test_a_model_without_a_limit_warning_only_has_the_switch_set():
    line = FaultLine(model="hiwin-e1", telegram=3, cycle="1ms")
    line.enable()
    two = [line.add("limit-switch", params={"side": "negative"}) for _ in range(2)]
    line.run(0.01)
    assert int(line.farm.columns.axis[0].machine.limit_switch) == 1
    assert not line.seen_zsw1() & WARNING
    assert two[0].evidence().confirmed
    line.clear(two[0].id)
    line.run(0.01)
    assert int(line.farm.columns.axis[0].machine.limit_switch) == 1, "the other one still stands"
    line.clear(two[1].id)
    line.run(0.01)
    assert int(line.farm.columns.axis[0].machine.limit_switch) == 0


@pytest.mark.parametrize(
    ("kind", "params"),
    [
        ("limit-switch", {"side": "positive"}),
        ("not-ready", {"missing": "enable"}),
        ("digital-input", {"input": 1}),
        ("load", {"torque": 0.1}),
    ],
)
def test_a_fault_of_the_machine_is_confirmed_only_when_the_controller_was_told(kind, params):
    line = FaultLine(model="hiwin-e1", telegram=3, cycle="1ms")
    fault = line.add(kind, params=params)
    line.run(0.0005)
    assert (fault.evidence().activations, fault.evidence().confirmed) == (1, False)
    line.connect()
    line.run(0.1)
    assert fault.evidence().confirmed


def test_the_earlier_warning_shows_again_when_the_later_one_ends(line):
    line.add("drive-warning", params={"warning": 107}, as_="one")
    line.add("drive-warning", params={"warning": 108}, as_="two")
    line.run(0.1)
    assert int(line.farm.columns.axis[0].warnings.code) == 108
    line.clear("two")
    line.run(0.1)
    assert int(line.farm.columns.axis[0].warnings.code) == 107


def test_several_warnings_are_shown_together_and_all_are_back_after_a_power_cycle(line):
    store = line.farm.axes[0].store
    line.add("drive-warning", params={"warning": 107}, as_="one")
    line.add("limit-switch", params={"side": "negative"}, as_="two")
    line.add("drive-warning", params={"warning": 107}, as_="three")
    line.run(0.1)
    assert [store.get(f"DRV.WARNING{n}") for n in (1, 2, 3)] == [107, 108, 0]
    line.clear("one")
    line.add("power-cycle", params={"off": "100ms"})
    line.run(1.0)
    assert [store.get(f"DRV.WARNING{n}") for n in (1, 2, 3)] == [107, 108, 0], "the newest first, as before"
    line.clear("three")
    line.run(0.1)
    assert [store.get(f"DRV.WARNING{n}") for n in (1, 2, 3)] == [108, 0, 0]


def test_a_warning_is_back_after_a_boot_that_no_fault_made(line):
    store = line.farm.axes[0].store
    line.add("drive-warning", params={"warning": 107})
    line.run(0.1)
    line.farm.axes[0].station.power_cycle(line.world.now)
    line.run(1.0)
    assert store.get("DRV.WARNING1") == 107
    line.clear()
    line.run(0.1)
    assert store.get("DRV.WARNING1") == 0


def test_a_fault_that_the_model_does_not_have_is_refused_and_nothing_happens(line):
    with pytest.raises(ConfigError, match=r"axis-01: kollmorgen-akd-profinet has no fault '9999'|has no fault"):
        line.add("drive-fault", params={"fault": 9999})
    with pytest.raises(ConfigError, match="is a warning"):
        line.add("drive-fault", params={"fault": 107})
    with pytest.raises(ConfigError, match="is a fault"):
        line.add("drive-warning", params={"warning": 702})
    assert line.faults.list() == []


def test_a_fault_whose_drive_loses_its_supply_before_it_has_it_comes_when_the_supply_is_back(line):
    fault = line.add("drive-fault", params={"fault": 702})
    line.add("power-cycle", params={"off": "300ms"})
    line.run(0.2)
    assert fault.state == "active"
    assert line.until(lambda: line.farm.axes[0].fault_counts == {702: 1})
    assert line.until(lambda: fault.state == "ended", 10.0)
    assert line.farm.axes[0].fault_counts == {702: 1}


def test_a_power_cycle_boots_the_drive_and_the_controller_finds_it_again(line):
    fault = line.add("power-cycle", params={"off": "500ms"})
    assert not line.farm.axes[0].powered
    line.run(0.4)
    assert line.losses() == 1
    assert not line.farm.axes[0].powered
    line.run(0.2)
    assert line.farm.axes[0].powered
    assert fault.state == "ended"
    line.enable()
    assert line.events("axis-01").count("power off") == 1


def test_a_power_cycle_leaves_a_drive_off_that_a_user_has_switched_off(line):
    station = line.farm.axes[0].station
    station.switch(line.world.now, on=False)
    fault = line.add("power-cycle", params={"off": "200ms"})
    line.run(1.0)
    assert not station.powered
    assert fault.state == "ended"
    assert (fault.evidence().activations, fault.evidence().confirmed) == (0, False)
    station.switch(line.world.now, on=True)
    line.enable()


def test_a_drive_that_a_user_switches_off_during_a_power_cycle_stays_off(line):
    station = line.farm.axes[0].station
    fault = line.add("power-cycle", params={"off": "200ms"})
    line.run(0.1)
    assert not station.switch(line.world.now, on=False)
    line.run(1.0)
    assert (fault.state, station.powered) == ("ended", False)
    assert station.switch(line.world.now, on=True)
    line.enable()


def test_a_power_cycle_that_is_cleared_switches_on_at_once(line):
    fault = line.add("power-cycle", params={"off": "1h"})
    line.run(1.0)
    line.clear(fault.id)
    assert line.farm.axes[0].powered
    line.enable()


def test_a_second_power_cycle_waits_until_the_drive_is_connected_again(line):
    fault = line.add("power-cycle", params={"off": "200ms"}, count=2)
    assert line.until(lambda: fault.state == "ended", 5.0)
    assert line.losses() == 2
    line.enable()


@pytest.mark.parametrize("ends", ["by its time", "cleared"])
def test_a_held_fault_that_ends_while_a_user_has_the_drive_off_can_be_acknowledged_afterwards(line, ends):
    fault = line.add("f702", for_="1s")
    line.run(0.2)
    station = line.farm.axes[0].station
    station.switch(line.world.now, on=False)
    line.farm.settle(station, line.world.now)
    if ends == "cleared":
        line.clear(fault.id)
    line.run(1.0)
    assert fault.state == "ended"
    station.switch(line.world.now, on=True)
    line.farm.settle(station, line.world.now)
    line.enable(10.0)
    assert line.faults.drive("axis-01").in_force() == {}


def test_faults_that_begin_and_end_at_once_are_not_held_however_many_they_are(line):
    for number in (301, 302, 304, 439, 501, 502, 602, 702):
        line.add("drive-fault", params={"fault": number, "hold": True})
    line.clear()
    line.run(0.5)
    line.enable(10.0)
    assert line.faults.drive("axis-01").in_force() == {}


def test_a_fault_held_while_the_drive_is_off_is_there_when_it_comes_back(line):
    line.add("power-cycle", params={"off": "1s"})
    for _ in range(12):
        held = line.add("undervoltage")
        line.run(0.01)
        line.clear(held.id)
    held = line.add("undervoltage")
    line.run(3.0)
    assert active_fault(line) == 502
    line.clear(held.id)
    line.enable()


# -- the manager


def test_faults_are_listed_named_cleared_and_kept_with_their_evidence(line):
    first = line.add("iops-bad", as_="bad-data")
    second = line.add("loss", probability=0.01)
    assert [fault.id for fault in line.faults.list()] == ["bad-data", "fault-1"]
    assert second.spec.seed is not None
    with pytest.raises(ConfigError, match="an injection named 'bad-data' is in force"):
        line.add("iops-bad", as_="bad-data")
    with pytest.raises(ConfigError, match="there is no fault 'bad-dta', did you mean bad-data"):
        line.clear("bad-dta")
    line.run(0.1)
    assert line.faults.active() == {"iops-bad": 1, "loss": 1}
    line.clear("bad-data")
    assert line.faults.get("bad-data") is first
    seen = line.faults.get("bad-data").as_dict()
    assert seen["state"] == "ended"
    assert seen["evidence"]["activations"] > 0
    assert line.faults.activations()["iops-bad", "axis-01"] == seen["evidence"]["activations"]
    assert [fault.id for fault in line.clear()] == ["fault-1"]
    assert line.faults.active() == {}
    line.run(0.1)
    assert line.events("axis-01").count("fault injected") == 2
    assert line.events("axis-01").count("injected fault ended") == 2


def test_a_fault_on_one_of_many_drives_leaves_the_others_alone():
    line = FaultLine(3)
    line.connect()
    line.enable()
    fault = line.add("timeout", on="axis-02")
    line.run(2.0)
    assert fault.drives == ("axis-02",)
    assert [line.losses(index) for index in range(3)] == [0, 1, 0]
    assert [line.seen_zsw1(index) & 0x0004 for index in (0, 2)] == [4, 4]


def _turning(line):
    line.run(1.0)
    return line.farm.columns.axis[0]


def test_a_load_draws_current_and_goes_away_again(line):
    axis = _turning(line)
    before = float(axis.motor.current)
    fault = line.add("load", params={"torque": 1.0})
    line.run(0.5)
    assert float(axis.motor.current) - before == pytest.approx(
        1.0 / float(axis.motor.settings.torque_constant), rel=0.02
    )
    assert fault.evidence().confirmed
    line.clear(fault.id)
    line.run(0.5)
    assert float(axis.motor.current) == pytest.approx(before, abs=0.02)


def test_loads_add_up_and_each_takes_its_own_away(line):
    axis = _turning(line)
    line.add("load", params={"torque": 0.5, "inertia": 1e-4, "friction": 0.1}, as_="one")
    line.add("load", params={"torque": -0.25}, as_="two")
    assert (axis.load.settings.added_torque, axis.load.settings.added_inertia, axis.load.settings.added_friction) == (
        0.25,
        1e-4,
        0.1,
    )
    line.clear("one")
    assert (axis.load.settings.added_torque, axis.load.settings.added_inertia, axis.load.settings.added_friction) == (
        -0.25,
        0.0,
        0.0,
    )


def test_loads_that_are_gone_leave_exactly_nothing(line):
    axis = _turning(line)
    for name, share in (("one", 0.1), ("two", 0.2), ("three", 0.3)):
        line.add("load", params={"torque": share, "inertia": share * 1e-4, "friction": share}, as_=name)
    for name in ("one", "two", "three"):
        line.clear(name)
    assert (axis.load.settings.added_torque, axis.load.settings.added_inertia, axis.load.settings.added_friction) == (
        0.0,
        0.0,
        0.0,
    )


def test_a_stuck_axis_draws_the_peak_current_until_the_drive_trips_on_the_overload(line):
    axis = _turning(line)
    assert axis.motor.velocity != 0.0
    fault = line.add("stuck-axis")
    line.run(0.5)
    assert axis.motor.velocity == 0.0
    assert axis.motor.current == pytest.approx(axis.motor.settings.peak_current)
    assert line.seen_zsw1() & 0x0100 == 0, "the speed is not what it should be"
    line.run(20.0)
    assert line.farm.axes[0].fault_counts[524] > 0, "the drive has folded its current back"
    line.clear(fault.id)
    line.enable()


@pytest.mark.parametrize(
    ("params", "words"),
    [({"torque": "x"}, "number"), ({"inertia": -1.0}, "from 0"), ({"friction": float("nan")}, "from 0")],
)
def test_an_impossible_load_is_refused(line, params, words):
    with pytest.raises(ConfigError, match=words):
        line.add("load", params=params)


def test_a_drive_that_left_operation_unseen_and_waits_for_an_edge_is_enabled_again():
    line = FaultLine(model="moog-msd", cycle="4ms", watchdog=20)
    line.connect()
    line.enable()
    cable, supply = line.add("link-down"), line.add("not-ready")
    line.run(0.02)
    line.clear(supply.id)
    line.clear(cable.id)
    line.run(0.5)
    assert line.losses() == 0
    assert line.seen_zsw1() & 0x0007 == 0x0003, "switched on; P-0144 lets operation begin with an edge"
    line.enable(10.0)
    assert line.seen_zsw1() & 0x0004


def test_a_shaft_coasts_when_the_supply_goes_and_still_turns_when_it_is_back_soon():
    line = FaultLine(program="{kind: constant, speed_rpm: 1000}", load="{inertia: 1.0e-2, friction: 0, damping: 0.001}")
    line.enable()
    line.run(1.0)
    axis = line.farm.columns.axis[0]
    line.add("power-cycle", params={"off": "2s"})
    line.run(1.0)
    assert axis.motor.velocity == pytest.approx(1000 * math.exp(-0.1), rel=0.01), "inertia over damping is 10 s"
    assert (axis.motor.current, axis.motor.torque) == (0.0, 0.0)
    line.run(1.1)
    assert line.farm.axes[0].powered
    assert axis.motor.velocity == pytest.approx(1000 * math.exp(-0.21), rel=0.01)
    line.enable()
    line.run(1.0)
    assert axis.motor.velocity == pytest.approx(1000, rel=0.01), "operation takes it up as it turns"


class HandFaultLine(FaultLine, HandLine):
    """Control words by hand, and faults."""


def test_a_limit_switch_stops_an_axis_in_position_mode_in_its_direction_and_lets_it_back():
    """AKD PROFINET manual 5.8.1: HWLS.POSSTATE is bit 3 of DRIVE_INPUTS."""
    line = HandFaultLine(telegram=9, params="{DRV.OPMODE: 2}")
    mdi = {"SATZANW": 0x8000, "MDI_VELOCITY": 2**32 // 20, "MDI_ACC": 39, "MDI_DEC": 39, "MDI_MOD": 1}
    line.enable_axis(0x043F)
    line.send(0x0C3F)
    line.send(0x043F)
    line.send(0x047F, MDI_TARPOS=50 * 65536, **mdi, frames=20)
    fault = line.add("limit-switch", params={"side": "positive"})
    store = line.farm.axes[0].store
    assert line.send(0x043F, frames=20) & 0x6080 == 0x2080, "a warning, at rest, no task"
    assert (store.get("HWLS.POSSTATE"), store.get("DRIVE_INPUTS")) == (1, 0x48)
    held = line.place
    assert not line.send(0x047F, frames=10) & 0x1000, "no task in this direction"
    line.send(0x043F)
    assert line.send(0x047F, MDI_TARPOS=0) & 0x1000
    assert line.until(lambda: line.zsw1 & 0x0400)
    assert line.place < held
    line.clear(fault.id)
    line.run(0.1)
    assert store.get("HWLS.POSSTATE") == 0


@pytest.mark.parametrize("torque", [1e6, -1e6])
def test_a_load_that_outruns_every_brake_leaves_speed_and_place_numbers_and_the_farm_at_work(torque):
    line = FaultLine(load="{inertia: 1.0e-6, friction: 0, damping: 0}")
    line.connect()
    line.add("load", params={"torque": torque})
    line.run(20.0)
    axis = line.farm.columns.axis[0]
    assert abs(float(axis.motor.velocity)) == FASTEST_RPM
    assert abs(float(axis.motor.position)) < FASTEST_RPM
    line.clear()
    line.run(1.0)
    assert line.plc.all_connected


def test_a_load_beyond_all_machines_is_refused():
    line = FaultLine()
    with pytest.raises(InjectionError, match=r"params\.torque"):
        line.add("load", params={"torque": 1e9})
