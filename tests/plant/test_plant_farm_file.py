"""What a farm file may say of its plant, and how it is told what is wrong."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from pnfarm.errors import ConfigError
from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import FarmFileError, load_farm, parse_farm
from pnfarm.testing import Line

HEAD = """farm: t
link: {kind: memory}
drives:
- {name: x, model: akd-profinet, ip: 10.77.0.11/24, load: {friction: 0, damping: 0}}
plant:
"""


def _issues(plant: str) -> list[str]:
    with pytest.raises(FarmFileError) as caught:
        parse_farm(HEAD + plant)
    return [f"{issue.line}: {issue.what}; {issue.allowed}" for issue in caught.value.issues]


@pytest.mark.parametrize(
    ("plant", "what"),
    [
        ("  wires: [x.shaft_position]", "6: 'x.shaft_position' is no wire"),
        ("  wires: [y.position -> x.load_torque]", "6: 'y.position' names no model and no station"),
        ("  wires: [x.shaft -> x.load_torque]", "6: x gives no 'shaft' to a plant"),
        ("  wires: [x.torque -> x.load]", "6: x takes no 'load' from a plant"),
        ("  wires: [x.torque -> x.limit_low]", "6: x.torque is a number, x.limit_low is a bit"),
        ("  wires: [x.shaft_velocity -> x.load_torque]", "6: x.load_torque is in Nm"),
        ("  wires: [not x.torque -> x.load_torque]", "6: x.load_torque is a number, which cannot be inverted"),
        ("  wires: [x.torque -> x.load_torque, x.torque * 2 -> x.load_torque]", "6: x.load_torque has a wire already"),
        ("  models: [{name: c, kind: cilinder}]", "6: 'cilinder' is no built-in model, did you mean cylinder?"),
        (
            "  models: [{name: c, kind: cylinder}]",
            "6: cylinder c has no time; time: from one end to the other, a time such as 300ms",
        ),
        ("  models: [{name: c, kind: cylinder, time: 3}]", "6: is 3, which has no unit"),
        ("  models: [{name: c, kind: cylinder, time: 1s, tim: 3}]", "6: cylinder has no such parameter"),
        ("  models: [{name: c, kind: cylinder, time: 1s, valve: three}]", "6: is 'three'; monostable"),
        ("  models: [{name: x, kind: lamp}]", "6: 'x' is a station, too"),
        ("  models: [{name: a, kind: lamp}, {name: a, kind: lamp}]", "6: 'a' is another model, too"),
        ("  models: [{name: a, kind: lamp, python: a.py}]", "6: model a has kind and python"),
        ("  models: [{name: a}]", "6: model a has no kind"),
        ("  models: [{name: a.b, kind: lamp}]", "6: 'a.b' is not a model's name"),
        ("  models: [{name: a, kind: lamp, step: 500us}]", "6: is shorter than the plant's own step"),
        ("  step: 100us", "6: 100us is no step of a plant; 500us to 100ms"),
        ("  models: [{name: m, kind: elastic-load, axis: z, stiffness: 1, inertia: 1}]", "6: there is no axis 'z'"),
        ("  models: [{name: m, kind: rigid-coupling, axes: [x]}]", "6: rigid-coupling is between two axes"),
        (
            "  models: [{name: m, kind: elastic-load, axis: x, stiffness: 1, inertia: 1, backlash: 5 mm}]",
            "6: is not measured in mm",
        ),
    ],
)
def test_what_is_wrong_with_a_plant_is_told_at_its_line(plant: str, what: str):
    assert any(issue.startswith(what) for issue in _issues(plant)), _issues(plant)


@pytest.mark.parametrize(
    ("wrong", "where"),
    [
        ("- {name: y, model: akd-profinet, ip: 10.77.0.300/24}", "drives[1].ip"),
        ("- {name: y, model: akd-profinet, ip: 10.77.0.12/24, telegram: 999}", "drives[1].telegram"),
        ("- {name: 'y{', model: akd-profinet, ip: 10.77.0.12/24}", "drives[1].name"),
        ("devices:\n- {name: y, gsdml: none.xml, ip: 10.77.0.12/24}", "devices[0].gsdml"),
        ("devices:\n- {name: y, gsdml: none.xml, ip: 10.77.0.12}", "devices[0].ip"),
    ],
)
def test_a_station_with_an_error_is_not_also_missed_by_the_plant(wrong: str, where: str):
    plant = (
        "  models:\n  - {name: m, kind: rigid-coupling, axes: [x, y]}\n"
        "  wires: [y.torque -> x.load_torque, x.torque -> y.load_torque]\n"
    )
    with pytest.raises(FarmFileError) as caught:
        parse_farm(HEAD.replace("plant:\n", f"{wrong}\nplant:\n") + plant)
    assert [issue.field for issue in caught.value.issues] == [where]


def test_a_wire_converts_between_units_of_one_kind_and_takes_a_factor_between_others():
    text = HEAD + (
        "  models: [{name: s, kind: position-sensor, from: 30, to: 50}, {name: e, kind: encoder}]\n"
        "  wires:\n"
        "  - x.shaft_position * 40 mm + 5 mm -> s.position\n"
        "  - x.shaft_position * 180 deg -> e.position\n"
    )
    with Line.from_text(text) as line:
        line.core.axes[0].handle.axis.load.settings.torque = -0.02
        line.run(0.5)
        shaft = float(line.core.axes[0].handle.axis.outside.shaft)
        assert shaft > 1.0
        assert line.plant.s.position == pytest.approx(40 * shaft + 5, rel=0.02)
        assert line.plant.e.position == pytest.approx(shaft / 2, rel=0.02)


def test_an_offset_beside_a_number_without_a_unit_is_in_its_own_unit():
    models = "  models: [{name: m, kind: first-order, time_constant: 0ms, start: 0.5}, {name: e, kind: encoder}]\n"
    with Line.from_text(HEAD + models + "  wires: [m.value + 90 deg -> e.position]\n") as line:
        line.run(0.003)
        assert line.plant.e.position == pytest.approx(0.25)
    (issue,) = _issues(models + "  wires: [m.value + 5 mm -> e.position]")
    assert issue.startswith("7: e.position is in revolutions, what the wire gives has the unit mm; ")


def test_a_wire_reads_the_bit_of_the_telegram_that_the_controller_chose():
    text = """
