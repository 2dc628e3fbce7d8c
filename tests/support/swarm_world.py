"""A farm in shards behind a hub, all in virtual time: its start, a storm of faults, and a shard that is lost.

Shards are those of ``pnfarm up --shard``, the hub is the real one, and each shard has a controller for its drives.  In
place of the database stand one memory for all and one row for each shard's claim; leases are the real machines.
"""

from __future__ import annotations

import asyncio
import random
from dataclasses import dataclass, field
from fnmatch import fnmatch
from typing import Any

import httpx
from hub_world import TOKEN, HubWorld, MemoryShard

from pnfarm.api import make_app
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.farm.file.reading import FarmConfig, expand, parse_farm
from pnfarm.farm.lease import DEFAULT_TTL_NS, Lease, LeaseState
from pnfarm.farm.shard import Shard
from pnfarm.station.event_log import EventLog

FILE = """
farm: swarm-{farm}
link: {{kind: memory}}
drives:
{groups}
controller:
  name: plc
  ip: 10.77.0.200/16
  cycle: {cycle}ms
  program: {{kind: constant, speed_rpm: 60, acknowledge_after: 200ms}}
  reconnect: {{after: 1s}}
"""
GROUP = '  - {{name: "axis-{place:02}-{{n:04}}", count: {count}, model: akd-profinet, ip: 10.77.{net}.1/16}}'
GROUP_SIZE = 1000
#: Of one farm file.
MAX_DRIVES = 4094
STEP_SECONDS = 1.0
#: What the drives of the shard to be lost save beforehand.
SAVED = "DRV.ACC"


def _farm(number: int, drives: int, cycle: int) -> FarmConfig:
    """A farm file: names and addresses go on from one to the next."""
    sizes = [min(GROUP_SIZE, drives - first) for first in range(0, drives, GROUP_SIZE)]
    places = range(number * len(sizes), (number + 1) * len(sizes))
    groups = [GROUP.format(place=at, count=size, net=1 + 4 * at) for at, size in zip(places, sizes, strict=True)]
    return parse_farm(FILE.format(farm=number + 1, groups="\n".join(groups), cycle=cycle), "swarm.pnfarm.yml")


@dataclass
class Claim:
    """The database's row of one shard."""

    holder: str = ""
    expires_ns: int = 0
    period: int = 0

    def ask(self, holder: str, ttl_ns: int, now: int) -> str | None:
        """The period of holding it, None while another has it."""
        if self.holder != holder:
            if now < self.expires_ns:
                return None
            self.holder, self.period = holder, self.period + 1
        self.expires_ns = now + ttl_ns
        return str(self.period)


class SwarmShard(MemoryShard):
    """One copy of a shard; it boots its drives once it has its claim."""

    def __init__(self, world: SwarmWorld, number: int, copy: int) -> None:
        self.number, self.name = number, f"s{number}-{copy}"
        self.lease = Lease(DEFAULT_TTL_NS)
        self.line: Any = None
        self.is_lost = False
        super().__init__(world, "", 0)
        self.renew()

    def start(self) -> None:
        """Nothing yet: it waits for its claim."""

    def renew(self) -> None:
        """Ask the database, if that is due."""
        world: Any = self.world
        now = world.clock_ns
        if self.is_lost or self.lease.next_request(now) > now:
            return
        sent = self.lease.asked(now)
        period = world.claims[self.number].ask(self.name, self.lease.ttl_ns, now)
        if period is None:
            self.lease.refused(now)
            return
        self.lease.granted(sent, period, now)
        if self.line is None and self.lease.may_speak(now):
            self.boot()

    @property
    def names(self) -> list[str]:
        return [station.configured_name for station in self.farm.axes]

    def boot(self) -> None:
        world: Any = self.world
        self.log = EventLog(quiet=True)
        farm, part = divmod(self.number - 1, world.parts)
        shard = Shard(part + 1, world.parts)
        made = VirtualLine.create(world.configs[farm], memory=world.memory, log=self.log, shard=shard)
        self.line = asyncio.run(made)
        self.farm = self.line.farm
        virtual = self.line.world
        self.offset_ns = virtual.now - world.clock_ns
        self.app = make_app(
            self.farm, now=lambda: virtual.now, poke=lambda: self.farm.service(virtual.now), token=TOKEN
        )
        self.inner = httpx.ASGITransport(self.app, raise_app_exceptions=False)

    def catch_up(self) -> None:
        if self.line is not None and not self.is_lost:
            super().catch_up()

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        if self.line is None or self.is_lost:
            raise httpx.ConnectError("refused")
        return await super().handle_async_request(request)


