"""A shard's answers and streams that are JSON, and hold other types than a farm's: it is away, and the others go on."""

import asyncio
import json

import httpx
import pytest
from device_world import add_island
from hub_world import BASE, TOKEN, HubWorld

from pnfarm.hub.overview import HubOverview
from pnfarm.hub.shards import AwayError

PLANT = """
plant:
  step: 2ms
  models: [{name: gripper-NUMBER, kind: cylinder, time: 20ms}, {name: parts-NUMBER, kind: counter}]
  wires: [gripper-NUMBER.extended -> parts-NUMBER.up]
"""
#: Path -> what the first shard has there.
LISTS = {
    "drives": "axis-01", "stations": "island-1", "devices": "island-1", "plant": "gripper-1", "faults": "axis-01",
    "health": "s1:8702", "reactions": "axis-01", "readiness": "axis-01", "faults/a": "axis-01",
}  # fmt: skip
OTHERS = (5, "x", [], {}, None, [[]], {"x": {}}, 1e300)


class Changed(httpx.AsyncBaseTransport):
    """The way to a shard, on which the answer for one path is another."""

    def __init__(self, inner):
        self.inner = inner
        self.path, self.content = "", b""

    async def handle_async_request(self, request):
        answer = await self.inner.handle_async_request(request)
        if request.url.path != f"/api/v1/{self.path}":
            return answer
        return httpx.Response(answer.status_code, content=self.content, headers=dict(answer.headers))


@pytest.fixture(scope="module")
def cells():
    world = HubWorld(("axis-{n:02}", 1), ("pump-{n:02}", 1), controller=True, devices=PLANT)
    for number in (1, 2):
        add_island(world[number].farm, f"island-{number}")
    world.restart_hub()
    world.run(1.5)
    assert world.post("faults", {"kind": "silence", "on": ["axis-01", "pump-01"], "as": "a"}).status_code == 201
    world.run(0.3)
    world[2].inner = Changed(world[2].inner)
    return world


def places(value, path=()):
    """Every place in a JSON value; of a list those in its first."""
    yield path
    below = value.items() if isinstance(value, dict) else enumerate(value[:1]) if isinstance(value, list) else ()
    for key, one in below:
        yield from places(one, (*path, key))


def wrong(text):
    """The answer with another value in it, or with one left out, for each place; all of them in turn."""
    for turn, path in enumerate(list(places(json.loads(text)))[1:]):
        # a few places get each of them
        for other in (..., *OTHERS) if turn % 16 == 0 else [(..., *OTHERS)[turn % (1 + len(OTHERS))]]:
            value = json.loads(text)
            at = value
            for key in path[:-1]:
                at = at[key]
            if other is ...:
                del at[path[-1]]
            else:
                at[path[-1]] = other
            yield json.dumps(value).encode()


async def real(world, path):
    headers = {"Authorization": f"Bearer {TOKEN}"}
    async with httpx.AsyncClient(transport=world[2].inner.inner, base_url=BASE, headers=headers) as client:
        return (await client.get(f"/api/v1/{path}")).text


@pytest.mark.parametrize("path", LISTS)
def test_an_answer_of_other_types_makes_its_shard_bad_in_words_and_the_others_go_on(cells, path):
    text = asyncio.run(real(cells, path))
    there, reasons = cells[2].inner, []
    there.path = path
    for there.content in wrong(text):
        answer = cells.get(path)
        assert answer.status_code == 200, (there.content, answer.text)
        assert LISTS[path] in answer.text, there.content
        reasons += [one["reason"] for one in answer.json().get("unreachable", ()) if "reason" in one]
    assert all(reason.startswith("s2:8702 does not answer as a farm does: ") for reason in reasons)
    assert reasons or path == "faults/a"
    there.path = ""
    assert cells.get("drives").json()["partial"] is False


@pytest.mark.parametrize(
    "entry",
    [
        {"sequence": 1, "drive": [], "event": [], "farm_seconds": 1.0},
        {"sequence": 10**20, "drive": "", "event": "e", "farm_seconds": 1.0},
        {"sequence": 1, "drive": 5, "event": 5, "farm_seconds": 1.0},
        {"sequence": 1, "drive": "", "event": "e", "farm_seconds": None},
        {"drive": "", "event": "e", "farm_seconds": 1.0},
    ],
)
def test_an_entry_that_no_farm_has_ends_the_stream_and_not_the_hub(cells, entry):
    with pytest.raises(AwayError, match="s2:8702 sends no entries as a farm does"):
        cells.hub.take_entry(cells.known(2), entry)


