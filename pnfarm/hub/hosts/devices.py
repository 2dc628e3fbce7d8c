"""Stations and devices at the hub: the lists of all, and a device's own paths at the shard that has it."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from fastapi import FastAPI

from pnfarm.api.paths.devices import add_device
from pnfarm.errors import ConfigError
from pnfarm.hub.hosts.passing import Passing
from pnfarm.hub.hub import read, refusal
from pnfarm.hub.merging import with_fault_ids
from pnfarm.hub.shards import understood
from pnfarm.web.paths import Paths

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["HubDevices"]


def _entry(shard: Shard, one: dict[str, Any]) -> dict[str, Any]:
    return {**with_fault_ids(shard, one), "shard": shard.label}


class HubDevices(Passing):
    """As :class:`~pnfarm.api.paths.devices.StationsHost`; what is below a device is passed on."""

    def __init__(self, hub: Hub) -> None:
        super().__init__(hub, "devices/{name}", hub.shards.device_owner)

    async def stations(self) -> dict[str, Any]:
        return await self._hub.joined("stations", _entry)

    async def devices(self) -> dict[str, Any]:
        return await self._hub.joined("devices", _entry)

    def add_device(self, app: FastAPI) -> None:
        """What is below a device."""
        farm = FastAPI()
        # no station answers there
        nobody: Any = None
        add_device(Paths(farm, "devices"), nobody)
        self.add(app, farm)

    async def write(self, name: str, values: Mapping[str, Any], *, how: str = "value") -> dict[str, str]:
        """Write or force (``how``) signals of a device; those that a stronger owner has, and which.

        Raises :class:`ConfigError` with the shard's refusal, or :class:`pnfarm.hub.shards.AwayError`.
        """
        shard = self._hub.shards.device_owner(name)
        path = f"devices/{quote(name, safe='')}/signals"
        answer = await self._hub.ask(shard, "PATCH", path, body=values, query={"as": how})
        if answer.status == HTTPStatus.UNPROCESSABLE_ENTITY:
            raise ConfigError(f"{name}: {refusal(answer)}")
        overruled = read(shard, answer, "overruled")["overruled"]
        with understood(shard):
            return dict(overruled)