@dataclass
class Report:
    """What was seen; ``wrong`` has a sentence for each thing that should not be."""

    drives: int = 0
    shards: int = 0
    seconds_to_start: float = 0.0
    faults: int = 0
    hits: int = 0
    seconds_to_recover: float = 0.0
    lost: int = 0
    seconds_to_take_over: float = 0.0
    wrong: list[str] = field(default_factory=list)


class SwarmWorld(HubWorld):
    """``drives`` in ``count`` shards."""

    #: All shards answer in one process, one after the other.
    request_seconds = 120.0

    def __init__(self, drives: int, count: int, *, cycle: int = 16) -> None:
        self.count = count
        # a farm file has so many drives at most: then they are several farms, each in equal shards
        farms = next(n for n in range(1, count + 1) if count % n == 0 and drives % n == 0 and drives // n <= MAX_DRIVES)
        self.parts = count // farms
        self.configs = [_farm(number, drives // farms, cycle) for number in range(farms)]
        self.names = [drive.name for config in self.configs for drive in expand(config)]
        self.memory = VolatileMemory()
        self.claims = {number: Claim() for number in range(1, count + 1)}
        self.clock_ns = 1_000_000_000
        self.tokens = {}
        self.shards = {}
        for number in range(1, count + 1):
            self.add(number, 1)
        self.restart_hub()

    def add(self, number: int, copy: int) -> SwarmShard:
        """Start a copy of a shard at an address of its own."""
        shard = SwarmShard(self, number, copy)
        self.shards[f"http://{shard.name}:8702"] = shard
        return shard

    def run(self, seconds: float) -> None:
        """All shards live on; leases are renewed, and the hub asks each shard's clock once a second."""
        end = self.clock_ns + round(seconds * 1e9)
        while self.clock_ns < end:
            self.clock_ns += min(round(STEP_SECONDS * 1e9), end - self.clock_ns)
            for shard in list(self.shards.values()):
                shard.renew()
                shard.catch_up()
            self.ask_clocks()

    def ask_clocks(self) -> None:
        async def all_of_them() -> None:
            for shard in self.hub.shards:
                await self.hub.probe(shard)

        asyncio.run(all_of_them())

    def drives(self) -> dict[str, Any]:
        return {drive["name"]: drive for drive in self.get("drives").json()["drives"]}

    def until_all_work(self, seconds: float) -> float | None:
        """How long until every drive of the file exchanges data and is in operation; None: not in this time."""
        began = self.clock_ns
        while self.clock_ns - began < seconds * 1e9:
            self.run(1.0)
            drives = self.drives()
            if list(drives) == self.names and all(d["connected"] and d["state"] == "S4" for d in drives.values()):
                return (self.clock_ns - began) / 1e9
        return None

    def copies(self, number: int) -> list[SwarmShard]:
        return [shard for shard in self.shards.values() if shard.number == number]


def simulate(world: SwarmWorld, *, faults: int, seed: int) -> Report:
    """Start, a storm of faults over globs, a lost shard and its return elsewhere."""
    report = Report(drives=len(world.names), shards=world.count)
    _start(world, report)
    if not report.wrong:
        _storm(world, report, faults, random.Random(seed))
    if not report.wrong:
        _loss(world, report)
    return report


def _start(world: SwarmWorld, report: Report) -> None:
    seconds = world.until_all_work(60)
    if seconds is None:
        working = sum(drive["connected"] for drive in world.drives().values())
        report.wrong.append(f"{working} of {report.drives} drives exchange data 60 s after the start")
    report.seconds_to_start = seconds or 0.0


def _storm(world: SwarmWorld, report: Report, faults: int, choices: random.Random) -> None:
    before = world.drives()
    hit: set[str] = set()
    for _ in range(faults):
        # any last digit: as drives are dealt out in turn, these are in all shards, as far as there are ten or fewer
        glob = f"*{choices.randrange(min(10, report.drives // 10))}?"
        kind = choices.choice(("timeout", "f702"))
        answer = world.post("faults", {"kind": kind, "on": glob})
        wanted = {name for name in world.names if fnmatch(name, glob)}
        fault = answer.json()
        if answer.status_code != 201 or set(fault["drives"]) != wanted:
            report.wrong.append(f"{kind} on {glob}: {answer.status_code}, {len(fault.get('drives', ()))} drives")
            return
        starts = [run["started_seconds"] for run in fault["drives"].values()]
        if max(starts) - min(starts) > 0.003:
            report.wrong.append(f"{kind} on {glob} began within {max(starts) - min(starts):.4f} s, not at one moment")
        if any(wanted.isdisjoint(shard.names) for shard in world.shards.values()):
            report.wrong.append(f"{kind} on {glob} is not over all shards")
        report.faults += 1
        report.hits += len(wanted)
        hit |= wanted
        world.run(choices.uniform(0.1, 1.0))
    seconds = world.until_all_work(60)
    report.seconds_to_recover = seconds or 0.0
    after = world.drives()
    if seconds is None:
        report.wrong.append("60 s after the storm not every drive is in operation")
    for name in world.names:
        troubled = after[name]["connects"] > before[name]["connects"] or after[name]["last_fault"] is not None
        if troubled != (name in hit):
            report.wrong.append(f"{name} was {'' if name in hit else 'not '}hit, and shows {after[name]['last_fault']}")


def _loss(world: SwarmWorld, report: Report) -> None:
    number = world.count // 2 + 1
    (lost,) = world.copies(number)
    names = lost.names
    report.lost = len(names)
    kept = {}
    for place, name in enumerate(names):
        kept[name] = 10_000_000 + place
        for parameter, value in ((SAVED, kept[name]), ("DRV.NVSAVE", 1)):
            lost.farm.axis(name).store.set(parameter, value)
    others = {name: drive["connects"] for name, drive in world.drives().items() if name not in kept}
    lost.is_lost = True
    began = world.clock_ns
    copy = world.add(number, 2)
    world.hub.shards.give(f"http://{copy.name}:8702")
    if copy.line is not None:
        report.wrong.append("a second copy ran while the first one's claims were in force")
    world.run(2.0)
    answer = world.get("drives").json()
    silent = {drive["name"] for drive in answer["drives"] if drive["state"] == "unreachable"}
    if not answer["partial"] or silent != set(names):
        report.wrong.append(f"{len(silent)} drives are told as unreachable, {len(names)} are")
    fault = world.post("faults", {"kind": "silence", "on": "all", "for": "100ms"})
    missed = {entry["drive"] for entry in fault.json().get("not_hit", ())}
    if fault.status_code != 207 or missed != set(names):
        report.wrong.append(f"a fault on all drives: {fault.status_code}, {len(missed)} not hit")
    while copy.lease.state is not LeaseState.HELD and world.clock_ns - began < 60e9:
        world.run(1.0)
    waited = (world.clock_ns - began) / 1e9
    if copy.lease.state is LeaseState.HELD and world.clock_ns < lost.lease.until_ns:
        report.wrong.append("the second copy ran while the first one might speak")
    rest = world.until_all_work(60)
    if rest is None:
        report.wrong.append("60 s after the loss not every drive is in operation")
        return
    report.seconds_to_take_over = waited + rest
    if wrong := [name for name in names if copy.farm.axis(name).store.get(SAVED) != kept[name]]:
        report.wrong.append(f"{len(wrong)} drives came back without what they had saved, such as {wrong[0]}")
    after = world.drives()
    if disturbed := [name for name, connects in others.items() if after[name]["connects"] > connects]:
        report.wrong.append(f"{len(disturbed)} drives of other shards lost their connections, such as {disturbed[0]}")
