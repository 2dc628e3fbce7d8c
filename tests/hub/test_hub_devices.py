"""Stations and devices of farms in memory, through the hub."""

from __future__ import annotations

import asyncio
import itertools
import json
from types import SimpleNamespace

import httpx
import pytest
from api_world import assert_problem
from cell_file import DEVICES
from device_world import add_island
from hub_world import HubWorld
from plain_station import controller_sends

from pnfarm.api.paths.streams import Chosen
from pnfarm.drives import catalogue
from pnfarm.hub.log import HubEntry
from pnfarm.hub.scenario import HubRun
from pnfarm.scenario.definition.binding import bind_scenario
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.station.lateness import Lateness
from pnfarm.station.visits import Caller

SIGNALS = "devices/island-2/signals"


@pytest.fixture
def world():
    world = HubWorld(("axis-{n:02}", 2), ("pump-{n:02}", 1))
    world.islands = [add_island(world[number].farm, f"island-{number}") for number in (1, 2)]
    # a farm has its devices from the beginning
    world.restart_hub()
    return world


def test_stations_and_devices_of_all_shards_are_listed(world):
    found = world.get("stations").json()
    assert [(one["name"], one["kind"], one["shard"]) for one in found["stations"]] == [
        ("axis-01", "drive", "s1:8702"),
        ("axis-02", "drive", "s1:8702"),
        ("island-1", "device", "s1:8702"),
        ("pump-01", "drive", "s2:8702"),
        ("island-2", "device", "s2:8702"),
    ]
    assert found["partial"] is False
    assert [one["name"] for one in world.get("devices").json()["devices"]] == ["island-1", "island-2"]
    world.lose(2)
    found = world.get("devices").json()
    assert ([one["name"] for one in found["devices"]], found["partial"]) == (["island-1"], True)


def test_a_device_is_asked_at_the_shard_that_has_it(world):
    assert world.get("devices/island-2").json()["description"] == "Example island"
    written = world.request("PATCH", SIGNALS, json={"pressure": 6.5})
    assert {one["name"]: one["value"] for one in written.json()["signals"]}["pressure"] == 6.5
    assert world.islands[1].signals.get("pressure") == 6.5
    assert world.islands[0].signals.get("pressure") == 0
    assert not [line for line in world[1].requests if "island-2" in line]


def test_a_refusal_is_the_shards(world):
    found = assert_problem(world.request("PATCH", SIGNALS, json={"valve_1": True}), 422, "the controller alone")
    assert found["errors"][0]["field"] == "valve_1"
    assert_problem(world.get("devices/island-3"), 404, "there is no device 'island-3', did you mean island-")
    assert_problem(world.get("devices/axis-01"), 404, "there is no device 'axis-01'")


def test_conditions_reach_the_shard_and_its_tag_the_client(world):
    tag = world.get(SIGNALS).headers["etag"]
    assert world.request("GET", SIGNALS, headers={"If-None-Match": tag}).status_code == 304
    controller_sends(world.islands[1].signals, b"\2\0\0")
    late = world.request("PATCH", SIGNALS, json={"pressure": 1}, headers={"If-Match": tag})
    assert_problem(late, 412, "has changed since")


def test_a_device_of_a_shard_that_is_away_is_unreachable(world):
    world.get("devices/island-2")
    world.lose(2)
    assert_problem(world.get("devices/island-2"), 503, "island-2 is unreachable")
    assert_problem(world.get("devices/island-3"), 503, "no shard that answers has a device 'island-3'")


def test_a_device_that_two_shards_have_is_refused(world):
    add_island(world[1].farm, "island-2")
    world.restart_hub()
    assert_problem(world.get("devices/island-2"), 409, "claimed by s1:8702 and s2:8702")


def carried_out(world, text, meanwhile=lambda: None):
    async def run():
        transport = httpx.ASGITransport(world.app)
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1/api/v1") as client:
            begun = (await client.post("scenarios", json={"text": text})).json()
            for _ in range(500):
                found = (await client.get(f"scenarios/{begun['id']}")).json()
                if found["state"] == "ended":
                    break
                meanwhile()
                await asyncio.sleep(0.01)
            return found

    return asyncio.run(run())


