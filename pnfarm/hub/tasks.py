"""The hub's tasks: names are resolved again, each shard's clock every second, its events are followed.

All of them are here; what they do is in :mod:`pnfarm.hub.hub`.
"""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

import anyio
from anyio import TASK_STATUS_IGNORED

from pnfarm.api.events import format_position
from pnfarm.api.server import api_url
from pnfarm.hub.shard_events import DrivesClaimedTwice, ShardForgotten, ShardLost, ShardReturned
from pnfarm.hub.shards import AwayError
from pnfarm.vocabulary.quoting import shortened
from pnfarm.web.bodies import PREFIX

if TYPE_CHECKING:
    from collections.abc import Sequence

    from anyio.abc import TaskGroup, TaskStatus

    from pnfarm.hub.hub import Hub
    from pnfarm.hub.live import HubLive
    from pnfarm.hub.shards import Shard

__all__ = ["DISCOVER_SECONDS", "discover", "run_hub"]

#: Between two questions for a name, and for a shard's clock.
DISCOVER_SECONDS = 5.0
ASK_SECONDS = 1.0
#: Longest wait for the answer to a name.
NAME_SECONDS = 4.0
#: Between two checks of what waits in the log, and of shards that came or went.
RELEASE_SECONDS = 0.05
LOOK_SECONDS = 0.25
#: Names of drives in one entry of the log.
MOST_NAMES = 16
#: After a stream of events broke.
AGAIN_SECONDS = 0.5
#: What a name answers that has no address: no task of it runs.
_NOBODY = {socket.EAI_NONAME, getattr(socket, "EAI_NODATA", socket.EAI_NONAME)}


async def run_hub(
    hub: Hub,
    urls: Sequence[str],
    names: Sequence[tuple[str, int]],
    views: HubLive,
    *,
    task_status: TaskStatus[None] = TASK_STATUS_IGNORED,
) -> None:
    """Until it is cancelled; started when each shard was asked once, at most some seconds later."""
    for url in urls:
        hub.shards.give(url)
    found: dict[str, list[str]] = {}
    try:
        async with anyio.create_task_group() as tasks:
            async with anyio.create_task_group() as first:
                for name, port in names:
                    first.start_soon(discover, hub, name, port, found)
            await hub.each(hub.shards, lambda shard: _probe(hub, shard))
            tasks.start_soon(_release, hub)
            tasks.start_soon(views.run)
            tasks.start_soon(_attend_all, hub, tasks)
            if names:
                tasks.start_soon(_discover_all, hub, names, found)
            task_status.started()
    finally:
        with anyio.CancelScope(shield=True):
            await hub.aclose()


async def _discover_all(hub: Hub, names: Sequence[tuple[str, int]], found: dict[str, list[str]]) -> None:
    while True:
        for name, port in names:
            await discover(hub, name, port, found)
        await anyio.sleep(DISCOVER_SECONDS)


async def discover(hub: Hub, name: str, port: int, found: dict[str, list[str]]) -> None:
    """Ask for all addresses of a name; ``found`` has the last answer of each.

    A name without an address has no shards any more.  A server of names that does not answer changes nothing.
    """
    where = f"{name}:{port}"
    try:
        with anyio.fail_after(NAME_SECONDS):
            answer = await anyio.getaddrinfo(name, port, type=socket.SOCK_STREAM)
    except TimeoutError:
        hub.discovery[where] = f"no answer within {NAME_SECONDS:g} s"
        return
    except OSError as exc:
        hub.discovery[where] = (exc.strerror or str(exc)).lower()
        if not (isinstance(exc, socket.gaierror) and exc.errno in _NOBODY):
            return
        answer = []
    else:
        hub.discovery[where] = ""
    hosts = dict.fromkeys(str(address[4][0]) for address in answer)
    found[where] = [api_url(host, port, secure=hub.is_secure) for host in hosts]
    # a certificate is for the name, not for the addresses that it has today
    hub.server_names.update(dict.fromkeys(found[where], name))
    hub.shards.found([url for urls in found.values() for url in urls], hub.now())


async def _release(hub: Hub) -> None:
    while True:
        hub.log.release(hub.now())
        await anyio.sleep(RELEASE_SECONDS)


async def _attend_all(hub: Hub, tasks: TaskGroup) -> None:
    """One task for each shard that is known, as long as it is."""
    scopes: dict[Shard, anyio.CancelScope] = {}
    claimed: set[str] = set()
    while True:
        for shard in hub.shards:
            if shard not in scopes:
                scopes[shard] = anyio.CancelScope()
                tasks.start_soon(_attend, hub, shard, scopes[shard])
        for shard in hub.shards.forget(hub.now()):
            hub.record(ShardForgotten(shard.label))
            scopes.pop(shard).cancel()
            await hub.drop(shard)
        conflicts = hub.shards.conflicts()
        if fresh := sorted(set(conflicts) - claimed):
            labels = dict.fromkeys(shard.label for name in fresh for shard in conflicts[name])
            hub.record(DrivesClaimedTwice(shortened(fresh, MOST_NAMES), " ".join(labels)))
        claimed = set(conflicts)
        hub.log.forget_but({hub.instance, *(shard.instance for shard in hub.shards)})
        await anyio.sleep(LOOK_SECONDS)


async def _attend(hub: Hub, shard: Shard, scope: anyio.CancelScope) -> None:
    with scope:
        if shard.asked:
            hub.record(ShardReturned(shard.label, str(shard.about.get("farm", "")), len(shard.drives)))
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(_follow, hub, shard)
            while True:
                await _probe(hub, shard, tell=True)
                await anyio.sleep(ASK_SECONDS)


async def _probe(hub: Hub, shard: Shard, *, tell: bool = False) -> None:
    if not await hub.probe(shard) or not tell:
        return
    if shard.asked:
        hub.record(ShardReturned(shard.label, str(shard.about.get("farm", "")), len(shard.drives)))
    else:
        hub.record(ShardLost(shard.label, shard.reason, len(shard.drives)))


async def _follow(hub: Hub, shard: Shard) -> None:
    """The shard's event log, from the oldest entry that it holds."""
    while True:
        if shard.asked:
            # a stream is of the run that answers now
            await _probe(hub, shard, tell=True)
        if shard.asked:
            last = format_position({shard.instance: hub.log.taken(shard.instance)})
            try:
                async for _, entry in hub.client(shard).stream(f"{PREFIX}/events", last=last):
                    hub.take_entry(shard, entry)
            except AwayError as exc:
                shard.errors[exc.slug] += 1
        await anyio.sleep(AGAIN_SECONDS)
