"""Traces of devices' signals: beside an axis, of every type, as triggers, replayed."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest
from device_cell import DRIVES, ONE, Cell
from hypothesis import given, settings
from hypothesis import strategies as st
from slave_cell import ONE as SLAVE
from slave_cell import SlaveCell

from pnfarm.errors import ConfigError
from pnfarm.farm.injection_fields import fields_of
from pnfarm.trace import Recording, Trace
from pnfarm.trace.plot import as_svg, as_text

MS = 1_000_000
#: Every type in the eight octets of slot 3, in both orders.
TYPES = {
    f"{kind}_{order}": f"{{at: 3.1.0, type: {kind}, order: {order}{scale}}}"
    for order in ("big", "little")
    for kind, scale in [
        *((f"{sign}int{bits}", "") for sign in ("", "u") for bits in range(8, 72, 8)),
        ("float32", ""), ("float64", ""), ("bool", ""), ("int24", ", scale: -0.001, unit: kg"),
    ]
    if not scale or order == "big"
}  # fmt: skip
EVERY = (
    ONE
    + "".join(f"      {name}: {place}\n" for name, place in TYPES.items())
    + "      raw: {at: 3.1.0, type: 'octets[8]'}\n"
)


def start(cell: Cell, **fields: Any) -> Trace:
    return cell.farm.traces.start({"on": "island", **fields}, cell.world.now)


def complete(cell: Cell, trace: Trace) -> Recording:
    assert cell.world.run(5.0, until=lambda: trace.complete), trace.as_dict()
    return trace.recording()


@pytest.fixture(scope="module")
def shared() -> Cell:
    cell = Cell(DRIVES + EVERY)
    cell.connect()
    return cell


@pytest.fixture
def cell(shared: Cell) -> Cell:
    for trace in shared.farm.traces.kept():
        shared.farm.traces.delete(trace.id, shared.world.now)
    shared.signals().set({"part_present": False, "pressure": 0})
    shared.sent(b"\0")
    return shared


def test_signals_of_a_device_are_columns_beside_those_of_an_axis(cell: Cell) -> None:
    signals = ["velocity", "island.part_present", "island.pressure", "island.slot2_output_0"]
    trace = start(cell, on="axis-1", signals=signals, length="40ms")
    cell.world.run(0.0105)
    cell.signals().set({"part_present": True, "pressure": 6.5})
    cell.plc.plain["island"][0].write({0: b"\1"})
    got = complete(cell, trace)
    assert [(one.drive, one.signal, one.unit, one.form) for one in got.columns] == [
        ("axis-1", "velocity", "rpm", "real"), ("island", "part_present", "", "bit"),
        ("island", "pressure", "bar", "real"), ("island", "slot2_output_0", "", "bit"),
    ]  # fmt: skip
    np.testing.assert_allclose(np.diff(got.time), 0.001, atol=1e-12)
    # in force in the step behind it, both in the same one
    (first,) = np.flatnonzero(np.diff(got.values("part_present")))
    assert 0.0085 < got.time[first] < 0.0115
    assert got.values("pressure").tolist() == [6.5 if place > first else 0.0 for place in range(len(got.time))]
    # the output came with a frame of the controller, whose cycle has 16 ms
    assert set(got.values("slot2_output_0").tolist()) == {0, 1}
    assert got.first("island.slot2_output_0", 1) is not None


@settings(max_examples=40)
@given(st.binary(min_size=8, max_size=8))
def test_samples_of_every_type_are_what_reading_the_signal_gives(shared: Cell, octets: bytes) -> None:
    signals = shared.signals()
    signals.set({"raw": octets})
    trace = start(shared, signals=list(TYPES), length="2ms")
    got = complete(shared, trace)
    shared.farm.traces.delete(trace.id, shared.world.now)
    for name in TYPES:
        values = got.values(name)
        np.testing.assert_array_equal(values, np.array(signals.get(name), np.float64), err_msg=name)
        assert (values.dtype == np.int64) == (got.column(name).form != "real")
    again = Recording.from_dict(json.loads(json.dumps(got.as_dict(), allow_nan=False)))
    assert again.csv() == re.sub(r"-?inf", "nan", got.csv())
    assert as_text(again)
    assert "nan" not in as_svg(got)


@pytest.mark.parametrize(
    ("trigger", "more"),
    [
        ("island.pressure > 6.4 bar", {}),
        ("island.pressure > 6.4bar", {}),
        ("pressure rising 6.45", {}),
        ("pressure == 6.5 on island", {"on": "axis-1", "signals": ["velocity"]}),
        ("island.part_present", {}),
        ("part_present rising", {"signals": ["*"], "on": "all"}),
        ("island.part_present changes", {"on": "axis-*", "signals": ["island.part_present"]}),
    ],
)
def test_a_signal_of_a_device_triggers_in_the_step_in_which_it_passes_the_level(
    cell: Cell, trigger: str, more: dict[str, Any]
) -> None:
    fields = {"signals": ["pressure", "part_present"], "trigger": trigger, "pre": "20ms", "length": "5ms", **more}
    trace = start(cell, **fields)
    cell.world.run(0.1)
    assert trace.state == "waiting"
    cell.signals().set({"pressure": 6.4})
    cell.world.run(0.1)
    assert trace.state == "waiting"
    begun = cell.world.now
    cell.signals().set({"pressure": 6.5, "part_present": True})
    got = complete(cell, trace)
    assert got.triggered_by == "island"
    assert 0 <= int(cell.farm.columns.trace[trace.row].trigger_ns) - begun <= MS
    if "part_present" in {one.signal for one in got.columns}:
        assert got.at(0.0, "part_present") == 1
        assert got.at(-0.001, "part_present") == 0


def test_a_controllers_output_triggers_a_trace(cell: Cell) -> None:
    trace = start(cell, signals=["slot2_*"], trigger="slot2_output_3 rising", length="5ms")
    cell.sent(b"\7")
    assert trace.state == "waiting"
    cell.sent(b"\x0f")
    assert trace.complete
    assert [trace.recording().at(0.0, f"slot2_output_{bit}") for bit in range(5)] == [1, 1, 1, 1, 0]


def test_the_connection_of_a_device_is_traced_and_its_loss_triggers(cell: Cell) -> None:
    trace = start(cell, signals=["connected", "connection", "frame_age", "injected"], trigger="disconnect", length="3s")
    cell.farm.injections.inject({"kind": "timeout", "on": "island"}, cell.world.now)
    cell.farm.service(cell.world.now)
    got = complete(cell, trace)
    assert got.triggered_by == "island"
    assert set(got.values("connected").tolist()) == {0, 1}
    assert max(got.values("injected")) == 1
    assert got.values("frame_age").max() > 0.1
    cell.connect()


def test_a_saved_trace_of_a_signal_is_replayed_as_it_was(cell: Cell, tmp_path: Any) -> None:
    trace = start(cell, signals=["island.part_present", "pressure", "float32_little"], length="60ms")
    for number in range(5):
        cell.signals().set({"pressure": number / 4, "part_present": number % 2 == 1})
        cell.world.run(0.01)
    got = complete(cell, trace)
    file = tmp_path / "run.csv"
    file.write_text(got.csv())
    cell.signals().set({"pressure": 0, "part_present": False})
    again = start(cell, signals=["part_present", "pressure"], trigger="injection signal-replay", length="60ms")
    for signal, title in (("part_present", "island part_present"), ("pressure", "island pressure [bar]")):
        replay = fields_of("signal-replay", "island", {"signal": signal, "values": f"@{file}#{title}"})
        cell.farm.injections.inject(replay, cell.world.now)
    replayed = complete(cell, again)
    for name in ("part_present", "pressure"):
        changes = [np.flatnonzero(np.diff(one.values(name))) for one in (got, replayed)]
        assert len(changes[0]) == len(changes[1]) > 2
        np.testing.assert_allclose(got.time[changes[0]], replayed.time[changes[1]], atol=0.0021)
        assert set(got.values(name).tolist()) == set(replayed.values(name).tolist())
    cell.farm.injections.clear(None, cell.world.now)


def test_a_farm_of_devices_alone_on_profibus_samples_each_millisecond() -> None:
    cell = SlaveCell(SLAVE)
    cell.connect()
    trace = start(cell, signals=["part_present", "count", "clamp", "connected"], length="100ms", trigger="clamp rising")
    cell.signals().set({"count": 70_000})
    cell.sent(b"\1")
    got = complete(cell, trace)
    # the first step of all is not on the grid
    np.testing.assert_allclose(np.diff(got.time)[1:], 0.001, atol=1e-12)
    assert got.values("count").tolist() == [70_000] * len(got.time)
    assert got.at(0.0, "clamp") == 1
    assert set(got.values("connected").tolist()) == {1}


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"signals": ["island.presure"]}, ("island has no signal 'presure', did you mean pressure?",)),
        ({"signals": ["presure"]}, ("trace.signals: island has no signal 'presure'",)),
        ({"signals": ["raw"]}, ("island has no signal 'raw'",)),
        ({"on": "all", "signals": ["presure"]}, ("has no signal 'presure'",)),
        ({"signals": ["pressure"], "trigger": "pressure > 6 rpm"}, ("pressure is not measured in rpm", "in bar")),
        ({"signals": ["pressure"], "trigger": "pressure == 6.555"}, ("trace.trigger: pressure is never", "steps")),
        ({"signals": ["pressure"], "trigger": "pressure rising"}, ("pressure needs a level in bar",)),
        ({"signals": ["pressure"], "trigger": "pressure > high"}, ("'high' is not a value of pressure",)),
        ({"signals": ["pressure"], "trigger": "island.presure > 6"}, ("did you mean pressure?",)),
        ({"signals": ["pressure"], "trigger": "island.pressure > 6 on axis-1"}, ("names two stations",)),
        ({"signals": ["pressure"], "trigger": "fault 702"}, ("island is a device",)),
        ({"signals": ["pressure"], "trigger": "fault"}, ("island is a device",)),
    ],
)  # fmt: skip
def test_a_wrong_signal_of_a_device_is_refused_with_what_is_allowed(
    cell: Cell, fields: dict[str, Any], words: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError) as caught:
        start(cell, **fields)
    for word in words:
        assert word in str(caught.value)
    assert not cell.farm.traces.kept()
