"""Traces over the API: started, read as JSON and CSV, triggered, deleted, refused."""

from __future__ import annotations

from typing import Any

import pytest
from api_world import ApiWorld, assert_problem

from pnfarm.trace import Recording


@pytest.fixture
def world() -> ApiWorld:
    world = ApiWorld(2)
    world.line.enable()
    return world


REQUEST: dict[str, Any] = {"on": "axis-*", "signals": ["velocity", "zsw1.fault_present", "fault"], "length": "50ms"}


def test_a_trace_is_started_read_and_deleted(world: ApiWorld) -> None:
    answer = world.post("/api/v1/traces", {**REQUEST, "trigger": "fault on axis-02", "pre": "10ms", "as": "trip"})
    assert answer.status_code == 201
    assert answer.headers["location"] == "/api/v1/traces/trip"
    assert answer.json()["state"] == "waiting"
    world.line.run(0.1)
    world.post("/api/v1/faults", {"kind": "f702", "on": "axis-02"})
    world.line.run(0.2)
    status = world.get("/api/v1/traces/trip", params={"format": "status"}).json()
    assert status["state"] == "complete"
    assert status["triggered_by"] == "axis-02"
    assert "time" not in status
    whole = world.get("/api/v1/traces/trip").json()
    assert whole["request"]["trigger"] == "fault on axis-02"
    assert [(c["drive"], c["signal"], c["unit"]) for c in whole["columns"]][:2] == [
        ("axis-01", "velocity", "rpm"), ("axis-01", "zsw1.fault_present", ""),
    ]  # fmt: skip
    recording = Recording.from_dict(whole)
    assert recording.first("fault", 702, "axis-02") == 0.0
    assert recording.column("fault", "axis-02").labels == {0: "0", 702: "702"}
    text = world.get("/api/v1/traces/trip", params={"format": "csv"})
    assert text.headers["content-type"].startswith("text/csv")
    assert text.text == recording.csv()
    assert [t["id"] for t in world.get("/api/v1/traces").json()["traces"]] == ["trip"]
    assert world.delete("/api/v1/traces/trip").json()["state"] == "deleted"
    assert_problem(world.get("/api/v1/traces/trip"), 404, "there is no trace 'trip'")
    assert_problem(world.delete("/api/v1/traces/trip"), 404, "there is no trace 'trip'")


def test_a_trace_is_triggered_by_hand(world: ApiWorld) -> None:
    trace_id = world.post("/api/v1/traces", {**REQUEST, "trigger": "manual"}).json()["id"]
    world.line.run(0.2)
    early = world.get(f"/api/v1/traces/{trace_id}").json()
    assert (early["state"], early["triggered"]) == ("waiting", False)
    world.post(f"/api/v1/traces/{trace_id}/trigger")
    world.line.run(0.2)
    assert world.get(f"/api/v1/traces/{trace_id}").json()["state"] == "complete"
    assert_problem(world.post("/api/v1/traces/other/trigger"), 404, "there is no trace 'other'")


def test_the_signals_of_a_drive_are_listed_with_units(world: ApiWorld) -> None:
    signals = {s["signal"]: s for s in world.get("/api/v1/traces/signals/axis-01").json()["signals"]}
    assert signals["velocity"]["unit"] == "rpm"
    assert signals["position"]["unit"] == "revolutions"
    assert signals["current"]["unit"] == "A"
    assert {"stw1.enable_operation", "zsw1.fault_present", "nsoll_a", "fault_2"} <= set(signals)
    assert_problem(world.get("/api/v1/traces/signals/axis-99"), 404, "axis-99")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"signals": ["velocty"]}, ("did you mean velocity?",)),
        ({"signals": 3}, ("trace.signals: is 3",)),
        ({"trigger": "velocity >"}, ("is not a trigger",)),
        ({"length": "2"}, ("is not a duration",)),
        ({"on": "nobody"}, ("no drive matches 'nobody'",)),
        ({"length": "1h", "signals": ["*"]}, ("a shorter time",)),
        ({"speed": 1}, ("trace.speed", "is not a field")),
    ],
)
def test_a_wrong_trace_is_refused_with_the_field(
    world: ApiWorld, change: dict[str, Any], words: tuple[str, ...]
) -> None:
    found = assert_problem(world.post("/api/v1/traces", {**REQUEST, **change}), 422, *words)
    assert found["errors"][0]["field"] == next(iter(change))
    assert world.get("/api/v1/traces").json()["traces"] == []


def test_the_seventeenth_trace_is_refused(world: ApiWorld) -> None:
    for _ in range(16):
        assert world.post("/api/v1/traces", REQUEST).status_code == 201
    assert_problem(world.post("/api/v1/traces", REQUEST), 422, "delete one")
    world.delete("/api/v1/traces/trace-3")
    assert world.post("/api/v1/traces", REQUEST).status_code == 201
