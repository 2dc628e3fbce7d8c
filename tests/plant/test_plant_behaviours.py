"""Built-in behaviours against their equations, step by step."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_bench import PlantBench

from pnfarm.behaviours.catalogue import BEHAVIOURS
from pnfarm.behaviours.declaration import Parameter
from pnfarm.behaviours.dispatch import step_behaviour


def test_a_cylinder_reports_its_end_after_its_time_to_the_step():
    bench = PlantBench({"name": "c", "kind": "cylinder", "time": "300ms"})
    bench.step()
    assert bench["c.retracted"]
    bench["c.extend"] = True
    # the step that sees the valve, and 300 of way
    assert bench.steps_until("c.extended") == 301
    assert not bench["c.retracted"]


def test_the_way_back_may_take_another_time():
    bench = PlantBench({"name": "c", "kind": "cylinder", "time": "100ms", "time_in": "250ms", "start": 1.0})
    bench["c.extend"] = True
    bench.step(10)
    assert bench["c.extended"]
    bench["c.extend"] = False
    assert bench.steps_until("c.retracted") == 251


def test_a_bistable_valve_keeps_its_last_order_and_a_centred_one_stops_the_piston():
    bench = PlantBench(
        {"name": "two", "kind": "cylinder", "time": "100ms", "valve": "bistable"},
        {"name": "mid", "kind": "cylinder", "time": "100ms", "valve": "centre"},
    )
    for name in ("two", "mid"):
        bench[f"{name}.extend"] = True
    bench.step(51)
    for name in ("two", "mid"):
        bench[f"{name}.extend"] = False
    bench.step(200)
    assert bench["two.extended"]
    assert bench["mid.position"] == pytest.approx(0.51)
    bench["mid.retract"] = True
    bench.step(200)
    assert bench["mid.retracted"]


def test_a_piston_that_is_stuck_stays_where_it_is_and_goes_on_later():
    bench = PlantBench({"name": "c", "kind": "cylinder", "time": "100ms"})
    bench["c.extend"] = True
    bench.step(31)
    bench["c.stuck"] = True
    bench.step(500)
    assert bench["c.position"] == pytest.approx(0.3)
    bench["c.stuck"] = False
    assert bench.steps_until("c.extended") == 70


def test_a_motor_starter_answers_after_its_time_and_not_while_it_has_tripped():
    bench = PlantBench({"name": "m", "kind": "motor-starter", "time_on": "40ms", "time_off": "20ms"})
    bench.step()
    bench["m.run"] = True
    assert bench.steps_until("m.running") == 41
    bench["m.trip"] = True
    assert bench.steps_until("m.running", value=False) == 21
    bench["m.trip"] = False
    bench.step(200)
    assert not bench["m.running"]
    assert bench["m.tripped"]
    bench["m.reset"] = True
    assert bench.steps_until("m.running") == 41


def test_a_sensor_is_on_over_its_range_with_hysteresis_and_delays():
    bench = PlantBench(
        {"name": "s", "kind": "position-sensor", "from": 100, "to": 140, "hysteresis": 2, "delay_off": "5ms"}
    )
    seen = []
    for place in (99.9, 100.0, 140.0, 141.9, 142.1):
        bench["s.position"] = place
        bench.step()
        seen.append(bench["s.on"])
    assert seen == [False, True, True, True, True]
    assert bench.steps_until("s.on", value=False) == 5
    bench["s.position"] = 141.0
    bench.step(10)
    assert not bench["s.on"]


def test_a_cam_is_there_again_each_period_also_backwards():
    bench = PlantBench({"name": "s", "kind": "position-sensor", "from": 0.9, "to": 1.1, "period": 1})
    found = []
    for place in (-0.95, -0.5, 0.0, 0.05, 0.2, 0.95, 7.0, 7.5):
        bench["s.position"] = place
        bench.step()
        found.append(bench["s.on"])
    assert found == [True, False, True, True, False, True, True, False]


def test_a_cam_across_the_end_of_its_period_may_end_below_its_begin():
    bench = PlantBench({"name": "s", "kind": "position-sensor", "from": 350, "to": 10, "period": 360, "hysteresis": 2})
    found = []
    for place in (180.0, 350.0, 359.0, 370.0, 371.0, 373.0, 349.0, 725.0, -5.0):
        bench["s.position"] = place
        bench.step()
        found.append(bench["s.on"])
    assert found == [False, True, True, True, True, False, False, True, True]


def test_a_contact_that_bounces_changes_in_each_step_and_settles():
    bench = PlantBench({"name": "s", "kind": "position-sensor", "from": 0, "to": 1, "bounce": "4ms"})
    bench["s.position"] = 5.0
    bench.step(20)
    bench["s.position"] = 0.5
    found = []
    for _ in range(8):
        bench.step()
        found.append(bench["s.on"])
    assert found == [True, False, True, False, True, True, True, True]


def test_what_comes_and_goes_within_the_delay_makes_no_contact_bounce():
    bench = PlantBench(
        {"name": "s", "kind": "position-sensor", "from": 0, "to": 1, "delay_on": "20ms", "delay_off": "20ms",
         "bounce": "4ms"}
    )  # fmt: skip
    found = set()
    for place, steps in ((5.0, 50), (0.5, 10), (5.0, 50)):
        bench["s.position"] = place
        for _ in range(steps):
            bench.step()
            found.add(bench["s.on"])
    assert found == {False}
    bench["s.position"] = 0.5
    bench.step(50)
    found.clear()
    for place, steps in ((5.0, 10), (0.5, 50)):
        bench["s.position"] = place
        for _ in range(steps):
            bench.step()
            found.add(bench["s.on"])
    assert found == {True}


def test_a_contact_that_nothing_moved_does_not_bounce_at_the_start():
    bench = PlantBench({"name": "s", "kind": "position-sensor", "from": 3, "to": 4, "bounce": "10ms"})
    for _ in range(30):
        bench.step()
        assert not bench["s.on"]


def test_a_process_of_first_order_is_exact_whatever_its_step():
    for step, count in (("1ms", 1000), ("20ms", 50)):
        bench = PlantBench(
            {"name": "t", "kind": "first-order", "time_constant": "2s", "gain": 80, "rest": 20, "start": 20}, step=step
        )
        bench["t.input"] = 1.0
        bench.step(count + 1)
        assert bench["t.value"] == pytest.approx(100 - 80 * math.exp(-0.5), abs=1e-9)


def test_parts_pass_the_light_barriers_of_a_conveyor_that_an_axis_moves():
    bench = PlantBench({"name": "belt", "kind": "conveyor", "length": 1000, "part": 50, "sensor_1": 300})
    bench.step()
    bench["belt.feed"] = True
    bench.step()
    assert bench["belt.parts"] == 1
    for place, seen in ((299.0, False), (300.0, True), (350.0, True), (350.5, False)):
        bench["belt.travel"] = place
        bench.step()
        assert bench["belt.at_1"] is seen, place
    bench["belt.travel"] = 1000.0
    bench.step()
    assert bench["belt.at_end"]
    bench["belt.travel"] = 1051.0
    bench.step()
    assert (bench["belt.parts"], bench["belt.left"]) == (0, 1)


def test_a_belt_carries_a_part_as_far_as_it_has_moved_itself():
    """A quarter of a million uneven steps add up to the way of the belt, within 1e-9 of it."""
    bench = PlantBench({"name": "belt", "kind": "conveyor", "length": 1e9, "part": 50})
    bench.step()
    bench["belt.feed"] = True
    bench.step()
    travel = 0.0
    for number in range(250_000):
        travel += 0.1 + 0.01 * (number % 7)
        bench["belt.travel"] = travel
        bench.step()
    assert bench["belt.front"] == pytest.approx(travel, rel=1e-9)


def test_parts_of_a_pitch_follow_each_other_without_drift():
    bench = PlantBench({"name": "belt", "kind": "conveyor", "length": 1000, "part": 50, "pitch": 100, "speed": 250})
    bench["belt.run"] = True
    bench.run(100.0)
    # 25 m less the first step
    assert bench["belt.fed"] == 250
    assert bench["belt.parts"] == pytest.approx(11, abs=1)


def test_parts_of_a_pitch_follow_each_other_also_where_the_belt_is_empty_between_them():
    bench = PlantBench({"name": "belt", "kind": "conveyor", "length": 100, "part": 10, "pitch": 500, "speed": 250})
    bench["belt.run"] = True
    bench.run(100.0)
    assert bench["belt.fed"] == 50


def test_a_part_that_is_taken_away_changes_nothing_for_the_next_one():
    bench = PlantBench({"name": "belt", "kind": "conveyor", "length": 1000, "part": 10, "pitch": 200})
    found = []
    for place in (0.0, 0.1, 150.1, 199.1, 200.1, 230.1):
        bench["belt.travel"] = place
        bench["belt.take"] = place == 150.1
        bench.step()
        found.append((bench["belt.fed"], round(bench["belt.front"], 6)))
    assert found == [(0, 0), (1, 0), (1, 0), (1, 0), (2, 0), (2, 30)]


def test_a_belt_that_went_backwards_and_comes_again_has_its_parts_where_they_were():
    bench = PlantBench({"name": "belt", "kind": "conveyor", "length": 1000, "part": 10, "pitch": 100})
    for place, parts, front in ((0.0, 0, 0), (1e-9, 1, 0), (150.0, 2, 150), (30.0, 1, 30), (-40, 0, 0), (75.0, 1, 75)):
        bench["belt.travel"] = place
        bench.step()
        assert (bench["belt.parts"], round(bench["belt.front"], 6)) == (parts, front), place


def test_a_part_fed_onto_a_belt_that_runs_backwards_is_the_only_one_there():
    bench = PlantBench({"name": "belt", "kind": "conveyor", "length": 1000, "part": 10})
    bench["belt.feed"] = True
    bench.step()
    bench["belt.feed"] = False
    bench.step()
    bench["belt.feed"] = True
    bench["belt.travel"] = -1.0
    bench.step()
    assert (bench["belt.parts"], bench["belt.front"]) == (1, 0.0)


def test_a_jam_holds_the_parts_and_a_belt_backwards_loses_them():
    bench = PlantBench({"name": "belt", "kind": "conveyor", "length": 1000, "part": 50})
    bench["belt.feed"] = True
    bench.step()
    bench["belt.jam"] = True
    bench["belt.travel"] = 2000.0
    bench.step()
    assert bench["belt.parts"] == 1
    bench["belt.jam"] = False
    bench["belt.travel"] = 1990.0
    bench.step()
    assert (bench["belt.parts"], bench["belt.left"]) == (0, 0)


def test_a_counter_counts_edges_and_an_encoder_wraps_like_a_counter_module():
    bench = PlantBench(
        {"name": "n", "kind": "counter", "preset": 3},
        {"name": "e", "kind": "encoder", "lines": 100, "limit": 1000},
        {"name": "b", "kind": "push-button"},
        wires=("b.on -> n.up",),
    )
    for _ in range(3):
        bench["b.press"] = True
        bench.step(2)
        bench["b.press"] = False
        bench.step(2)
    assert (bench["n.count"], bench["n.reached"]) == (3, True)
    bench["e.position"] = -0.0026
    bench.step()
    assert bench["e.count"] == 998
    bench["e.position"] = 2.6
    bench.step()
    assert bench["e.count"] == 40


def test_a_latching_button_changes_with_each_press():
    bench = PlantBench({"name": "b", "kind": "push-button", "action": "latching"})
    seen = []
    for press in (True, False, True, False):
        bench["b.press"] = press
        bench.step(3)
        seen.append((bench["b.on"], bench["b.off"]))
    assert seen == [(True, False), (True, False), (False, True), (False, True)]


def test_a_lamp_that_changes_twice_within_its_time_flashes():
    bench = PlantBench({"name": "l", "kind": "lamp", "within": "400ms"})
    bench.run(1.0)
    for on in (True, False, True, False):
        bench["l.on"] = on
        bench.run(0.25)
    assert bench["l.flashing"]
    bench.run(0.5)
    assert not bench["l.flashing"]


@pytest.mark.parametrize(
    ("kind", "port", "flashing"), [("lamp", "on", "flashing"), ("stack-light", "red", "red_flashing")]
)
def test_a_lamp_that_goes_on_with_the_start_has_changed_once_and_does_not_flash(kind, port, flashing):
    bench = PlantBench({"name": "l", "kind": kind})
    bench.run(0.2)
    bench[f"l.{port}"] = True
    for _ in range(100):
        bench.step()
        assert not bench[f"l.{flashing}"]
    bench[f"l.{port}"] = False
    bench.step()
    assert bench[f"l.{flashing}"]


def test_a_value_at_its_place_in_the_catalogue_is_what_the_engine_steps():
    """The engine's list of steps is written by hand: each kind moves the ports of its own declaration."""
    for number, kind in enumerate(BEHAVIOURS.values()):
        assert kind.step.__name__ in _calls_of(number), kind.name


