"""Traces of the plant: ports of its models beside signals of stations, as triggers, in the same step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pnfarm.errors import ConfigError
from pnfarm.testing import Line
from pnfarm.trace import Recording

FARM = """farm: t
link: {kind: memory}
drives:
- {name: x, model: akd-profinet, ip: 10.77.0.11/24, load: {friction: 0, damping: 0}}
plant:
  step: 2ms
  models:
  - {name: gripper, kind: cylinder, time: 20ms}
  - {name: lamp, kind: lamp}
  wires:
  - gripper.extended -> lamp.on
"""


@pytest.fixture(scope="module")
def shared() -> Line:
    return Line.from_text(FARM)


@pytest.fixture
def line(shared: Line) -> Line:
    for trace in shared.core.traces.kept():
        shared.core.traces.delete(trace.id, shared.now_ns)
    shared.plant.gripper.extend = False
    shared.run(0.1)
    return shared


def recorded(line: Line, move: bool = True, **fields: Any) -> Recording:
    trace = line.core.traces.start({"on": "x", "length": "60ms", **fields}, line.now_ns)
    line.run(0.01)
    line.plant.gripper.extend = move
    line.run(0.2)
    assert trace.complete, trace.as_dict()
    return trace.recording()


def test_ports_are_columns_beside_the_signals_of_a_drive(line: Line) -> None:
    got = recorded(line, signals=["powered", "gripper.position", "gripper.extended", "lamp.on"])
    assert [(one.drive, one.signal, one.form) for one in got.columns] == [
        ("x", "powered", "bit"), ("gripper", "position", "real"), ("gripper", "extended", "bit"),
        ("lamp", "on", "bit"),
    ]  # fmt: skip
    position = got.values("position")
    assert position[0] == 0
    assert position[-1] == 1
    assert (np.diff(position) >= 0).all()
    # 20 ms of travel, in steps of the plant
    assert len(set(position.tolist())) == 11
    (there,) = np.flatnonzero(np.diff(got.values("extended")))
    assert position[there] < 1 <= position[there + 1]
    # a wire between two models takes a step of the plant
    (lit,) = np.flatnonzero(np.diff(got.values("on")))
    assert got.time[lit] - got.time[there] == pytest.approx(0.002)


@pytest.mark.parametrize(
    ("trigger", "position"),
    [
        ("gripper.position rising 0.5", (0.5, 0.6)),
        ("gripper.position > 0.7", (0.7, 0.8)),
        ("gripper.extended", (1, 1)),
        ("extended rising on gripper", (1, 1)),
    ],
)
def test_a_port_triggers(line: Line, trigger: str, position: tuple[float, float]) -> None:
    got = recorded(line, signals=["gripper.position"], trigger=trigger, pre="10ms")
    assert got.triggered_by == "gripper"
    (at,) = got.values("position")[np.isclose(got.time, 0, atol=1e-9)]
    assert position[0] - 1e-9 <= at <= position[1] + 1e-9


def test_a_model_is_traced_by_its_name_its_kind_and_a_glob(line: Line) -> None:
    got = recorded(line, on="model:cylinder", signals=["*"])
    assert {one.drive for one in got.columns} == {"gripper"}
    assert [one.signal for one in got.columns] == [*line.core.plant.parts["gripper"].signals.names]
    # what drives alone have is no reason to refuse a model
    got = recorded(line, on="all", signals=["velocity", "position"])
    assert [(one.drive, one.signal) for one in got.columns] == [
        ("x", "velocity"), ("x", "position"), ("gripper", "position"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"signals": ["gripper.positon"]}, "gripper has no signal 'positon', did you mean position?"),
        (
            {"signals": ["lamp.on"], "trigger": "fault on lamp"},
            "lamp is a model of the plant, which has no event fault",
        ),
        ({"signals": ["lamp.on"], "trigger": "gripper.position rising"}, "position needs a level"),
        ({"signals": ["lamp.on"], "trigger": "gripper.extended on lamp"}, "names two stations"),
    ],
)
def test_what_a_model_does_not_have_is_refused(line: Line, fields: dict[str, Any], why: str) -> None:
    with pytest.raises(ConfigError) as caught:
        line.core.traces.start({"on": "x", **fields}, line.now_ns)
    assert why in str(caught.value)
