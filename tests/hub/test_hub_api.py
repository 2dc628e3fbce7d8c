"""The hub's paths over farms in memory: lists, one drive, health, events, the page's stream, traces, access."""

import itertools
import json

import httpx
import jsonschema
import pytest
from api_world import assert_problem
from hub_world import HubWorld

from pnfarm import __version__
from pnfarm.hub.states import ShardEvent
from pnfarm.protocols.profinet.dcp.rules import NameSet


@pytest.fixture
def world():
    return HubWorld(("axis-{n:02}", 2), ("pump-{n:02}", 1), farms=("hall-1", "hall-2"), skews=(0.0, 7.0))


def told(text):
    """The messages of a stream: (event, id, data)."""
    found = []
    for block in text.split("\n\n"):
        lines = dict(line.split(": ", 1) for line in block.splitlines() if ": " in line)
        if "data" in lines:
            found.append((lines.get("event", "message"), lines.get("id"), json.loads(lines["data"])))
    return found


def test_all_drives_are_listed_as_those_of_one_farm(world):
    view = world.get("drives").json()
    assert [drive["name"] for drive in view["drives"]] == ["axis-01", "axis-02", "pump-01"]
    assert (view["farm"], view["link"], view["partial"], view["unreachable"]) == (
        "hall-1 + hall-2",
        "memory",
        False,
        [],
    )
    cycles = [shard.line.farm.columns.engine[0].cycles for shard in world.shards.values()]
    assert 0 < view["engine"]["cycles"] <= sum(cycles)
    shown = world.get("drives/pump-01").json()
    assert (shown["name"], shown["shard"]) == ("pump-01", "s2:8702")
    assert [line for line in world[2].requests if "pump-01" in line] == ["GET /api/v1/drives/pump-01"]
    assert not [line for line in world[1].requests if "pump-01" in line]


def test_what_is_a_drives_own_goes_to_the_shard_that_has_it(world):
    assert world.request("PUT", "drives/pump-01/params/IL.LIMITP", json={"value": 1234}).json()["value"] == 1234
    assert world.get("drives/pump-01/params?text=il.limitp").json()["parameters"][0]["value"] == 1234
    assert world.get("drives/axis-01/params/IL.LIMITP").json()["value"] != 1234
    assert_problem(world.request("PUT", "drives/pump-01/params/NO.SUCH", json={"value": 1}), 404)
    assert world.post("drives/pump-01/power-off").json()["state"] == "off"
    assert_problem(world.get("drives/pump-01/params/IL.LIMITP"), 409, "switched off")
    assert world.get("drives/pump-01/controller").json()["drive"] == "pump-01"
    assert world.get("drives/axis-01/modules").status_code == 200
    assert_problem(world.get("drives/axis-77"), 404, "axis-77")


def test_what_a_renamed_drive_lacks_is_told_as_of_any_other(world):
    world[2].farm.station("pump-01").device.dcp.name = "press-left"
    world.get("drives")
    assert world.get("drives/press-left").json()["name"] == "pump-01"
    assert_problem(world.get("drives/press-left/params/NO.SUCH"), 404, "has no parameter 'NO.SUCH'")


def test_a_name_that_a_controller_sets_is_known_within_a_second(world):
    shard = world[2]
    station = shard.farm.station("pump-01")
    now = shard.line.world.now
    station.device.dcp.name = "press-left"
    station.device.addressing.take_dcp(NameSet("press-left", False), now)
    shard.farm.settle(station, now)
    assert_problem(world.get("drives/press-left"), 404)
    world.follow()
    world.probe()
    listed = shard.requests.count("GET /api/v1/drives")
    assert world.get("drives/press-left").json()["name"] == "pump-01"
    assert world.post("faults?dry_run=true", {"kind": "silence", "on": "press-*"}).json()["drives"] == ["pump-01"]
    # nothing is read while no name changes
    world.post("drives/axis-01/power-cycle")
    world.follow()
    world.probe()
    assert shard.requests.count("GET /api/v1/drives") == listed
    # a name that is not permanent is gone without supply
    world.post("drives/pump-01/power-cycle")
    world.run(1.0)
    world.follow()
    world.probe()
    assert_problem(world.get("drives/press-left"), 404)


