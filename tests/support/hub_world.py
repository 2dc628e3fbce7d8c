"""Farms in virtual time behind a hub, without a socket: one clock moves them all, each with an offset of its own."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx

from pnfarm.api import make_app
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.farm.file.reading import parse_farm
from pnfarm.hub import Hub, make_hub_app
from pnfarm.hub.client import REQUEST_SECONDS
from pnfarm.station.event_log import EventLog

BASE = "http://127.0.0.1:8702"
FILE = """
farm: {farm}
link: {{kind: memory}}
drives:
  - {{name: "{name}", count: {count}, model: akd-profinet, ip: 10.77.{net}.11/23}}
"""
CONTROLLER = """
controller:
  name: plc
  ip: 10.77.{net}.250/23
  cycle: 16ms
  program: {{kind: constant, speed_rpm: 60, acknowledge_after: 200ms}}
"""
#: Of the shards.
TOKEN = "the-shards-own-token"
#: Half a round trip.
TRIP_NS = 500_000


class MemoryShard(httpx.AsyncBaseTransport):
    """One farm and the way to it.  ``trouble`` is what a request meets there instead."""

    def __init__(self, world: HubWorld, text: str, skew_ns: int) -> None:
        self.world, self.text, self.skew_ns = world, text, skew_ns
        self.trouble: Any = None
        self.trips = (TRIP_NS, TRIP_NS)
        self.requests: list[str] = []
        self.start()

    def start(self) -> None:
        """A new run of the farm, whose clock begins anew."""
        self.log = EventLog(quiet=True)
        self.line = asyncio.run(VirtualLine.create(parse_farm(self.text), memory=VolatileMemory(), log=self.log))
        self.farm = self.line.farm
        virtual = self.line.world
        # an offset of its own: it has lived longer
        virtual.run(self.skew_ns / 1e9)
        self.offset_ns = virtual.now - self.world.clock_ns
        self.app = make_app(
            self.farm, now=lambda: virtual.now, poke=lambda: self.farm.service(virtual.now), token=TOKEN
        )
        self.inner = httpx.ASGITransport(self.app, raise_app_exceptions=False)

    def catch_up(self) -> None:
        """The farm lives until now, by its own clock."""
        missing = self.world.clock_ns + self.offset_ns - self.line.world.now
        if missing > 0:
            self.line.world.run(missing / 1e9)

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        there, back = self.trips
        self.requests.append(f"{request.method} {request.url.path}")
        if isinstance(self.trouble, Exception):
            raise self.trouble
        if self.trouble is not None:
            return self.trouble(request)
        self.world.clock_ns += there
        self.catch_up()
        try:
            return await self.inner.handle_async_request(request)
        finally:
            self.world.clock_ns += back


class HubWorld:
    """``shards`` by name: each is (name of its drives, how many); ``names`` as ``axis-{n:02}`` or one without.

    ``devices`` are those of each of them, with its number for NUMBER, and that of its network for NET.
    """

    #: How long an answer may take; of real time.
    request_seconds = REQUEST_SECONDS

    def __init__(
        self,
        *drives: tuple[str, int],
        farms: tuple[str, ...] = (),
        controller: bool = False,
        skews: tuple[float, ...] = (),
        devices: str = "",
        **tokens: Any,
    ) -> None:
        self.clock_ns = 1_000_000_000
        self.shards: dict[str, MemoryShard] = {}
        for place, (name, count) in enumerate(drives):
            farm = farms[place] if farms else "line"
            text = (FILE + (CONTROLLER if controller else "")).format(farm=farm, name=name, count=count, net=2 * place)
            text += devices.replace("NUMBER", str(place + 1)).replace("NET", str(2 * place))
            skew = round(skews[place] * 1e9) if skews else 0
            self.shards[f"http://s{place + 1}:8702"] = MemoryShard(self, text, skew)
        self.tokens = tokens
        self.restart_hub()

    def restart_hub(self) -> None:
        """A new hub, which knows nothing."""
        self.hub = Hub(
            token=TOKEN,
            now=lambda: self.clock_ns,
            wall=lambda: 1.7e9 + self.clock_ns / 1e9,
            sleep=self.sleep,
            transport=lambda url: self.shards[url],
            request_seconds=self.request_seconds,
        )
        self.app = make_hub_app(self.hub, **self.tokens)
        for url in self.shards:
            self.hub.shards.give(url)
        self.probe()

    async def sleep(self, seconds: float) -> None:
        self.clock_ns += round(max(0.0, seconds) * 1e9)
        # tasks of the shards have their turn
        await asyncio.sleep(0)

    def __getitem__(self, number: int) -> MemoryShard:
        """The shard ``s1``, ``s2`` ..."""
        return self.shards[f"http://s{number}:8702"]

    def known(self, number: int) -> Any:
        """What the hub knows of it."""
        return next(shard for shard in self.hub.shards if shard.url == f"http://s{number}:8702")

    def probe(self, times: int = 1) -> None:
        """Ask every shard's clock, as the hub does each second."""

        async def all_of_them() -> None:
            for shard in self.hub.shards:
                await self.hub.probe(shard)

        for _ in range(times):
            self.clock_ns += 1_000_000_000
            asyncio.run(all_of_them())

    def run(self, seconds: float) -> None:
        self.clock_ns += round(seconds * 1e9)
        for shard in self.shards.values():
            shard.catch_up()

    def follow(self) -> None:
        """Read the shards' events once, and give out what came."""

        async def read() -> None:
            for shard in self.hub.shards.reachable:
                stream = self.hub.client(shard).stream(
                    "/api/v1/events", last=str(self.hub.log.taken(shard.instance)), query={"follow": "false"}
                )
                async for _, entry in stream:
                    self.hub.take_entry(shard, entry)

        asyncio.run(read())
        self.clock_ns += 300_000_000
        self.hub.log.release(self.clock_ns)

    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        async def ask() -> httpx.Response:
            transport = httpx.ASGITransport(self.app, raise_app_exceptions=False)
            async with httpx.AsyncClient(transport=transport, base_url=BASE) as client:
                return await client.request(method, f"/api/v1/{path}", **options)

        return asyncio.run(ask())

    def get(self, path: str, **options: Any) -> httpx.Response:
        return self.request("GET", path, **options)

    def post(self, path: str, json: Any = None, **options: Any) -> httpx.Response:
        return self.request("POST", path, json=json, **options)

    def lose(self, number: int, why: Exception | None = None) -> None:
        """A shard that does not answer any more, and the hub knows."""
        self[number].trouble = why or httpx.ConnectError("refused")
        self.probe(2)
