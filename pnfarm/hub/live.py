"""``GET live`` at the hub: the page's stream (:mod:`pnfarm.api.live`) over the drives of all shards.

While a page is open, the hub follows the stream of each shard once, for all pages.  What a page looks at in detail has
streams of its own (:mod:`pnfarm.hub.relay`).
"""

from __future__ import annotations

import asyncio
from contextlib import aclosing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import anyio

from pnfarm.api.access.guard import ROLE
from pnfarm.api.events import parse_position
from pnfarm.api.live import page_stream
from pnfarm.api.messages import message
from pnfarm.drives.catalogue import model as model_by_name
from pnfarm.errors import ConfigError
from pnfarm.hub.overview import HubOverview
from pnfarm.hub.relay import Relay
from pnfarm.hub.shards import AwayError
from pnfarm.web.bodies import PREFIX
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator, Mapping

    from pnfarm.api.paths.streams import Chosen
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["HubLive"]

#: Between two checks of whether a page is open, and after a shard's stream broke.
LOOK_SECONDS = 0.1
AGAIN_SECONDS = 1.0


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
        try:
            if not await self._take(shard):
                await anyio.sleep(AGAIN_SECONDS)
        finally:
            self._followed.discard(shard)

    async def _take(self, shard: Shard, query: Mapping[str, str] | None = None) -> bool:
        """The messages of a shard's stream; False if it broke."""
        run = shard.instance, shard.since_ns
        try:
            async for event, data in self._hub.client(shard).stream(f"{PREFIX}/live", query=query):
                # of drives at rest only a stream that starts again shows that they are back
                if (shard.instance, shard.since_ns) != run or not shard.asked:
                    break
                if event == "overview":
                    self._overview.take(shard, data)
        except AwayError as exc:
            shard.errors[exc.slug] += 1
            return False
        return True

    async def _look_once(self) -> None:
        """One message of each shard that is not followed."""
        shards = [shard for shard in self._hub.shards.reachable if shard not in self._followed]
        with anyio.move_on_after(2.0):
            await self._hub.each(shards, lambda shard: self._take(shard, {"follow": "false"}))

    async def stream(self, scope: Mapping[str, Any], chosen: Chosen) -> AsyncIterator[bytes]:
        """See :func:`pnfarm.api.live.page_stream`."""
        relay = Relay(self._hub, chosen)
        task: asyncio.Task[None] | None = None
        self.viewers += chosen.overview
        try:
            if chosen.overview:
                await self._look_once()
            if not chosen.follow:
                await relay.once()
            elif chosen.drive is not None or chosen.devices:
                # of this page alone; it ends with its stream
                task = asyncio.get_running_loop().create_task(relay.run())
            page = _HubPage(self._hub, self._overview, scope.get(ROLE, Role.READ).covers(Role.INJECT), relay)
            log = self._hub.log if chosen.overview else None
            # the log of a hub that was started again has what the page had of the one before
            known = chosen.begin is not None and self._hub.instance in (parse_position(chosen.begin) or {})
            begin = chosen.begin if known else None
            async with aclosing(page_stream(self._hub, log, page, begin=begin, follow=chosen.follow)) as parts:
                async for part in parts:
                    yield part
        finally:
            self.viewers -= chosen.overview
            if task is not None:
                task.cancel()


@dataclass(slots=True)
class _HubPage:
    hub: Hub
    seen: HubOverview
    #: Whether this client may change something.
    writes: bool
    relay: Relay
    layout: int = -1
    version: int = 0

    def overview(self) -> Iterator[bytes]:
        self.seen.refresh()
        if self.seen.layout != self.layout:
            # drives have come or gone: the page starts again
            self.layout, self.version = self.seen.layout, 0
            yield message("farm", self._farm())
        text = self.seen.since(self.version)
        self.version = self.seen.version
        yield message("overview", text)

    def chosen(self, *, whole: bool) -> Iterator[bytes]:  # noqa: ARG002 - the shards do
        return self.relay.messages()

    def _farm(self) -> dict[str, Any]:
        shards = self.hub.shards
        models = {str(view["model"]) for shard in shards for view in shard.drives.values()}
        return {
            "farm": shards.farm,
            "link": "+".join(dict.fromkeys(str(shard.view.get("link", "")) for shard in shards)),
            "drives": len(shards.names),
            "writes": self.writes,
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