def test_a_body_in_chunks_reaches_the_shard(world):
    async def body():
        yield b'{"val'
        yield b'ue": 77}'

    # of unknown length: it arrives in chunks
    headers = {"content-type": "application/json"}
    chunks = world.request("PUT", "drives/pump-01/params/IL.LIMITP", content=body(), headers=headers)
    assert chunks.json().get("value") == 77, chunks.text


@pytest.mark.parametrize(
    ("answer", "word"),
    [
        (httpx.ConnectError("x"), "refuses the connection"),
        (httpx.RemoteProtocolError("half an answer"), "not answer as a farm"),
        (lambda _: httpx.Response(200, text="<html>hello</html>"), "not answer as a farm"),
        (lambda _: httpx.Response(200, json=[1]), "not answer as a farm"),
        (lambda _: httpx.Response(200, json={"kind": "farm"}), "farm is missing"),
        (lambda _: httpx.Response(200, text="[" * 100_000), "not answer as a farm"),
        (lambda _: httpx.Response(302, headers={"Location": "http://evil/"}), "redirects elsewhere"),
        (lambda _: httpx.Response(401, json={"detail": "this farm needs its token"}), "needs its token"),
        (lambda _: httpx.Response(404, json={"detail": "no such path: /api/v1/clock"}), "without GET clock"),
        (lambda _: httpx.Response(500, text="oops"), "not answer as a farm"),
        (
            lambda _: httpx.Response(
                200,
                json={"kind": "hub", "farm": "x", "instance": "0" * 8, "farm_seconds": 1, "pnfarm": "1"},
            ),
            "itself a hub",
        ),
        (
            lambda _: httpx.Response(
                200,
                json={"kind": "farm", "farm": "x", "instance": "../", "farm_seconds": 1e99, "pnfarm": "1"},
            ),
            "its clock is not valid",
        ),
    ],
)
def test_what_is_no_farm_is_away_and_told_and_the_others_work(world, answer, word):
    world[2].trouble = answer
    world.probe(2)
    view = world.get("drives").json()
    assert view["partial"]
    assert word in view["unreachable"][0]["reason"]
    pump = next(drive for drive in view["drives"] if drive["name"] == "pump-01")
    assert (pump["state"], pump["connected"], pump["unreachable"]["shard"]) == ("unreachable", False, "s2:8702")
    assert_problem(world.get("drives/pump-01"), 503, "pump-01 is unreachable")
    assert world.get("drives/axis-01").status_code == 200
    assert_problem(world.get("readyz"), 503, "1 of 2 shards answer")
    # whoever has no token may ask, too
    assert "s2:8702" not in world.get("readyz").text
    health = world.get("health").json()
    assert [one["state"] for one in health["shards"]] == ["up", "away"]
    assert health["shards"][1]["errors"]
    for path in ("faults", "reactions", "readiness", "doctor", "traces"):
        found = world.get(path).json()
        assert (path, found["partial"], found["unreachable"][0]["shard"]) == (path, True, "s2:8702")
    assert any(one["name"] == "s2:8702: answers" and not one["ok"] for one in world.get("doctor").json()["findings"])


@pytest.mark.parametrize("name", ["%2e%2e", "%2e", "x%2f%2e%2e"])
def test_a_name_never_leads_to_another_path_of_a_shard(world, name):
    for path in (f"faults/{name}", f"traces/{name}", f"drives/axis-01/params/{name}"):
        begun = len(world[1].requests)
        assert world.get(path).status_code in {404, 503}
        asked = world[1].requests[begun:]
        assert all(
            one.startswith(("GET /api/v1/faults/", "GET /api/v1/traces/", "GET /api/v1/drives/")) for one in asked
        )
        assert not [one for one in asked if one.endswith(("/faults/", "/traces/", "axis-01/"))]


def test_an_answer_without_end_is_cut_off(world, monkeypatch):
    monkeypatch.setattr("pnfarm.hub.client.MOST_OCTETS", 1000)
    assert_problem(world.get("drives/pump-01/params?most=500"), 503, "more than 1000 octets")


