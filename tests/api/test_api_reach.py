"""Dry runs and times to live over HTTP; who may change the farm, and what the log says of it."""

from __future__ import annotations

import pytest
from api_world import ApiWorld, assert_problem

FULL, READS = "the-farms-own-token", "the-token-that-reads"  # a test's, nobody's
BEARER = {"Authorization": f"Bearer {FULL}"}
READER = {"Authorization": f"Bearer {READS}"}


@pytest.fixture(scope="module")
def world() -> ApiWorld:
    return ApiWorld(4, controller=False, token=FULL, read_token=READS)


@pytest.fixture(scope="module")
def still_four() -> ApiWorld:
    return ApiWorld(4, controller=False)


def entries(world: ApiWorld, event: str) -> list[dict]:
    return [entry.as_dict() for entry in world.line.log.entries() if entry.event == event]


def test_a_dry_run_lists_the_drives_and_injects_nothing(still_four):
    body = {"kind": "silence", "on": "all", "share": "50%", "seed": 3}
    answer = still_four.post("/api/v1/faults?dry_run=true", body)
    assert answer.status_code == 200
    found = answer.json()
    assert found["dry_run"]
    assert len(found["drives"]) == len(found["left_out"]) == 2
    assert found["cannot"] == []
    assert still_four.get("/api/v1/faults").json() == {"faults": []}
    hit = still_four.post("/api/v1/faults", body).json()
    assert list(hit["drives"]) == found["drives"]
    assert still_four.post("/api/v1/reset").status_code == 200
    assert_problem(still_four.post("/api/v1/faults?dry_run=perhaps", body), 422, "dry_run")
    assert_problem(still_four.post("/api/v1/faults?dry_run=true", {"kind": "silence", "on": "nobody"}), 422, "nobody")


def test_a_time_to_live_is_renewed_and_lapses(still_four):
    made = still_four.post("/api/v1/faults", {"kind": "silence", "on": "axis-01", "ttl": "1s", "as": "mine"}).json()
    assert made["spec"]["ttl"] == "1s"
    still_four.line.run(0.8)
    renewed = still_four.post("/api/v1/faults/mine/renew").json()
    assert renewed["expires_seconds"] > made["expires_seconds"]
    still_four.line.run(0.8)
    assert still_four.get("/api/v1/faults/mine").json()["state"] == "active"
    still_four.line.run(0.4)
    ended = still_four.get("/api/v1/faults/mine").json()
    assert ended["state"] == "ended"
    assert ended["drives"]["axis-01"]["reason"] == "ttl"
    assert_problem(still_four.post("/api/v1/faults/mine/renew"), 404, "mine")
    assert_problem(still_four.post("/api/v1/faults/nobody/renew"), 404, "nobody")
    assert still_four.post("/api/v1/faults", {"kind": "silence", "on": "axis-01", "as": "ever"}).status_code == 201
    assert_problem(still_four.post("/api/v1/faults/ever/renew"), 422, "no time to live")
    still_four.post("/api/v1/reset")


def test_the_token_that_reads_reads_everything_and_changes_nothing(world):
    for path in ("drives", "faults", "fault-kinds", "drives/axis-01", "drives/axis-01/params/930"):
        assert world.get(f"/api/v1/{path}", headers=READER).status_code == 200
    assert world.get("/metrics", headers=READER).status_code == 200
    refused = "this token may read, and change nothing"
    fault = {"kind": "silence", "on": "all"}
    assert_problem(world.post("/api/v1/faults", fault, headers=READER), 403, refused)
    assert_problem(world.post("/api/v1/faults?dry_run=true", fault, headers=READER), 403, refused)
    assert_problem(world.post("/api/v1/reset", headers=READER), 403, refused)
    assert_problem(world.put("/api/v1/drives/axis-01/params/930", {"value": 1}, headers=READER), 403, refused)
    assert_problem(world.request("DELETE", "/api/v1/faults/x", headers=READER), 403, refused)
    assert_problem(world.post("/api/v1/drives/axis-01/power-cycle", headers=READER), 403, refused)
    assert world.line.farm.injections.list() == []


def test_no_token_and_a_wrong_one_do_not_even_read(world):
    assert_problem(world.get("/api/v1/drives"), 401, "token")
    assert_problem(world.get("/api/v1/drives", headers={"Authorization": f"Bearer {READS}x"}), 401, "token")


def test_a_browser_is_let_in_by_the_token_that_reads_and_stays_a_reader(world):
    answer = world.get(f"/?token={READS}")
    assert answer.status_code == 303
    cookie = {"Cookie": answer.headers["set-cookie"].split(";")[0]}
    assert world.get("/api/v1/drives", headers=cookie).status_code == 200
    assert_problem(world.post("/api/v1/reset", headers=cookie), 403, "may read")


def test_the_log_says_who_changed_what(world):
    world.post("/api/v1/faults", {"kind": "silence", "on": "axis-0[12]", "as": "x"}, headers=BEARER)
    (asked,) = entries(world, "fault requested")
    assert (asked["id"], asked["kind"], asked["drives"]) == ("x", "silence", "axis-01 axis-02")
    assert (asked["who"], asked["peer"]) == ("token", "127.0.0.1")
    world.request("DELETE", "/api/v1/faults/x", headers=BEARER)
    world.post("/api/v1/faults", {"kind": "silence", "on": "axis-01", "as": "y"}, headers=BEARER)
    world.post("/api/v1/reset", headers=BEARER)
    assert [entry["id"] for entry in entries(world, "fault cleared by a client")] == ["x", "y"]
    world.put("/api/v1/drives/axis-01/params/DRV.OPMODE", {"value": 1}, headers=BEARER)
    (written,) = entries(world, "parameter written by a client")
    assert (written["drive"], written["parameter"], written["value"]) == ("axis-01", "DRV.OPMODE", 1)
    world.post("/api/v1/drives/axis-01/power-cycle", headers=BEARER)
    assert entries(world, "power cycle requested")[0]["who"] == "token"


def test_a_refused_change_is_not_logged_as_one(world):
    before = len(entries(world, "fault requested"))
    assert_problem(world.post("/api/v1/faults", {"kind": "silence", "on": "nobody"}, headers=BEARER), 422)
    assert len(entries(world, "fault requested")) == before


def test_on_loopback_without_a_token_the_log_says_so(still_four):
    still_four.post("/api/v1/faults", {"kind": "silence", "on": "axis-01"})
    assert entries(still_four, "fault requested")[-1]["who"] == "loopback"
    still_four.post("/api/v1/reset")
