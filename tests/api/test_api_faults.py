"""Faults over HTTP: the catalogue, in force, taken back."""

from __future__ import annotations

import pytest
from api_world import ApiWorld, assert_problem
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.buses.registry import fault_kinds


def test_catalogue_lists_every_kind_with_its_parameters(still):
    kinds = still.get("/api/v1/fault-kinds").json()["kinds"]
    assert [kind["kind"] for kind in kinds] == list(fault_kinds())
    assert all(kind["doc"] and kind["family"] for kind in kinds)


def test_fault_from_its_injection_to_its_end():
    world = ApiWorld(2)
    world.line.connect()
    world.line.enable()
    answer = world.post("/api/v1/faults", {"kind": "f702", "on": "axis-01", "as": "trip", "params": {"hold": True}})
    assert answer.status_code == 201
    assert answer.headers["location"] == "/api/v1/faults/trip"
    world.line.run(0.1)
    assert world.get("/api/v1/drives/axis-01").json()["faults_injected"] == ["trip"]
    assert world.get("/api/v1/drives/axis-02").json()["faults_injected"] == []
    assert world.get("/api/v1/drives/axis-01").json()["fault"]["number"] == 702
    (fault,) = world.get("/api/v1/faults").json()["faults"]
    assert fault == world.get(answer.headers["location"]).json()
    assert fault["evidence"]["activations"] == 1
    assert 'pnfarm_faults_active{kind="f702"} 1' in world.get("/metrics").text
    gone = world.delete("/api/v1/faults/trip")
    assert gone.status_code == 200
    assert gone.json()["state"] == "ended"
    assert world.get("/api/v1/faults").json() == {"faults": []}
    # its evidence can still be asked for
    assert world.get("/api/v1/faults/trip").json()["state"] == "ended"
    assert_problem(world.delete("/api/v1/faults/trip"), 404, "trip")
    metrics = world.get("/metrics").text
    assert 'pnfarm_fault_activations_total{kind="f702",drive="axis-01"} 1' in metrics
    assert 'pnfarm_faults_active{kind="f702"} 0' in metrics
    world.line.run(2.0)
    assert world.get("/api/v1/drives/axis-01").json()["fault"] is None


def test_reset_ends_every_fault():
    world = ApiWorld(2, controller=False)
    for name in ("a", "b"):
        assert world.post("/api/v1/faults", {"kind": "silence", "on": "all", "as": name}).status_code == 201
    both = [{"id": name, "kind": "silence", "drives": ["axis-01", "axis-02"]} for name in ("a", "b")]
    assert world.post("/api/v1/reset").json() == {"cleared": ["a", "b"], "faults": both}
    assert world.get("/api/v1/faults").json() == {"faults": []}
    assert world.post("/api/v1/reset").json() == {"cleared": [], "faults": []}


@pytest.mark.parametrize(
    ("body", "field", "word"),
    [
        ({"kind": "tmeout", "on": "all"}, "kind", "timeout"),
        ({"kind": "silence"}, "on", "missing"),
        ({"kind": "silence", "on": "press-*"}, "on", "press-*"),
        ({"kind": "silence", "on": "all", "for": "5"}, "for", "500ms"),
        ({"kind": "loss", "on": "all", "probability": 2}, "probability", "at most 1"),
        ({"kind": "f702", "on": "all", "parms": {}}, "parms", "params"),
    ],
)
def test_fault_that_cannot_be_names_the_field_and_what_is_allowed(still, body, field, word):
    found = assert_problem(still.post("/api/v1/faults", body), 422)
    (issue,) = [issue for issue in found["errors"] if issue["field"] == field]
    assert word in issue["what"] + issue["allowed"]
    assert still.get("/api/v1/faults").json() == {"faults": []}


def test_unknown_fault_is_not_found(still):
    assert_problem(still.get("/api/v1/faults/nobody"), 404, "nobody")


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)
FIELDS = st.sampled_from(
    [
        "kind",
        "on",
        "params",
        "probability",
        "seed",
        "direction",
        "after_cycles",
        "after",
        "count",
        "for",
        "cycles",
        "as",
    ]
)
KIND = st.sampled_from(list(fault_kinds()))


@settings(max_examples=150)
@given(body=JSON | st.dictionaries(FIELDS, JSON, max_size=6), kind=KIND | st.none(), on=st.sampled_from(["all", None]))
def test_any_body_is_a_fault_or_a_problem(still, body, kind, on):
    if isinstance(body, dict):
        body = body | ({"kind": kind} if kind else {}) | ({"on": on} if on else {})
    response = still.request(
        "POST", "/api/v1/faults", content=_json(body), headers={"Content-Type": "application/json"}
    )
    assert response.status_code in {201, 400, 422}, response.text
    if response.status_code != 201:
        assert_problem(response, response.status_code)
    still.post("/api/v1/reset")


