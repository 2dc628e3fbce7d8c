"""What one client of the hub's ``GET live`` looks at in detail, from the shards that have it.

One stream for each of these shards, for this client alone; it starts again after the shard was away, or when another
one has the drive or device.  Messages of the drive are passed on, the oldest left out where the client is slow; of
signals of devices what is newest is kept.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import anyio

from pnfarm.api.followed import values_messages
from pnfarm.api.messages import message
from pnfarm.api.paths.streams import ALL
from pnfarm.errors import ConfigError
from pnfarm.hub.merging import with_fault_ids
from pnfarm.hub.shards import AwayError, understood
from pnfarm.web.bodies import PREFIX

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from pnfarm.api.paths.streams import Chosen
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["Relay"]

#: Messages of a drive that wait for a slow client.
MOST_RELAYED = 32
#: Signals of one device: each bit of the longest data of both directions, and as many of a farm file.
MOST_SIGNALS = 50_000
#: After a shard's stream broke, and between two checks of which shard has what.
AGAIN_SECONDS = 1.0


class Relay:
    """See the module's docstring."""

    def __init__(self, hub: Hub, chosen: Chosen) -> None:
        self._hub = hub
        self._chosen = chosen
        self._messages: deque[bytes] = deque(maxlen=MOST_RELAYED)
        #: Device -> its newest message, without signals, and these by name.
        self._values: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {}

    def messages(self) -> Iterator[bytes]:
        """What came since the last call."""
        while self._messages:
            yield self._messages.popleft()
        values, self._values = self._values, {}
        for device, (newest, signals) in values.items():
            yield from values_messages(device, newest["revision"], newest["tag"], signals.values())

    async def run(self) -> None:
        """Until it is cancelled."""
        while True:
            known, queries = self._shards(), self._queries()
            async with anyio.create_task_group() as tasks:
                for shard, query in queries.items():
                    tasks.start_soon(self._follow, shard, query)
                while True:
                    await anyio.sleep(AGAIN_SECONDS)
                    if self._shards() != known:
                        break
                tasks.cancel_scope.cancel()

    async def once(self) -> None:
        """One message of each kind."""
        queries = self._queries()
        await self._hub.each(queries, lambda shard: self._take(shard, {**queries[shard], "follow": "false"}))

    def _shards(self) -> list[tuple[Shard, bool, str]]:
        """Where which drive and device is depends on this alone."""
        return [(shard, shard.asked, shard.instance) for shard in self._hub.shards]

    def _queries(self) -> dict[Shard, dict[str, Any]]:
        """What to ask of which shard, of those that answer."""
        chosen, shards = self._chosen, self._hub.shards
        found: dict[Shard, dict[str, Any]] = {}

        def add(key: str, name: str, find: Callable[[str], Shard]) -> None:
            try:
                found.setdefault(find(name), {"overview": "false"}).setdefault(key, []).append(name)
            except (AwayError, ConfigError) as exc:
                self._messages.append(b": %b\n\n" % str(exc).encode("ascii", "replace"))

        if chosen.drive is not None:
            add("drive", chosen.drive, shards.owner)
        if ALL in chosen.devices:
            for shard in shards.reachable:
                found.setdefault(shard, {"overview": "false"})["device"] = [ALL]
        else:
            for name in chosen.devices:
                add("device", name, shards.device_owner)
        return found

    async def _follow(self, shard: Shard, query: Mapping[str, Any]) -> None:
        while True:
            await self._take(shard, query)
            await anyio.sleep(AGAIN_SECONDS)

    async def _take(self, shard: Shard, query: Mapping[str, Any]) -> None:
        """The messages of a shard's stream, until it ends or breaks."""
        try:
            async for event, data in self._hub.client(shard).stream(f"{PREFIX}/live", query=query):
                with understood(shard, "streams nothing"):
                    if event in {"drive", "signals"}:
                        self._messages.append(message(event, with_fault_ids(shard, data) if event == "drive" else data))
                    elif event == "values":
                        self._take_values(shard, data)
        except AwayError as exc:
            shard.errors[exc.slug] += 1

    def _take_values(self, shard: Shard, data: Mapping[str, Any]) -> None:
        device, states = data["device"], {state["name"]: state for state in data["signals"]}
        if device not in shard.devices and device not in shard.models:
            raise ValueError(f"values of {device}, which it has not")
        signals = {**self._values.get(device, ({}, {}))[1], **states}
        if len(signals) > MOST_SIGNALS:
            raise ValueError(f"{len(signals)} signals of {device}")
        self._values[device] = {"revision": int(data["revision"]), "tag": str(data["tag"])}, signals
