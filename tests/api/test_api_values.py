"""The signals of devices as they change, in the page's stream."""

from __future__ import annotations

import asyncio
import json
import time

import pytest
from api_world import assert_problem
from device_world import DeviceWorld, add_island
from plain_station import controller_sends

from pnfarm.api import followed, live
from pnfarm.api.schemas.device import ChangedSignals


@pytest.fixture
def world():
    return DeviceWorld()


def told(octets) -> list[ChangedSignals]:
    """The messages ``values`` of a part of the stream; there is no other message."""
    found = []
    for block in octets.decode().split("\n\n"):
        lines = [line for line in block.splitlines() if not line.startswith((":", "retry"))]
        if lines:
            assert lines[0] == "event: values"
            found.append(ChangedSignals.model_validate_json(lines[1].removeprefix("data: ")))
    return found


def values(message):
    return {signal.name: signal.value for signal in message.signals}


class Client:
    """Follows devices, and no drive; ``names`` as the query has them."""

    def __init__(self, world, *names, **more):
        self.world = world
        chosen = world.app.state.views._context.core.stations
        devices = {one.configured_name: one.signals for one in chosen if one.configured_name in names}
        self.loop = asyncio.new_event_loop()
        self.stream = world.app.state.views.stream({}, None, devices, overview=False, **more)
        assert self.part().startswith(b"retry")

    def part(self, seconds=10.0):
        """The next part of the stream; the farm's time goes on by a round."""
        self.world.line.run(0.1)
        return self.loop.run_until_complete(asyncio.wait_for(anext(self.stream), seconds))

    def close(self):
        self.loop.run_until_complete(self.stream.aclose())
        self.loop.close()


@pytest.fixture
def client(world):
    found = Client(world, "island-1")
    yield found
    found.close()


def test_a_client_gets_all_signals_and_then_those_that_changed(world, client):
    (first,) = told(client.part())
    assert (first.device, values(first)) == (
        "island-1", {"part_present": False, "pressure": 0, "code": "00 00 00 00", "valve_1": False, "speed": 0},
    )  # fmt: skip
    world.signals.set({"pressure": 6.5})
    (second,) = told(client.part())
    assert [(one.name, one.value, one.shown, one.good) for one in second.signals] == [("pressure", 6.5, "6.5", True)]
    controller_sends(world.signals, b"\x02\0\7")
    (third,) = told(client.part())
    assert values(third) == {"valve_1": True, "speed": 7}
    assert first.revision < second.revision < third.revision


def test_a_status_that_goes_bad_is_a_change(world, client):
    controller_sends(world.signals, b"\0\0\0")
    client.part()
    controller_sends(world.signals, b"\0\0\0", good=(True, False))
    (found,) = told(client.part())
    assert [(one.name, one.good) for one in found.signals] == [("speed", False)]


def test_the_tag_of_a_message_is_one_for_a_write_on_what_was_seen(world, client):
    (first,) = told(client.part())
    where, headers = "/api/v1/devices/island-1/signals", {"If-Match": first.tag}
    assert world.request("PATCH", where, json={"pressure": 1}, headers=headers).status_code == 200
    assert_problem(world.request("PATCH", where, json={"pressure": 2}, headers=headers), 412, "has changed since")
    (second,) = told(client.part())
    assert world.request("PATCH", where, json={"pressure": 2}, headers={"If-Match": second.tag}).status_code == 200


def test_changes_between_two_rounds_come_as_one(world, client):
    client.part()
    for number in range(100):
        world.signals.set({"pressure": number / 10, "part_present": number % 2})
    (found,) = told(client.part())
    assert values(found) == {"pressure": 9.9, "part_present": True}


def test_a_device_that_does_not_change_costs_a_client_a_comment_now_and_then(world, client, monkeypatch):
    monkeypatch.setattr(live, "ALIVE_ROUNDS", 3)
    client.part()
    begun = time.monotonic()
    assert client.part() == b": alive\n\n"
    assert time.monotonic() - begun > 2.5 * live.INTERVAL_SECONDS


