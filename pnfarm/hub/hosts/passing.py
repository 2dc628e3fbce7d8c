"""Paths below what one shard has: described as a farm's, and answered by that shard."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from fastapi import Request  # noqa: TC002 - FastAPI reads the annotations of handlers
from starlette.responses import Response  # noqa: TC002 - FastAPI reads the annotations of handlers

from pnfarm.api.access.rights import role_of
from pnfarm.api.changes import changes_nothing
from pnfarm.hub.hub import passed_on, read
from pnfarm.hub.merging import with_fault_ids
from pnfarm.hub.shards import AwayError, no_steps, understood
from pnfarm.web.bodies import PREFIX, Json, read_object
from pnfarm.web.paths import ROLE_KEY

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from fastapi import FastAPI

    from pnfarm.hub.client import Answer
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["Passing"]

#: Headers of a request that the shard needs, too.
_CONDITIONS = ("if-match", "if-none-match")


class Passing:
    """``below``: such as ``drives/{name}``; ``owner`` gives the shard by the name, or raises."""

    def __init__(self, hub: Hub, below: str, owner: Callable[[str], Shard]) -> None:
        self._hub = hub
        self._below = below
        self._owner = owner

    def add(self, app: FastAPI, farm: FastAPI) -> None:
        """Add to ``app`` what ``farm`` has below; the farm's handlers are not called."""
        for route in farm.routes:
            path: str = getattr(route, "path", "")
            if path.startswith(f"{PREFIX}/{self._below}"):
                methods = sorted(route.methods)  # type: ignore[attr-defined]  # those of the API have it
                app.add_api_route(
                    path,
                    self.answer,
                    methods=methods,
                    include_in_schema=False,
                    openapi_extra={ROLE_KEY: role_of(route).value},
                )
                # only describes it: the one before answers
                app.router.routes.append(route)

    async def answer(self, request: Request) -> Response:
        """The shard's answer as it is, but for what the drive or device itself is."""
        shard, answer = await self._asked(request)
        itself = request.scope["path"].count("/") == f"{PREFIX}/{self._below}".count("/")
        if itself and request.method == "GET" and answer.good:
            view = read(shard, answer, "name")
            with understood(shard):
                return Json(self.shown(shard, view))
        return passed_on(answer)

    def shown(self, shard: Shard, view: Mapping[str, Any]) -> dict[str, Any]:
        """It as the hub shows it."""
        return with_fault_ids(shard, view)

    async def _asked(self, request: Request) -> tuple[Shard, Answer]:
        """The shard, and its answer.  Raises :class:`AwayError`."""
        name = str(request.path_params["name"])
        shard = self._owner(name)
        path = request.scope["path"].removeprefix(f"{PREFIX}/")
        no_steps(path)
        body = None
        if request.method in {"PUT", "POST", "PATCH"} and _has_body(request):
            body = await read_object(request)
        if request.method not in {"GET", "HEAD"}:
            changes_nothing(request)
        headers = {key: request.headers[key] for key in _CONDITIONS if key in request.headers}
        query = str(request.url.query)
        try:
            return shard, await self._hub.ask(
                shard, request.method, quote(path, safe="/"), body=body, query=query, headers=headers
            )
        except AwayError as exc:
            later = "" if request.method == "GET" else "; whether it was carried out is not known"
            raise AwayError(f"{name} is unreachable: {exc}{later}", exc.event, exc.slug) from exc


def _has_body(request: Request) -> bool:
    """One of a known length, or one in chunks."""
    return request.headers.get("content-length", "0") not in {"", "0"} or "transfer-encoding" in request.headers