def _calls_of(number: int) -> str:
    import inspect

    lines = inspect.getsource(getattr(step_behaviour, "py_func", step_behaviour)).splitlines()
    place = next(i for i, line in enumerate(lines) if f"number == {number}:" in line)
    return lines[place + 1]


def _number(parameter: Parameter) -> st.SearchStrategy[object]:
    if parameter.words:
        return st.sampled_from(parameter.words)
    if parameter.unit == "s":
        return st.integers(0, 5000).map(lambda ms: f"{ms}ms")
    low, high = max(parameter.low, -1e6), min(parameter.high, 1e6)
    return st.floats(low, high, allow_nan=False)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_every_value_stays_finite_and_every_bit_is_one_whatever_comes_in(data: st.DataObject):
    kind = data.draw(st.sampled_from(list(BEHAVIOURS.values())))
    keys = {one.name: data.draw(_number(one)) for one in kind.parameters}
    bench = PlantBench({"name": "m", "kind": kind.name, **keys})
    assert not bench.issues
    for _ in range(data.draw(st.integers(1, 12))):
        for port in kind.inputs:
            value = st.booleans() if port.form == "bit" else st.floats(-1e9, 1e9)
            bench[f"m.{port.name}"] = data.draw(value)
        bench.step(data.draw(st.integers(1, 40)))
        for port in kind.outputs:
            value = bench[f"m.{port.name}"]
            assert isinstance(value, bool) if port.form == "bit" else math.isfinite(value)
