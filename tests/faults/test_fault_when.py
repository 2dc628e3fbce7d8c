"""Injections that wait for a condition on their drive."""

from __future__ import annotations

import pytest
from fault_line import FaultLine, enabled_line
from storm import left_behind

from pnfarm.errors import ConfigError
from pnfarm.faults import manager
from pnfarm.faults.errors import InjectionError
from pnfarm.signals.conditions import bind

TICK = 1_000_000


def velocity(line: FaultLine, index: int = 0) -> float:
    return float(line.farm.columns.axis[index].motor.velocity)


def run_of(fault, drive: str = "axis-01"):
    return fault.runs[drive]


def accelerate(line: FaultLine, rpm: float = 1000.0, index: int = 0) -> None:
    line.plc.columns.program[index].speed = rpm


def test_it_begins_in_the_step_in_which_the_condition_holds_first(line):
    fault = line.add("f702", when="velocity > 300")
    line.run(0.5)
    assert fault.state == "waiting"
    shown = fault.as_dict()
    assert shown["spec"]["when"] == "velocity > 300"
    assert shown["drives"]["axis-01"]["waits_for"] == "velocity > 300"
    accelerate(line)
    before = None
    while fault.state == "waiting":
        before = velocity(line)
        line.run(0.001)
    run = run_of(fault)
    assert before <= 300, "the step before it did not hold"
    # in virtual time the event loop runs in the same step
    assert run.started_ns == run.held_ns
    assert fault.as_dict()["drives"]["axis-01"]["held_seconds"] == run.held_ns / 1e9
    assert line.faults.conditions_watched == 0, "nothing is watched any more"


def test_already_true_starts_at_once_and_the_end_of_the_condition_ends_nothing(line):
    fault = line.add("silence", when="zsw1.operation_enabled and not faulted")
    assert fault.state == "active"
    assert run_of(fault).held_ns == line.world.now
    line.run(1.0)
    assert line.farm.axes[0].handle.axis.faults.code[0], "the silence broke the connection"
    assert fault.state == "active"


def test_a_state_that_lasts_one_step_is_not_missed(line):
    fault = line.add("load", when="fault == 702")
    line.run(0.2)
    assert fault.state == "waiting"
    line.add("f702", count=1)
    line.run(0.05)
    assert fault.state == "active"


@pytest.mark.parametrize(
    "condition",
    [
        "state == S4",
        "state == 4",
        "S4 == state",
        "state != S1 and powered",
        "zsw1.operation_enabled",
        "zsw1.2",
        "stw1 != 0",
        "connected",
        "not (velocity > 5000 or faulted)",
        "fault == 0",
        'param("DRV.OPMODE") >= 0',
        "connects > 0 and velocity < 1e9",
        "velocity == velocity",
        "position <= position",
        "cycle < 1 s",
        "0 < bus_voltage",
    ],
)
def test_the_engine_and_the_event_loop_agree_on_a_condition(line, condition):
    fault = line.add("load", when=condition)
    assert fault.state == "active", "true now, as the event loop sees it"
    line.clear()
    fault = line.add("load", when=f"({condition}) and setpoint > 100")
    assert fault.state == "waiting"
    accelerate(line, 500.0)
    line.run(0.3)
    assert fault.state == "active", "as the engine sees it"
    line.clear()
    fault = line.add("load", when=f"not ({condition}) and setpoint > 100")
    line.run(0.3)
    assert fault.state == "waiting"


@pytest.mark.parametrize(
    ("condition", "holds"),
    [("faulted == 1", True), ("faulted != 1", False), ("not (faulted == true)", False), ("faulted == homed", False)],
)
def test_a_fault_compared_with_yes_or_no_is_not_taken_for_its_number(line, condition, holds):
    accelerate(line)
    line.run(1.0)
    line.add("drive-fault", params={"fault": 702, "hold": True})
    # the shaft slows down; between two velocities nothing happens that the event loop could see
    fault = line.add("load", when=f"({condition}) and velocity < 500 and velocity > 450")
    line.run(1.0)
    assert (fault.state == "active") is holds


