"""Thousands of requests after the API's own description, right and wrong: each is answered, none by a server error,
and every answer is what the description says."""

from __future__ import annotations

import json
from random import Random
from typing import Any
from urllib.parse import quote

import pytest
from api_world import ApiWorld, assert_problem
from cell_file import DEVICES
from json_schema import wrongs

from pnfarm.api.paths.streams import LIVE_STREAM

#: Of every operation of the description; there are some twenty.
CASES = 60
#: Any operation may have these, under `default`: a head or body that is none, overload; an empty name makes the path
#: another one (307, 405).
UNNAMED = {307, 400, 405, 413, 414, 415, 503}
WORDS = (
    "", "axis-01", "axis-02", "axis-*", "all", "922", "915.1", "DRV.OPMODE", "MT.NUM", "fault-1", "0", "1", "-1",
    "65535", "1e9", "nan", "1" * 400, "x" * 400, "%00", "\x00", "..", "../..", "a/b", "ä\u202e\U0001f600", " ", "null",
    "[]", "'\"<>&",
)  # fmt: skip
NUMBERS = (0, 1, 2, -1, 255, 65535, 65536, 2**31, -(2**31), 2**32, 2**63, 2**64, 10**400, 0.5, -0.0, 1e308)
HEADERS: tuple[dict[str, str], ...] = (
    {}, {}, {}, {"Content-Type": "text/plain"}, {"Content-Type": ""}, {"Accept": "text/html"}, {"Accept-Encoding": "x"},
    {"Last-Event-ID": "x"}, {"Last-Event-ID": "9" * 40}, {"Range": "bytes=9-1"}, {"Cookie": "=;="},
)  # fmt: skip
#: Bodies that no chance would find.
WHOLE = {
    "/api/v1/traces": {"on": "axis-01", "signals": ["velocity"], "trigger": "manual"},
    "/api/v1/faults": {"kind": "not-ready", "on": "axis-01", "ttl": "60s"},
    "/api/v1/scenarios": {"text": "scenario: short\nsteps: [{wait: 1ms}]"},
}
BROKEN = (b"", b"{", b"[" * 5000, b"\xff\xfe", b'{"a":1}{"b":2}', b'{"value":', b"null", b"0", b'"\\ud800"', b"NaN")


@pytest.fixture(scope="module")
def described() -> dict[str, Any]:
    return dict(ApiWorld(1, controller=False).get("/openapi.json").json())


@pytest.fixture
def world() -> ApiWorld:
    world = ApiWorld(2, top=DEVICES)
    world.line.connect()
    return world


def anything(rng: Random, depth: int = 0) -> Any:
    match rng.randrange(6 if depth < 3 else 4):
        case 0:
            return rng.choice(WORDS)
        case 1:
            return rng.choice(NUMBERS)
        case 2:
            return rng.choice((None, True, False))
        case 3:
            return rng.uniform(-1e6, 1e6)
        case 4:
            return [anything(rng, depth + 1) for _ in range(rng.randrange(4))]
    return {rng.choice(WORDS): anything(rng, depth + 1) for _ in range(rng.randrange(4))}


def fitting(rng: Random, schema: dict[str, Any], whole: dict[str, Any]) -> Any:
    """Mostly what the schema describes; every eighth value is anything."""
    if rng.random() < 0.125:
        return anything(rng)
    if "$ref" in schema:
        return fitting(rng, whole["components"]["schemas"][schema["$ref"].rpartition("/")[2]], whole)
    if "anyOf" in schema:
        return fitting(rng, rng.choice(schema["anyOf"]), whole)
    if "enum" in schema:
        return rng.choice(schema["enum"])
    kind = schema.get("type")
    match rng.choice(kind) if isinstance(kind, list) else kind:
        case "object":
            wanted = schema.get("properties", {})
            return {
                key: fitting(rng, below, whole)
                for key, below in wanted.items()
                if key in schema.get("required", ()) or rng.random() < 0.4
            }
        case "array":
            return [fitting(rng, schema.get("items", {}), whole) for _ in range(rng.randrange(1, 4))]
        case "integer":
            return rng.choice([n for n in NUMBERS if isinstance(n, int)])
        case "number":
            return rng.choice(NUMBERS)
        case "boolean":
            return rng.random() < 0.5
        case "null":
            return None
    return f"{rng.randrange(2000)}ms" if "pattern" in schema else rng.choice(WORDS)


def place(rng: Random, path: str, faults: list[str], traces: list[str]) -> str:
    """The path with something in the place of each of its names: mostly what there is."""
    there = {
        "{name}": "island-1" if "/devices/" in path else "axis-01",
        "{pnu}": rng.choice(("922", "DRV.OPMODE", "VL.LIMITP", "3072")),
        "{slot}": "1",
        "{fault_id}": rng.choice(faults),
        "{trace_id}": rng.choice(traces),
        "{scenario_id}": f"scenario-{rng.randrange(1, 9)}",
    }
    for word, known in there.items():
        path = path.replace(word, known if rng.random() < 0.75 else quote(rng.choice(WORDS), safe=""))
    return path


