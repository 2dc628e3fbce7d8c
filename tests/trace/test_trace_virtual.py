"""Traces of virtual lines: exact samples, triggers at their steps, rings that wrap, drives that go away meanwhile."""

from __future__ import annotations

import asyncio
from typing import Any

import numpy as np
import pytest
from virtual_line import VirtualLine

from pnfarm.controller.line import VirtualLine as FarmLine
from pnfarm.drives.telegrams.word_bits import ZSW1_BITS
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.table.trace import RING_VALUES
from pnfarm.trace import Recording, Trace
from pnfarm.trace.manager import MOST_TRACES

MS = 1_000_000


def start(line: VirtualLine, **fields: Any) -> Trace:
    return line.farm.traces.start({"on": "all", **fields}, line.world.now)


def recorded(line: VirtualLine, seconds: float = 5.0, **fields: Any) -> Recording:
    trace = start(line, **fields)
    assert line.world.run(seconds, until=lambda: trace.complete), trace.as_dict()
    return trace.recording()


@pytest.fixture
def line() -> VirtualLine:
    line = VirtualLine(1, cycle="16ms")
    line.connect()
    return line


def test_a_ramp_is_sampled_at_each_millisecond_with_the_ramps_own_values(line: VirtualLine) -> None:
    axis = line.farm.axes[0].handle.axis
    # an edge needs the step before; the velocity command leaves 0 with the first step in operation
    got = recorded(line, signals=["command", "state"], trigger="command > 0", pre="20ms", length="30ms")
    assert got.triggered
    np.testing.assert_allclose(np.diff(got.time), 0.001, atol=1e-12)
    assert got.time[0] == -0.02
    assert got.time[-1] == 0.03
    assert got.at(0.0, "command") > 0.0
    assert got.at(-0.001, "command") == 0.0
    ramp = float(axis.ramp.up) or float(axis.ramp.settings.acceleration)
    # the firmware steps every 4 ms at this cycle; its ramp rises as much in each step, up to 60 rpm
    rise = ramp * 0.004
    assert rise < 60.0
    for millisecond in range(31):
        wanted = min(rise * (1 + millisecond // 4), got.at(0.03, "command"))
        assert got.at(millisecond / 1000, "command") == pytest.approx(wanted, rel=1e-6)
    assert got.at(0.03, "command") == pytest.approx(60.0, abs=0.2)
    assert got.at(0.0, "state") == 4


def test_the_samples_are_what_the_table_holds_at_each_step() -> None:
    line = VirtualLine(2, cycle="1ms", limits="lax")
    line.connect()
    trace = start(line, signals=["velocity", "position", "current", "zsw1", "setpoint"], length="300ms")
    axis = line.farm.columns.axis[1]
    seen: list[tuple[float, ...]] = []

    def look() -> bool:
        motor = axis.motor
        position = float(motor.position) - float(axis.homing.origin)
        seen.append(
            (
                float(motor.velocity),
                position,
                float(motor.current),
                int(axis.profidrive.zsw1),
                float(axis.ramp.setpoint),
            )
        )
        return False

    line.world.run(0.2, until=look, look_ns=MS)
    line.world.run(0.2)
    got = trace.recording()
    names = ("velocity", "position", "current", "zsw1", "setpoint")
    rows = set(zip(*(got.values(name, "axis-02").tolist() for name in names), strict=True))
    assert rows.issuperset(seen)


def test_a_trigger_fires_in_the_step_of_the_fault_and_the_fault_bit_rises_there(line: VirtualLine) -> None:
    line.enable()
    trace = start(
        line, signals=["zsw1.fault_present", "fault", "state"], trigger="fault 702", pre="50ms", length="100ms"
    )
    line.run(0.3)
    assert trace.state == "waiting"
    when: list[int] = []
    line.log.subscribe(lambda entry: when.append(entry.now_ns) if entry.event == "fault" else None)
    line.farm.injections.inject({"kind": "f702", "on": "axis-01"}, line.world.now)
    line.farm.service(line.world.now)
    assert line.world.run(1.0, until=lambda: trace.complete)
    got = trace.recording()
    assert got.triggered_by == "axis-01"
    assert got.first("fault", 702) == 0.0
    assert got.at(-0.001, "fault") == 0
    assert got.at(0.0, "fault") == 702
    assert got.first("zsw1.fault_present", 1) == pytest.approx(0.0, abs=1e-9)
    assert len(when) == 1
    assert got.time[0] == pytest.approx(-0.05)


@pytest.mark.parametrize(
    ("trigger", "signal", "at_zero", "before"),
    [
        ("state == S4", "state", 4, 3),
        ("state changes", "state", None, None),
        ("zsw1.operation_enabled", "zsw1.operation_enabled", 1, 0),
        ("zsw1.2 rising", "zsw1.operation_enabled", 1, 0),
        ("stw1.enable_operation rising", "stw1.enable_operation", 1, 0),
        ("zsw1.switching_on_inhibited falling", "zsw1.switching_on_inhibited", 0, 1),
    ],
)
def test_an_edge_or_a_level_triggers_in_the_step_in_which_it_happens(
    trigger: str, signal: str, at_zero: int | None, before: int | None
) -> None:
    line = VirtualLine(1)
    line.connect()
    got = recorded(line, signals=[signal], trigger=trigger, pre="30ms", length="10ms")
    if at_zero is None:
        assert got.at(0.0, signal) != got.at(-0.001, signal)
    else:
        assert got.at(0.0, signal) == at_zero
        assert got.at(-0.001, signal) == before


def test_an_analogue_edge_fires_where_the_value_passes_the_level(line: VirtualLine) -> None:
    got = recorded(line, signals=["velocity"], trigger="velocity rising 30", pre="20ms", length="20ms")
    assert got.at(0.0, "velocity") >= 30 > got.at(-0.001, "velocity")


def test_every_nth_step_and_an_interval_of_ones_own(line: VirtualLine) -> None:
    line.run(0.0075)
    # the first sample is the first step's, the others are on the grid
    assert np.diff(recorded(line, signals=["state"], every=8, length="80ms").time)[1:] == pytest.approx(0.008)
    assert np.diff(recorded(line, signals=["state"], interval="20ms", length="80ms").time)[1:] == pytest.approx(0.02)


def test_with_every_nth_step_the_trigger_is_still_that_of_its_own_step(line: VirtualLine) -> None:
    got = recorded(line, signals=["velocity"], trigger="velocity rising 30", every=50, pre="200ms", length="200ms")
    assert 0.0 in got.time.tolist()
    assert got.at(0.0, "velocity") >= 30
    assert got.at(0.0, "velocity") < 60


def test_a_ring_that_wraps_many_times_keeps_the_time_before_the_trigger(line: VirtualLine) -> None:
    line.enable()
    trace = start(line, signals=["velocity"], trigger="manual", pre="10ms", length="5ms")
    line.run(20.0)
    assert trace.state == "waiting"
    waiting = trace.recording()
    assert not waiting.triggered
    assert len(waiting.time) <= int(line.farm.columns.trace[trace.row].capacity)
    line.farm.traces.fire(trace.id, line.world.now)
    line.run(0.1)
    got = trace.recording()
    assert got.state == "complete"
    assert got.time.tolist() == pytest.approx([t / 1000 for t in range(-10, 6)])


def test_a_disconnect_triggers_and_shows_the_connection_go_and_come_back() -> None:
    line = VirtualLine(1, cycle="16ms")
    line.enable()
    signals = ["connected", "connection", "frame_age", "frame_interval", "injected", "state"]
    trace = start(line, signals=signals, trigger="disconnect", pre="200ms", length="3s")
    line.run(0.5)
    line.farm.injections.inject({"kind": "timeout", "on": "axis-01"}, line.world.now)
    line.farm.service(line.world.now)
    line.run(6.0)
    got = trace.recording()
    assert got.state == "complete"
    assert got.at(-0.1, "connected") == 1
    assert got.at(0.002, "connected") == 0
    assert got.column("connection").labels[int(got.at(0.002, "connection"))] == "closed"
    assert max(got.values("injected")) == 1
    # it came back
    assert got.values("connected")[-1] == 1
    assert got.values("frame_interval")[-1] == pytest.approx(0.016)
    assert got.values("frame_age").max() > 0.2
    ages = got.values("frame_age")[got.time < -0.1]
    assert 0.0 <= ages.min() <= ages.max() < 0.016


def test_a_drive_that_is_switched_off_during_a_trace_is_sampled_through(line: VirtualLine) -> None:
    line.enable()
    trace = start(line, signals=["powered", "state", "connected"], trigger="power-off", pre="50ms", length="4s")
    line.run(0.2)
    station = line.farm.axes[0]
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.farm.service(line.world.now)
    line.run(5.0)
    got = trace.recording()
    assert got.state == "complete"
    np.testing.assert_allclose(np.diff(got.time), 0.001, atol=1e-12)
    assert got.missed == 0
    assert set(got.values("state").tolist()) >= {0, 1, 4}
    assert got.values("connected")[0] == 1
    assert got.values("connected").min() == 0


def test_an_injection_triggers_by_its_kind_and_another_one_does_not(line: VirtualLine) -> None:
    trace = start(line, signals=["state"], trigger="injection f702 on axis-01", length="10ms")
    line.farm.injections.inject({"kind": "not-ready", "on": "axis-01"}, line.world.now)
    line.run(0.1)
    assert trace.state == "waiting"
    now = line.world.now
    line.farm.injections.inject({"kind": "f702", "on": "axis-01"}, now)
    line.run(0.1)
    assert trace.complete
    assert int(line.farm.columns.trace[trace.row].trigger_ns) == now


def test_many_traces_at_once_are_independent_and_leave_nothing_running(line: VirtualLine) -> None:
    traces = [start(line, signals=["velocity", "zsw1.*"], length=f"{10 + n}ms", every=1) for n in range(MOST_TRACES)]
    with pytest.raises(ConfigError, match="at most: delete one"):
        start(line, signals=["velocity"])
    line.run(0.2)
    for n, trace in enumerate(traces):
        assert trace.recording().time[-1] == pytest.approx((10 + n) / 1000)
        line.farm.traces.delete(trace.id, line.world.now)
    line.run(0.1)
    assert line.farm.columns.engine[0].trace_rows == 0
    assert line.farm.traces._ring.free == RING_VALUES
    # and the room is there again
    start(line, signals=["velocity"])


def test_a_trace_that_is_deleted_while_it_samples_ends_and_its_samples_are_gone(line: VirtualLine) -> None:
    trace = start(line, signals=["velocity"], length="10s")
    line.run(0.1)
    line.farm.traces.delete(trace.id, line.world.now)
    with pytest.raises(ConfigError, match="deleted"):
        trace.recording()
    with pytest.raises(ConfigError, match="there is no trace"):
        line.farm.traces.get(trace.id, line.world.now)
    head = int(line.farm.columns.trace[trace.row].head)
    line.run(0.1)
    assert int(line.farm.columns.trace[trace.row].head) == head


def test_a_trace_of_a_client_that_is_gone_ends_by_itself(line: VirtualLine) -> None:
    trace = start(line, signals=["velocity"], trigger="manual", length="1s", keep="2s")
    line.run(1.5)
    line.farm.traces.get(trace.id, line.world.now)
    line.run(1.5)
    assert trace.state == "waiting"
    line.run(1.0)
    assert trace.state == "deleted"
    assert line.farm.columns.engine[0].trace_rows == 0


def test_the_words_of_a_telegram_are_traced_by_their_names_and_signs() -> None:
    program = "{kind: constant, speed_rpm: -60, acknowledge_after: 200ms}"
    line = VirtualLine(1, program=program)
    line.enable()
    line.run(1.0)
    got = recorded(line, signals=["nsoll_a", "nist_a", "stw1_received", "velocity"], length="10ms")
    image = line.farm.columns.image[0]
    assert got.values("stw1_received")[-1] == int(image.received[0])
    assert got.values("nsoll_a")[-1] < 0
    assert got.values("nist_a")[-1] < 0
    assert got.values("velocity")[-1] == pytest.approx(-60, abs=1)


@pytest.mark.parametrize(("model", "telegram"), [("hiwin-e1", 3), ("moog-msd", 3), ("akd-profinet-2012", 1)])
def test_every_model_has_words_and_bits_by_its_own_names(model: str, telegram: int) -> None:
    line = VirtualLine(1, model=model, telegram=telegram, cycle="16ms", limits="lax")
    line.enable(20.0)
    signals = ["*"]
    got = recorded(line, signals=signals, length="20ms")
    names = {column.signal for column in got.columns}
    own = line.farm.axes[0].model.profidrive.bit_names("ZSW1", telegram) or ZSW1_BITS
    assert {"velocity", "zsw1", "stw1", *(f"zsw1.{name}" for name in own if name)} <= names
    if telegram == 3:
        assert {"stw2", "zsw2"} <= names
        # the sign of life counts in the upper bits
        assert len(set(got.values("zsw2").tolist())) > 1
    zsw1 = int(line.farm.columns.axis[0].profidrive.zsw1)
    bits = [column for column in got.columns if column.signal.startswith("zsw1.")]
    assert len(bits) == 16
    assert sum(int(column.values[-1]) << bit for bit, column in enumerate(bits)) == zsw1


def test_a_fault_of_the_moog_is_triggered_and_shown_by_its_number_and_place() -> None:
    line = VirtualLine(1, model="moog-msd", telegram=1)
    line.enable(20.0)
    trace = start(line, signals=["fault"], trigger="fault 32-1", pre="5ms", length="20ms")
    line.farm.injections.inject({"kind": "drive-fault", "on": "axis-01", "params": {"fault": "32-1"}}, line.world.now)
    line.run(1.0)
    assert trace.complete
    assert set(trace.recording().column("fault").labels.values()) == {"0", "32-1"}
    assert ",32-1" not in trace.recording().csv().splitlines()[1]
    assert trace.recording().csv().splitlines()[-1].endswith(",32-1")


@pytest.mark.parametrize("trigger", ["fault == 3", "warning != 3", "fault == 3.5 on axis-01"])
def test_a_fault_that_the_drive_cannot_have_is_refused_in_a_comparison(trigger: str) -> None:
    line = VirtualLine(1, model="moog-msd", telegram=1)
    with pytest.raises(ConfigError, match=r"trace\.trigger: moog-msd has no fault '3"):
        start(line, signals=["fault"], trigger=trigger)


@pytest.mark.parametrize("trigger", ["fault == 3-1", "fault != 0", "fault > 3"])
def test_a_comparison_with_a_fault_of_the_moog_fires(trigger: str) -> None:
    line = VirtualLine(1, model="moog-msd", telegram=1)
    line.connect()
    trace = start(line, signals=["fault"], trigger=trigger, length="5ms")
    line.farm.injections.inject({"kind": "drive-fault", "on": "axis-01", "params": {"fault": "3-1"}}, line.world.now)
    assert line.world.run(1.0, until=lambda: trace.complete)
    assert set(trace.recording().column("fault").labels.values()) == {"3-1"}


MIXED = """
farm: mixed
link: {kind: memory}
drives:
  - {name: axis-01, model: akd-profinet, ip: 10.77.0.11/24}
  - {name: axis-02, model: akd-ethernetip, ip: 10.77.0.12/24}
"""


def test_drives_of_two_profiles_are_traced_together_each_with_its_own_words() -> None:
    line = asyncio.run(FarmLine.create(parse_farm(MIXED)))
    line.world.run(0.5)

    def begin(*signals: str) -> Trace:
        request = {"on": "all", "signals": list(signals), "trigger": "now", "length": "20ms"}
        return line.farm.traces.start(request, line.world.now)

    trace = begin("velocity", "homed", "in_operation", "zsw1.fault*", "status_1.*", "control.enable*")
    line.world.run(0.1)
    assert trace.complete
    columns = {(column.drive, column.signal) for column in trace.recording().columns}
    assert {signal for drive, signal in columns if drive == "axis-01"} == {
        "velocity", "homed", "in_operation", "zsw1.fault_present",
    }  # fmt: skip
    own = {signal for drive, signal in columns if drive == "axis-02"}
    assert {"velocity", "homed", "in_operation", "status_1.in_motion", "status_1.general_fault"} < own
    assert not any(signal.startswith(("zsw1", "stw1")) for signal in own)
    with pytest.raises(ConfigError, match=r"no signal 'nope\.\*'"):
        begin("nope.*")
    with pytest.raises(ConfigError, match=r"axis-02 has no signal 'zsw1'"):
        begin("zsw1")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"signals": ["velocty"]}, ("no signal 'velocty'", "did you mean velocity?", "following_error", "zsw1.*")),
        ({"signals": ["zsw1.fault_presnt"]}, ("did you mean zsw1.fault_present?",)),
        ({"signals": ["nope.*"]}, ("no signal 'nope.*'",)),
        ({"signals": ["velocity"], "on": "axis-9"}, ("no drive matches 'axis-9'", "did you mean axis-01?")),
        ({"signals": ["velocity"], "trigger": "velocity rising"}, ("needs a level in rpm",)),
        ({"signals": ["velocity"], "trigger": "speed > 3"}, ("no signal 'speed'",)),
        ({"signals": ["velocity"], "trigger": "velocity > fast"}, ("'fast' is not a value of velocity",)),
        ({"signals": ["velocity"], "trigger": "fault 9999"}, ("has no fault '9999'",)),
        ({"signals": ["velocity"], "trigger": "connect on plc"}, ("no drive matches 'plc'",)),
        ({"signals": ["velocity"], "trigger": "conect"}, ("no signal 'conect'",)),
        ({"signals": ["*"], "length": "1h"}, ("numbers; allowed:",)),
        ({"signals": ["velocity"], "as": "a b"}, ("trace.as: is 'a b'",)),
        ({"signals": ["velocity"], "every": 0}, ("trace.every: is 0", "1 to")),
        ({"signals": ["velocity"], "every": 2, "interval": "1ms"}, ("contradicts interval",)),
        ({"signals": []}, ("trace.signals: is an empty list",)),
        ({}, ("trace.signals: is missing",)),
        ({"signals": ["velocity"], "pre": "5"}, ("trace.pre: '5' is not a duration",)),
        ({"signals": ["velocity"], "triger": "now"}, ("did you mean trigger?",)),
    ],
)
def test_a_wrong_request_is_refused_with_what_is_allowed(
    fields: dict[str, Any], words: tuple[str, ...], line: VirtualLine
) -> None:
    with pytest.raises(ConfigError) as caught:
        start(line, **fields)
    for word in words:
        assert word in str(caught.value)
    assert not line.farm.traces.kept()
    assert line.farm.columns.engine[0].trace_rows == 0
    assert line.farm.traces._ring.free == RING_VALUES