def test_an_entry_of_a_time_to_come_does_not_hold_up_those_behind_it(cells):
    number = cells.hub.log.taken(cells.known(2).instance)
    for seconds in (1e6, 1.0):
        number += 1
        entry = {"sequence": number, "drive": "pump-01", "event": f"e {seconds}", "farm_seconds": seconds}
        cells.hub.take_entry(cells.known(2), entry)
    cells.run(0.3)
    cells.hub.log.release(cells.clock_ns)
    assert [entry.data["event"] for entry in cells.hub.log.entries()[-2:]] == ["e 1000000.0", "e 1.0"]


@pytest.mark.parametrize("engine", [{"cycles": "x"}, {"lateness_max_seconds": []}, "x", 5])
def test_an_overview_with_an_engine_that_no_farm_has_is_left_out_and_pages_go_on(cells, engine):
    overview = HubOverview(cells.hub.shards, cells.hub.now)
    with pytest.raises(AwayError, match="s2:8702 sends no overview as a farm does"):
        overview.take(cells.known(2), {"engine": engine})
    assert "engine" not in json.loads(overview.since(0))


@pytest.mark.parametrize("number", ["NaN", "-Infinity", "1e999"])
def test_a_number_that_no_browser_can_read_is_passed_on_to_none(cells, number):
    async def read():
        return [one async for one in cells.hub.client(cells.known(2)).stream("/api/v1/live")]

    text = f'event: overview\ndata: {{"seconds": {number}}}\n\n'
    cells[2].trouble = lambda _: httpx.Response(200, text=text, headers={"content-type": "text/event-stream"})
    try:
        with pytest.raises(AwayError, match="which is no number of JSON"):
            asyncio.run(read())
        cells[2].trouble = lambda _: httpx.Response(200, text=f'{{"devices": [{{"name": "x", "a": {number}}}]}}')
        assert "no number of JSON" in cells.get("devices").json()["unreachable"][0]["reason"]
    finally:
        cells[2].trouble = None


def test_the_id_of_a_trace_may_be_anything(cells):
    cells[2].trouble = lambda _: httpx.Response(201, json={"id": 5})
    try:
        found = cells.post("traces", {"on": "pump-01", "signals": ["velocity"]})
        assert (found.status_code, found.json()["id"]) == (201, "5")
    finally:
        cells[2].trouble = None


def test_a_header_that_is_no_ascii_is_not_passed_on(cells):
    headers = [(key, "\u20ac".encode()) for key in (b"etag", b"content-type")]
    cells[2].trouble = lambda _: httpx.Response(200, content=b"{}", headers=headers)
    try:
        found = cells.get("drives/pump-01/modules")
        assert (found.status_code, found.headers.get("etag")) == (200, None)
    finally:
        cells[2].trouble = None


@pytest.mark.parametrize(
    "record",
    [{"cases": 5}, {"cases": [5]}, {"cases": [{}]}, {"cases": [], "verdict": 5, "lateness": []}, {"verdict": "passed"}],
)
def test_a_shards_part_of_a_scenario_that_has_other_types_is_lost_and_the_scenario_ends(cells, record):
    def part(request):
        if request.method == "POST":
            return httpx.Response(201, json={"id": "../x"})
        assert b"/../" not in request.url.raw_path
        return httpx.Response(200, json={"state": "ended", **record})

    async def run():
        app = httpx.ASGITransport(cells.app)
        async with httpx.AsyncClient(transport=app, base_url=f"{BASE}/api/v1") as client:
            begun = (await client.post("scenarios", json={"text": text})).json()
            while True:
                found = (await client.get(f"scenarios/{begun['id']}")).json()
                if found["state"] == "ended":
                    return found
                # the hub's task runs in this loop
                await asyncio.sleep(0)

    text = "scenario: s\nsteps:\n  - expect: {drive: pump-01, that: not connected, for: 1ms}\n"
    cells[2].trouble = part
    try:
        found = asyncio.run(run())
    finally:
        cells[2].trouble = None
    assert (found["verdict"], found["cases"][0]["verdict"]) == ("inconclusive", "inconclusive")
    assert "s2:8702 does not answer as a farm does" in found["cases"][0]["message"]
