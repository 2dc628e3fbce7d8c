"""A farm in virtual time behind its HTTP API, and a client that needs no socket."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
from virtual_line import VirtualLine

from pnfarm.api import make_app

BASE = "http://127.0.0.1:8702"
#: What ``make_app`` takes about who may do what.
ACCESS = ("token", "read_token", "tokens", "audit", "wall")


class Served:
    """``line`` is a farm with its ``world``; ``get``, ``post`` ... go to ``app``.  ``access`` is for ``make_app``."""

    def __init__(self, line: Any, **access: Any) -> None:
        self.line = line
        self.faults = self.line.farm.injections
        self.app = make_app(
            self.line.farm,
            now=lambda: self.line.world.now,
            poke=lambda: self.line.farm.service(self.line.world.now),
            **access,
        )
        self.context = self.app.state.context

    def request(self, method: str, path: str, *, base: str = BASE, **options: Any) -> httpx.Response:
        async def ask() -> httpx.Response:
            async with self.client(base) as client:
                return await client.request(method, path, **options)

        return asyncio.run(ask())

    def client(self, base: str = BASE) -> httpx.AsyncClient:
        # what a handler raises is the client's to see as a problem, not the test's as an exception
        return httpx.AsyncClient(transport=httpx.ASGITransport(self.app, raise_app_exceptions=False), base_url=base)

    def get(self, path: str, **options: Any) -> httpx.Response:
        return self.request("GET", path, **options)

    def post(self, path: str, json: Any = None, **options: Any) -> httpx.Response:
        return self.request("POST", path, json=json, **options)

    def put(self, path: str, json: Any, **options: Any) -> httpx.Response:
        return self.request("PUT", path, json=json, **options)

    def delete(self, path: str) -> httpx.Response:
        return self.request("DELETE", path)


class ApiWorld(Served):
    """``line`` is the farm of so many drives with its controller; options are those of the line and of the access."""

    def __init__(self, drives: int = 2, **options: Any) -> None:
        access = {key: options.pop(key) for key in ACCESS if key in options}
        super().__init__(VirtualLine(drives, **options), **access)


def assert_problem(response: httpx.Response, status: int, *words: str) -> dict[str, Any]:
    """A problem document (RFC 9457) with this status, whose sentence holds ``words``."""
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    found: dict[str, Any] = response.json()
    assert found["status"] == status
    assert found["type"] == "about:blank"
    assert found["title"]
    assert "\n" not in found["detail"]
    for word in words:
        assert word in found["detail"]
    return found
