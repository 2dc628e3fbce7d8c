"""The API on a real socket: streams, shutdown, and a real Prometheus."""

import json
import os
import shutil
import signal
import socket
import subprocess
from contextlib import asynccontextmanager
from types import SimpleNamespace

import anyio
import httpx
import pytest
from api_world import ApiWorld
from events import Something

from pnfarm.api import serve, serve_farm
from pnfarm.api.server import listen
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.file.sections import Api

TOKEN = "a-long-secret"  # a test's, nobody's


@asynccontextmanager
async def served(world):
    """The base URL of a running server."""
    async with anyio.create_task_group() as group:

        async def run(*, task_status):
            await serve(world.app, "127.0.0.1", 0, task_status=task_status)

        host, port = await group.start(run)
        yield f"http://{host}:{port}"
        group.cancel_scope.cancel()


class Stream:
    """Messages of an event stream, one after the other."""

    def __init__(self, response):
        self._lines = response.aiter_lines()

    async def next(self):
        message = {}
        with anyio.fail_after(5):
            async for line in self._lines:
                if not line and message:
                    return message
                if line and not line.startswith(":"):
                    key, _, value = line.partition(": ")
                    message[key] = value
        return None

    async def next_entry(self):
        while (message := await self.next()) is not None:
            if "data" in message:
                return message | {"data": json.loads(message["data"])}
        return None


def test_events_stream_live_and_continue_where_a_client_was():
    world = ApiWorld(2)

    async def main():
        async with served(world) as base, httpx.AsyncClient(base_url=base) as client:
            async with client.stream("GET", "/api/v1/events") as response:
                assert response.headers["content-type"].startswith("text/event-stream")
                stream = Stream(response)
                assert "retry" in await stream.next()
                world.line.connect()
                first = await stream.next_entry()
                second = await stream.next_entry()
                assert second["data"]["sequence"] == first["data"]["sequence"] + 1
                assert first["id"] == f"{world.context.instance}-{first['data']['sequence']}"
                assert {first["data"]["event"], second["data"]["event"]} == {"neighbour appeared"}
            # whoever was away gets what it missed, and only that
            headers = {"Last-Event-ID": first["id"]}
            async with client.stream("GET", "/api/v1/events", headers=headers) as response:
                assert (await Stream(response).next_entry())["id"] == second["id"]
            # a number beyond the end, of an earlier run
            headers = {"Last-Event-ID": "999999"}
            async with client.stream("GET", "/api/v1/events", headers=headers) as response:
                assert (await Stream(response).next_entry())["data"]["sequence"] == 1
            async with client.stream("GET", "/api/v1/events?drive=axis-02", headers={"Last-Event-ID": "0"}) as response:
                assert (await Stream(response).next_entry())["data"]["drive"] == "axis-02"

    anyio.run(main)
    assert not world.context.streams


def test_stream_tells_what_the_log_no_longer_holds():
    world = ApiWorld(1, controller=False)
    for number in range(5000):
        world.line.log.record(number, "axis-01", Something("try"))

    async def main():
        async with (
            served(world) as base,
            httpx.AsyncClient(base_url=base) as client,
            client.stream("GET", "/api/v1/events", headers={"Last-Event-ID": "4"}) as response,
        ):
            stream = Stream(response)
            gap = await stream.next_entry()
            assert gap["event"] == "gap"
            assert gap["data"]["lost"] > 800
            assert (await stream.next_entry())["data"]["sequence"] == 4 + gap["data"]["lost"] + 1

    anyio.run(main)


def test_server_ends_with_open_streams_and_frees_its_port():
    world = ApiWorld(1, controller=False)

    async def main():
        async with httpx.AsyncClient() as client:
            async with served(world) as base:
                response = await client.send(client.build_request("GET", f"{base}/api/v1/events"), stream=True)
                stream = Stream(response)
                assert "retry" in await stream.next()
            with anyio.fail_after(5):
                assert await stream.next() is None
            await response.aclose()
            with pytest.raises(httpx.ConnectError):
                await client.get(f"{base}/api/v1/healthz")
        listen("127.0.0.1", int(base.rpartition(":")[2])).close()

    anyio.run(main)


def test_signals_stay_with_the_program():
    world = ApiWorld(1, controller=False)

    async def main():
        before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
        async with served(world):
            assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before

    anyio.run(main)


def test_port_in_use_is_one_sentence():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(EnvironmentError_, match=rf"127\.0\.0\.1:{port}: another program") as caught:
            listen("127.0.0.1", port)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("host", ["203.0.113.1", "no.such.host.invalid"])
def test_address_that_is_not_ours_is_one_sentence(host):
    with pytest.raises(EnvironmentError_, match="address"):
        listen(host, 0)


def test_page_streams_and_faults_work_on_a_guarded_farm():
    world = ApiWorld(1, token=TOKEN)
    world.line.connect()

    async def main():
        async with served(world) as base, httpx.AsyncClient(base_url=base, follow_redirects=True) as client:
            assert (await client.get("/api/v1/drives")).status_code == 401
            page = await client.get("/", params={"token": TOKEN})
            assert '<div id="app">' in page.text
            # the cookie goes with everything that the page asks for
            fault = await client.post("/api/v1/faults", json={"kind": "f702", "on": "axis-01"})
            assert fault.status_code == 201
            async with client.stream("GET", "/api/v1/events") as response:
                assert response.status_code == 200

    anyio.run(main)


