"""The ring of the engine's events: what it lost, and events of a row that another connection has by now."""

from __future__ import annotations

from pathlib import Path

from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller.session import SessionState
from pnfarm.station.events import FaultRaised
from pnfarm.table.channel import W_START
from pnfarm.table.engine_row import EVENTS, EXPIRED, TRACE_ENDED, emit
from pnfarm.testing import Line

PICK_AND_PLACE = Path(__file__).parents[2] / "configs" / "pick-and-place.pnfarm.yml"


def connected() -> VirtualLine:
    line = VirtualLine(1)
    line.connect()
    return line


def overrun(columns) -> None:
    """More events than the ring holds, all of them taken long ago."""
    engine = columns.engine[0]
    for _ in range(EVENTS + 5):
        emit(engine, columns.events, 0, 0, int(engine.now_ns), 0)


def test_a_connection_ends_although_the_ring_lost_its_end() -> None:
    line = connected()
    (station,) = line.farm.axes
    ((row, _),) = next(iter(station.device.ars.values())).consumers
    line.farm.columns.cpm[row].state = W_START
    line.farm.columns.cpm[row].expirations = 1
    overrun(line.farm.columns)
    line.farm.service(line.world.now)
    assert station.device.ars == {}
    assert station.device.watchdog_expirations == 1
    assert line.farm.events_lost >= 5


def test_an_open_connection_survives_what_the_ring_lost() -> None:
    line = connected()
    (station,) = line.farm.axes
    overrun(line.farm.columns)
    line.farm.service(line.world.now)
    assert len(station.device.ars) == 1
    assert station.device.connects == 1


def test_the_end_of_an_earlier_connection_in_the_same_row_is_not_that_of_the_present_one() -> None:
    line = connected()
    (station,) = line.farm.axes
    ((row, _),) = next(iter(station.device.ars.values())).consumers
    emit(line.farm.columns.engine[0], line.farm.columns.events, EXPIRED, row, line.world.now, 48_000_000)
    line.farm.service(line.world.now)
    assert len(station.device.ars) == 1


def test_the_controller_ends_a_connection_whose_end_its_ring_lost_and_no_other() -> None:
    line = connected()
    (session,) = line.plc.sessions
    emit(line.plc.columns.engine[0], line.plc.columns.events, EXPIRED, session.consumer, line.world.now, 1)
    line.plc.service(line.world.now)
    assert session.state is SessionState.DATA
    overrun(line.plc.columns)
    line.plc.service(line.world.now)
    assert session.state is SessionState.DATA
    consumer = line.plc.columns.cpm[session.consumer]
    consumer.state, consumer.expirations = W_START, 1
    overrun(line.plc.columns)
    line.plc.service(line.world.now)
    assert session.state is SessionState.WAIT
    assert "data hold time" in session.measures.last_reason


def test_a_trace_is_told_complete_once_although_the_ring_lost_its_reports(monkeypatch) -> None:
    line = connected()
    fields = {"on": "all", "signals": ["velocity"], "trigger": "velocity rising 10", "length": "10ms"}
    trace = line.farm.traces.start(fields, line.world.now)
    ended: list[str] = []
    trace.on_end.append(lambda: ended.append(trace.state))
    with monkeypatch.context() as stalled:
        # the event loop stands still
        stalled.setattr(line.farm, "service", lambda now: None)
        assert line.world.run(2.0, until=lambda: trace.complete)
        overrun(line.farm.columns)
    line.farm.service(line.world.now)
    assert ended == ["complete"]
    assert trace.triggered_by == "axis-01"
    line.run(0.1)
    told = [entry.event for entry in line.log.entries() if entry.event.startswith("trace")]
    assert told == ["trace triggered", "trace complete"]


def test_an_injection_begins_although_the_ring_lost_the_report_of_its_condition(monkeypatch) -> None:
    line = connected()
    fields = {"kind": "f702", "on": "all", "when": "velocity > 2 and velocity < 55"}
    fault = line.farm.injections.inject(fields, line.world.now)
    with monkeypatch.context() as stalled:
        # the event loop stands still until the condition holds no more
        stalled.setattr(line.farm, "service", lambda now: None)
        assert line.world.run(2.0, until=lambda: line.farm.columns.axis[0].motor.velocity > 58)
        overrun(line.farm.columns)
    line.farm.service(line.world.now)
    line.run(0.01)
    assert fault.state == "active"


def test_faults_and_their_ends_reach_bus_and_memory_although_the_ring_lost_them(monkeypatch) -> None:
    line = VirtualLine(1, model="profidrive")
    line.connect()
    line.run(0.5)
    (axis,) = line.farm.axes
    with monkeypatch.context() as stalled:
        stalled.setattr(line.farm, "service", lambda now: None)
        held = axis.raise_fault(min(axis.model.faults), hold=True)
        line.run(0.02)
        overrun(line.farm.columns)
    line.farm.service(line.world.now)
    assert axis.fault_counts == {held: 1}
    assert axis.station.kept["faults"][0] == held
    assert [entry.what.number for entry in line.log.entries() if isinstance(entry.what, FaultRaised)] == [held]
    assert len(list(axis.device.cm.diagnosis)) == 1
    with monkeypatch.context() as stalled:
        stalled.setattr(line.farm, "service", lambda now: None)
        axis.release_fault(held)
        # the controller acknowledges it
        assert line.world.run(2.0, until=lambda: not axis.handle.axis.faults.code[0])
        overrun(line.farm.columns)
    line.farm.service(line.world.now)
    assert list(axis.device.cm.diagnosis) == []
    assert axis.fault_counts == {held: 1}


def test_a_report_of_the_trace_before_in_the_same_row_does_not_end_the_present_one() -> None:
    line = connected()
    trace = line.farm.traces.start({"on": "all", "signals": ["velocity"], "trigger": "manual"}, line.world.now)
    ended: list[str] = []
    trace.on_end.append(lambda: ended.append(trace.state))
    line.run(0.1)
    emit(line.farm.columns.engine[0], line.farm.columns.events, TRACE_ENDED, trace.row, line.world.now, 5)
    line.farm.service(line.world.now)
    assert ended == []
    assert "trace complete" not in [entry.event for entry in line.log.entries()]


def test_inputs_that_a_plant_gives_go_on_although_the_ring_lost_its_report() -> None:
    with Line.from_file(PICK_AND_PLACE) as line:
        line.run(1.0)
        assert line.device("island").signals["part_present"]
        # one is under way, and lost
        line.plant.handling.starved = True
        row = line.core.plant.row
        row.reported += 1
        overrun(line.core.columns)
        line.core.service(line.now_ns)
        line.wait_until(lambda: not line.device("island").signals["part_present"], 10.0)
