"""Scenarios that a running farm carries out for a client of its API."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

import httpx
import pytest
from api_world import BASE, ApiWorld, assert_problem

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

SCENARIO = """
scenario: over-http
steps:
  - wait: {until: all-connected, within: 5s}
  - fault: {kind: f702, on: axis-01, as: trip}
  - expect: {drive: axis-01, that: fault == 702, within: 1s}
  - clear: trip
  - expect: {drive: axis-01, that: fault == 0, within: 5s}
"""
LONG = """
scenario: long
steps:
  - fault: {kind: silence, on: axis-01}
  - wait: 1h
  - expect: {drive: all, that: connected}
"""


@pytest.fixture
def world() -> ApiWorld:
    world = ApiWorld(2)
    world.line.enable()
    return world


def with_client(world: ApiWorld, act: Callable[[httpx.AsyncClient], Awaitable[None]]) -> None:
    async def run() -> None:
        transport = httpx.ASGITransport(world.app)
        async with httpx.AsyncClient(transport=transport, base_url=BASE) as client:
            try:
                await act(client)
            finally:
                world.context.close()

    asyncio.run(run())


async def ended(world: ApiWorld, client: httpx.AsyncClient, place: str) -> dict[str, Any]:
    for _ in range(2000):
        found: dict[str, Any] = (await client.get(place)).json()
        if found["state"] == "ended":
            return found
        world.line.run(0.02)
        await asyncio.sleep(0.002)
    raise AssertionError(found)


def test_a_scenario_runs_in_the_farm_and_its_record_is_read_by_id(world: ApiWorld) -> None:
    async def act(client: httpx.AsyncClient) -> None:
        begun = await client.post("/api/v1/scenarios", json={"text": SCENARIO})
        assert begun.status_code == 201
        record = await ended(world, client, begun.headers["location"])
        assert record["verdict"] == "passed", record["cases"]
        assert [case["verdict"] for case in record["cases"]] == ["passed", "passed"]
        assert record["plc"]["axis-01"]["acknowledged_seconds"]
        (summary,) = (await client.get("/api/v1/scenarios")).json()["scenarios"]
        assert summary["verdict"] == "passed"

    with_client(world, act)


def test_a_cancelled_scenario_clears_its_faults_and_says_what_did_not_run(world: ApiWorld) -> None:
    async def act(client: httpx.AsyncClient) -> None:
        begun = (await client.post("/api/v1/scenarios", json={"text": LONG})).json()
        await asyncio.sleep(0.05)
        assert (await client.get("/api/v1/faults")).json()["faults"]
        found = (await client.delete(f"/api/v1/scenarios/{begun['id']}")).json()
        assert found["state"] == "ended"
        assert found["verdict"] == "inconclusive"
        assert found["ended_early"] == "cancelled"
        assert found["counts"]["not run"] == 1
        states = {fault["state"] for fault in (await client.get("/api/v1/faults")).json()["faults"]}
        assert states <= {"ended"}

    with_client(world, act)


def test_the_number_of_scenarios_at_work_is_bounded_and_the_api_ends_them_when_it_stops(world: ApiWorld) -> None:
    async def act(client: httpx.AsyncClient) -> None:
        text = LONG.replace("  - fault: {kind: silence, on: axis-01}\n", "")
        answers = [(await client.post("/api/v1/scenarios", json={"text": text})) for _ in range(6)]
        assert [answer.status_code for answer in answers] == [201] * 4 + [422] * 2
        assert_problem(answers[-1], 422, "4 scenarios are at work")
        world.context.close()
        await asyncio.sleep(0)
        found = (await client.get("/api/v1/scenarios")).json()["scenarios"]
        assert {scenario["state"] for scenario in found} == {"ended"}

    with_client(world, act)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"text": "scenario: x\nsteps:\n  - weit: 1s\n"}, ("<scenario>:3: steps[0].weit", "did you mean wait")),
        ({"text": "scenario: x\nsteps:\n  - wait: {until: connected, drive: axis-77}\n"}, ("no drive matches",)),
        ({"text": "scenario: x\nwith: {api: off}\nsteps:\n  - wait: 1s\n"}, ("this farm runs already",)),
        ({"text": "{"}, ("is not valid YAML",)),
        ({"text": 1}, ("send {",)),
        ({}, ("text",)),
        (
            {"text": "scenario: x\nsteps:\n  - expect: {metric: pnfarm_no_such, value: 1}\n"},
            ("there is no metric pnfarm_no_such",),
        ),
    ],
)
def test_a_wrong_scenario_is_refused_with_each_place(world: ApiWorld, body: Any, words: tuple[str, ...]) -> None:
    assert_problem(world.post("/api/v1/scenarios", body), 422, *words)
    assert world.get("/api/v1/scenarios").json() == {"scenarios": []}


def test_an_unknown_scenario_is_not_found(world: ApiWorld) -> None:
    assert_problem(world.get("/api/v1/scenarios/scenario-9"), 404, "there is no scenario 'scenario-9'")
    assert_problem(world.delete("/api/v1/scenarios/scenario-9"), 404)


def test_the_report_of_a_scenario_that_ended_is_a_page_that_cannot_call_the_api(world: ApiWorld) -> None:
    async def act(client: httpx.AsyncClient) -> None:
        answer = await client.post("/api/v1/scenarios", json={"text": SCENARIO})
        place = answer.headers["location"]
        assert_problem(await client.get(f"{place}/report"), 409, "still runs")
        await ended(world, client, place)
        report = await client.get(f"{place}/report")
        assert report.headers["content-type"].startswith("text/html")
        assert "sandbox allow-scripts;" in report.headers["content-security-policy"]
        assert "connect-src" not in report.headers["content-security-policy"]
        assert "over-http" in report.text
        assert "fault == 702" in report.text
        assert_problem(await client.get("/api/v1/scenarios/scenario-77/report"), 404, "there is no scenario")

    with_client(world, act)