def test_another_version_is_told(world):
    world.known(2).about = {}
    inner = world[2].inner

    class Old(httpx.AsyncBaseTransport):
        async def handle_async_request(self, request):
            answer = await inner.handle_async_request(request)
            text = (await answer.aread()).replace(__version__.encode(), b"0.0.1")
            return httpx.Response(answer.status_code, content=text, headers={"content-type": "application/json"})

    world[2].inner = Old()
    world.probe()
    assert "runs pnfarm 0.0.1" in world.get("health").json()["shards"][1]["notes"][0]


def test_what_a_shard_answers_is_no_page_of_the_hub(world):
    page = httpx.Response(200, content=b"<script>1</script>", headers={"content-type": "text/html"})
    world[1].trouble = lambda request: page
    answer = world.get("drives/axis-01/modules")
    assert (answer.text, answer.headers["content-security-policy"]) == ("<script>1</script>", "sandbox")
    assert answer.headers["x-content-type-options"] == "nosniff"


def test_drives_that_two_shards_claim_are_refused_and_told():
    world = HubWorld(("axis-{n:02}", 2), ("axis-{n:02}", 1))
    assert_problem(world.get("drives/axis-01"), 409, "axis-01 is claimed by s1:8702 and s2:8702")
    assert_problem(world.post("faults", {"kind": "silence", "on": "all"}), 409, "claimed by")
    assert_problem(world.get("readyz"), 503, "1 drives are claimed")
    assert "axis-01" not in world.get("readyz").text
    assert world.get("health").json()["conflicts"] == {"axis-01": ["s1:8702", "s2:8702"]}
    drives = {drive["name"]: drive.get("claimed_by") for drive in world.get("drives").json()["drives"]}
    assert drives == {"axis-01": ["s1:8702", "s2:8702"], "axis-02": None}
    assert world.get("drives/axis-02").status_code == 200


def test_a_shard_that_restarts_has_a_new_clock_and_its_events_go_on(world):
    world.follow()
    before = world.known(2).clock.offset_ns
    world[2].start()
    world.run(3)
    world.probe()
    assert world.known(2).clock.offset_ns != before
    world[2].farm.injections.inject({"kind": "silence", "on": "all"}, world[2].line.world.now)
    world.run(0.1)
    world.follow()
    events = [data["event"] for _, _, data in told(world.get("events?follow=false&after=0").text)]
    assert "fault injected" in events


def test_nobody_known_is_never_an_all_clear():
    world = HubWorld()
    for path in ("drives", "faults", "readyz", "readiness", "traces", "reactions"):
        assert_problem(world.get(path), 503, "no shard is known yet")
    assert_problem(world.post("reset"), 503, "no shard is known yet")
    assert_problem(world.post("faults", {"kind": "silence", "on": "all"}), 503, "no shard is known yet")
    assert world.get("healthz").json() == {"alive": True}
    assert world.get("health").json()["partial"]


def test_events_of_all_shards_are_one_log_that_resumes_also_at_another_hub(world):
    world.follow()
    for number, name in itertools.product((1, 2), ("one", "two")):
        world.run(0.1)
        shard = world[number]
        shard.farm.injections.inject({"kind": "silence", "on": "all", "as": f"{name}-{number}"}, shard.line.world.now)
    world.run(0.1)
    world.follow()
    whole = told(world.get("events?follow=false&after=0").text)
    times = [data["farm_seconds"] for _, _, data in whole]
    assert times == sorted(times)
    assert {data["shard"] for _, _, data in whole if "shard" in data} == {"s1:8702", "s2:8702"}
    middle = len(whole) // 2
    last = whole[middle][1]
    rest = told(world.get("events?follow=false", headers={"Last-Event-ID": last}).text)
    assert [data["sequence"] for _, _, data in rest] == [data["sequence"] for _, _, data in whole[middle + 1 :]]
    world.restart_hub()
    world.follow()
    again = told(world.get("events?follow=false", headers={"Last-Event-ID": last}).text)
    assert {(one["event"], one["drive"]) for _, _, one in again} >= {(one["event"], one["drive"]) for _, _, one in rest}
    assert len(again) <= len(rest)
    only = told(world.get("events?follow=false&after=0&drive=pump-01").text)
    assert {data["drive"] for _, _, data in only} == {"pump-01"}
    assert_problem(world.get("events?drive=axis-77"), 404, "axis-77")