def test_a_round_has_no_more_than_some_signals_and_every_device_has_its_turn(world, monkeypatch):
    monkeypatch.setattr(followed, "MOST_SIGNALS", 5)
    names = [f"island-{n}" for n in (1, 2, 3)]
    islands = [world.signals, *(add_island(world.line.farm, name).signals for name in names[1:])]
    client = Client(world, *names)
    found = []
    for number in range(9):
        for one in islands:
            one.set({"pressure": number})
        found.append(told(client.part()))
    client.close()
    assert [[one.device for one in part] for part in found] == [[name] for name in names] * 3
    assert [values(part[0])["pressure"] for part in found] == list(range(9))


def test_a_device_that_is_large_rests_after_its_turn(world, monkeypatch):
    # five signals, of which two are one round's share
    monkeypatch.setattr(followed, "MOST_SIGNALS", 2)
    monkeypatch.setattr(live, "INTERVAL_SECONDS", 0.001)
    monkeypatch.setattr(live, "ALIVE_ROUNDS", 1)
    client = Client(world, "island-1")
    found = []
    for number in range(6):
        world.signals.set({"pressure": number})
        found.append(len(told(client.part())))
    client.close()
    assert found == [1, 0, 1, 0, 0, 1]


def test_a_long_message_comes_as_several_of_one_revision(world, monkeypatch):
    monkeypatch.setattr(followed, "MOST_OCTETS", 100)
    client = Client(world, "island-1")
    found = told(client.part())
    client.close()
    assert len(found) > 1
    assert len({one.revision for one in found}) == 1
    assert [name for one in found for name in values(one)] == list(world.signals.names)


def test_clients_of_one_device_share_what_is_read_and_nothing_is_read_without_one(world, monkeypatch):
    looks = []
    readings = type(world.signals).readings
    monkeypatch.setattr(type(world.signals), "readings", lambda self: looks.append(1) or readings(self))
    clients = [Client(world, "island-1") for _ in range(3)]
    world.signals.set({"pressure": 1})
    first = clients[0].part()
    # the others look within the same moment of the farm
    with monkeypatch.context() as frozen:
        frozen.setattr(world.line, "run", lambda _: None)
        assert [one.part() for one in clients[1:]] == [first] * 2
    assert len(looks) == 1
    for one in clients:
        one.close()
    del clients, one
    world.signals.set({"pressure": 2})
    world.line.run(1)
    assert len(looks) == 1
    assert not world.app.state.views._changes


def test_devices_are_chosen_by_name_and_by_the_word_all(world):
    add_island(world.line.farm, "island-2")
    asked = "/api/v1/live?follow=false&overview=false"
    for query, names in (
        ("", []),
        ("&device=island-2", ["island-2"]),
        ("&device=island-2&device=island-1&device=island-2", ["island-2", "island-1"]),
        ("&device=all", ["island-1", "island-2"]),
    ):
        assert [one.device for one in told(world.get(asked + query).content)] == names
    assert_problem(world.get(f"{asked}&device=island-3"), 404, "there is no device 'island-3', did you mean island-")
    assert_problem(world.get(f"{asked}&device=axis-01"), 404, "axis-01 is a drive")
    assert_problem(world.get("/api/v1/live", params={"device": ["island-1"] * 1001}), 422, "device")


def test_a_device_without_signals_sends_none(world):
    world.device.signals = None
    assert told(world.get("/api/v1/live?follow=false&overview=false&device=island-1").content) == []


def test_a_page_gets_the_device_beside_all_drives(world):
    text = world.get("/api/v1/live?follow=false&device=island-1").text
    assert [line for line in text.splitlines() if line.startswith("event")] == [
        "event: farm", "event: overview", "event: values",
    ]  # fmt: skip


def test_devices_are_listed_with_their_connection_counts_and_faults(world):
    (row,) = world.get("/api/v1/devices").json()["devices"]
    assert (row["connection"]["state"], row["inputs"], row["outputs"], row["injected"]) == ("NO_AR", 3, 2, [])


def test_the_stream_s_messages_are_described(world):
    described = world.get("/openapi.json").json()
    operation = described["paths"]["/api/v1/live"]["get"]
    assert "ChangedSignals" in json.dumps(operation["responses"]["200"])
    assert "ChangedSignals" in described["components"]["schemas"]
    assert {"device", "overview"} <= {one["name"] for one in operation["parameters"]}