def test_a_scenarios_step_writes_signals_of_any_shard(world):
    text = "scenario: s\nsteps:\n  - set: {island-1.pressure: 1.5, island-2.pressure: 2.5}\n"
    assert carried_out(world, text)["verdict"] == "passed"
    assert [island.signals.get("pressure") for island in world.islands] == [1.5, 2.5]
    found = carried_out(world, "scenario: s\nsteps:\n  - set: {island-2.valve_1: true}\n")
    assert found["verdict"] == "error"
    assert "island-2: valve_1: is an output: the controller alone writes it" in str(found["cases"])


def test_an_expectation_is_checked_by_the_shard_that_has_the_device(world):
    world.islands[1].signals.set({"pressure": 2.5})
    head = "scenario: s\nsteps:\n"
    found = carried_out(
        world, head + "  - expect: {that: island-2.pressure == 2.5}\n  - wait: {until: island-1.pressure == 0}\n"
    )
    assert found["verdict"] == "passed"
    assert found["cases"][0]["shown"]["island-2"]["island-2.pressure"] == "2.5 bar"
    found = carried_out(world, head + "  - expect: {that: island-2.presure > 2}\n")
    assert "did you mean pressure" in str(found["cases"])
    found = carried_out(world, head + "  - expect: {that: island-1.pressure > 2 or island-2.pressure > 2}\n")
    assert found["verdict"] == "error"
    assert "island-1, island-2 are devices of several shards" in str(found["cases"])


def test_a_force_of_a_scenario_reaches_the_shard_and_ends_with_it(world):
    text = """scenario: s
steps:
  - force: {island-1.pressure: 4, island-2.pressure: 5}
  - release: [island-1, island-2.code]
  - set: {island-2.pressure: 1}
  - expect: {that: island-2.pressure == 5}
  - expect: {that: island-1.pressure == 0}
"""
    found = carried_out(world, text)
    assert found["verdict"] == "passed", found["cases"]
    assert [entry["text"] for entry in found["timeline"] if entry["what"] == "event"] == [
        "pressure waits: a force has it"
    ]
    assert [island.signals.get("pressure") for island in world.islands] == [0, 1]
    assert not any(island.signals.forced for island in world.islands)


def test_what_was_cut_short_on_a_shard_does_not_pass(world):
    inner = world[2].inner

    class CutShort(httpx.AsyncBaseTransport):
        async def handle_async_request(self, request):
            answer = await inner.handle_async_request(request)
            text = (await answer.aread()).replace(b'"verdict":"passed"', b'"verdict":"not run"')
            return httpx.Response(answer.status_code, content=text, headers={"content-type": "application/json"})

    world[2].inner = CutShort()
    found = carried_out(world, "scenario: s\nsteps:\n  - expect: {drive: all, that: not connected, for: 100ms}\n")
    assert (found["verdict"], found["cases"][0]["verdict"]) == ("inconclusive", "inconclusive")


@pytest.mark.parametrize("late_ns", [0, 90_000_000])
def test_a_drive_that_a_late_shard_lost_is_known_until_it_is_back(world, late_ns):
    """For its metrics; the timeline has the loss by the bus's own name."""
    scenario = parse_scenario("scenario: s\nsteps:\n  - wait: 1s\n")
    binding = bind_scenario(scenario, {"axis-01": catalogue.model("akd-profinet")}, {})
    run = HubRun(binding, world.hub, None, 0)

    def noted(at_ns, **data):
        run._note(HubEntry(1, "a", 1, at_ns, {"drive": "axis-01", **data}))

    noted(100, event="ar aborted", **Lateness(16_000_000, engine_ns=late_ns).as_dict())
    assert [run._is_own_loss("axis-01", begin) for begin in (50, 200)] == [late_ns > 0] * 2
    noted(150, event="state changed", before="S3", after="S4")
    assert [run._is_own_loss("axis-01", begin) for begin in (50, 200)] == [late_ns > 0, False]
    assert [entry["text"] for entry in run.record.as_dict()["timeline"]] == ["ar aborted", "state changed"]


