"""FMUs as models of the plant: what they get and give, and what becomes of a farm whose FMU does not behave."""

import gc
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from fmus import DESCRIPTION, TROUBLE, bench_fmu, needs_fmpy, python_fmu
from plant_bench import PlantBench

from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.farm.state.content import TakenState, check_state, put_state
from pnfarm.plant.events import PlantModelFailed, PlantModelLate
from pnfarm.plant.fmi import models as fmu_models
from pnfarm.testing import Line

pytestmark = needs_fmpy


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    return bench_fmu(tmp_path_factory.mktemp("fmu"))


@pytest.fixture(scope="module")
def tank(tmp_path_factory):
    return python_fmu("tank.py", tmp_path_factory.mktemp("fmu"))


@pytest.fixture
def make():
    """Plants whose FMUs are ended after the test."""
    made = []

    def one(path, *, in_real_time=False, wires=(), step="2ms", on_failure=None, **parameters):
        model = {"name": "press", "fmu": str(path), "step": step, "parameters": parameters}
        if on_failure is not None:
            model["on_failure"] = on_failure
        made.append(PlantBench(model, wires=wires, in_real_time=in_real_time))
        assert not made[-1].issues
        return made[-1]

    yield one
    for plant in made:
        plant.fmus.close()


def _troubled(make, bench, trouble, at=3, **more):
    return make(bench, trouble=TROUBLE.index(trouble), at=at, **more)


def _alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"


def _pid(plant):
    return plant.fmus._fmus[0].process.pid


def _ended(pid):
    until = time.monotonic() + 20
    while _alive(pid) and time.monotonic() < until:
        time.sleep(0.01)
    return not _alive(pid)


def test_an_fmu_steps_at_its_own_time_with_the_inputs_of_the_steps_begin(make, bench):
    plant = make(bench, gain=3.0)
    assert (plant["press.u"], plant["press.y"], plant["press.count"]) == (2.0, 6.0, 0)
    plant["press.u"] = 5.0
    plant.run(0.003)
    # the first step began with the start value; its end is where the second one got the new value
    assert (plant["press.count"], plant["press.y"]) == (1, 6.0)
    plant.run(0.002)
    assert (plant["press.count"], plant["press.y"]) == (2, 15.0)
    plant.run(0.1)
    assert plant["press.count"] == 52
    assert plant["press.seconds"] == pytest.approx(0.104)


def test_inputs_are_numbers_whole_numbers_and_switches_within_the_limits_of_the_description(make, bench):
    plant = make(bench)
    for given, y, number, whole in ((7.5, 7.5, 3.6, 4), (1e9, 100.0, 1e9, 7), (-1e9, -100.0, -1e12, -(2**31))):
        plant["press.u"], plant["press.n[1]"] = given, number
        plant.run(0.006)
        assert (plant["press.y"], plant["press.whole"]) == (y, whole)
    assert plant["press.off"] is True
    plant["press.on"] = True
    plant.run(0.006)
    assert plant["press.off"] is False


def test_wires_join_an_fmu_with_other_models_and_its_text_parameters_reach_it(make, bench):
    plant = make(bench, label="hello", wires=("press.count * 2 -> press.n[1]",))
    assert plant["press.length"] == 5
    plant.run(0.007)
    # the wire saw the first count before the third step began, which is done
    assert (plant["press.count"], plant["press.whole"]) == (3, 2)


def test_the_same_plant_gives_the_same_values_each_time(make, bench):
    runs = []
    for _ in range(2):
        plant = make(bench, wires=("press.y * 1 mm + 1 -> press.u",))
        plant.run(0.05)
        runs.append([plant[f"press.{name}"] for name in ("y", "count", "seconds")])
    assert runs[0] == runs[1]


