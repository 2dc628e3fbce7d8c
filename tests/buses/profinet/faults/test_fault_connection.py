"""Injections into a PROFINET drive's connection and records, as the controller sees them."""

from fault_line import FaultLine
from profinet_state import API, read

from pnfarm.drives.profiles.profidrive.base_mode import ParameterAddress, ParameterRequest, emit_request
from pnfarm.protocols.profinet.errors import AccessError, RecordError

CYCLE = 0.016
FAULT, WARNING = 0x0008, 0x0080


# -- connection


def test_ar_abort_tells_the_controller_its_code(line):
    fault = line.add("ar-abort", params={"code": "ip-suite-changed"})
    line.run(CYCLE)
    assert line.losses() == 1
    assert "IP suite changed" in line.session().measures.last_reason
    assert fault.state == "ended"
    line.connect()
    line.run(2.0)
    assert line.losses() == 1


def test_ar_abort_ends_every_connection_while_it_lasts(line):
    fault = line.add("ar-abort", for_="2s")
    line.run(2.1)
    assert line.losses() >= 3
    assert fault.evidence().activations == line.losses()
    line.connect()


def test_connect_refuse_gives_its_codes_so_often_and_then_lets_the_controller_in():
    line = FaultLine()
    fault = line.add("connect-refuse", count=2, params={"code1": "cmdev", "code2": 1})
    assert line.until(lambda: line.session().measures.refusals == 1, 5.0)
    assert "CMDEV: resources (DB 81 3D 01)" in line.session().measures.last_reason
    line.connect()
    assert line.session().measures.refusals == 2
    assert fault.state == "ended"
    assert fault.evidence().confirmed


def test_of_two_refusals_each_has_its_own_end():
    line = FaultLine()
    line.add("connect-refuse", as_="one")
    line.add("connect-refuse", as_="two")
    line.run(2.0)
    line.clear("one")
    line.run(2.0)
    assert not line.plc.all_connected
    line.clear("two")
    line.connect()


def test_without_application_ready_the_start_up_waits_until_the_fault_is_cleared():
    line = FaultLine()
    fault = line.add("no-application-ready")
    line.run(3.0)
    assert line.session().state == "CONNECT"
    assert str(line.session().machine.state) == "W_ARDY"
    assert fault.evidence().activations == 1
    line.clear(fault.id)
    line.connect(0.5)
    assert line.session().measures.refusals == 0


def test_late_application_ready_is_late_by_its_delay_and_once_if_asked():
    line = FaultLine()
    fault = line.add("late-application-ready", params={"delay": "2s"}, count=1)
    start = line.world.now
    line.connect()
    assert 2e9 <= line.world.now - start < 2.4e9
    line.run(0.1)
    assert fault.state == "ended"
    line.add("ar-abort")
    line.run(0.1)
    start = line.world.now
    line.connect()
    assert line.world.now - start < 1e9


def test_application_ready_of_a_running_connection_is_not_held_back():
    line = FaultLine()
    line.add("late-application-ready", params={"delay": "2s"})
    line.connect()
    missing = line.add("module-missing")
    line.run(0.1)
    line.clear(missing.id)
    line.run(0.2)
    assert not line.session().unusable


def test_a_fault_that_ends_lets_its_own_connections_go_on_and_not_those_of_another_fault():
    line = FaultLine()
    line.add("no-application-ready", as_="other", count=1)
    line.run(1.0)
    line.add("no-application-ready", as_="later")
    line.clear("later")
    line.run(1.0)
    assert str(line.session().machine.state) == "W_ARDY"
    line.add("no-application-ready", as_="later")
    line.clear("other")
    line.connect(0.5)


def test_faults_of_the_connection_survive_a_reboot_of_the_drive(line):
    refuse = line.add("connect-refuse")
    record = line.add("record-error")
    busy = line.add("parameter-busy")
    line.farm.axes[0].station.power_cycle(line.world.now)
    line.farm.settle(line.farm.axes[0].station, line.world.now)
    line.run(3.0)
    assert not line.plc.all_connected
    assert refuse.evidence().activations >= 1
    line.clear(refuse.id)
    line.connect()
    assert read(line) == "module failure"
    line.clear(record.id)
    assert read(line) == "state conflict"
    line.clear(busy.id)
    assert read(line) == "answered"


# -- records


def test_record_error_refuses_the_drives_records_with_its_code_so_often(line):
    assert read(line) == "answered"
    fault = line.add("record-error", params={"code": "resource-busy"}, count=2)
    assert read(line) == "resource busy"
    assert fault.state == "ended"
    assert fault.evidence().activations == 2
    assert read(line) == "answered"


def test_parameter_busy_holds_the_response_back(line):
    fault = line.add("parameter-busy", count=1)
    assert read(line) == "state conflict"
    assert fault.state == "ended"
    assert fault.evidence().confirmed
    assert read(line) == "answered"


def test_the_latest_of_two_record_errors_holds(line):
    line.add("record-error", as_="one")
    line.add("record-error", params={"code": "resource-busy"}, as_="two")
    assert read(line) == "resource busy"
    line.clear("two")
    assert read(line) == "module failure"


def test_a_response_that_is_withheld_is_a_state_conflict_and_is_there_afterwards(line):
    """The hook is asked for responses that wait, and for no others."""
    records = line.farm.axes[0].device.kind.records
    (index, *_) = records.channels
    slot, asked = line.farm.axes[0].device.description.modules[0].slot, []
    (ar,) = line.farm.axes[0].device.cm.ars

    def withhold(now: int) -> bool:
        asked.append(now)
        return len(asked) == 1

    def read(now: int):
        return records.read(ar, API, slot, 1, index, 240, now)

    records.withhold = withhold
    assert read(5) == RecordError(AccessError.STATE_CONFLICT)
    assert asked == []
    request = emit_request(ParameterRequest(1, 1, 1, (ParameterAddress(922),)))
    assert records.write(ar, API, slot, 1, index, request, 6) is None
    assert read(7) == RecordError(AccessError.STATE_CONFLICT)
    assert isinstance(read(8), bytes)
    assert asked == [7, 8]
