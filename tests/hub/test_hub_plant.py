"""The plants of farms in memory, through the hub."""

import pytest
from api_world import assert_problem
from hub_world import HubWorld

PLANT = """
plant:
  step: 2ms
  models:
    - {name: gripper-NUMBER, kind: cylinder, time: 20ms}
    - {name: parts-NUMBER, kind: counter}
  wires:
    - gripper-NUMBER.extended -> parts-NUMBER.up
"""


@pytest.fixture
def world():
    return HubWorld(("axis-{n:02}", 1), ("pump-{n:02}", 1), devices=PLANT)


def test_the_plants_of_all_shards_are_one_answer(world):
    found = world.get("plant").json()
    assert [(one["name"], one["shard"]) for one in found["models"]] == [
        ("gripper-1", "s1:8702"),
        ("parts-1", "s1:8702"),
        ("gripper-2", "s2:8702"),
        ("parts-2", "s2:8702"),
    ]
    assert [(wire["source"], wire["shard"]) for wire in found["wires"]] == [
        ("gripper-1.extended", "s1:8702"),
        ("gripper-2.extended", "s2:8702"),
    ]
    assert (found["step_seconds"], found["partial"]) == (0.002, False)
    world.lose(2)
    found = world.get("plant").json()
    assert ({one["shard"] for one in found["models"]}, found["partial"]) == ({"s1:8702"}, True)


def test_a_models_ports_are_read_and_written_at_the_shard_that_has_it(world):
    path = "devices/gripper-2/signals"
    written = world.request("PATCH", path, json={"extend": True})
    assert written.status_code == 200, written.text
    world.run(0.1)
    values = {one["name"]: one["value"] for one in world.get(path).json()["signals"]}
    assert (values["extended"], values["position"]) == (True, 1.0)
    values = {one["name"]: one["value"] for one in world.get("devices/gripper-1/signals").json()["signals"]}
    assert values["extended"] is False
    assert not [line for line in world[1].requests if "gripper-2" in line]
    wired = world.request("PATCH", "devices/parts-2/signals", json={"up": True})
    assert_problem(wired, 422, "a wire")


@pytest.mark.parametrize(
    ("on", "signals"),
    [
        ("pump-01", ["velocity", "gripper-2.position"]),
        ("gripper-2", ["position", "extended"]),
        ("gripper-2", ["gripper-2.position"]),
    ],
)
def test_a_trace_on_a_models_port_goes_to_its_shard(world, on, signals):
    fields = {"on": [on], "signals": signals, "trigger": "gripper-2.extended", "pre": "40ms", "length": "80ms"}
    started = world.post("traces", fields)
    assert started.status_code in {200, 201}, started.text
    name = started.json()["id"]
    world.run(0.1)
    world.request("PATCH", "devices/gripper-2/signals", json={"extend": True})
    world.run(0.5)
    found = world.get(f"traces/{name}").json()
    assert found["state"] == "complete"
    (position,) = [column for column in found["columns"] if column["signal"].endswith("position")]
    # it goes from end to end in 20 ms, before the trigger
    assert (position["values"][0], position["values"][-1]) == (0, 1)
    assert not [line for line in world[1].requests if line.startswith("POST /api/v1/traces")]


def test_the_signals_that_a_trace_can_have_of_a_model_are_listed(world):
    found = world.get("traces/signals/gripper-2").json()["signals"]
    assert {"extend", "position", "extended"} <= {one["signal"] for one in found}
    assert_problem(world.get("traces/signals/gripper-3"), 404, "there is no drive 'gripper-3'")


def test_a_trace_of_models_of_two_shards_is_refused(world):
    fields = {"on": ["model:cylinder"], "signals": ["position"], "length": "80ms"}
    assert_problem(world.post("traces", fields), 422, "means stations of 2 shards", "start a trace for each")