def farm_like(world, section, token_path=None):
    """What serving needs of a running farm."""
    driver = SimpleNamespace(poke=lambda: world.line.farm.service(world.line.world.now))
    config = SimpleNamespace(api=section, token_path=token_path)
    now = world.line.world.clock
    return SimpleNamespace(core=world.line.farm, log=world.line.log, driver=driver, config=config, now=now, states=None)


def test_farm_is_served_as_its_file_says_and_its_new_token_is_told_once():
    world = ApiWorld(1, controller=False)
    section = Api.model_validate({"listen": "0.0.0.0:0"})

    async def main():
        async with anyio.create_task_group() as group:

            async def run(*, task_status):
                await serve_farm(farm_like(world, section), task_status=task_status)

            host, port = await group.start(run)
            assert host == "0.0.0.0"
            (told,) = [entry for entry in world.line.log.entries() if entry.event == "api listening"]
            assert told.data["url"] == f"http://0.0.0.0:{port}"
            async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}") as client:
                assert (await client.get("/api/v1/healthz")).status_code == 200
                assert (await client.get("/metrics")).status_code == 401
                # what any client may read has no token
                assert "token" not in told.data
                assert told.what.logged()["token"] == told.what.token
                shown = {"Authorization": f"Bearer {told.what.token}"}
                assert (await client.get("/metrics", headers=shown)).status_code == 200
            group.cancel_scope.cancel()

    anyio.run(main)


def test_a_token_that_lies_in_a_file_is_told_by_its_place(tmp_path):
    world = ApiWorld(1, controller=False)
    section = Api.model_validate({"listen": "0.0.0.0:0"})
    kept = tmp_path / "state" / "api-token"

    async def main():
        async with anyio.create_task_group() as group:

            async def run(*, task_status):
                await serve_farm(farm_like(world, section, kept), task_status=task_status)

            _, port = await group.start(run)
            (told,) = [entry for entry in world.line.log.entries() if entry.event == "api listening"]
            assert told.data["token_file"] == str(kept)
            assert "token" not in told.data
            async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}") as client:
                shown = {"Authorization": f"Bearer {kept.read_text().strip()}"}
                assert (await client.get("/metrics", headers=shown)).status_code == 200
                assert (await client.get("/metrics")).status_code == 401
            group.cancel_scope.cancel()

    anyio.run(main)


def test_farm_whose_api_is_off_is_not_served():
    world = ApiWorld(1, controller=False)

    async def main():
        with anyio.fail_after(1):
            await serve_farm(farm_like(world, None))

    anyio.run(main)
    assert not [entry for entry in world.line.log.entries() if entry.event == "api listening"]


@pytest.mark.skipif(shutil.which("prometheus") is None, reason="prometheus is not installed")
def test_prometheus_scrapes_a_guarded_farm(tmp_path):
    world = ApiWorld(2, token=TOKEN)
    world.line.connect()
    world.line.enable()
    world.line.run(0.5)

    async def main():
        async with served(world) as base:
            config = {
                "global": {"scrape_interval": "250ms", "scrape_timeout": "250ms"},
                "scrape_configs": [
                    {
                        "job_name": "pnfarm",
                        "authorization": {"credentials": TOKEN},
                        "static_configs": [{"targets": [base.removeprefix("http://")]}],
                    }
                ],
            }
            file = tmp_path / "prometheus.json"
            file.write_text(json.dumps(config))
            with socket.create_server(("127.0.0.1", 0)) as free:
                port = free.getsockname()[1]
            process = await anyio.open_process(
                [
                    "prometheus",
                    f"--config.file={file}",
                    f"--storage.tsdb.path={tmp_path / 'data'}",
                    f"--web.listen-address=127.0.0.1:{port}",
                ],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={"PATH": os.environ["PATH"]},
            )
            try:
                async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", trust_env=False) as client:
                    with anyio.fail_after(30):
                        assert await query(client, "up") == {"": 1}
                        assert await query(client, "pnfarm_axis_state") == {"axis-01": 4, "axis-02": 4}
                        assert set(await query(client, "pnfarm_frames_sent_total > 20")) == {"axis-01", "axis-02"}
                        quantile = "histogram_quantile(0.5, pnfarm_controller_frame_interval_seconds_bucket)"
                        assert 0.012 < (await query(client, quantile))["axis-01"] <= 0.016
            finally:
                process.terminate()
                with anyio.fail_after(10):
                    await process.wait()

    async def query(client, what):
        """Values by drive, as soon as there are any."""
        while True:
            try:
                found = (await client.get("/api/v1/query", params={"query": what})).json()
            except (httpx.HTTPError, ValueError):
                found = {}
            result = found.get("data", {}).get("result", [])
            values = {one["metric"].get("drive", ""): float(one["value"][1]) for one in result}
            if any(values.values()):
                return values
            await anyio.sleep(0.1)

    anyio.run(main)