def test_the_samples_that_are_told_are_those_of_the_recording_whatever_else_is_kept(line: VirtualLine) -> None:
    line.enable()
    trace = start(line, signals=["velocity"], trigger="manual", pre="20ms", length="30ms")
    line.run(0.2)
    line.farm.traces.fire(trace.id, line.world.now)
    assert line.world.run(1.0, until=lambda: trace.complete)
    assert trace.as_dict()["samples"] == len(trace.recording().time) == 51


def test_a_viewer_gets_each_sample_once_although_the_engine_goes_on_meanwhile(
    line: VirtualLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    trace = start(line, signals=["velocity"], trigger="manual", pre="1s")
    copied = Trace._samples

    def slowly(self: Trace, *args: Any) -> Any:
        line.world.run(0.01)
        return copied(self, *args)

    monkeypatch.setattr(Trace, "_samples", slowly)
    seen, times = 0, []
    for _ in range(5):
        seen, more, _ = trace.since(seen)
        times += more.tolist()
    assert len(times) == len(set(times)) == seen > 40


def test_csv_names_time_drive_signal_and_unit(line: VirtualLine) -> None:
    line.enable()
    got = recorded(line, signals=["velocity", "state", "zsw1"], length="3ms")
    head, *rows = got.csv().splitlines()
    assert head == "time [s],axis-01 velocity [rpm],axis-01 state,axis-01 zsw1"
    assert len(rows) == len(got.time) == 4
    assert rows[0].startswith("0.000000000,")
    assert rows[0].split(",")[2] == "S4"
    again = Recording.from_dict(got.as_dict())
    assert again.csv() == got.csv()


def test_a_trace_does_not_change_what_the_drives_do() -> None:
    def run(traced: bool) -> bytes:
        line = VirtualLine(2, cycle="4ms", limits="lax", program="{kind: sine, speed_rpm: 300, period: 1s}")
        if traced:
            start(line, signals=["*"], trigger="velocity rising 100", pre="100ms", length="500ms")
        line.run(4.0)
        # whole rows: NumPy leaves the padding of a field that it copies by itself as the memory was
        return line.farm.columns.axis.tobytes()

    assert run(traced=True) == run(traced=False)
