"""Faults of modules and diagnosis, as the controller sees them; and that whatever was in force leaves no trace."""

import pytest
from fault_line import FaultLine
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from profinet_state import alarms, at_rest, iops, station

from pnfarm.buses.profinet.device.modules import plug_module, pull_module
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.wire.records.pdev import PortDataCheck
from pnfarm.protocols.profinet.wire.records.pdev_port import CheckLinkState, LinkStateLink
from pnfarm.table.channel import STATUS_GOOD, STATUS_NO_PROBLEM

CYCLE = 0.016
BAD, GOOD = 0x40, 0x80


def data_status(line) -> int:
    line.run(3 * CYCLE)
    return int(line.input_row().data_status)


def diff(line):
    """The ModuleDiffBlock of the connection: (slot, module ident, {subslot: state})."""
    (ar,) = station(line).device.cm.ars
    blocks = ar.module_diff.apis if ar.module_diff else ()
    return [(m.slot, m.module_ident, {s.subslot: s.state for s in m.submodules}) for a in blocks for m in a.modules]


def reconnect(line):
    """The built-in controller parametrises what was plugged with its next connection."""
    line.add("ar-abort")
    line.run(0.1)
    line.enable()


# -- modules


def test_a_missing_module_raises_an_alarm_its_data_are_bad_and_its_return_is_reported(line):
    fault = line.add("module-missing")
    assert iops(line) == BAD
    assert alarms(line) == ["module pulled on slot 1"]
    assert fault.evidence().confirmed
    assert line.losses() == 0
    line.clear(fault.id)
    line.run(0.1)
    assert alarms(line)[1:] == [
        "submodule plugged on slot 1 subslot 0x0001",
        "submodule plugged on slot 1 subslot 0x0002",
    ]
    reconnect(line)
    assert iops(line) == GOOD
    assert diff(line) == []
    assert at_rest(line)


def test_a_missing_submodule_leaves_the_other_one_there(line):
    fault = line.add("module-missing", params={"slot": 1, "subslot": 2}, for_="500ms")
    line.run(0.1)
    assert alarms(line) == ["submodule pulled on slot 1 subslot 0x0002"]
    assert [(slot, list(subs)) for slot, _, subs in diff(line)] == [(1, [2])]
    line.run(0.5)
    assert fault.state == "ended"
    assert alarms(line)[1:] == ["submodule plugged on slot 1 subslot 0x0002"]
    assert at_rest(line)


def test_a_module_that_is_missing_from_the_start_is_in_the_module_diff_and_comes_back_as_the_controller_expects_it():
    line = FaultLine(telegram=9)
    fault = line.add("module-missing")
    line.run(0.01)
    assert not fault.evidence().confirmed
    assert line.until(lambda: line.session().state == "DATA")
    line.run(0.1)
    assert diff(line) == [(1, 0, {})]
    assert fault.evidence().confirmed
    assert alarms(line) == []
    line.clear(fault.id)
    line.run(0.1)
    assert "submodule plugged on slot 1 subslot 0x0002" in alarms(line)
    assert station(line).store.telegram_number == 9
    reconnect(line)
    assert iops(line) == GOOD


def test_a_wrong_module_has_an_ident_that_the_drive_does_not_know(line):
    fault = line.add("module-wrong")
    line.run(0.1)
    ((slot, ident, subs),) = diff(line)
    assert (slot, sorted(subs)) == (1, [1, 2])
    assert station(line).model.profidrive.telegram_by_module(ident) is None
    assert alarms(line) == [f"wrong submodule plugged on slot 1 subslot 0x000{n}" for n in (1, 2)]
    assert fault.evidence().confirmed
    line.clear(fault.id)
    reconnect(line)
    assert at_rest(line)


@pytest.mark.parametrize(("params", "ident"), [({"telegram": 9}, None), ({"ident": 0x1234}, 0x1234)])
def test_the_wrong_module_may_be_another_telegrams_or_of_any_ident(line, params, ident):
    line.add("module-wrong", params=params)
    line.run(0.1)
    wanted = ident or station(line).model.profidrive.telegrams[9].module.ident
    assert [(slot, found) for slot, found, _ in diff(line)] == [(1, wanted)]


def test_a_submodule_can_be_wrong_in_a_proper_module(line):
    fault = line.add("module-wrong", params={"subslot": 2, "ident": 0xABCD})
    line.run(0.1)
    assert [(slot, list(subs)) for slot, _, subs in diff(line)] == [(1, [2])]
    assert alarms(line) == ["wrong submodule plugged on slot 1 subslot 0x0002"]
    line.clear(fault.id)
    line.run(0.1)
    assert at_rest(line)


