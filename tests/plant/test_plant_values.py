"""Values that no machine has, on wires: a REAL that is no number, a negative inertia."""

from __future__ import annotations

import math

import pytest
from farm_file import CONFIGS

from pnfarm.testing import Line

CELL = f"""
farm: t
link: {{kind: memory}}
drives: [{{name: x, model: akd-profinet, ip: 10.77.0.11/24, load: {{friction: 0}}}}]
devices:
- name: island
  gsdml: {CONFIGS / "gsdml" / "GSDML-V2.35-Example-Island-20261127.xml"}
  access_point: DAP 1
  ip: 10.77.0.41/24
  slots: {{1: 16DI, 2: 8DO, 3: EX-AI-4, 4: VALVES}}
  signals:
    level: {{at: 4.1.2, type: float32, direction: input}}
    shown: {{at: 3.1.0, type: int16}}
    travel: {{at: 3.1.0, type: int64, unit: mm, scale: 0.001}}
plant:
  models:
  - {{name: tank, kind: first-order, time_constant: 10ms}}
  - {{name: press, kind: first-order, time_constant: 0ms}}
  wires: [WIRES]
"""


def _line(wires: str) -> Line:
    return Line.from_text(CELL.replace("WIRES", wires))


def test_a_real_that_is_no_number_leaves_models_and_axes_with_what_they_had():
    with _line(
        "island.level * 0.1 Nm -> x.load_torque, island.level -> tank.input, tank.value -> island.shown"
    ) as line:
        island = line.device("island").signals
        for value in (math.nan, math.inf, math.nan):
            island.set({"level": value})
            line.run(0.02)
            assert math.isfinite(line["x"].velocity)
            assert math.isfinite(line.plant.tank.value)


def test_what_is_behind_it_goes_on_with_the_next_number():
    with _line(
        "island.level * 0.1 Nm -> x.load_torque, island.level -> tank.input, tank.value -> island.shown"
    ) as line:
        island = line.device("island").signals
        island.set({"level": math.nan})
        line.run(0.02)
        assert (line["x"].velocity, line.plant.tank.value) == (0.0, 0.0)
        island.set({"level": 5.0})
        line.run(0.2)
        assert line.plant.tank.value == pytest.approx(5.0, rel=1e-3)
        assert island.get("shown") == 5
        assert line["x"].velocity < -100.0


def test_an_input_of_whole_numbers_behind_such_a_real_keeps_its_value():
    with _line("island.level -> island.shown") as line:
        island = line.device("island").signals
        for value, shown in ((7.0, 7), (math.nan, 7), (-math.inf, -0x8000), (8.0, 8)):
            island.set({"level": value})
            line.run(0.02)
            assert island.get("shown") == shown


def test_a_scaled_input_of_64_bits_stays_at_its_limit():
    with _line("press.value * 1 mm -> island.travel") as line:
        for value in (1e18, -1e18):
            line.plant.press.input = value
            line.run(0.02)
            assert line.device("island").signals["travel"] == pytest.approx(math.copysign(2.0**63 / 1000, value))


@pytest.mark.parametrize(
    ("kind", "least", "most"),
    [("int64", -(2**63), 2**63 - 1), ("uint64", 0, 2**64 - 1), ("int56", -(2**55), 2**55 - 1), ("uint8", 0, 255)],
)
def test_an_input_of_whole_numbers_stays_at_its_limit(kind: str, least: int, most: int):
    text = CELL.replace("type: int64, unit: mm, scale: 0.001", f"type: {kind}")
    with Line.from_text(text.replace("WIRES", "press.value -> island.travel")) as line:
        for value, limit in ((1e300, most), (-1e300, least), (2.0**64, most)):
            line.plant.press.input = value
            line.run(0.02)
            assert line.device("island").signals["travel"] == limit


@pytest.mark.parametrize("taken", ["load_friction", "load_inertia"])
def test_a_load_of_less_than_nothing_is_none(taken: str):
    unit = " * 1 Nm" if taken == "load_friction" else ""
    with _line(f"press.value{unit} -> x.{taken}") as line:
        line.plant.press.input = -1e-5
        line.run(0.05)
        assert (line["x"].velocity, float(line.plant.press.value)) == (0.0, -1e-5)
        outside = line.core.axes[0].handle.axis.outside
        assert (float(outside.friction), float(outside.inertia)) == (0.0, 0.0)


def test_a_torque_beyond_all_machines_leaves_a_motor_that_turns_again_behind_it():
    with Line.from_text(
        CELL.replace("time_constant: 0ms", "time_constant: 0ms, gain: 1000000000000").replace(
            "WIRES", "press.value * 1 Nm -> x.load_torque"
        )
    ) as line:
        for value in (1e300, -1e300, 0.0):
            line.plant.press.input = value
            line.run(0.05)
            assert math.isfinite(line["x"].velocity)
            assert math.isfinite(float(line.core.axes[0].handle.axis.motor.position))
        line["x"].power_cycle()
        line.run(1.0)
        assert math.isfinite(line["x"].velocity)