@pytest.mark.parametrize(
    ("trouble", "why"),
    [
        ("crash", "its process ended, SIGABRT"),
        ("exit", "its process ended with code 3"),
        ("refuse", "fmi2DoStep failed with status 3 (error).; it says: the press is jammed"),
        ("not a number", "y is nan, not a finite number"),
        ("last", "it asks for the end of the simulation"),
    ],
)
def test_an_fmu_that_fails_is_an_event_and_its_outputs_hold(make, bench, trouble, why):
    plant = _troubled(make, bench, trouble)
    plant.run(0.1)
    [failed] = plant.events
    assert isinstance(failed, PlantModelFailed)
    assert (failed.model, failed.error, failed.file) == ("press", why, str(bench))
    # as many steps as were good
    assert (plant["press.count"], plant["press.y"]) == ((2 if trouble == "not a number" else 3), 2.0)
    assert plant.fmus.snapshot()["press"]["failure"] == why
    assert _ended(_pid(plant))


def test_outputs_of_an_fmu_that_failed_have_the_values_of_the_farm_file(make, bench):
    plant = _troubled(make, bench, "crash", on_failure={"y": 0.5, "off": False})
    plant.run(0.1)
    assert (plant["press.y"], plant["press.off"], plant["press.count"]) == (0.5, False, 3)


def test_an_fmu_that_does_not_return_has_failed_after_the_limit(make, bench, monkeypatch):
    monkeypatch.setattr(fmu_models, "STEP_NS", 300_000_000)
    plant = _troubled(make, bench, "hang")
    plant.run(0.02)
    assert [event.error for event in plant.events] == ["a step did not end within 0.3 s"]
    assert _ended(_pid(plant))


def test_in_real_time_nobody_waits_for_a_late_fmu_which_makes_up_for_what_it_missed(make, bench, monkeypatch, tmp_path):
    gate = tmp_path / "gate"
    monkeypatch.setenv("PNFARM_TEST_GATE", str(gate))
    plant = _troubled(make, bench, "gated", at=0, in_real_time=True)
    fmus, now, began = plant.fmus, plant.now, time.perf_counter()
    for _ in range(5):
        now = fmus.next_deadline()
        fmus.service(now)
    assert fmus.snapshot()["press"]["missed_steps"] == 5
    assert (plant["press.count"], plant.events) == (0, [])
    # longer than the step, whose length this is
    time.sleep(0.003)
    opened = time.perf_counter() - began
    gate.touch()
    until = time.monotonic() + 20
    while plant["press.count"] == 0 and time.monotonic() < until:
        time.sleep(0.001)
        now = fmus.next_deadline()
        fmus.service(now)
    missed = fmus.snapshot()["press"]["missed_steps"]
    [late] = plant.events
    assert isinstance(late, PlantModelLate)
    assert (late.model, late.step_seconds, late.missed) == ("press", 0.002, missed)
    assert late.duration_seconds >= opened
    assert plant.late[-1] == (now, 2_000_000 * missed)
    assert fmus._fmus[0].process.answer(20_000_000_000) is not None
    fmus.service(fmus.next_deadline())
    # at most ten steps in one
    assert plant["press.seconds"] == pytest.approx(0.002 + 0.002 * min(missed + 1, 10))


def test_in_real_time_an_fmu_that_hangs_has_failed_after_the_limit(make, bench, monkeypatch):
    monkeypatch.setattr(fmu_models, "STEP_NS", 100_000_000)
    plant = _troubled(make, bench, "hang", at=0, in_real_time=True)
    until = time.monotonic() + 20
    while not plant.events and time.monotonic() < until:
        plant.fmus.service(plant.fmus.next_deadline())
    assert [event.error for event in plant.events] == ["a step did not end within 0.1 s"]
    assert plant.fmus.next_deadline() is None


def test_in_real_time_an_fmu_that_dies_is_an_event(make, bench):
    plant = make(bench, in_real_time=True, on_failure={"y": 0.0})
    os.kill(_pid(plant), signal.SIGKILL)
    until = time.monotonic() + 20
    while not plant.events and time.monotonic() < until:
        plant.fmus.service(plant.fmus.next_deadline())
    assert [event.error for event in plant.events] == ["its process ended, SIGKILL"]
    assert plant["press.y"] == 0.0


