"""``GET live`` at the hub: the page's stream (:mod:`pnfarm.api.live`) over the drives of all shards.

While a page is open, the hub follows the stream of each shard once, for all pages.  For the drive that a page looks at
it follows that drive's own stream, for this page.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from typing import TYPE_CHECKING, Any

import anyio

from pnfarm.api.access.guard import WHO
from pnfarm.api.live import INTERVAL_SECONDS, MOST_BEHIND, MOST_ENTRIES, RETRY_MILLISECONDS
from pnfarm.drives.catalogue import model as model_by_name
from pnfarm.errors import ConfigError
from pnfarm.hub.overview import HubOverview
from pnfarm.hub.shards import AwayError
from pnfarm.web.bodies import PREFIX

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Mapping

    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["HubLive"]

#: Messages of a chosen drive that wait for a slow page; the oldest are left out.
MOST_RELAYED = 32
#: Between two looks whether a page is open, and after a shard's stream broke.
LOOK_SECONDS = 0.1
AGAIN_SECONDS = 1.0


def _message(event: str, data: object) -> str:
    text = data if isinstance(data, str) else json.dumps(data, separators=(",", ":"), default=str)
    return f"event: {event}\ndata: {text}\n\n"


class HubLive:
    """The streams of the hub's pages."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._overview = HubOverview(hub.shards, hub.now)
        #: Pages that are open.
        self.viewers = 0
        #: Shards whose stream is followed.
        self._followed: set[Shard] = set()

    async def run(self) -> None:
        """Follow the shards' streams while a page is open; until it is cancelled."""
        while True:
            if self.viewers:
                async with anyio.create_task_group() as tasks:
                    while self.viewers:
                        for shard in self._hub.shards:
                            if shard.asked and shard not in self._followed:
                                self._followed.add(shard)
                                tasks.start_soon(self._follow, shard)
                        await anyio.sleep(LOOK_SECONDS)
                    tasks.cancel_scope.cancel()
            await anyio.sleep(LOOK_SECONDS)

    async def _follow(self, shard: Shard) -> None:
        instance = shard.instance
        try:
            async for event, data in self._hub.client(shard).stream(f"{PREFIX}/live"):
                if shard.instance != instance or not shard.asked:
                    return
                if event == "overview":
                    self._overview.take(shard, data)
        except AwayError as exc:
            shard.errors[exc.slug] += 1
            await anyio.sleep(AGAIN_SECONDS)
        finally:
            self._followed.discard(shard)

    async def _look_once(self) -> None:
        """One message of each shard that is not followed."""

        async def one(shard: Shard) -> None:
            try:
                async for event, data in self._hub.client(shard).stream(f"{PREFIX}/live", query={"follow": "false"}):
                    if event == "overview":
                        self._overview.take(shard, data)
            except AwayError as exc:
                shard.errors[exc.slug] += 1

        with anyio.move_on_after(2.0):
            async with anyio.create_task_group() as tasks:
                for shard in self._hub.shards.reachable:
                    if shard not in self._followed:
                        tasks.start_soon(one, shard)

    async def stream(self, scope: Mapping[str, Any], drive: str | None, *, follow: bool = True) -> AsyncIterator[str]:
        """Messages until the client goes or the hub stops; ``drive`` is the chosen one."""
        hub, overview = self._hub, self._overview
        wake = anyio.Event()

        def stop() -> None:
            wake.set()

        relayed: deque[str] = deque(maxlen=MOST_RELAYED)
        relay: asyncio.Task[None] | None = None
        hub.streams.add(stop)
        self.viewers += 1
        try:
            await self._look_once()
            overview.refresh()
            if drive is not None and follow:
                # of this page alone; it ends with its stream
                relay = asyncio.get_running_loop().create_task(self._relay(drive, relayed))
            elif drive is not None:
                await self._relay(drive, relayed, follow=False)
            layout, version, after = -1, 0, hub.log.newest
            yield f"retry: {RETRY_MILLISECONDS}\n"
            while not hub.closing:
                overview.refresh()
                pieces = []
                if overview.layout != layout:
                    # drives have come or gone: the page begins anew
                    layout, version = overview.layout, 0
                    pieces.append(_message("farm", self._farm(scope)))
                pieces.append(_message("overview", overview.since(version)))
                version = overview.version
                entries, after = self._entries(after)
                if entries is not None:
                    pieces.append(_message("log", entries))
                while relayed:
                    pieces.append(relayed.popleft())
                yield "".join(pieces)
                if not follow:
                    return
                with anyio.move_on_after(INTERVAL_SECONDS):
                    await wake.wait()
        finally:
            self.viewers -= 1
            hub.streams.discard(stop)
            if relay is not None:
                relay.cancel()

    async def _relay(self, drive: str, relayed: deque[str], *, follow: bool = True) -> None:
        """The messages of one drive, from the shard that has it, also after it was away."""
        hub = self._hub
        while True:
            try:
                shard = hub.shards.owner(drive)
                query = {"drive": drive} | ({} if follow else {"follow": "false"})
                async for event, data in hub.client(shard).stream(f"{PREFIX}/live", query=query):
                    if event in {"drive", "signals"}:
                        relayed.append(_message(event, data))
            except (AwayError, ConfigError) as exc:
                if not follow:
                    return
                relayed.append(f": {str(exc).encode('ascii', 'replace').decode()}\n\n")
            if not follow:
                return
            await anyio.sleep(AGAIN_SECONDS)

    def _entries(self, after: int) -> tuple[dict[str, Any] | None, int]:
        log = self._hub.log
        lost = max(0, log.newest - after - MOST_BEHIND)
        entries = log.entries(after=after + lost, most=MOST_ENTRIES)
        if not entries:
            return None, after
        lost = entries[0].sequence - after - 1
        found: dict[str, Any] = {"entries": [entry.as_dict() for entry in entries]}
        return found | ({"lost": lost} if lost else {}), entries[-1].sequence

    def _farm(self, scope: Mapping[str, Any]) -> dict[str, Any]:
        shards = self._hub.shards
        models = {str(view["model"]) for shard in shards for view in shard.drives.values()}
        return {
            "farm": shards.farm,
            "link": "+".join(dict.fromkeys(str(shard.view.get("link", "")) for shard in shards)),
            "drives": len(shards.names),
            "writes": scope.get(WHO) != "read_token",
            "lines": {
                f"{line['name']} {shard.label}": {"way": line["way"], "where": line["where"]}
                for shard in shards
                for line in shard.view.get("lines", ())
            },
            "faults": {name: _faults(name) for name in sorted(models)},
            "shards": [
                {"shard": shard.label, "state": shard.state.value, "drives": len(shard.drives)} for shard in shards
            ],
        }


def _faults(model: str) -> dict[int, list[str]]:
    try:
        return {number: [fault.label, fault.name] for number, fault in model_by_name(model).faults.items()}
    except ConfigError:
        return {}
