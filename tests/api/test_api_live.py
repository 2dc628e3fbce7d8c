"""The page's stream, and what else a page asks for: parameters as a list, power, reactions, health."""

import asyncio
import itertools
import json

import anyio
import pytest
from api_world import ApiWorld, assert_problem
from events import Something

from pnfarm.api import live
from pnfarm.station.events import PowerLost
from pnfarm.trace.live import MOST_DRIVES


def messages(text):
    found = []
    for block in text.split("\n\n"):
        lines = dict(line.split(": ", 1) for line in block.splitlines() if ": " in line)
        if "event" in lines:
            found.append((lines["event"], json.loads(lines["data"])))
    return found


@pytest.fixture
def world():
    world = ApiWorld(3)
    world.line.connect()
    world.line.enable()
    world.line.run(0.5)
    return world


def test_a_long_message_comes_in_pieces_of_a_bounded_size(world, monkeypatch):
    monkeypatch.setattr(live, "PIECE", 100)
    pieces = []

    async def read():
        stream = world.app.state.views.stream({}, None, follow=False)
        pieces.extend([piece async for piece in stream])

    asyncio.run(read())
    assert max(map(len, pieces)) == 100
    assert [event for event, _ in messages(b"".join(pieces).decode())] == ["farm", "overview"]


@pytest.mark.parametrize("way", ["header", "query"])
def test_a_page_that_comes_back_gets_the_entries_of_the_log_that_came_meanwhile(world, way):
    def opened(last=None):
        given = (
            {}
            if last is None
            else {"headers": {"Last-Event-ID": last}}
            if way == "header"
            else {"params": {"after": last}}
        )
        url = "/api/v1/live" if way == "query" and last is not None else "/api/v1/live?follow=false"
        if "params" in given:
            given["params"]["follow"] = "false"
        text = world.get(url, **given).text
        entries = dict(messages(text)).get("log", {"entries": []})["entries"]
        return text.rpartition("id: ")[2].split("\n")[0], [entry.get("number") for entry in entries]

    last, entries = opened()
    assert entries == []
    for number in range(3):
        world.line.log.record(number, "axis-01", Something("try", {"number": number}))
    # a page that is opened now begins now
    assert opened()[1] == []
    last, entries = opened(last)
    assert entries == [0, 1, 2]
    assert opened(last)[1] == []
    # of another run: all of this one
    assert opened("00000000-999")[1] != []


def test_a_page_is_told_the_farm_and_its_drives(world):
    found = dict(messages(world.get("/api/v1/live?follow=false").text))
    assert list(found) == ["farm", "overview"]
    assert found["farm"]["drives"] == 3
    assert found["farm"]["writes"]
    assert (
        found["farm"]["faults"]["akd-profinet"]["702"] == ["702", "Fieldbus communication lost"]
        or found["farm"]["faults"]["akd-profinet"]["702"][0] == "702"
    )
    assert [row["name"] for row in found["overview"]["rows"].values()] == ["axis-01", "axis-02", "axis-03"]
    assert {row["ar_state"] for row in found["overview"]["rows"].values()} == {"DATA"}


def test_a_chosen_drive_is_told_in_detail(world):
    found = dict(messages(world.get("/api/v1/live?follow=false&drive=axis-02").text))
    assert found["drive"]["name"] == "axis-02"
    assert set(found["signals"]["signals"]) >= {"setpoint", "velocity", "stw1", "zsw1"}
    assert_problem(world.get("/api/v1/live?drive=axis-77"), 404, "axis-77")


def test_a_motor_that_was_driven_out_of_all_numbers_hides_neither_itself_nor_other_drives():
    world = ApiWorld(2, controller=False)
    motor = world.line.farm.axes[0].handle.axis.motor
    motor.velocity, motor.torque = float("nan"), float("-inf")
    shown = dict(messages(world.get("/api/v1/live?follow=false&drive=axis-01").text))["drive"]
    listed = world.get("/api/v1/drives").json()["drives"]
    assert [one["name"] for one in listed] == ["axis-01", "axis-02"]
    for one in (shown, listed[0], world.get("/api/v1/drives/axis-01").json()):
        assert one["velocity_rpm"] == 0.0
    assert shown["torque_newton_metres"] < -1e300


def test_only_some_drives_are_sampled_at_once_and_the_next_is_told_so(world):
    world = ApiWorld(MOST_DRIVES + 1, controller=False)
    told = [
        dict(messages(world.get(f"/api/v1/live?follow=false&drive=axis-{n:02}").text))["signals"]
        for n in range(1, MOST_DRIVES + 2)
    ]
    assert all(one is not None for one in told[:-1])
    assert told[-1] is None
    # who goes from drive to drive leaves room for the next
    world.line.run(1.5)
    found = dict(messages(world.get(f"/api/v1/live?follow=false&drive=axis-{MOST_DRIVES + 1:02}").text))
    assert found["signals"] is not None
    # the other ones have their past until it is needed, or long gone
    assert len(world.line.farm.traces.kept()) == MOST_DRIVES
    world.line.run(11)
    assert world.line.farm.traces.kept() == []


def test_samples_come_once_and_in_order(world):
    async def main():
        scope = {}
        stream = world.app.state.views.stream(scope, world.line.farm.axes[0])
        seconds = []
        for _ in range(8):
            for event, data in messages((await anext(stream)).decode()):
                if event == "signals":
                    seconds += data["seconds"]
            world.line.run(0.1)
        await stream.aclose()
        return seconds

    seconds = anyio.run(main)
    assert 60 <= len(seconds) <= 71
    assert seconds == sorted(set(seconds))
    assert max(b - a for a, b in itertools.pairwise(seconds)) == pytest.approx(0.01)


