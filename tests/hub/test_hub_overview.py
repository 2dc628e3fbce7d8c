"""All drives at a glance at the hub: what shards told stays true while other shards and drives come and go."""

import asyncio
import json
from types import SimpleNamespace

import httpx

from pnfarm.config.drive import MAX_DRIVES
from pnfarm.hub import Hub
from pnfarm.hub.client import ShardClient
from pnfarm.hub.live import HubLive
from pnfarm.hub.overview import UNREACHABLE, HubOverview
from pnfarm.hub.shards import Shards
from pnfarm.hub.states import ShardEvent


def up(shards, url, *names):
    shard = shards.give(url)
    shards.note(shard, ShardEvent.ANSWERED, "", 0, 0.0)
    shards.take(shard, {"drives": [{"name": name, "model": "akd-profinet"} for name in names], "lines": []})
    return shard


def whole(*names, states):
    """A shard's first message."""
    rows = {str(place): {"name": name} for place, name in enumerate(names)}
    return {"values": {"state": [None, states]}, "rows": rows}


def shown(overview):
    """State by drive, as a page sees it that has just been opened."""
    overview.refresh()
    found = json.loads(overview.since(0))
    states = dict(zip(*found["values"]["state"], strict=True))
    return {row["name"]: states[int(place)] for place, row in found["rows"].items()}


def test_drives_at_rest_are_still_shown_when_a_shard_with_others_comes():
    shards = Shards()
    one = up(shards, "http://a:1", "axis-2", "axis-3")
    overview = HubOverview(shards, lambda: 0)
    overview.take(one, whole("axis-2", "axis-3", states=[4, 2]))
    other = up(shards, "http://b:1", "axis-1")
    assert shown(overview) == {"axis-2": 4, "axis-3": 2}
    overview.take(other, whole("axis-1", states=[3]))
    overview.take(one, {"values": {"state": [[1], [1]]}})
    assert shown(overview) == {"axis-1": 3, "axis-2": 4, "axis-3": 1}


def test_drives_that_a_new_run_has_in_another_order_are_not_taken_for_each_other():
    shards = Shards()
    one = up(shards, "http://a:1", "axis-1", "axis-2")
    overview = HubOverview(shards, lambda: 0)
    overview.take(one, whole("axis-1", "axis-2", states=[1, 2]))
    up(shards, "http://a:1", "axis-2", "axis-1")
    # of many drives the rows come later
    overview.take(one, {"values": {"state": [None, [2, 1]]}})
    assert shown(overview) == {"axis-1": 1, "axis-2": 2}


def test_a_shards_stream_of_before_a_loss_is_left_for_one_that_has_its_drives_at_rest_as_well(monkeypatch):
    hub, clock = Hub(now=lambda: clock[0]), [5]
    one = up(hub.shards, "http://a:1", "axis-1", "axis-2")
    live = HubLive(hub)

    async def stream(_path, query=None):
        yield "overview", whole("axis-1", "axis-2", states=[4, 2])
        if query is None:
            # the process is stopped and goes on: its stream did not break, and its clock is heard first
            for event in (ShardEvent.MISSED, ShardEvent.MISSED, ShardEvent.ANSWERED):
                clock[0] += 1
                hub.shards.note(one, event, "late", clock[0], 0.0)
                live._overview.refresh()
            yield "overview", {"values": {"state": [[1], [3]]}}

    async def follow():
        await live._take(one)
        gone = shown(live._overview)
        # what a broken stream's successor says
        await live._take(one, {"follow": "false"})
        return gone

    monkeypatch.setattr(hub, "client", lambda _: SimpleNamespace(stream=stream))
    assert asyncio.run(follow()) == {"axis-1": UNREACHABLE, "axis-2": UNREACHABLE}
    assert shown(live._overview) == {"axis-1": 4, "axis-2": 2}


def test_all_drives_of_the_largest_farm_come_in_one_message():
    # as a farm's, with long names
    row = {
        "name": "n" * 63, "station_name": "n" * 63, "model": "akd-profinet-2012", "bus": "profinet", "telegram": 1,
        "mac": "02:75:f3:5e:ef:d1", "ip": "10.77.100.100/16", "address": None, "ar_state": "DATA", "connected": True,
        "controller": "n" * 63, "controller_ip": "10.77.100.250", "cycle_seconds": 0.016,
        "injected": [["f-12345678", "silence"]], "neighbours": ["n" * 63],
    }  # fmt: skip
    sent = json.dumps({"version": 1, "rows": dict.fromkeys(map(str, range(MAX_DRIVES)), row)}, separators=(",", ":"))

    async def pieces():
        body = f"event: overview\ndata: {sent}\n\n".encode()
        for begin in range(0, len(body), 65_536):
            yield body[begin : begin + 65_536]

    def answer(_):
        return httpx.Response(200, content=pieces(), headers={"Content-Type": "text/event-stream"})

    async def taken():
        client = ShardClient("http://a:1", None, httpx.MockTransport(answer))
        return [len(data["rows"]) async for _, data in client.stream("/api/v1/live")]

    assert asyncio.run(taken()) == [MAX_DRIVES]