def test_the_axes_of_a_drive_system_that_a_late_shard_lost_are_known(world, monkeypatch):
    views = {f"axis-0{n}": {"station_name": "system"} for n in (1, 2)} | {"axis-03": {"station_name": "axis-03"}}
    monkeypatch.setattr(type(world.hub.shards), "views", views)
    scenario = parse_scenario("scenario: s\nsteps:\n  - wait: 1s\n")
    run = HubRun(bind_scenario(scenario, {"axis-01": catalogue.model("moog-msd")}, {}), world.hub, None, 0)
    run._note(HubEntry(1, "a", 1, 100, {"drive": "system", "event": "ar aborted", "cause": "farm"}))
    assert [run._is_own_loss(f"axis-0{n}", 50) for n in (1, 2, 3)] == [True, True, False]


# -- real ones, with their controllers


@pytest.fixture(scope="module")
def cells():
    devices = DEVICES.replace("island-1", "island-NUMBER").replace("10.77.0.41", "10.77.NET.41")
    world = HubWorld(("axis-{n:02}", 1), ("pump-{n:02}", 1), controller=True, devices=devices)
    world.run(3.0)
    return world


HEAD = "scenario: s\nsteps:\n  - wait: {until: all-connected, within: 10s}\n"


def test_all_connected_waits_for_the_devices_of_all_shards(cells):
    assert carried_out(cells, HEAD)["verdict"] == "passed"
    cut = cells.post("faults", {"kind": "link-down", "on": "island-2", "as": "cut"})
    assert (cut.status_code, cut.json()["hit"]) == (201, ["island-2"])
    cells.run(2.0)
    found = carried_out(cells, HEAD.replace("10s", "500ms"))
    assert found["verdict"] == "failed"
    assert "island-2" in found["cases"][0]["message"]
    assert carried_out(cells, HEAD.replace("within", "drive: all, within"))["verdict"] == "passed"
    cells.request("DELETE", "faults/cut")
    assert carried_out(cells, HEAD)["verdict"] == "passed"


def test_a_scenarios_fault_on_a_device_goes_to_its_shard_and_ends_with_it(cells):
    steps = """  - fault: {kind: signal-stuck, on: island-2, params: {signal: part_present, value: true}}
  - expect: {that: island-2.part_present, within: 1s}
  - fault: {kind: link-down, on: "model:EX-ISL-100", as: cut}
  - wait: {until: not island-1.connected, within: 2s}
  - clear: cut
  - wait: {until: all-connected, within: 10s}
"""
    found = carried_out(cells, HEAD + steps)
    assert found["verdict"] == "passed", found["cases"]
    assert [list(one["drives"]) for one in found["faults"]] == [["island-2"], ["island-1", "island-2"]]
    assert cells.get("faults").json()["faults"] == []


POWERED = "that: powered, within: 1s"


@pytest.mark.parametrize(
    "following",
    [
        f"  - expect: {{drive: all, {POWERED}}}\n",
        "  - wait: {until: powered, within: 1s}\n",
        f"  - parallel: [[expect: {{drive: axis-01, {POWERED}}}], [expect: {{drive: pump-01, {POWERED}}}]]\n",
    ],
)
def test_what_follows_a_fault_begins_on_all_shards_at_the_moment_of_the_fault(cells, monkeypatch, following):
    starts = {}
    for shard in cells.shards.values():

        async def note(request, shard=shard, inner=shard.inner):
            path = request.url.path.rpartition("/")[2]
            if request.method == "POST" and "dry_run" not in request.url.params:
                starts.setdefault(path, set()).add((shard, request.url.params.get("at")))
            return await inner.handle_async_request(request)

        monkeypatch.setattr(shard, "inner", SimpleNamespace(handle_async_request=note))
    found = carried_out(cells, f"scenario: s\nsteps:\n  - fault: {{kind: silence, on: all, for: 1ms}}\n{following}")
    assert found["verdict"] == "passed", found["cases"]
    assert len(starts["faults"]) == 2
    assert None not in {at for _, at in starts["faults"]}
    assert starts["scenarios"] == starts["faults"]