def test_a_saved_state_continues_in_another_farm_and_what_is_none_is_refused(make, bench):
    first, second = make(bench, gain=0.9), make(bench, gain=0.5)
    for plant in (first, second):
        plant["press.u"] = 3.0
    first.run(0.021)
    second.run(0.004)
    found, notes = first.fmus.states(first.now)
    assert notes == []
    saved = found["press"]
    for odd in (
        [],
        {},
        {"press": 3},
        {"press": {**saved, "token": "x"}},
        {"press": {**saved, "state": "%"}},
        {"press": {**saved, "state": 1}},
        {"press": {**saved, "time_ns": -1}},
        {"press": {**saved, "time_ns": 0.5}},
        {"press": {**saved, "remaining_ns": 10**9}},
        {"press": {**saved, "more": 1}},
    ):
        with pytest.raises(ConfigError, match=r"FMU|time that it cannot have|not in base64"):
            second.fmus.check_states(odd)
    second.fmus.check_states(json.loads(json.dumps(found)))
    second.run(0.002)
    assert (second["press.count"], second["press.y"]) == (2, 1.5)
    assert second.fmus.put_states(found, second.now) == []
    for plant in (first, second):
        plant.run(0.040)
    seen = [[plant[f"press.{name}"] for name in ("y", "count", "seconds")] for plant in (first, second)]
    assert seen[0] == seen[1] == [2.7, 30, pytest.approx(0.06)]


def test_an_fmu_hears_in_each_step_that_a_state_of_before_may_be_put_back(make, bench):
    plant = make(bench)
    plant.run(0.009)
    assert (plant.events, plant["press.count"]) == ([], 4)


def test_an_fmu_that_refuses_a_state_goes_on_with_its_own(make, bench):
    plant = make(bench)
    plant.run(0.009)
    found, _ = plant.fmus.states(plant.now)
    found["press"]["state"] = "AAAA"
    plant.fmus.check_states(found)
    [note] = plant.fmus.put_states(found, plant.now)
    assert note.startswith("press: the inner state of its FMU continues: fmi2DeSerializeFMUstate failed")
    plant.run(0.1)
    assert plant["press.count"] == 54
    assert plant.events == []


def test_an_fmu_that_has_failed_or_dies_meanwhile_is_a_sentence(make, bench):
    plant = make(bench)
    found, _ = plant.fmus.states(plant.now)
    os.kill(_pid(plant), signal.SIGKILL)
    [note] = plant.fmus.put_states(found, plant.now)
    assert note == "press: the inner state of its FMU continues: it has failed: its process ended, SIGKILL"
    assert plant.fmus.states(plant.now) == (
        {"press": None},
        ["press: the inner state of its FMU is not saved: it has failed"],
    )
    assert [type(event) for event in plant.events] == [PlantModelFailed]


def test_a_save_in_real_time_does_not_wait_for_a_step_without_end(make, bench, monkeypatch):
    monkeypatch.setattr(fmu_models, "BUSY_NS", 100_000_000)
    plant = _troubled(make, bench, "hang", at=0, in_real_time=True)
    found, notes = plant.fmus.states(plant.now)
    assert found == {"press": None}
    assert notes == ["press: the inner state of its FMU is not saved: it is in a step of more than 0.1 s"]


CELL = """farm: cell
link: {kind: memory}
drives: [{name: x, model: akd-profinet, ip: 10.77.0.11/24}]
plant:
  step: 2ms
  models: [{name: press, fmu: FMU}]
"""


def _taken(line):
    state = TakenState(line.core)
    return json.loads(json.dumps(state.plain())), [note for note in state.notes if "press" in note]


def _put(line, state):
    return [note for note in put_state(line.core, check_state(line.core, state), line.now_ns) if "press" in note]


def test_a_farms_state_has_what_is_inside_an_fmu(bench):
    with Line.from_text(CELL.replace("FMU", str(bench))) as line:
        line.run(0.1)
        state, notes = _taken(line)
        assert notes == []
        count, seconds = line.plant.press.count, line.plant.press.seconds
        line.run(0.1)
        assert line.plant.press.count > count + 40
        assert _put(line, state) == []
        assert (line.plant.press.count, line.plant.press.seconds) == (count, seconds)
        line.run(0.02)
        assert count + 9 <= line.plant.press.count <= count + 11
        assert line.plant.press.seconds == pytest.approx(2e-3 * line.plant.press.count)
        state["plant"]["fmus"]["press"]["token"] = "x"
        with pytest.raises(ConfigError, match="plant model press has the state of another FMU"):
            _put(line, state)