@pytest.mark.parametrize(
    "condition",
    [
        "fault == 0",
        "not faulted",
        "faulted == false",
        "zsw1 == 0",
        "not zsw1.3",
        "stw1 == 0",
        "setpoint == 0",
        "not enabled",
        "bus_voltage == 0",
        'param("DRV.OPMODE") == 0',
    ],
)
def test_a_drive_without_its_supply_says_nothing(line, condition):
    """In the API it has no fault and no words either; the shaft turns on."""
    accelerate(line)
    line.run(1.0)
    line.add("drive-fault", params={"fault": 702, "hold": True})
    line.run(0.01)
    station = line.farm.axes[0].station
    assert bind(condition, line.farm.axes[0].model).holds(line.farm.axes[0], {}) is False
    station.switch(line.world.now, on=False)
    assert bind(condition, line.farm.axes[0].model).holds(line.farm.axes[0], {}) is True
    # between two velocities nothing happens that the event loop could see: it is the engine that finds it
    fault = line.add("silence", when=f"({condition}) and velocity < 500")
    assert fault.state == "waiting"
    line.run(5.0)
    assert fault.state == "active"


def test_it_waits_for_a_connection_and_for_a_parameter():
    line = FaultLine()
    connected = line.add("load", when="connected")
    written = line.add("load", when='param("DRV.OPMODE") == 77 or connects > 5', as_="by-parameter")
    line.run(0.001)
    assert (connected.state, written.state) == ("waiting", "waiting")
    line.connect()
    assert connected.state == "active"
    assert written.state == "waiting"
    line.clear()
    station = line.farm.axes[0]
    before = int(station.store.get("DRV.OPMODE"))
    written = line.add("load", when=f'param("DRV.OPMODE") != {before}')
    line.run(0.1)
    assert written.state == "waiting"
    station.store.set("DRV.OPMODE", before - 1 if before else 1)
    line.farm.settle(station.station, line.world.now)
    line.run(0.001)
    assert written.state == "active"


def test_a_condition_that_reads_what_only_the_event_loop_knows_goes_on_with_what_the_engine_knows(line):
    # yes for the event loop from the start, for the engine from the set point on
    fault = line.add("load", when="connects == 1 and setpoint > 100")
    line.run(0.1)
    assert fault.state == "waiting"
    assert line.faults.conditions_watched == 1
    accelerate(line, 500.0)
    line.run(0.2)
    assert fault.state == "active"


def test_after_and_healthy_cycles_count_from_the_condition(line):
    fault = line.add("load", when="setpoint > 100", after="200ms")
    cycles = line.add("load", when="setpoint > 100", after_cycles=50)
    line.run(1.0)
    accelerate(line, 500.0)
    assert line.until(lambda: fault.state == "active", 1.0)
    run = run_of(fault)
    assert run.started_ns - run.held_ns == 200 * TICK
    assert line.until(lambda: cycles.state == "active", 2.0)
    other = run_of(cycles)
    cycle = line.farm.axes[0].device.connection().cycle_ns
    assert 49 * cycle <= other.started_ns - other.held_ns <= 52 * cycle
    line.clear()
    # the condition started it; that it ended meanwhile does not matter
    fault = line.add("load", when="setpoint > 100", after="300ms")
    accelerate(line, 0.0)
    line.run(0.1)
    assert fault.state == "waiting"
    assert fault.as_dict()["drives"]["axis-01"]["waits_for"] == "300ms"
    line.run(0.3)
    assert fault.state == "active"


def test_each_drive_waits_for_itself():
    line = FaultLine(2)
    line.connect()
    line.enable()
    fault = line.add("load", when="setpoint > 100")
    accelerate(line, 500.0, 1)
    line.run(0.5)
    assert (run_of(fault, "axis-01").state, run_of(fault, "axis-02").state) == ("waiting", "active")
    assert fault.state == "active"
    line.clear()
    assert line.faults.conditions_watched == 0


def test_with_a_rate_every_start_waits_for_the_condition(line):
    fault = line.add("load", rate="100/s", for_="1ms", when="setpoint > 100", seed=3)
    line.run(1.0)
    run = run_of(fault)
    assert run.starts == 0
    assert fault.as_dict()["drives"]["axis-01"]["waits_for"] == "setpoint > 100"
    accelerate(line, 500.0)
    line.run(1.0)
    starts = run.starts
    assert starts > 50
    accelerate(line, 0.0)
    line.run(0.1)
    starts = run.starts
    line.run(1.0)
    assert run.starts == starts, "no start while the condition does not hold"


