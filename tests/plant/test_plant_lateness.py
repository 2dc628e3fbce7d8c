"""The plant in real time: when it steps; what is late is left out, counted, and makes a verdict inconclusive."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np
import pytest
from plant_bench import PlantBench

from pnfarm.config.plant import PlantSection
from pnfarm.engine.tick import tick
from pnfarm.plant.events import PlantStepsLeftOut
from pnfarm.plant.plan import plan_plant
from pnfarm.plant.python_models import PythonModels
from pnfarm.scenario.lateness import FarmLateness
from pnfarm.testing import Line
from pnfarm.user_code.thread import CodeThread
from pnfarm.vocabulary.durations import parse_duration

MS = 1_000_000
MODEL = """
class Ramp:
    outputs = {"value": float}

    def step(self, dt):
        self.value += dt
"""


@pytest.fixture
def models(tmp_path: Path):
    (tmp_path / "ramp.py").write_text(MODEL)
    section = PlantSection.model_validate({"models": [{"name": "ramp", "python": "ramp.py", "step": "5ms"}]})
    plan = plan_plant(section, {}, {}, tmp_path, lambda *issue: pytest.fail(str(issue)))
    late: list[tuple[int, int]] = []
    found = PythonModels(
        plan.models.values(), np.zeros(1), lambda *_: None, late=lambda now, ns: late.append((now, ns))
    )
    found.start(0)
    yield found, late
    found.close()


FRAGILE = """
class Fragile:
    outputs = {"value": float}

    def __init__(self):
        self.broken = False

    def step(self, dt):
        if self.broken:
            raise ValueError("broken")
"""


def test_a_model_that_failed_steps_again_in_real_time_when_a_state_brings_it_back(tmp_path: Path):
    (tmp_path / "fragile.py").write_text(FRAGILE)
    section = PlantSection.model_validate({"models": [{"name": "m", "python": "fragile.py"}]})
    plan = plan_plant(section, {}, {}, tmp_path, lambda *issue: pytest.fail(str(issue)))
    failed, stepped = threading.Event(), threading.Event()
    models = PythonModels(
        plan.models.values(), np.zeros(1), lambda *_: failed.set(), late=lambda *_: failed.is_set() and stepped.set()
    )
    whole, _ = models.states()
    models._models[0].model.broken = True
    models.start(time.monotonic_ns())
    thread = CodeThread(models, pytest.fail, "plant")
    thread.start()
    try:
        assert failed.wait(20.0)
        models.put_states(whole, time.monotonic_ns())
        assert stepped.wait(20.0)
        assert models.snapshot()["m"]["failure"] == ""
    finally:
        thread.close()


def test_steps_that_were_due_while_the_machine_stood_are_left_out_and_counted(models):
    python, late = models
    python.service(5 * MS)
    assert python.snapshot()["ramp"]["missed_steps"] == 0
    python.service(32 * MS)
    assert python.snapshot()["ramp"]["missed_steps"] == 4
    assert python.next_deadline() == 35 * MS
    assert python.snapshot()["ramp"]["steps"] == 2
    assert late[-1][0] == 32 * MS
    assert late[-1][1] >= 22 * MS


def test_steps_of_the_plant_that_were_left_out_are_in_the_log_at_most_once_per_second():
    bench = PlantBench({"name": "lamp", "kind": "lamp"}, in_real_time=True)
    bench.service()
    bench.stand(0.3)
    bench.stand(0.4)
    bench.service()
    assert bench.events == []
    bench.stand(0.5)
    bench.service()
    assert bench.events == [PlantStepsLeftOut(1200)]
    for _ in range(20):
        bench.stand(0.06)
        bench.service()
    # up to 64 steps are made up for
    assert bench.events == [PlantStepsLeftOut(1200)]
    bench.stand(0.1)
    bench.service()
    bench.stand(1.0)
    bench.service()
    assert bench.events == [PlantStepsLeftOut(1200), PlantStepsLeftOut(1100)]


SPRINGS = {
    "elastic-load": "axis: x1, inertia: 2.0e-4, stiffness: 5",
    "elastic-coupling": "axes: [x1, x2], stiffness: 5",
}


@pytest.mark.parametrize("kind", SPRINGS)
def test_a_spring_swings_on_behind_a_time_in_which_the_machine_stood(kind):
    text = f"""
farm: t
link: {{kind: memory}}
drives:
- {{name: "x{{n}}", count: 2, model: akd-profinet, ip: 10.77.0.11/24, load: {{inertia: 1.0e-4, friction: 0}}}}
plant:
  models: [{{name: spring, kind: {kind}, {SPRINGS[kind]}}}]
"""
    with Line.from_text(text) as line:
        line.run(0.01)
        line.plant.spring.offset = 0.01
        line.run(0.2)
        now = line.now_ns + 300 * MS
        twists = []
        for number in range(200):
            tick(line.core.columns, 0, now + number * MS)
            twists.append(abs(float(line.plant.spring.twist)))
        assert int(line.core.columns.engine[0].plant_late) > 200
        assert max(twists) < 0.0105


@pytest.mark.parametrize("step", ["0.5ms", "1ms", "5ms"])
def test_a_plant_in_real_time_steps_in_ticks_that_send_whenever_it_was_started(step):
    bench = PlantBench({"name": "lamp", "kind": "lamp"}, step=step, in_real_time=True)
    begin = 7_000_123_456
    bench.start(begin)
    due = bench.due_ns
    assert due % parse_duration(step) == 0
    assert begin - parse_duration(step) < due <= begin


def test_a_plant_that_is_late_makes_a_failure_inconclusive():
    with Line("axis-01") as line:
        line.wait_running()
        lateness = FarmLateness(line.core, 10 * MS, line.now_ns)
        begin = line.now_ns
        line.run(0.1)
        assert not lateness.was_late(begin, line.now_ns)
        line.core.lateness.plant.note(line.now_ns, 25 * MS)
        line.run(0.001)
        assert lateness.was_late(begin, line.now_ns)
        assert "plant" in lateness.told


def test_a_plants_step_is_compiled_before_its_time_begins(monkeypatch):
    bench = PlantBench({"name": "button", "kind": "push-button"}, in_real_time=True)
    monkeypatch.setattr("pnfarm.plant.table.address_of", lambda *_: pytest.fail("compiled while the farm's time runs"))
    bench.start(bench.now)