def test_a_farms_state_says_which_fmu_cannot_save_its_own(tank):
    with Line.from_text(CELL.replace("FMU", str(tank))) as line:
        line.plant.press.inflow = 1.0
        line.run(0.1)
        state, notes = _taken(line)
        assert notes == ["press: the inner state of its FMU is not saved: it cannot save its state"]
        line.run(0.1)
        assert _put(line, state) == ["press: the inner state of its FMU continues: it was not saved"]
        line.run(0.1)
        assert line.plant.press.level == pytest.approx(0.3, abs=0.02)
        with pytest.raises(ConfigError, match="a line with FMUs cannot go back to a moment: press cannot"):
            line.save()


def test_an_fmu_written_in_python_steps_and_its_exception_is_its_failure(make, tank):
    plant = make(tank, area=2.0, step="10ms")
    plant["press.inflow"] = 4.0
    plant.run(1.001)
    assert plant["press.level"] == pytest.approx(0.99 * 2.0)
    assert (plant["press.full"], plant["press.litres"]) == (True, pytest.approx(3960, abs=1))
    assert plant.fmus.states(plant.now)[0] == {"press": None}, "it cannot save its state"
    plant.run(4.0)
    [failed] = plant.events
    assert "fmi3DoStep failed" in failed.error
    assert "the tank burst" in failed.error


def test_an_fmu_that_cannot_be_made_is_a_sentence(bench, make, tmp_path):
    with pytest.raises(ConfigError, match=r"plant model press cannot be made: \S+bench.fmu: fmi2EnterInitialization"):
        _troubled(make, bench, "refuse", at=-1)
    other = bench_fmu(tmp_path, DESCRIPTION.replace('guid="bench"', 'guid="x"'))
    with pytest.raises(ConfigError, match="Failed to instantiate model"):
        make(other)


def test_without_fmpy_the_message_says_what_to_install(make, bench, monkeypatch):
    monkeypatch.setattr("pnfarm.plant.fmi.process.find_spec", lambda _: None)
    with pytest.raises(EnvironmentError_, match=r"plant model press is an FMU, .*pip install 'pnfarm\[fmi\]'"):
        make(bench)


def test_a_line_ends_its_fmu_in_good_order(bench, monkeypatch, tmp_path):
    monkeypatch.setenv("PNFARM_TEST_TERMINATED", str(tmp_path / "terminated"))
    text = f"""
farm: t
link: {{kind: memory}}
drives:
- {{name: x, model: akd-profinet, ip: 10.77.0.11/24}}
plant:
  models: [{{name: press, fmu: {bench}, step: 10ms}}]
  wires: [press.y -> x.load_torque, x.shaft_position * 100 mm -> press.u]
"""
    with Line.from_text(text) as line:
        line.run(0.1)
        assert float(line.plant.press.count) == 10
        pid = line.core.plant.fmus._fmus[0].process.pid
    assert (tmp_path / "terminated").is_symlink()
    assert not _alive(pid)


def test_an_fmu_whose_plant_is_forgotten_ends(bench):
    plant = PlantBench({"name": "press", "fmu": str(bench)})
    pid = _pid(plant)
    del plant
    gc.collect()
    assert _ended(pid)


def test_an_fmu_in_the_midst_of_a_step_ends_when_the_farm_is_killed(bench):
    code = (
        "import sys, time; sys.path.insert(0, 'tests/support')\n"
        "from plant_bench import PlantBench\n"
        f"model = {{'name': 'press', 'fmu': {str(bench)!r}, 'parameters': {{'trouble': {TROUBLE.index('hang')}}}}}\n"
        "plant = PlantBench(model)\n"
        "print(plant.fmus._fmus[0].process.pid, flush=True)\n"
        "time.sleep(600)\n"
    )
    farm = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2]
    )
    with farm:
        pid = int(farm.stdout.readline())
        assert _alive(pid)
        farm.kill()
    assert _ended(pid)