def test_a_substitute_works_and_is_reported_at_connect(line):
    fault = line.add("module-wrong", params={"ident": 0x1234, "substitute": True})
    assert iops(line) == GOOD
    assert alarms(line) == []
    assert not fault.evidence().confirmed
    reconnect(line)
    assert fault.evidence().confirmed
    assert [(slot, ident) for slot, ident, _ in diff(line)] == [(1, 0x1234)]
    assert iops(line) == GOOD


def test_of_two_module_faults_the_latest_holds_and_each_has_its_own_end(line):
    line.add("module-missing", params={"subslot": 2}, as_="sub")
    line.add("module-wrong", params={"ident": 0x77}, as_="wrong")
    line.run(0.1)
    assert [(slot, ident) for slot, ident, _ in diff(line)] == [(1, 0x77)]
    line.clear("sub")
    line.run(0.1)
    assert sorted(diff(line)[0][2]) == [1, 2]
    line.add("module-missing", as_="all")
    line.clear("wrong")
    line.run(0.1)
    assert diff(line) == [(1, 0, {})]
    line.clear("all")
    line.run(0.1)
    assert at_rest(line)


def test_a_reboot_keeps_a_module_fault_in_force_and_its_end_undoes_it(line):
    fault = line.add("module-missing")
    line.add("power-cycle", params={"off": "300ms"})
    line.run(3.0)
    assert diff(line) == [(1, 0, {})]
    line.clear(fault.id)
    reconnect(line)
    assert at_rest(line)


def test_what_hands_plugged_meanwhile_stays_when_the_fault_ends(line):
    fault = line.add("module-missing")
    plug_module(station(line).device, 1, line.world.now, ident=0x99)
    line.clear(fault.id)
    line.run(0.1)
    assert station(line).device.cm.plugged.module(1).module_ident == 0x99
    plug_module(station(line).device, 1, line.world.now)
    assert at_rest(line)


def test_what_hands_pulled_before_is_still_out_when_the_fault_ends(line):
    pull_module(station(line).device, 1, None, line.world.now)
    fault = line.add("module-wrong")
    line.run(0.1)
    line.clear(fault.id)
    line.run(0.1)
    assert station(line).device.cm.plugged.module(1) is None
    plug_module(station(line).device, 1, line.world.now)
    assert at_rest(line)


@pytest.mark.parametrize("place", [{}, {"subslot": 2}])
def test_a_wrong_module_is_found_where_the_drive_has_the_highest_ident(place):
    line = FaultLine(identity="{telegrams: {1: {module: 0xFFFFFFFF, submodule: 0xFFFFFFFF}}}")
    line.connect()
    fault = line.add("module-wrong", params=place)
    line.run(0.1)
    assert fault.evidence().confirmed
    line.clear(fault.id)
    reconnect(line)
    assert at_rest(line)


@pytest.mark.parametrize(
    ("kind", "params", "told"),
    [
        ("module-missing", {"slot": 0}, "fault.params.slot: slot 0 of axis-01 holds the access point"),
        ("module-missing", {"slot": 7}, "fault.params.slot: axis-01 has no slot 7; allowed: 0, 1"),
        ("module-missing", {"subslot": 9}, "fault.params.subslot: slot 1 of axis-01 has no subslot 0x0009; allowed: "),
        ("module-wrong", {"telegram": 4711}, "fault.params.telegram: akd-profinet has no telegram 4711"),
        ("module-wrong", {"telegram": 1, "ident": 5}, "fault.params.ident: is given together"),
        ("module-wrong", {"telegram": 1, "subslot": 2}, "fault.params.telegram: is of a whole module"),
        ("module-wrong", {"substitute": True, "subslot": 2}, "fault.params.substitute: is of a whole module"),
        ("diagnosis", {"severity": "advice"}, "fault.params.severity: is 'advice'; allowed: with `coding` qualified"),
        ("diagnosis", {"ext": 5}, "fault.params: USI 0x8000 has no extended error type"),
        (
            "diagnosis",
            {"coding": "manufacturer", "severity": "maintenance-required"},
            "fault.params.severity: is 'maintenance-required'; allowed: fault",
        ),
        ("alarm-storm", {"interval": "1us"}, "fault.params.interval: is '1us'; allowed: a duration from 100us"),
        ("alarm-storm", {"slot": 3}, "fault.params.slot: axis-01 has no slot 3"),
    ],
)
def test_what_a_drive_cannot_do_is_refused_and_changes_nothing(line, kind, params, told):
    with pytest.raises(ConfigError) as caught:
        line.add(kind, params=params)
    assert str(caught.value).startswith(told)
    assert line.faults.list() == []
    assert at_rest(line)


# -- diagnosis