def test_a_slow_page_is_told_how_many_entries_it_missed(world):
    async def main():
        stream = world.app.state.views.stream({}, None)
        await anext(stream)
        await anext(stream)
        for _ in range(1000):
            world.line.log.record(world.line.world.now, "axis-01", PowerLost())
        found = []
        for _ in range(10):
            found += [data for event, data in messages((await anext(stream)).decode()) if event == "log"]
        await stream.aclose()
        return found

    found = anyio.run(main)
    assert sum(one.get("lost", 0) for one in found) > 0
    numbers = [entry["sequence"] for one in found for entry in one["entries"]]
    assert numbers == sorted(set(numbers))
    assert all(len(one["entries"]) <= 64 for one in found)


def test_who_may_only_read_is_told_so():
    world = ApiWorld(1, controller=False, token="a-long-secret", read_token="another-long-secret")
    for token, writes in (("a-long-secret", True), ("another-long-secret", False)):
        answer = world.get("/api/v1/live?follow=false", headers={"Authorization": f"Bearer {token}"})
        assert dict(messages(answer.text))["farm"]["writes"] is writes


def test_parameters_are_listed_by_number_name_or_unit(world):
    whole = world.get("/api/v1/drives/axis-01/params?most=500").json()
    assert whole["count"] > 500 == len(whole["parameters"])
    found = world.get("/api/v1/drives/axis-01/params?text=il.limitp").json()
    assert [one["name"] for one in found["parameters"]] == ["IL.LIMITP"]
    one = world.get("/api/v1/drives/axis-01/params/IL.LIMITP").json()
    assert found["parameters"][0]["value"] == one["value"]
    rest = world.get(f"/api/v1/drives/axis-01/params?from={whole['count'] - 3}").json()
    assert len(rest["parameters"]) == 3
    assert world.get("/api/v1/drives/axis-01/params?text=nothing-has-this").json()["parameters"] == []
    assert_problem(world.get("/api/v1/drives/axis-01/params?most=100000"), 422, "most")


def test_power_is_switched_off_and_on_and_twice_is_once(world):
    for _ in range(2):
        assert world.post("/api/v1/drives/axis-01/power-off").json()["state"] == "off"
    assert world.get("/api/v1/drives/axis-01/params?text=il.limitp").json()["parameters"][0]["value"] is None
    for _ in range(2):
        assert world.post("/api/v1/drives/axis-01/power-on").json()["powered"]
    events = [entry["event"] for entry in world.get("/api/v1/drives/axis-01").json()["events"]]
    assert events.count("power off requested") == 2
    assert events.count("power off") == events.count("power on") == 1


def test_the_fault_buffer_of_a_drive_is_shown_by_situation(world):
    world.post("/api/v1/faults", {"kind": "f702", "on": "axis-01"})
    world.line.run(0.1)
    memory = world.get("/api/v1/drives/axis-01").json()["fault_memory"]
    assert [one["label"] for one in memory[0]] == ["702"]


def test_reactions_tell_the_steps_of_the_controller(world):
    world.post("/api/v1/faults", {"kind": "f702", "on": "axis-02"})
    world.line.run(0.5)
    (found,) = world.get("/api/v1/reactions").json()["reactions"]
    assert (found["drive"], found["what"], found["kind"], found["code"]) == ("axis-02", "fault", "f702", "702")
    acknowledged = next(step["seconds"] for step in found["steps"] if step["what"] == "acknowledged")
    assert found["recovered_seconds"] == acknowledged
    assert any(step["text"] == "stw1.fault_acknowledge = 1" for step in found["steps"])
    assert {"injected", "wire", "fault"} == {step["what"] for step in found["steps"][:3]}
    world.post("/api/v1/faults", {"kind": "timeout", "on": "axis-03"})
    world.line.run(3)
    (lost,) = [one for one in world.get("/api/v1/reactions").json()["reactions"] if one["what"] == "connection"]
    assert (lost["drive"], lost["kind"]) == ("axis-03", "timeout")
    steps = [step["what"] for step in lost["steps"]]
    assert steps[:3] == ["injected", "wire", "lost"]
    injected, wire, gone = (step["seconds"] for step in lost["steps"][:3])
    # silent from its next frame on, until the controller's watchdog expires
    assert injected <= wire < gone == 0.0


def test_a_connection_that_was_lost_without_an_injection_has_no_cause_in_its_timeline(world):
    world.post("/api/v1/faults", {"kind": "f702", "on": "axis-03"})
    world.line.run(70)
    world.post("/api/v1/drives/axis-03/power-off")
    world.line.run(1)
    world.post("/api/v1/drives/axis-03/power-on")
    world.line.run(5)
    lost = [one for one in world.get("/api/v1/reactions").json()["reactions"] if one["what"] == "connection"]
    assert all(one["kind"] == "" and one["steps"][0]["what"] == "lost" for one in lost)


def test_health_has_the_engine_and_its_lateness(world):
    found = world.get("/api/v1/health").json()
    assert found["engine"]["cycles"] > 100
    assert found["lateness"][-1]["up_to_seconds"] is None
    assert found["loop_late_seconds"] == 0