def request(
    rng: Random, method: str, path: str, operation: dict[str, Any], whole: dict[str, Any], *there: list[str]
) -> dict[str, Any]:
    options: dict[str, Any] = {"headers": dict(rng.choice(HEADERS))}
    query = {p["name"]: fitting(rng, p["schema"], whole) for p in operation.get("parameters", ()) if p["in"] == "query"}
    options["params"] = {key: str(value) for key, value in query.items() if rng.random() < 0.6}
    if path in {"/api/v1/events", "/api/v1/live"}:
        # what follows the farm ends with its client alone
        options["params"]["follow"] = "false"
    if body := operation.get("requestBody"):
        schema = body["content"]["application/json"]["schema"]
        value = fitting(rng, schema, whole)
        if path == "/api/v1/faults" and isinstance(value, dict) and rng.random() < 0.6:
            # few faults of any fields fit together: the kind alone, and one field more
            extra = rng.choice(sorted({*value, "kind"} - {"on"}))
            value = {"kind": value.get("kind"), extra: value.get(extra), "on": rng.choice(("axis-01", "all"))}
        if (whole_body := WHOLE.get(path)) is not None and rng.random() < 0.25:
            value = whole_body
            # nor a moment that is still to come
            options["params"] = {}
        options["content"] = rng.choice(BROKEN) if rng.random() < 0.1 else json.dumps(value).encode()
        options["headers"].setdefault("Content-Type", "application/json")
    return {"method": method.upper(), "path": place(rng, path, *there), **options}


def test_each_operation_names_its_errors_as_problem_documents(described):
    for path, methods in described["paths"].items():
        for method, operation in methods.items():
            named = {status: found for status, found in operation["responses"].items() if status[0] in "4d"}
            assert {"401", "403", "default"} <= named.keys(), (method, path)
            assert ("{" not in path) or "404" in named, (method, path)
            assert ("requestBody" not in operation) or "422" in named, (method, path)
            for found in named.values():
                assert found["description"]
                schema = found["content"]["application/problem+json"]["schema"]
                assert schema == {"$ref": "#/components/schemas/Problem"}


def described_body(operation: dict[str, Any], response: Any, whole: dict[str, Any], asked: str) -> list[str]:
    """What is wrong with a body by the description of its operation."""
    if response.is_redirect or response.request.url.path.count("/") != asked.count("/"):
        # an empty name, or one of dots, is another path
        return []
    status, kind = str(response.status_code), response.headers.get("content-type", "").partition(";")[0]
    kinds = operation["responses"].get(status, operation["responses"]["default"])["content"]
    if kind not in kinds:
        return [f"{kind} is none of {list(kinds)}"]
    body = response.json() if kind.endswith("json") else response.text
    found = list(wrongs(body, kinds[kind]["schema"], whole))
    if kind == "text/event-stream" and operation["responses"]["200"]["content"][kind]["schema"] != LIVE_STREAM:
        entry = whole["components"]["schemas"]["LogEntry"]
        events = [event.splitlines() for event in response.text.split("\n\n")]
        for event in events:
            data = "".join(line.removeprefix("data: ") for line in event if line.startswith("data: "))
            if data and "event: gap" not in event:
                found += wrongs(json.loads(data), entry, whole)
    return found


def test_each_success_has_a_described_body(described):
    for path, methods in described["paths"].items():
        for method, operation in methods.items():
            successes = [found for status, found in operation["responses"].items() if status[0] == "2"]
            assert successes, (method, path)
            for found in successes:
                for kind, body in found["content"].items():
                    # one of no words is of any form
                    words = body["schema"].keys() & {"$ref", "anyOf"}
                    assert words if kind == "application/json" else body["schema"]["type"] == "string", (path, kind)


def test_no_request_after_the_description_is_answered_by_a_server_error(described, world):
    rng = Random(8702)
    operations = [
        (method, path, operation)
        for path, methods in described["paths"].items()
        for method, operation in methods.items()
    ]
    seen = set()
    for number in range(CASES * len(operations)):
        method, path, operation = operations[number % len(operations)]
        if number % len(operations) == 0:
            # one that can be renewed
            world.faults.inject(WHOLE["/api/v1/faults"], world.line.world.now)
        faults = [fault.id for fault in world.faults.list()][-4:] or ["fault-1"]
        traces = [trace.id for trace in world.line.farm.traces.kept()] or ["trace-1"]
        asked = request(rng, method, path, operation, described, faults, traces)
        response = world.request(**asked)
        assert response.status_code < 500 or path == "/api/v1/readyz", (asked, response.text)
        if response.status_code >= 400:
            assert_problem(response, response.status_code)
        assert not (found := described_body(operation, response, described, path)), (asked, found)
        known = operation["responses"]
        assert str(response.status_code) in known or response.status_code in UNNAMED, (asked, response.text)
        seen.add((method, path, response.status_code // 100))
        if number % 100 == 99:
            world.line.run(0.05)
    # each operation was had, not only refused; this farm has no folder for states (test_api_states has one)
    had = {(method, path) for method, path, kind in seen if kind == 2}
    assert had == {(m, p) for m, p, _ in operations if not p.startswith("/api/v1/states/")}
    world.post("/api/v1/reset")
    for drive in ("axis-01", "axis-02"):
        # hands have switched off, plugged and pulled, too
        world.post(f"/api/v1/drives/{drive}/power-on")
        assert world.put(f"/api/v1/drives/{drive}/modules/1", {"telegram": 1}).status_code == 200
    back = world.line.world.run(15.0, until=lambda: world.line.plc.all_connected)
    assert back, (world.line.reasons(), [dict(session.unusable) for session in world.line.plc.sessions])
