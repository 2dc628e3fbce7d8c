"""Saved states at the hub: each shard has its part, and a state is whole only with all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from pnfarm.hub.hub import RefusedError
from pnfarm.hub.shards import no_steps, understood

if TYPE_CHECKING:
    from pnfarm.hub.hub import Hub

__all__ = ["HubStates"]

#: A farm of a thousand drives takes seconds to be switched off and on.
PATIENCE_SECONDS = 30.0


class HubStates:
    """As :class:`~pnfarm.api.paths.states.StatesHost`.

    A restore is checked by every shard before the first one does it.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    async def kept(self) -> dict[str, Any]:
        return await self._hub.joined("states", lambda shard, one: {**one, "shard": shard.label})

    async def save(self, name: str) -> dict[str, Any]:
        return await self._all("PUT", name, "")

    async def restore(self, name: str, *, check: bool) -> dict[str, Any]:
        found = await self._all("POST", name, "/restore", check="true")
        return found if check else await self._all("POST", name, "/restore")

    async def delete(self, name: str) -> dict[str, Any]:
        return await self._all("DELETE", name, "")

    async def _all(self, method: str, name: str, below: str, **query: str) -> dict[str, Any]:
        """Ask every shard; raises for the first that is away or refuses."""
        hub = self._hub
        hub.check_any()
        no_steps(name)
        if away := hub.shards.unreachable:
            raise away[0].away()
        path = f"states/{quote(name, safe='')}{below}"
        answers = await hub.each(
            hub.shards, lambda shard: hub.ask(shard, method, path, seconds=PATIENCE_SECONDS, query=query)
        )
        for why in answers.away.values():
            raise why
        notes: list[str] = []
        for shard, answer in answers.good.items():
            if not answer.good:
                raise RefusedError(answer)
            with understood(shard):
                notes += [f"{shard.label}: {note}" for note in answer.object()["notes"]]
        return {"state": name, "notes": notes}
