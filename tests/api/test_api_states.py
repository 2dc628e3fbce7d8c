"""Saved states through the API and the hub, of farms in virtual time."""

import asyncio

import httpx
import pytest
from api_world import ApiWorld, assert_problem
from hub_world import TOKEN, HubWorld

from pnfarm.api import make_app
from pnfarm.farm.state.states import SavedStates


def serve(world, farm, clock, folder, **options):
    """Another application of a farm, with a folder for states."""
    return make_app(
        farm,
        now=lambda: clock.now,
        poke=lambda: farm.service(clock.now),
        states=SavedStates(farm, folder, lambda: clock.now),
        **options,
    )


@pytest.fixture
def world(tmp_path):
    world = ApiWorld(2)
    world.app = serve(world, world.line.farm, world.line.world, tmp_path / "states")
    world.folder = tmp_path / "states"
    return world


def test_a_state_is_saved_listed_restored_and_deleted(world):
    answer = world.put("/api/v1/states/mid", {})
    assert (answer.status_code, answer.json()["state"]) == (200, "mid")
    (found,) = world.get("/api/v1/states").json()["states"]
    assert found["state"] == "mid"
    assert found["octets"] == (world.folder / "mid.json").stat().st_size
    assert world.post("/api/v1/states/mid/restore").status_code == 200
    assert world.delete("/api/v1/states/mid").json() == {"state": "mid", "notes": []}
    assert world.get("/api/v1/states").json() == {"states": []}


def test_an_unknown_state_a_wrong_name_and_a_hostile_file_are_refused(world):
    assert_problem(world.post("/api/v1/states/none/restore"), 404, "there is no state none")
    assert_problem(world.put("/api/v1/states/..%5Cup", {}), 422, "is no name of a state")
    world.put("/api/v1/states/mid", {})
    (world.folder / "mid.json").write_text('{"pnfarm_state": 1, "layout": []}')
    assert_problem(world.post("/api/v1/states/mid/restore"), 422, "state mid cannot be restored", "another version")


def test_a_farm_without_a_folder_says_so(tmp_path):
    assert_problem(ApiWorld(1).put("/api/v1/states/mid", {}), 422, "no folder for states", "--state DIR")


def test_the_hub_restores_every_shard_once_each_says_that_it_can(tmp_path):
    world = HubWorld(("axis-{n:02}", 2), ("pump-{n:02}", 1))
    for number in (1, 2):
        shard = world[number]
        app = serve(world, shard.farm, shard.line.world, tmp_path / str(number), token=TOKEN)
        shard.inner = httpx.ASGITransport(app, raise_app_exceptions=False)
    assert world.request("PUT", "states/mid", json={}).status_code == 200
    found = world.get("states").json()
    assert [(one["state"], one["shard"]) for one in found["states"]] == [("mid", "s1:8702"), ("mid", "s2:8702")]
    assert world.request("POST", "states/mid/restore").status_code == 200
    (tmp_path / "2" / "mid.json").write_text("{}")
    world[1].requests.clear()
    assert_problem(world.request("POST", "states/mid/restore"), 422, "state mid cannot be restored")
    assert world[1].requests == ["POST /api/v1/states/mid/restore"]
    world.lose(2)
    assert world.request("PUT", "states/mid", json={}).status_code == 503


def test_a_scenario_that_the_hub_carries_out_restores_every_shard(tmp_path):
    world = HubWorld(("axis-{n:02}", 1), ("pump-{n:02}", 1))
    for number in (1, 2):
        shard = world[number]
        app = serve(world, shard.farm, shard.line.world, tmp_path / str(number), token=TOKEN)
        shard.inner = httpx.ASGITransport(app, raise_app_exceptions=False)
    assert world.request("PUT", "states/mid", json={}).status_code == 200

    def carried_out(name):
        async def run():
            transport = httpx.ASGITransport(world.app)
            async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1/api/v1") as client:
                text = f"scenario: s\nsteps:\n  - restore: {name}\n"
                begun = (await client.post("scenarios", json={"text": text})).json()
                for _ in range(500):
                    found = (await client.get(f"scenarios/{begun['id']}")).json()
                    if found["state"] == "ended":
                        break
                    # the hub carries it out in a task of this loop, and says that it ended when it is asked
                    await asyncio.sleep(0.01)
                return found

        return asyncio.run(run())

    world[1].requests.clear()
    assert carried_out("mid")["verdict"] == "passed"
    assert world[1].requests.count("POST /api/v1/states/mid/restore") == 2
    (refused,) = carried_out("none")["cases"]
    assert (refused["verdict"], refused["line"]) == ("error", 3)
    assert "there is no state none" in refused["message"]