farm: t
link: {kind: memory}
drives: [{name: x, model: hiwin-e1, ip: 10.77.0.11/24}]
controller:
  ip: 10.77.0.1/24
  telegram: 111
  program: {kind: positions, targets: [0, 1], speed_rpm: 240, acceleration: 6000, dwell: 100ms}
plant:
  models: [{name: there, kind: lamp}]
  wires: [x.zsw1.target_position_reached -> there.on]
"""
    with Line.from_text(text) as line:
        line.run(0.01)
        assert not line.plant.there.lit
        line.wait_running()
        line.wait_until(lambda: line["x"].zsw1.target_position_reached, 5.0)
        line.run(0.01)
        assert line.plant.there.lit
        line.wait_until(lambda: not line["x"].zsw1.target_position_reached, 5.0)
        line.run(0.01)
        assert not line.plant.there.lit


def test_limit_switches_and_digital_inputs_of_a_drive_are_the_plants_to_press():
    text = HEAD + (
        "  models: [{name: b, kind: push-button}, {name: c, kind: push-button}]\n"
        "  wires: [b.on -> x.limit_high, c.on -> x.input_5]\n"
    )
    with Line.from_text(text) as line:
        machine = line.core.axes[0].handle.axis.machine
        line.run(0.1)
        assert (int(machine.limit_switch), int(machine.inputs)) == (0, 0)
        line.plant.b.press = line.plant.c.press = True
        line.run(0.01)
        assert (int(machine.limit_switch), int(machine.inputs)) == (0x2, 0x20)
        line.plant.b.press = False
        line.run(0.01)
        assert int(machine.limit_switch) == 0


def test_a_load_torque_from_the_plant_turns_a_free_shaft_and_a_held_one_stays_in_place():
    text = HEAD + (
        "  models:\n"
        "  - {name: w, kind: first-order, time_constant: 1ms}\n"
        "  - {name: p, kind: first-order, time_constant: 1ms}\n"
        "  wires: [w.value * 1 Nm -> x.load_torque]\n"
    )
    with Line.from_text(text) as line:
        outside = line.core.axes[0].handle.axis.outside
        line.plant.w.input = -0.5
        line.run(0.5)
        assert float(outside.shaft) > 0.1
    held = text.replace("wires: [", "wires: [p.value * 1 revolutions -> x.load_position, ")
    with Line.from_text(held) as line:
        outside = line.core.axes[0].handle.axis.outside
        line.plant.w.input = -0.5
        line.plant.p.input = 0.25
        line.run(0.5)
        assert float(outside.shaft) == pytest.approx(0.25, abs=1e-6)


MODEL = """
class Barrier:
    inputs = {"position": "mm"}
    outputs = {"on": bool}

    def step(self, dt):
        self.on = 100.0 <= self.position <= 140.0
