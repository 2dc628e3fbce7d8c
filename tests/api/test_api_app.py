"""The API as a whole: errors, guard, health, description, page, metrics."""

from __future__ import annotations

import json
import re

import pytest
from api_world import ApiWorld, assert_problem
from events import Something
from prometheus_client.parser import text_string_to_metric_families

from pnfarm import __version__
from pnfarm.api.paths.farm import Ready, Version
from pnfarm.api.schemas.problem import Problem

TOKEN = "a-long-secret"  # a test's, nobody's


@pytest.fixture(scope="module")
def guarded() -> ApiWorld:
    world = ApiWorld(1, controller=False, token=TOKEN)
    world.line.run(0.2)
    return world


# errors


def test_unknown_path_is_a_problem(still):
    found = assert_problem(still.get("/api/v1/drifes"), 404, "/api/v1/drifes", "/openapi.json")
    Problem.model_validate(found)


def test_wrong_method_says_which_there_are(still):
    response = still.delete("/api/v1/drives/axis-01/params/922")
    assert_problem(response, 405, "DELETE", "GET, PUT")
    assert response.headers["allow"] == "GET, PUT"


def test_error_inside_is_a_problem_without_secrets(still, monkeypatch):
    def fail(*_args, **_options):
        raise RuntimeError("password in here")

    monkeypatch.setattr("pnfarm.api.context.drive_snapshot", fail)
    found = assert_problem(still.get("/api/v1/drives/axis-01"), 500, "RuntimeError")
    assert "password" not in found["detail"]


# health


def test_version(still):
    assert Version.model_validate_json(still.get("/api/v1/version").content).pnfarm == __version__


def test_ready_while_the_engine_ticks():
    world = ApiWorld(1, controller=False)
    assert world.get("/api/v1/healthz").status_code == 200
    assert_problem(world.get("/api/v1/readyz"), 503, "has not ticked")
    world.line.run(0.1)
    assert Ready.model_validate_json(world.get("/api/v1/readyz").content).cycles > 0
    # time goes on without the engine
    world.line.world.clock.now += 5_000_000_000
    assert_problem(world.get("/api/v1/readyz"), 503, "5.0 s")
    assert world.get("/api/v1/healthz").status_code == 200


# guard


def test_farm_without_a_token_answers_to_this_machine_only(still):
    for base in ("http://localhost:8702", "http://127.0.0.1:8702", "http://[::1]:8702"):
        assert still.get("/api/v1/drives", base=base).status_code == 200
    for base in ("http://farm.example:8702", "http://10.1.2.3:8702"):
        assert_problem(still.get("/api/v1/drives", base=base), 403, "localhost only")


def test_page_of_another_origin_changes_nothing(still):
    response = still.post("/api/v1/reset", headers={"Origin": "http://evil.example"})
    assert_problem(response, 403, "evil.example")
    assert still.post("/api/v1/reset", headers={"Origin": "http://127.0.0.1:8702"}).status_code == 200


@pytest.mark.parametrize("path", ["/api/v1/drives", "/api/v1/version", "/api/v1/events", "/metrics", "/nothing"])
def test_guarded_farm_asks_for_its_token(guarded, path):
    response = guarded.get(path, base="http://farm.example")
    assert_problem(response, 401, "Bearer")
    assert response.headers["www-authenticate"] == "Bearer"
    wrong = guarded.get(path, headers={"Authorization": "Bearer another"})
    assert wrong.status_code == 401


def test_token_opens_a_guarded_farm(guarded):
    shown = {"Authorization": f"Bearer {TOKEN}"}
    for path in ("/api/v1/drives", "/metrics", "/"):
        assert guarded.get(path, base="http://farm.example", headers=shown).status_code == 200


def test_health_needs_no_token(guarded):
    assert guarded.get("/api/v1/healthz", base="http://farm.example").status_code == 200
    assert guarded.get("/api/v1/readyz", base="http://farm.example").status_code == 200


def test_browser_brings_the_token_once_and_has_a_cookie_then(guarded):
    response = guarded.get(f"/?token={TOKEN}", base="http://farm.example")
    assert response.status_code == 303
    assert response.headers["location"] == "/"
    cookie = response.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    pair = cookie.partition(";")[0]
    assert guarded.get("/api/v1/drives", base="http://farm.example", headers={"Cookie": pair}).status_code == 200
    assert "set-cookie" not in guarded.get("/?token=another", base="http://farm.example").headers


def test_the_page_of_a_guarded_farm_asks_for_the_token_and_shows_nothing(guarded):
    page = guarded.get("/", base="http://farm.example")
    assert page.status_code == 200
    assert "needs its token" in page.text
    assert guarded.line.farm.name not in page.text.replace("pnfarm", "")
    assert "<script" not in page.text
    assert "default-src 'none'" in page.headers["content-security-policy"]
    assert guarded.get("/?token=another").status_code == 200
    assert "set-cookie" not in page.headers


