"""Alarm storms, broken handshakes and the return of submodules, as the controller sees them."""

import pytest
from fault_line import FaultLine
from profinet_state import alarms, at_rest, iops, station

from pnfarm.protocols.profinet.wire.alarms.rta import RtaType, parse_rta
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, parse_ethernet


@pytest.fixture
def wire(line):
    """RTA-PDUs as they leave each end: (who, type)."""
    seen: list[tuple[str, str]] = []

    def listen(node, who):
        send = node.link.inner.send if who == "drive" else node.link.send

        def spy(port, data):
            frame = parse_ethernet(data)
            if frame.ethertype == ETHERTYPE_PROFINET and frame.payload[:2] in {b"\xfc\x01", b"\xfe\x01"}:
                seen.append((who, RtaType(parse_rta(frame.payload).type).name))
            send(port, data)

        (node.link.inner if who == "drive" else node.link).send = spy

    listen(line.farm, "drive")
    listen(line.plc, "plc")
    return seen


# -- storms


def test_a_storm_is_as_fast_as_the_controller_acknowledges_and_ends_with_its_count(line):
    fault = line.add("alarm-storm", count=50)
    line.run(0.2)
    assert fault.state == "ended"
    seen = fault.evidence()
    assert (seen.checks, seen.activations, seen.confirmed) == (50, 50, True)
    assert alarms(line) == ["process alarm on slot 1 subslot 0x0002"] * 50
    assert line.losses() == 0
    assert at_rest(line)


def test_a_storm_at_a_rate_goes_on_until_it_is_cleared(line):
    fault = line.add("alarm-storm", params={"interval": "50ms", "type": "status", "priority": "high", "subslot": 1})
    line.run(1.0)
    assert 20 <= len(alarms(line)) <= 21
    line.clear(fault.id)
    count = len(alarms(line))
    line.run(0.5)
    assert alarms(line) == ["status alarm on slot 1 subslot 0x0001"] * count
    (entry, *_) = [e for e in line.plc_log.entries("axis-01") if e.event == "alarm"]
    assert entry.data["priority"] == "high"


def test_the_alarms_of_a_storm_may_carry_a_channel_diagnosis(line):
    line.add("alarm-storm", params={"type": "diagnosis", "error": "wire-break"}, count=1)
    line.run(0.1)
    assert alarms(line) == ["diagnosis appears on slot 1 subslot 0x0002: wire break (fault, appears)"]
    (entry, *_) = [e for e in line.plc_log.entries("axis-01") if e.event == "alarm"]
    assert entry.data["priority"] == "low"


def test_a_storm_that_does_not_wait_fills_the_queue_and_counts_what_it_could_not_send(line):
    line.add("alarm-unacknowledged", params={"raise": False})
    fault = line.add("alarm-storm", params={"wait": False})
    line.run(0.2)
    seen = fault.evidence()
    # one under way, and as many as the channel's queue takes
    assert seen.activations == 33
    assert seen.checks > 150
    assert not seen.confirmed


@pytest.mark.parametrize("wait", [True, False])
@pytest.mark.parametrize(
    "said", ["pull", "plug", "plug-wrong-submodule", "controlled-by-supervisor", "released", "pull-module"]
)
def test_after_a_storm_of_submodule_alarms_the_drive_is_in_operation_again(line, said, wait):
    fault = line.add("alarm-storm", params={"type": said, "wait": wait, "interval": "200us"})
    line.run(0.02)
    assert fault.evidence().activations > 1
    line.clear(fault.id)
    line.run(1.0)
    assert not line.session().unusable
    assert (iops(line), line.plc.all_connected, line.losses()) == (0x80, True, 0)
    line.enable()
    assert at_rest(line)


def test_a_storm_about_a_submodule_that_is_really_missing_leaves_it_missing(line):
    missing = line.add("module-missing", params={"subslot": 1})
    storm = line.add("alarm-storm", params={"type": "plug", "subslot": 1}, count=3)
    line.run(1.0)
    assert storm.state == "ended"
    assert [subslot for _, _, subslot in line.session().unusable] == [1]
    line.clear(missing.id)
    line.run(1.0)
    assert not line.session().unusable