def test_the_pages_stream_has_all_drives_and_marks_the_unreachable(world):
    found = {event: data for event, _, data in told(world.get("live?follow=false&drive=pump-01").text)}
    assert found["farm"]["drives"] == 3
    assert [row["name"] for row in found["overview"]["rows"].values()] == ["axis-01", "axis-02", "pump-01"]
    assert found["overview"]["rows"]["2"]["shard"] == "s2:8702"
    assert found["drive"]["name"] == "pump-01"
    world.lose(2)
    found = {event: data for event, _, data in told(world.get("live?follow=false").text)}
    row = found["overview"]["rows"]["2"]
    assert (row["name"], row["connected"]) == ("pump-01", False)
    assert "refuses" in row["unreachable"]["reason"]
    places, states = found["overview"]["values"]["state"]
    assert dict(zip(places, states, strict=True))[2] == -2


def test_a_shard_that_misses_one_request_is_told_with_what_happened_and_when(world):
    began = world.hub.wall()
    world.run(5)
    world[2].trouble = httpx.ReadTimeout("late")
    pump = world.get("drives").json()["drives"][2]["unreachable"]
    health = world.get("health").json()["unreachable"][0]
    for told_ in (pump, health):
        assert told_["reason"] == "s2:8702 gave no answer in time"
        assert told_["since"] > began + 4


def test_a_shard_that_comes_back_meanwhile_is_still_missing_in_that_answer(world):
    world.lose(1)

    def back(_):
        # the hub's own question is answered while the other shard's answer is on its way
        world[1].trouble = world[2].trouble = None
        world.hub.shards.note(world.known(1), ShardEvent.ANSWERED, "", world.clock_ns, world.hub.wall())
        return httpx.Response(200, json={"reactions": []})

    world[2].trouble = back
    view = world.get("reactions").json()
    assert (view["partial"], [one["shard"] for one in view["unreachable"]]) == (True, ["s1:8702"])


def test_a_trace_is_on_drives_of_one_shard(world):
    body = {"on": "axis-*", "signals": ["velocity"], "length": "100ms"}
    started = world.post("traces", body)
    assert started.status_code == 201
    trace = started.json()["id"]
    assert started.headers["location"] == f"/api/v1/traces/{trace}"
    world.run(0.3)
    assert world.get(f"traces/{trace}?format=status").json()["state"] == "complete"
    assert len(world.get(f"traces/{trace}").json()["columns"]) == 2
    assert [one["id"] for one in world.get("traces").json()["traces"]] == [trace]
    assert world.get("traces/signals/pump-01").json()["drive"] == "pump-01"
    assert_problem(world.post("traces", {**body, "on": "all"}), 422, "stations of 2 shards", "stations of one shard")
    assert world.request("DELETE", f"traces/{trace}").status_code == 200
    assert_problem(world.get(f"traces/{trace}"), 404, trace)
    world.lose(2)
    assert_problem(world.get(f"traces/{trace}"), 503, "not known is the rest")


def test_a_name_of_a_trace_is_one_for_all_shards_and_free_again(world):
    body = {"signals": ["velocity"], "length": "100ms", "as": "run"}
    assert world.post("traces", {**body, "on": "axis-01"}).status_code == 201
    for on in ("axis-02", "pump-01"):
        refused = world.post("traces", {**body, "on": on})
        assert_problem(refused, 422, "trace.as: there is a trace run already", "another name")
    assert world.get("traces/run").json()["drives"] == ["axis-01"]
    assert world.request("DELETE", "traces/run").status_code == 200
    assert world.post("traces", {**body, "on": "pump-01"}).status_code == 201


def test_drives_that_a_trace_does_not_find_are_the_field_on_of_a_trace(world):
    assert_problem(world.post("traces", {"on": "pumps-*", "signals": ["velocity"]}), 422, "trace.on: no drive matches")


def test_conditions_and_tags_pass_between_a_client_and_the_shard():
    world = HubWorld(("axis-{n:02}", 1))
    conditions = []

    def answer(request):
        conditions.append(request.headers.get("if-match"))
        return httpx.Response(412, json={"detail": "changed meanwhile"}, headers={"ETag": '"2"'})

    world[1].trouble = answer
    refused = world.request("PUT", "drives/axis-01/params/1", json={"value": 1}, headers={"If-Match": '"1"'})
    assert (refused.status_code, refused.headers["etag"]) == (412, '"2"')
    assert conditions == ['"1"']