def test_a_token_that_is_typed_opens_the_farm_and_another_does_not(guarded):
    form = {"Content-Type": "application/x-www-form-urlencoded"}
    opened = guarded.request("POST", "/", content=f"token={TOKEN}", headers=form)
    assert (opened.status_code, opened.headers["location"]) == (303, "/")
    pair = opened.headers["set-cookie"].partition(";")[0]
    assert "connect-src" in guarded.get("/", headers={"Cookie": pair}).headers["content-security-policy"]
    for body in (b"token=another-one", b"token=", b"", b"\xff\xfe", b"token=" + b"x" * 100_000, b"token=%ff"):
        refused = guarded.request("POST", "/", content=body, headers=form)
        assert refused.status_code == 403
        assert "Wrong token." in refused.text
        assert "set-cookie" not in refused.headers
    elsewhere = {**form, "Origin": "http://evil.example"}
    assert_problem(guarded.request("POST", "/", content=f"token={TOKEN}", headers=elsewhere), 403, "evil.example")


# description, page, metrics


def test_openapi_describes_every_path_and_its_problems(still):
    described = still.get("/openapi.json").json()
    for method, path in (
        ("get", "/api/v1/drives"),
        ("get", "/api/v1/drives/{name}"),
        ("get", "/api/v1/drives/{name}/params/{pnu}"),
        ("put", "/api/v1/drives/{name}/params/{pnu}"),
        ("post", "/api/v1/drives/{name}/power-cycle"),
        ("get", "/api/v1/fault-kinds"),
        ("get", "/api/v1/faults"),
        ("post", "/api/v1/faults"),
        ("get", "/api/v1/faults/{fault_id}"),
        ("delete", "/api/v1/faults/{fault_id}"),
        ("post", "/api/v1/reset"),
        ("get", "/api/v1/events"),
        ("get", "/api/v1/version"),
        ("get", "/api/v1/healthz"),
        ("get", "/api/v1/readyz"),
    ):
        operation = described["paths"][path][method]
        assert operation["summary"]
        assert "application/problem+json" in operation["responses"]["default"]["content"]
    schemas = described["components"]["schemas"]
    for reference in re.findall(r"#/components/schemas/(\w+)", str(described)):
        assert reference in schemas


@pytest.mark.parametrize(("path", "kind"), [("/metrics", "text/plain"), ("/api/v1/events", "text/event-stream")])
def test_what_is_no_json_is_not_described_as_json(still, path, kind):
    described = still.get("/openapi.json").json()["paths"][path]["get"]["responses"]
    assert [(known, content["schema"]["type"]) for known, content in described["200"]["content"].items()] == [
        (kind, "string")
    ]
    answer = still.get(path, params={"follow": "false"})
    assert answer.headers["content-type"].partition(";")[0] == kind


def test_page_needs_nothing_from_elsewhere(still):
    response = still.get("/")
    assert response.status_code == 200
    assert response.headers["content-type"].startswith("text/html")
    assert not re.search(r"https?://", response.text)
    policy = response.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe-inline" not in policy


def test_metrics_are_the_farms_and_the_process(still):
    response = still.get("/metrics")
    assert response.headers["content-type"].startswith("text/plain; version=0.0.4")
    families = {family.name for family in text_string_to_metric_families(response.text)}
    assert {"pnfarm_axis_state", "pnfarm_faults_active", "process_cpu_seconds"} <= families


def test_events_without_follow_end_with_the_newest():
    world = ApiWorld(2, controller=False)
    for number in range(20):
        world.line.log.record(number, f"axis-{number % 2 + 1:02}", Something("try", {"number": number}))
    newest = world.line.log.entries()[-1].sequence
    whole = world.get("/api/v1/events?after=0&follow=false").text
    assert whole.count("\nid: ") == newest
    one = world.get("/api/v1/events?after=0&follow=false&drive=axis-02").text
    assert one.count('"number": ') == 10
    assert "id: " not in world.get("/api/v1/events?follow=false").text


def test_a_stream_that_resumes_over_a_restart_has_every_entry_of_the_new_run():
    def sequences(world, last):
        text = world.get("/api/v1/events?follow=false", headers={"Last-Event-ID": last}).text
        return [json.loads(line[6:])["sequence"] for line in text.splitlines() if line.startswith("data: ")]

    before, after = ApiWorld(1, controller=False), ApiWorld(1, controller=False)
    for number in range(5):
        before.line.log.record(number, "axis-01", Something("try"))
        after.line.log.record(number, "axis-01", Something("try"))
    seen = before.get("/api/v1/events?after=2&follow=false").text
    last = next(line[4:] for line in seen.splitlines() if line.startswith("id: "))
    newest = after.line.log.newest
    assert sequences(before, last) == list(range(4, newest + 1))
    # the new run has passed that number already
    assert sequences(after, last) == list(range(1, newest + 1))


def test_unknown_drive_has_no_events(still):
    assert_problem(still.get("/api/v1/events?drive=nobody"), 404, "nobody")