def test_count_and_time_end_it_and_a_second_condition_can_wait_meanwhile(line):
    short = line.add("drop-cycles", when="setpoint > 100", count=2)
    long = line.add("load", when="setpoint > 100", for_="100ms")
    accelerate(line, 500.0)
    line.run(1.0)
    assert (run_of(short).reason, run_of(long).reason) == ("count", "time")
    assert short.evidence().activations == 2
    assert run_of(long).ended_ns - run_of(long).started_ns == 100 * TICK


def test_waiting_ones_end_by_clear_reset_and_time_to_live_and_leave_nothing(line):
    line.add("load", when="velocity > 9000", as_="one")
    line.add("silence", when="velocity > 9000", as_="two")
    lapsed = line.add("iops-bad", when="velocity > 9000", ttl="200ms")
    assert line.faults.conditions_watched == 3
    line.clear("one")
    assert line.faults.conditions_watched == 2
    line.run(0.3)
    assert (lapsed.state, run_of(lapsed).reason) == ("ended", "ttl")
    cleared = line.clear()
    assert [fault.id for fault in cleared] == ["two"]
    assert run_of(cleared[0]).reason == "cleared"
    assert line.faults.conditions_watched == 0
    assert int(line.farm.columns.engine[0].condition_rows) == 0
    assert left_behind(line) == {}


def test_it_goes_on_waiting_over_a_power_cycle_and_a_lost_connection(line):
    fault = line.add("load", when="velocity > 300")
    line.add("silence", for_="1s")
    line.run(3.0)
    station = line.farm.axes[0]
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(1.0)
    assert fault.state == "waiting"
    line.connect(20.0)
    line.enable(20.0)
    assert fault.state == "waiting"
    accelerate(line)
    line.run(2.0)
    assert fault.state == "active"


def test_power_off_is_a_condition_too(line):
    fault = line.add("load", when="state == off")
    other = line.add("load", when="not powered or state == boot")
    line.add("power-cycle")
    line.run(2.0)
    assert (fault.state, other.state) == ("active", "active")


@pytest.mark.parametrize(
    ("when", "expected"),
    [
        ("velocty > 3", "did you mean velocity"),
        ("zsw1.operation_enable", "did you mean"),
        ("velocity >", "ends where a name or a value is needed"),
        ("", "is empty"),
        ("velocity", "velocity is no yes or no"),
        ("velocity > 3 bananas", "not measured in bananas"),
        ("1 == 1", "compares two values"),
        ('param("DRV.OPMODES") == 1', "has no parameter"),
        ('param("DRV.OPMODE.1") == 1', "has no parameter"),
        ("p947.64 == 1", "has no signal"),
        ("state == S9", "never"),
        ("fault == 99999", "has no fault"),
        ("a" * 1001, "characters"),
        ("__import__('os')", "cannot be called"),
        (5, "is 5"),
        (["connected"], "is "),
    ],
)
def test_a_condition_that_makes_no_sense_is_refused_at_once_with_what_is_allowed(line, when, expected):
    with pytest.raises(InjectionError, match=r"fault\.when: ") as caught:
        line.add("load", when=when)
    assert expected in str(caught.value)
    assert left_behind(line) == {}


def test_a_dry_run_says_which_drives_do_not_understand_the_condition(line):
    reach = line.faults.reach({"kind": "load", "on": "all", "when": "velocty > 3"})
    assert reach.drives == ()
    assert "did you mean velocity" in reach.cannot["axis-01"]
    with pytest.raises(InjectionError, match=r"fault\.when"):
        line.faults.reach({"kind": "load", "on": "all", "when": "velocity >"})


def test_many_conditions_that_never_hold_come_and_go_and_too_many_are_refused(line, monkeypatch):
    monkeypatch.setattr(manager, "MOST_INJECTIONS", 300)
    for _ in range(3):
        for number in range(300):
            line.add("load", when=f"velocity > {9000 + number}" + " and setpoint > 1" * (number % 3))
        with pytest.raises(ConfigError, match="the maximum: clear some"):
            line.add("load")
        line.run(0.01)
        line.clear()
    assert left_behind(line) == {}
    fault = line.add("load", when="setpoint > 100")
    accelerate(line, 500.0)
    line.run(0.2)
    assert fault.state == "active", "rows that are used again report their own condition"


def test_the_seed_repeats_a_run_with_a_condition():
    def starts() -> list[int]:
        line = enabled_line()
        line.add("loss", when="velocity > 200", probability=0.2, seed=4, for_="1s")
        accelerate(line)
        line.run(2.0)
        return [entry.now_ns for entry in line.log.entries("axis-01")]

    assert starts() == starts()