"""


def _with_file(folder: Path, source: str, more: str = "") -> Path:
    (folder / "barrier.py").write_text(source)
    file = folder / "t.pnfarm.yml"
    file.write_text(
        HEAD + f"  models: [{{name: b, python: barrier.py, step: 5ms{more}}}]\n"
        "  wires: [x.shaft_position * 40 mm -> b.position]\n"
    )
    return file


def test_a_light_barrier_in_python_takes_ten_lines(tmp_path: Path):
    with Line.from_file(_with_file(tmp_path, MODEL)) as line:
        line.core.axes[0].handle.axis.load.settings.torque = -0.05
        waited = line.wait_until(lambda: line.plant.b.on, 5.0)
        assert waited > 0.01
        assert 100.0 <= float(line.plant.b.position) <= 140.0


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("class A(:\n", "barrier.py:1: invalid syntax"),
        ("x = 1\n", "no class with a method step(self, dt)"),
        ("class A:\n    def step(self): pass\n", "barrier.py:2: A needs step(self, dt)"),
        ("class A:\n    outputs = {'on': list}\n    def step(self, dt): pass\n", "on is <class 'list'>"),
        ("class A:\n    def step(self, dt): pass\n", "A has no ports"),
        (MODEL.replace('"position": "mm"', '"on": bool'), "has 'on' as input and output"),
        ("1 / 0\n", "barrier.py:1: ZeroDivisionError"),
        (MODEL + "    def __init__(self, mass): pass\n", "models[0]: Barrier: missing a required argument: 'mass'"),
    ],
)
def test_what_is_wrong_with_a_model_in_python_is_told_with_its_line(tmp_path: Path, source: str, what: str):
    with pytest.raises(FarmFileError) as caught:
        Line.from_file(_with_file(tmp_path, source))
    assert what in str(caught.value)


def test_a_model_that_fails_stops_alone_and_its_outputs_stay(tmp_path: Path):
    source = MODEL.replace("        self.on =", "        self.count = getattr(self, 'count', 0) + 1\n"
                                                "        if self.count > 10: raise KeyError('part')\n"
                                                "        self.on = True or")  # fmt: skip
    with Line.from_file(_with_file(tmp_path, source)) as line:
        line.run(1.0)
        assert line.plant.b.on
        (failed,) = line.events("plant model failed")
        assert failed.data["model"] == "b"
        assert failed.data["error"] == "KeyError: 'part'"
        assert failed.data["line"] == 8
        # the farm goes on
        before = line.now
        line.run(1.0)
        assert line.now == pytest.approx(before + 1.0)


def test_a_model_that_gives_what_is_no_number_fails_with_a_sentence(tmp_path: Path):
    with Line.from_file(_with_file(tmp_path, MODEL.replace("100.0 <= self.position <= 140.0", "float('nan')"))) as line:
        line.run(0.1)
        (failed,) = line.events("plant model failed")
        assert "on is nan, not a finite number" in str(failed.data["error"])


@pytest.mark.parametrize(
    ("given", "found"),
    [("numpy.int64(3)", (True, 3)), ("numpy.float32(0.5)", (True, 0.5)), ("numpy.bool_(False)", (False, 0)),
     ("2", (True, 2)), ("-0.0", (False, 0))],
)  # fmt: skip
def test_numbers_of_numpy_are_numbers_and_a_bit_is_0_or_1(tmp_path: Path, given: str, found: tuple[bool, float]):
    source = f"""
import numpy

class Barrier:
    inputs = {{"position": "mm"}}
    outputs = {{"on": bool, "number": float}}

    def step(self, dt):
        self.on = self.number = {given}
"""
    with Line.from_file(_with_file(tmp_path, source)) as line:
        line.run(0.02)
        assert (line.plant.b.on, line.plant.b.number) == found
        assert line.core.plant.table.values[1] == found[0]


@pytest.mark.parametrize(
    ("start", "why"),
    [
        (
            "    def __init__(self):\n        self.on = None\n",
            "barrier.py: ValueError: on is None, not a finite number",
        ),
        ("    __slots__ = ()\n", "barrier.py: AttributeError: 'Barrier' object has no attribute 'on'"),
    ],
)
def test_a_model_whose_output_has_no_number_from_the_start_is_refused_with_a_sentence(tmp_path: Path, start, why):
    source = MODEL.replace("    def step", f"{start}\n    def step")
    with pytest.raises(ConfigError, match=f"plant model b cannot be made: .*{why}"):
        Line.from_file(_with_file(tmp_path, source))


def test_a_farm_file_is_read_without_running_the_files_of_its_models(tmp_path: Path):
    file = _with_file(tmp_path, "raise SystemExit(3)\n")
    assert parse_farm(file.read_text(), file).plant is not None


def test_a_farm_in_memory_ends_while_a_model_in_python_steps(tmp_path: Path):
    async def run() -> None:
        async with Farm(load_farm(_with_file(tmp_path, MODEL))) as farm:
            # time passes in the event loop: a step of the model is due each 5 ms
            for _ in range(1000):
                await asyncio.sleep(0.01)
                if farm.core.plant is not None and farm.core.plant.python.snapshot()["b"]["steps"]:
                    break

    asyncio.run(asyncio.wait_for(run(), 60.0))


def test_a_model_that_does_not_return_stops_alone_and_those_behind_it_go_on(tmp_path: Path):
    (tmp_path / "hangs.py").write_text(
        "class Hangs:\n    outputs = {'on': bool}\n    def step(self, dt):\n        while True: pass\n"
    )
    (tmp_path / "counts.py").write_text(
        "class Counts:\n    outputs = {'n': float}\n    def step(self, dt):\n        self.n += 1\n"
    )
    file = tmp_path / "t.pnfarm.yml"
    file.write_text(HEAD + "  models: [{name: h, python: hangs.py}, {name: c, python: counts.py}]\n")
    with Line.from_file(file) as line:
        line.run(0.1)
        (failed,) = line.events("plant model failed")
        assert (failed.data["model"], failed.data["error"]) == ("h", "no return within 1 s")
        assert line.plant.c.n == pytest.approx(100, abs=1)
