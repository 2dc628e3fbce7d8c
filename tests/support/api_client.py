"""A client of a farm's API that needs no socket: for commands, in place of ``httpx.Client``."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx

__all__ = ["Farm"]


class Farm:
    """Stands for ``httpx.Client``; ``world`` has the ``app``."""

    base_url = httpx.URL("http://127.0.0.1/api/v1")

    def __init__(self, world: Any) -> None:
        self.world = world

    def client(self, **_: Any) -> Farm:
        return self

    def close(self) -> None:
        """As a client's."""

    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        async def ask() -> httpx.Response:
            transport = httpx.ASGITransport(self.world.app)
            async with self.async_client(transport=transport, base_url=self.base_url) as client:
                return await client.request(method, path, **options)

        return asyncio.run(ask())

    async_client = httpx.AsyncClient