@pytest.mark.parametrize(
    ("params", "told"),
    [
        ({}, "error (fault, appears)"),
        (
            {"error": "wire-break", "channel": 3, "severity": "maintenance-required"},
            "channel 3 wire break (maintenance required, appears)",
        ),
        ({"error": "feedback"}, "feedback (fault, appears)"),
        (
            {"coding": "extended", "error": "remote-mismatch", "ext": "no-peer-detected", "add-value": 7},
            "remote mismatch: no peer detected (fault, value 0x7, appears)",
        ),
        (
            {"coding": "qualified", "error": 0x10, "severity": "maintenance-demanded"},
            "parametrisation fault (qualified, appears)",
        ),
        ({"coding": "manufacturer", "usi": 0x42, "data": "0a1bff"}, "USI 0x0042 0A 1BFF"),
    ],
)
def test_a_diagnosis_appears_with_the_fault_and_disappears_with_it(line, params, told):
    fault = line.add("diagnosis", params=params)
    line.run(0.1)
    (seen,) = alarms(line)
    assert seen.endswith(told)
    assert " on slot 1 subslot 0x0002" in seen
    assert fault.evidence().confirmed
    line.clear(fault.id)
    line.run(0.1)
    assert len(alarms(line)) == 2
    assert line.losses() == 0
    assert at_rest(line)


def test_a_fault_shows_as_a_problem_in_the_data_status_and_maintenance_does_not(line):
    line.add("diagnosis", params={"severity": "maintenance-demanded"}, as_="soon")
    assert data_status(line) == STATUS_GOOD
    fault = line.add("diagnosis", params={"slot": 0, "subslot": 1, "error": 1}, as_="now")
    assert data_status(line) == STATUS_GOOD & ~STATUS_NO_PROBLEM
    reconnect(line)
    assert data_status(line) == STATUS_GOOD & ~STATUS_NO_PROBLEM
    line.clear(fault.id)
    assert data_status(line) == STATUS_GOOD


def test_a_problem_goes_with_its_submodule(line):
    ill = line.add("diagnosis")
    out = line.add("module-missing")
    assert data_status(line) == STATUS_GOOD
    line.clear(ill.id)
    line.clear(out.id)
    assert data_status(line) == STATUS_GOOD
    line.add("diagnosis")
    assert data_status(line) == STATUS_GOOD & ~STATUS_NO_PROBLEM


def test_a_diagnosis_that_is_there_at_connect_is_in_the_module_diff():
    early = FaultLine()
    fault = early.add("diagnosis")
    early.run(0.01)
    assert not fault.evidence().confirmed
    early.connect()
    early.run(0.1)
    assert fault.evidence().confirmed
    assert [(slot, list(subs)) for slot, _, subs in diff(early)] == [(1, [2])]


def test_two_diagnoses_are_confirmed_each_by_its_own_alarm(line):
    first = line.add("diagnosis", params={"error": 1})
    second = line.add("diagnosis", params={"error": 2})
    line.run(0.1)
    assert first.evidence().confirmed
    assert second.evidence().confirmed
    third = line.add("diagnosis", params={"error": 3})
    assert not third.evidence().confirmed
    line.clear(first.id)
    line.clear(second.id)
    line.run(0.1)
    assert third.evidence().confirmed
    assert [entry.error_type for entry in station(line).device.cm.diagnosis] == [3]


def test_of_two_diagnoses_with_one_key_the_latest_holds_and_the_earlier_comes_back(line):
    line.add("diagnosis", as_="one")
    line.add("diagnosis", params={"severity": "maintenance-required"}, as_="two")
    line.add("diagnosis", params={"severity": "maintenance-required"}, as_="three")

    def severities():
        return [entry.maintenance.name for entry in station(line).device.cm.diagnosis]

    assert severities() == ["REQUIRED"]
    line.clear("two")
    assert severities() == ["REQUIRED"]
    line.clear("three")
    assert severities() == ["FAULT"]
    line.clear("one")
    assert severities() == []
    line.run(0.1)
    assert at_rest(line)


def test_a_drives_own_diagnosis_is_there_again_when_a_fault_with_its_key_ends():
    line = FaultLine(model="moog-msd", cycle="1ms", watchdog=100, params="{P-1256: 3}")
    line.connect()
    line.add("drive-fault", params={"fault": "11-1"})
    line.run(0.1)
    (own,) = station(line).device.cm.diagnosis
    fault = line.add("diagnosis", params={"coding": "manufacturer", "usi": own.usi, "data": "01"})
    assert [entry.data for entry in station(line).device.cm.diagnosis] == [b"\1"]
    line.clear(fault.id)
    assert list(station(line).device.cm.diagnosis) == [own]
    assert data_status(line) == STATUS_GOOD & ~STATUS_NO_PROBLEM