def test_a_storm_waits_for_a_connection_and_goes_on_with_the_next_one():
    line = FaultLine()
    fault = line.add("alarm-storm", params={"interval": "50ms"})
    line.run(0.005)
    line.connect()
    line.run(0.3)
    before = fault.evidence().activations
    assert before >= 5
    line.add("ar-abort")
    line.run(2.0)
    assert fault.evidence().activations > before + 10
    assert line.losses() == 1


# -- broken handshakes


def test_a_drive_that_never_acknowledges_lets_the_controller_repeat_its_alarm_ack_and_give_up(line, wire):
    fault = line.add("alarm-unacknowledged")
    assert line.until(lambda: line.losses() == 1, 2.0)
    assert "an AlarmAck was sent 4 times without a transport ACK" in line.session().measures.last_reason
    assert wire.count(("plc", "DATA")) == 4
    assert ("drive", "ACK") not in wire
    assert wire.count(("drive", "DATA")) == 1
    line.run(0.1)
    assert fault.state == "ended"
    assert fault.evidence().confirmed
    line.enable()
    assert line.losses() == 1
    assert at_rest(line)


def test_a_drive_that_repeats_its_alarm_ends_the_connection_itself(line, wire):
    fault = line.add("alarm-unacknowledged", params={"what": "repeat"})
    assert line.until(lambda: line.losses() == 1, 2.0)
    assert "alarm send not confirmed" in line.session().measures.last_reason
    assert wire.count(("drive", "DATA")) == 4
    assert wire.count(("drive", "ERR")) == 1
    assert ("drive", "ACK") in wire, "it takes the controller's AlarmAck"
    assert len(alarms(line)) == 1, "a repetition is no other alarm"
    line.run(0.1)
    assert fault.evidence().confirmed
    line.enable()
    assert at_rest(line)


def test_the_handshake_of_another_faults_alarm_breaks_when_none_is_raised(line):
    fault = line.add("alarm-unacknowledged", params={"raise": False})
    line.run(1.0)
    assert line.losses() == 0
    assert fault.state == "active"
    line.add("diagnosis")
    assert line.until(lambda: line.losses() == 1, 2.0)
    line.run(0.1)
    assert fault.state == "ended"
    assert fault.evidence().confirmed


def test_a_broken_handshake_heals_when_the_fault_is_cleared_in_time(line):
    fault = line.add("alarm-unacknowledged")
    line.run(0.15)
    line.clear(fault.id)
    line.run(1.0)
    assert line.losses() == 0
    assert "alarm acknowledged" in line.events("axis-01")
    assert at_rest(line)


def test_the_handshake_breaks_as_often_as_asked(line):
    fault = line.add("alarm-unacknowledged", params={"what": "repeat", "priority": "low"}, count=2)
    assert line.until(lambda: fault.state == "ended", 10.0)
    assert line.losses() == 2
    assert fault.evidence().activations == 2


# -- the return of submodules


def test_a_submodule_whose_iops_was_bad_is_told_to_return(line):
    line.add("iops-bad", for_="200ms")
    line.run(0.15)
    assert alarms(line) == []
    line.run(0.3)
    assert alarms(line) == ["submodule returns on slot 1 subslot 0x0002"]
    assert line.losses() == 0
    line.enable()
    assert at_rest(line)


def test_only_the_last_of_two_ends_is_a_return(line):
    line.add("iops-bad", as_="one")
    line.add("iops-bad", as_="two")
    line.run(0.1)
    line.clear("one")
    line.run(0.1)
    assert alarms(line) == []
    line.clear("two")
    line.run(0.1)
    assert alarms(line) == ["submodule returns on slot 1 subslot 0x0002"]


@pytest.mark.parametrize("loses", [True, False])
def test_no_return_is_reported_to_a_connection_that_never_saw_it_bad(line, loses):
    fault = line.add("iops-bad", **({} if loses else {"after_cycles": 1000}))
    line.run(0.1)
    if loses:
        line.add("power-cycle", params={"off": "100ms"})
        line.clear(fault.id)
    line.run(3.0)
    line.clear()
    line.run(0.2)
    assert alarms(line) == []


def test_a_missing_module_does_not_return_with_its_iops(line):
    bad = line.add("iops-bad")
    line.run(0.1)
    line.add("module-missing")
    line.clear(bad.id)
    assert iops(line) == 0x40
    assert alarms(line) == ["module pulled on slot 1"]
    assert station(line).powered