def test_what_would_follow_a_fault_that_is_refused_is_not_asked_for(cells):
    fault = "{kind: signal-stuck, on: island-1, params: {signal: presure}}"
    text = f"scenario: s\nsteps:\n  - fault: {fault}\n  - expect: {{that: not island-1.connected, within: 9s}}\n"
    found = carried_out(cells, text)
    assert (found["verdict"], len(found["cases"])) == ("error", 2), found["cases"]
    part = [line.rpartition("/")[2] for line in cells[1].requests if line.startswith("DELETE /api/v1/scenarios/")]
    client = cells.hub.client(cells.known(1))
    asyncio.run(client.ask("GET", f"/api/v1/scenarios/{part}", seconds=1)).object()


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("{kind: link-down, on: island-3}", "no drive matches 'island-3', did you mean island-"),
        ("{kind: link-down, on: 'model:EX-ISL-1'}", "did you mean EX-ISL-100"),
    ],
)
def test_a_fault_on_a_device_that_no_shard_has_is_refused_before_the_scenario_begins(cells, fault, sentence):
    assert_problem(cells.post("scenarios", {"text": f"{HEAD}  - fault: {fault}\n"}), 422, sentence)


def test_a_fault_of_a_shards_own_is_shown_everywhere_by_the_name_that_ends_it(cells):
    farm = cells[2].farm
    farm.injections.inject({"kind": "silence", "on": ["pump-01", "island-2"]}, cells[2].line.world.now)
    own = "fault-1@s2:8702"
    assert [fault["id"] for fault in cells.get("faults").json()["faults"]] == [own]
    assert cells.get("drives").json()["drives"][1]["faults_injected"] == [own]
    assert cells.get("drives/pump-01").json()["faults_injected"] == [own]
    assert cells.get("devices").json()["devices"][1]["injected"] == [{"id": own, "kind": "silence"}]
    assert cells.get("devices/island-2").json()["injected"] == [{"id": own, "kind": "silence"}]
    lines = cells.get("live?follow=false&drive=pump-01").text.splitlines()
    found = {event: json.loads(data[6:]) for event, data in itertools.pairwise(lines) if event.startswith("event: ")}
    assert found["event: overview"]["rows"]["1"]["injected"] == [[own, "silence"]]
    assert found["event: drive"]["faults_injected"] == [own]
    assert cells.request("DELETE", f"faults/{own}").json()["state"] == "ended"


def test_a_wrong_signal_of_a_fault_is_refused_by_the_shard_when_the_step_is_due(cells):
    found = carried_out(cells, HEAD + "  - fault: {kind: signal-stuck, on: island-1, params: {signal: part_presnt}}\n")
    assert found["verdict"] == "error"
    assert "did you mean part_present" in str(found["cases"])


def test_a_trace_is_of_the_devices_of_one_shard(cells):
    body = {"on": "axis-01", "signals": ["velocity", "island-1.part_present"], "length": "20ms"}
    trace = cells.post("traces", {**body, "trigger": "island-1.part_present"}).json()["id"]
    cells.request("PATCH", "devices/island-1/signals", json={"part_present": True})
    cells.run(0.2)
    found = cells.get(f"traces/{trace}").json()
    assert (found["state"], found["triggered_by"], found["columns"][1]["values"][0]) == ("complete", "island-1", 1)
    assert cells.get("traces/signals/island-2").json()["drive"] == "island-2"
    cells.request("DELETE", f"traces/{trace}")
    for wrong in (
        {"on": "all"},
        {"signals": ["velocity", "island-2.part_present"]},
        {"trigger": "island-2.pressure > 6"},
    ):
        assert_problem(cells.post("traces", {**body, **wrong}), 422, "stations of 2 shards")


# -- their signals as they change


def told(octets) -> list[dict]:
    """The messages ``values``."""
    lines = octets.decode().splitlines()
    return [json.loads(data[6:]) for event, data in itertools.pairwise(lines) if event == "event: values"]


def values(message):
    return {signal["name"]: signal["value"] for signal in message["signals"]}


