"""A step that puts the whole farm into a saved state."""

import asyncio
import json

import httpx
import pytest
from api_world import BASE, ApiWorld

from pnfarm.cli.commands.run import bound
from pnfarm.errors import ConfigError
from pnfarm.farm.state.states import SavedStates
from pnfarm.scenario.definition.file import load_scenario
from pnfarm.scenario.virtual import run_virtual
from pnfarm.testing import Line

FARM = """farm: cell
link: {kind: memory}
state: kept
drives:
  - {name: axis-01, model: akd-profinet, ip: 10.77.0.11/24}
controller: {ip: 10.77.0.1/24, program: {kind: constant, speed_rpm: 60, acknowledge_after: 100ms}}
plant:
  models:
    - {name: gripper, kind: cylinder, time: 300ms}
    - {name: parts, kind: counter}
  wires:
    - gripper.extended -> parts.up
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A farm file, and the state `closed`: a gripper that has closed once."""
    folder = tmp_path_factory.mktemp("cell")
    (folder / "cell.pnfarm.yml").write_text(FARM)
    with Line.from_file(folder / "cell.pnfarm.yml") as line:
        line.wait_running()
        line.plant.gripper.extend = True
        line.run(0.5)
        states = SavedStates(line.core, line.core.states_folder, lambda: line.now_ns)
        asyncio.run(states.save("closed"))
    assert (folder / "kept" / "states" / "closed.json").exists()
    return folder


def checked(folder, *steps):
    path = folder / "restore.scenario.yml"
    path.write_text("scenario: restore\nfarm: cell.pnfarm.yml\nsteps:\n" + "".join(f"  - {step}\n" for step in steps))
    return bound(load_scenario(path))


def carried_out(folder, *steps):
    record, _ = asyncio.run(run_virtual(*checked(folder, *steps)))
    return record


def test_a_scenario_goes_on_from_a_saved_state(folder):
    record = carried_out(
        folder,
        "wait: {until: all-connected, within: 10s}",
        "expect: {that: parts.count == 0 and gripper.retracted}",
        "restore: closed",
        "expect: {that: parts.count == 1 and gripper.extended}",
        "expect: {drive: axis-01, that: connected, within: 10s}",
        "set: {gripper.extend: false}",
        "expect: {that: gripper.retracted, within: 1s}",
        "repeat: {for: {name: [closed]}, steps: [{restore: {state: $name}}]}",
        "expect: {that: gripper.extended, for: 100ms}",
    )
    assert record["verdict"] == "passed", record["cases"]
    told = {entry["text"] for entry in record["timeline"]}
    assert {"restore closed", "axis-01: its connection to 10.77.0.1 is set up again by its controller"} <= told


def test_a_fault_of_the_scenario_stays_in_force(folder):
    record = carried_out(
        folder,
        "wait: {until: state == S4, within: 10s}",
        "fault: {kind: link-down, on: axis-01, as: cable}",
        "restore: closed",
        "expect: {drive: axis-01, that: not connected, for: 5s}",
        "clear: cable",
        "expect: {drive: axis-01, that: state == S4, within: 20s}",
    )
    assert record["verdict"] == "passed", record["cases"]


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("restore: opened", "restore.scenario.yml:5: steps[1].restore: there is no state opened; allowed: closed"),
        ("restore: clsed", "there is no state clsed, did you mean closed?"),
        ("restore: ../closed", "5: steps[1].restore.state: is '../closed'; allowed: the name"),
        ("restore: {name: closed}", "is not a key here"),
        ("restore: [closed]", "5: steps[1].restore.state: is a list; allowed: the name"),
    ],
)
def test_a_state_that_is_not_there_is_an_error_at_its_line(folder, step, sentence):
    with pytest.raises(ConfigError) as error:
        checked(folder, "wait: 1ms", step)
    assert sentence in str(error.value)


def test_a_state_that_the_farm_cannot_have_is_refused_at_its_line_before_anything_happens(folder):
    state = json.loads((folder / "kept" / "states" / "closed.json").read_text())
    state["plant"]["models"] = {}
    (folder / "kept" / "states" / "other.json").write_text(json.dumps(state))
    with pytest.raises(ConfigError, match=r"5: steps\[1\].restore: state other cannot be restored: it is of another"):
        carried_out(folder, "fault: {kind: f702, on: axis-01}", "restore: other")
    (folder / "kept" / "states" / "other.json").unlink()


def test_a_farm_file_without_a_folder_for_states_is_an_error_at_the_line(folder):
    (folder / "none.pnfarm.yml").write_text(FARM.replace("state: kept\n", ""))
    path = folder / "none.scenario.yml"
    path.write_text("scenario: restore\nfarm: none.pnfarm.yml\nsteps: [{restore: closed}]\n")
    with pytest.raises(ConfigError, match=r"3: .*there is no state closed; allowed: `state: FOLDER` in the farm file"):
        bound(load_scenario(path))


def over_the_api(world, text):
    async def run():
        transport = httpx.ASGITransport(world.app)
        async with httpx.AsyncClient(transport=transport, base_url=BASE) as client:
            answer = await client.post("/api/v1/scenarios", json={"text": text})
            while answer.status_code < 300 and answer.json()["state"] != "ended":
                world.line.run(0.02)
                # the scenario is a task of this loop
                await asyncio.sleep(0)
                answer = await client.get(f"/api/v1/scenarios/{answer.json()['id']}")
            world.context.close()
            return answer

    return asyncio.run(run())


def test_a_running_farm_restores_for_a_client_of_its_api(tmp_path):
    world = ApiWorld(1)
    world.line.enable()
    farm = world.line.farm
    farm.states_folder = tmp_path
    asyncio.run(SavedStates(farm, tmp_path, lambda: world.line.world.now).save("on"))
    steps = "steps:\n  - power: {off: axis-01}\n  - restore: STATE\n  - expect: {drive: axis-01, that: powered}\n"
    answer = over_the_api(world, "scenario: api\n" + steps.replace("STATE", "on"))
    assert answer.json()["verdict"] == "passed", answer.text
    refused = over_the_api(world, "scenario: api\n" + steps.replace("STATE", "off"))
    assert refused.status_code == 422
    assert "<scenario>:4: steps[1].restore: there is no state off" in refused.text