def test_a_failed_port_check_is_reported_again_when_a_fault_with_its_key_ends(line):
    device, now = station(line).device, line.world.now
    check = PortDataCheck(0, 0x8001, (CheckLinkState(0, LinkStateLink.DOWN),))
    assert device.neighbours.pdev.write(None, 0, 0, 0x8001, 0x802B, check.emit(), now) is None
    line.farm.settle(station(line).station, now)
    (own,) = device.cm.diagnosis
    place = {"slot": own.slot, "subslot": own.subslot, "error": own.error_type, "ext": own.ext_error_type}
    fault = line.add("diagnosis", params={**place, "coding": "extended"})
    line.clear(fault.id)
    assert list(device.cm.diagnosis) == [own]


def test_a_diagnosis_goes_with_its_submodule_and_comes_back_with_it(line):
    line.add("diagnosis", as_="ill")
    line.add("module-missing", as_="out")
    assert len(station(line).device.cm.diagnosis) == 0
    line.clear("out")
    assert len(station(line).device.cm.diagnosis) == 1
    line.run(0.1)
    assert alarms(line)[-1].startswith("diagnosis appears")
    line.add("module-missing", as_="out")
    later = line.add("diagnosis", params={"error": 5})
    line.run(0.1)
    assert not later.evidence().confirmed
    reconnect_count = line.losses()
    line.add("ar-abort")
    line.run(2.0)
    assert line.losses() > reconnect_count
    assert not later.evidence().confirmed, "a missing module is no proof of a diagnosis"
    line.clear("out")
    line.run(0.1)
    assert later.evidence().confirmed
    line.clear()
    line.run(0.1)
    assert at_rest(line)


def test_a_diagnosis_outlives_a_reboot_as_long_as_its_fault_is_in_force(line):
    fault = line.add("diagnosis")
    line.add("power-cycle", params={"off": "300ms"})
    line.run(3.0)
    assert [(slot, list(subs)) for slot, _, subs in diff(line)] == [(1, [2])]
    line.clear(fault.id)
    line.run(0.1)
    assert at_rest(line)


def test_a_drive_with_as_many_diagnoses_as_it_holds_takes_no_more(line):
    for error in range(1, station(line).device.cm.diagnosis.maximum + 1):
        line.add("diagnosis", params={"error": error})
    with pytest.raises(ConfigError, match="axis-01 holds 64 diagnoses, its maximum"):
        line.add("diagnosis", params={"error": 100})
    line.add("diagnosis", params={"error": 1, "severity": "maintenance-required"})
    assert line.clear()
    line.run(1.0)
    assert at_rest(line)


# -- whatever was in force


def test_a_farm_that_was_killed_comes_back_without_its_faults(line):
    line.add("module-missing")
    line.add("diagnosis", params={"slot": 0, "subslot": 1})
    line.add("rpc-delay")
    line.run(0.2)
    again = FaultLine(memory=line.memory)
    again.connect()
    again.enable()
    assert diff(again) == []
    assert at_rest(again)


STEPS = st.lists(
    st.one_of(
        st.tuples(
            st.sampled_from(
                [
                    ("module-missing", {}),
                    ("module-missing", {"subslot": 2}),
                    ("module-wrong", {}),
                    ("module-wrong", {"telegram": 9}),
                    ("module-wrong", {"subslot": 1}),
                    ("diagnosis", {}),
                    ("diagnosis", {"severity": "maintenance-required"}),
                    ("alarm-storm", {"interval": "20ms"}),
                    ("alarm-storm", {"wait": False, "interval": "50ms", "type": "status"}),
                    ("alarm-unacknowledged", {"what": "repeat"}),
                    ("iops-bad", {}),
                    ("rpc-delay", {"delay": "150ms", "jitter": "30ms"}),
                    ("record-delay", {}),
                    ("watchdog-expire", {}),
                    ("power-cycle", {"off": "100ms"}),
                ]
            )
        ),
        st.tuples(st.just("clear"), st.integers(0, 20)),
        st.tuples(st.just("reboot")),
        st.tuples(st.just("run"), st.sampled_from([0.005, 0.05, 0.4])),
    ),
    max_size=12,
)


@settings(max_examples=12, suppress_health_check=[HealthCheck.too_slow])
@given(STEPS)
def test_any_faults_in_any_order_with_reboots_between_leave_nothing_behind(steps):
    line = FaultLine()
    line.connect()
    for step in steps:
        match step:
            case ("clear", index):
                standing = line.faults.list()
                if standing:
                    line.clear(standing[index % len(standing)].id)
            case ("reboot",):
                if station(line).powered:
                    station(line).station.power_cycle(line.world.now)
            case ("run", seconds):
                line.run(seconds)
            case ((kind, params),):
                line.add(kind, params=params)
    line.clear()
    line.run(0.5)
    assert at_rest(line)
    reconnect(line)
    line.enable(10.0)
    assert diff(line) == []