def test_access_is_checked_as_a_farm_checks_it():
    world = HubWorld(("axis-{n:02}", 1), token="a-long-secret", read_token="another-long-secret")
    assert_problem(world.get("drives"), 401, "token")
    for token, status in (("a-long-secret", 200), ("another-long-secret", 403)):
        headers = {"Authorization": f"Bearer {token}"}
        assert world.get("drives", headers=headers).status_code == 200
        assert world.post("reset", headers=headers).status_code == status
        assert world.post("drives/axis-01/power-cycle", headers=headers).status_code == status
    headers["Origin"] = "http://evil.example"
    assert_problem(world.post("reset", headers=headers), 403, "evil.example")
    open_world = HubWorld(("axis-{n:02}", 1))
    assert_problem(open_world.get("drives", headers={"Host": "evil.example"}), 403, "localhost only")


def test_the_hub_describes_what_it_answers(world):
    described = world.app.openapi()
    for path in ("/drives", "/drives/{name}", "/drives/{name}/params/{pnu}", "/faults", "/scenarios", "/live"):
        assert f"/api/v1{path}" in described["paths"]
    farm = world[1].app.openapi()
    assert set(farm["paths"]) == set(described["paths"])
    for path, method, status in (
        ("drives", "get", "200"),
        ("health", "get", "200"),
        ("faults", "get", "200"),
        ("reset", "post", "200"),
        ("traces", "get", "200"),
        ("clock", "get", "200"),
    ):
        answer = world.request(method.upper(), path).json()
        operation = described["paths"][f"/api/v1/{path}"][method]
        schema = operation["responses"][status]["content"]["application/json"]["schema"]
        jsonschema.validate(answer, {**schema, "components": described["components"]})
    world.post("faults", {"kind": "silence", "on": "all"})
    world.lose(2)
    for path in ("drives", "faults", "health"):
        schema = described["paths"][f"/api/v1/{path}"]["get"]["responses"]["200"]["content"]["application/json"][
            "schema"
        ]
        jsonschema.validate(world.get(path).json(), {**schema, "components": described["components"]})


def test_each_list_is_as_the_hub_describes_it_also_while_a_shard_is_away(monkeypatch):
    monkeypatch.setattr("pnfarm.api.hosts.farm.examine", list)
    more = """  - {name: dp-NUMBER, model: moog-msd-dp, address: 11}
plant:
  step: 2ms
  models: [{name: gripper-NUMBER, kind: cylinder, time: 20ms}, {name: parts-NUMBER, kind: counter}]
  wires: [gripper-NUMBER.extended -> parts-NUMBER.up]
"""
    world = HubWorld(("axis-{n:02}", 1), ("pump-{n:02}", 1), devices=more)
    described = world.app.openapi()
    paths = [path for path, of in described["paths"].items() if "get" in of and "{" not in path]

    def wrong():
        found = []
        for path in paths:
            content = described["paths"][path]["get"]["responses"]["200"]["content"]
            answer = world.get(path.removeprefix("/api/v1/")) if "application/json" in content else None
            if answer is not None and answer.status_code == 200:
                schema = {**content["application/json"]["schema"], "components": described["components"]}
                errors = jsonschema.Draft202012Validator(schema).iter_errors(answer.json())
                found += [f"{path}: {error.json_path}: {error.message[:100]}" for error in errors]
        return found

    assert wrong() == []
    world.lose(2)
    assert wrong() == []


def test_the_hubs_metrics_are_its_own_and_few(world):
    world.lose(2)
    transport = httpx.ASGITransport(world.app)

    async def ask():
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
            return (await client.get("/metrics")).text

    import asyncio

    text = asyncio.run(ask())
    assert 'pnfarm_hub_shard_up{shard="s1:8702"} 1.0' in text
    assert 'pnfarm_hub_shard_up{shard="s2:8702"} 0.0' in text
    assert 'pnfarm_hub_request_errors_total{reason="refused",shard="s2:8702"}' in text
    assert "pnfarm_axis" not in text
    assert len([line for line in text.splitlines() if not line.startswith("#")]) < 20