def test_signals_of_devices_come_from_the_shards_that_have_them(world):
    asked = "live?follow=false&overview=false"
    world.islands[1].signals.set({"pressure": 6.5})
    (found,) = told(world.get(f"{asked}&device=island-2").content)
    assert (found["device"], values(found)["pressure"]) == ("island-2", 6.5)
    assert world.get("devices/island-2/signals").headers["etag"] == found["tag"]
    assert [one["device"] for one in told(world.get(f"{asked}&device=all").content)] == ["island-1", "island-2"]
    assert_problem(world.get(f"{asked}&device=island-3"), 404, "there is no device 'island-3'")
    world.lose(2)
    assert_problem(world.get(f"{asked}&device=island-2"), 503, "island-2 is unreachable")
    assert [one["device"] for one in told(world.get(f"{asked}&device=all").content)] == ["island-1"]


def test_a_slow_client_gets_the_newest_values_of_each_signal_once(world, monkeypatch):
    def message(revision, **signals):
        states = [{"name": name, "value": value, "shown": str(value), "good": True} for name, value in signals.items()]
        return "values", {"device": "island-2", "revision": revision, "tag": f'"x-{revision}"', "signals": states}

    async def main():
        gone = asyncio.Event()

        async def stream(path, *, query):
            assert query == {"overview": "false", "device": ["island-2"]}
            for number in range(100):
                yield message(number, pressure=number)
            yield message(100, part_present=True)
            await gone.wait()

        monkeypatch.setattr(world.hub, "client", lambda shard: SimpleNamespace(stream=stream, ask=asked(shard).ask))
        live = world.app.state.views.stream({}, Chosen(None, ("island-2",), overview=False, follow=True))
        assert (await anext(live)).startswith(b"retry")
        (found,) = told(await asyncio.wait_for(anext(live), 10))
        await live.aclose()
        return found

    asked = world.hub.client
    found = asyncio.run(main())
    assert (found["revision"], found["tag"], values(found)) == (100, '"x-100"', {"pressure": 99, "part_present": True})


@pytest.mark.parametrize(
    "data",
    [{}, {"device": "island-1"}, {"device": "island-2", "signals": [1]}, {"device": [], "signals": []},
     {"device": "island-2", "signals": [{"name": []}]}, {"device": "island-2", "signals": [], "revision": "x"},
     {"device": "island-2", "revision": 1, "tag": "", "signals": [{"name": str(n)} for n in range(50_001)]}],
)  # fmt: skip
def test_values_that_no_farm_sends_are_counted_and_left_out(world, monkeypatch, data):
    async def stream(path, *, query):
        yield "values", data

    asked = world.hub.client
    monkeypatch.setattr(world.hub, "client", lambda shard: SimpleNamespace(stream=stream, ask=asked(shard).ask))
    assert told(world.get("live?follow=false&overview=false&device=island-2").content) == []
    assert world.known(2).errors["garbage"] == 1


# -- readiness


def test_the_readiness_of_all_shards_is_one_and_a_name_of_another_shard_is_not_missing():
    world = HubWorld(("axis-{n:02}", 1), ("pump-{n:02}", 1), controller=True, skews=(0.0, 7.0))
    for number in (1, 2):
        assert world[number].line.world.run(10.0, until=lambda n=number: world[n].line.plc.all_connected)
        world[number].line.world.run(0.2)
    plc = Caller("10.77.0.250", bytes(6))
    for number, name in ((1, "pump-01"), (1, "pump-07"), (2, "pump-07")):
        shard = world[number]
        shard.farm.segments["profinet"].absent.note(name, plc, shard.line.world.now)
    found = world.get("readiness").json()
    assert [(one["name"], one["shard"], one["state"]) for one in found["stations"]] == [
        ("axis-01", "s1:8702", "ready"),
        ("pump-01", "s2:8702", "ready"),
    ]
    assert [one["address"] for one in found["controllers"]] == ["10.77.0.250", "10.77.2.250"]
    assert [one["visits"][0]["controller"] for one in found["stations"]] == [0, 1]
    # two shards saw it
    assert [one["name"] for one in found["missing"]] == ["pump-07"]
    assert (found["ready"], found["partial"]) == (True, False)
    world.lose(2)
    found = world.get("readiness").json()
    assert (len(found["stations"]), found["ready"], found["partial"]) == (1, False, True)