@settings(max_examples=150)
@given(value=JSON, pnu=st.sampled_from(["DRV.OPMODE", "VL.FB", "922", "915.1", "PN.POSSCALE", "1"]))
def test_any_value_is_written_or_a_problem(still, value, pnu):
    response = still.request(
        "PUT",
        f"/api/v1/drives/axis-01/params/{pnu}",
        content=_json({"value": value}),
        headers={"Content-Type": "application/json"},
    )
    assert response.status_code in {200, 400, 404, 409, 422}, response.text
    if response.status_code != 200:
        assert_problem(response, response.status_code)


def _json(value: object) -> bytes:
    import json

    return json.dumps(value).encode()


class Never:
    """In place of a module whose functions must not be called."""

    def __getattr__(self, name):
        raise AssertionError(f"{name}: compared")


@pytest.fixture
def no_comparison(monkeypatch):
    for name in ("pnfarm.vocabulary.globs.fnmatchcase", "pnfarm.vocabulary.quoting.difflib"):
        monkeypatch.setattr(name, Never())


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ({"kind": "loss", "on": "*a" * 30_000}, "at most 250"),
        ({"kind": "loss", "on": ["a" * 60_000]}, "at most 250"),
        ({"kind": "loss", "on": [f"*{n}" for n in range(5_000)]}, "at most 64"),
        ({"kind": "loss", "on": [f"model:{n}" for n in range(4_000)]}, "at most 64"),
        ({"kind": "loss", "on": "all", "params": {f"p{n}": 1 for n in range(4_000)}}, "at most 64"),
        ({"kind": "loss", "on": "all"} | {f"p{n}": 1 for n in range(4_000)}, "at most 64"),
    ],
)
def test_a_body_that_would_stop_the_farm_is_refused_before_any_drive_is_looked_at(still, no_comparison, body, told):
    found = assert_problem(still.post("/api/v1/faults", body), 422, told)
    assert len(found["detail"]) < 400


def test_a_long_word_is_not_compared_with_the_known_ones(still, no_comparison):
    long = "x" * 60_000
    for body in (
        {"kind": long, "on": "all"},
        {"kind": "loss", "on": "all", long: 1},
        {"kind": "loss", "on": "all", "params": {long: 1}},
        {"kind": "f702", "on": "all", "direction": long},
    ):
        found = assert_problem(still.post("/api/v1/faults", body), 422)
        assert len(found["detail"]) < 1_500


def test_whole_names_of_many_drives_are_looked_up(still, no_comparison):
    """A list of all drives of a large farm is no list of patterns."""
    answer = still.post("/api/v1/faults", {"kind": "loss", "on": ["axis-01", "axis-02"] * 2_000, "as": "many"})
    assert answer.status_code == 201
    assert list(answer.json()["drives"]) == ["axis-01", "axis-02"]
    still.delete("/api/v1/faults/many")


def test_a_fault_begins_at_the_moment_that_is_set_for_it():
    world = ApiWorld(2, controller=False)
    world.line.run(0.1)
    now = world.get("/api/v1/clock").json()["farm_seconds"]
    fault = world.post(f"/api/v1/faults?at={now + 0.5}", {"kind": "silence", "on": "all", "as": "later", "ttl": "10s"})
    assert fault.status_code == 201
    assert fault.json()["drives"]["axis-01"]["waits_for"] == "the moment of its start"
    assert fault.json()["expires_seconds"] == pytest.approx(now + 10.5)
    world.line.run(0.4)
    assert world.get("/api/v1/faults/later").json()["state"] == "waiting"
    world.line.run(0.2)
    runs = world.get("/api/v1/faults/later").json()["drives"].values()
    assert [run["started_seconds"] for run in runs] == pytest.approx([now + 0.5] * 2, abs=0.002)


@pytest.mark.parametrize("ahead", [-0.001, 10.5, float("nan"), float("inf")])
def test_a_moment_that_has_passed_or_is_far_ahead_is_refused_and_nothing_begins(ahead):
    world = ApiWorld(1, controller=False)
    world.line.run(1)
    at = world.get("/api/v1/clock").json()["farm_seconds"] + ahead
    found = assert_problem(world.post(f"/api/v1/faults?at={at}", {"kind": "silence", "on": "all"}), 422, "at most 10 s")
    assert found["errors"][0]["field"] == "at"
    assert world.get("/api/v1/faults").json() == {"faults": []}


def test_the_clock_tells_one_run_of_a_farm_from_another():
    one, other = (ApiWorld(1, controller=False).get("/api/v1/clock").json() for _ in range(2))
    assert one["instance"] != other["instance"]
    assert (one["kind"], one["drives"]) == ("farm", 1)
