"""Drives at the hub: the list of all, and a drive's own paths at the shard that has it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from fastapi import FastAPI, Request
from starlette.responses import Response

from pnfarm.api.changes import changes_nothing
from pnfarm.api.drives import add_drives
from pnfarm.buses.registry import BUSES
from pnfarm.hub.answers import HubFarmView
from pnfarm.hub.hub import read
from pnfarm.hub.merging import joined_engine, unreachable_drive
from pnfarm.hub.shards import AwayError, no_steps
from pnfarm.web.bodies import PREFIX, Json, read_object
from pnfarm.web.errors import NotFoundError

if TYPE_CHECKING:
    from starlette.routing import BaseRoute

    from pnfarm.hub.client import Answer
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["add_hub_drives", "described_drives", "drives_view", "passed_on"]


def described_drives() -> FastAPI:
    """The farm's own paths of a drive: only for what they are called and take."""
    app = FastAPI()
    # their handlers are not called
    nobody: Any = None
    add_drives(app, nobody)
    for one in BUSES.values():
        one.add_routes(app, nobody)
    return app


def of_a_drive(app: FastAPI) -> list[BaseRoute]:
    """The routes below a drive."""
    return [route for route in app.routes if getattr(route, "path", "").startswith(f"{PREFIX}/drives/{{name}}")]


def passed_on(answer: Answer) -> Response:
    """A shard's answer as it is."""
    media_type = answer.media_type or "application/octet-stream"
    return Response(answer.body, answer.status, media_type=media_type)


async def drives_view(hub: Hub) -> dict[str, Any]:
    """``GET drives`` of all shards; drives of those that are away as they were seen last."""
    answers = await hub.ask_all(hub.shards.reachable, "GET", "drives", "drives", "engine", "lines", "link")
    for shard, answer in answers.items():
        if isinstance(answer, AwayError):
            continue
        try:
            hub.shards.take(shard, answer)
        except (KeyError, TypeError):
            answers[shard] = AwayError(f"{shard.label} lists drives as no farm does", slug="garbage")
    partial = hub.partial(answers)
    fresh = {shard for shard, answer in answers.items() if not isinstance(answer, AwayError)}
    conflicts = hub.shards.conflicts()
    drives = []
    for name in hub.shards.names:
        owners = [shard for shard in hub.shards if name in shard.drives]
        shard = next((one for one in owners if one in fresh), next((one for one in owners if one.asked), owners[-1]))
        if shard not in fresh:
            drives.append(unreachable_drive(shard.drives[name], shard))
        elif name in conflicts:
            drives.append({**shard.drives[name], "claimed_by": [one.label for one in conflicts[name]]})
        else:
            drives.append(shard.drives[name])
    views = [shard.view for shard in fresh]
    return {
        "farm": hub.shards.farm,
        # all of them; each shard tells its own
        "shard": None,
        "standing": None,
        "link": "+".join(dict.fromkeys(str(view["link"]) for view in views)) or "unreachable",
        "lines": [
            {**line, "shard": shard.label} if len(hub.shards) > 1 else line
            for shard in hub.shards
            if shard in fresh
            for line in shard.view["lines"]
        ],
        "engine": joined_engine(view["engine"] for view in views),
        "drives": drives,
        **partial,
    }


def _shown(hub: Hub, shard: Shard, drive: dict[str, Any]) -> dict[str, Any]:
    """A drive with its events by the hub's clock."""
    if "events" in drive:
        drive = {**drive, "events": [hub.entry(shard, entry) for entry in drive["events"]]}
    return {**drive, "shard": shard.label}


def add_hub_drives(app: FastAPI, hub: Hub) -> None:
    """Handlers under ``/drives``."""

    @app.get(
        f"{PREFIX}/drives",
        tags=["drives"],
        summary="All farms as one: every drive, also of shards that do not answer",
        responses={200: {"model": HubFarmView}},
    )
    async def get_drives() -> Json:
        return Json(await drives_view(hub))

    async def pass_on(request: Request) -> Response:
        name = str(request.path_params["name"])
        shard = hub.shards.owner(name)
        path = request.scope["path"].removeprefix(f"{PREFIX}/")
        no_steps(path)
        body = None
        if request.method in {"PUT", "POST", "PATCH"} and int(request.headers.get("content-length", "0") or 0):
            body = await read_object(request)
        if request.method not in {"GET", "HEAD"}:
            changes_nothing(request)
        try:
            answer = await hub.ask(
                shard, request.method, quote(path, safe="/"), body=body, query=str(request.url.query)
            )
        except AwayError as exc:
            later = "" if request.method == "GET" else "; whether it was carried out is not known"
            raise AwayError(f"{name} is unreachable: {exc}{later}", exc.event, exc.slug) from exc
        if answer.status == 404 and name not in shard.drives:
            raise NotFoundError(f"there is no drive {name!r}")
        if request.method == "GET" and path.count("/") == 1 and answer.good:
            return Json(_shown(hub, shard, read(shard, answer, "name")))
        return passed_on(answer)

    for route in of_a_drive(described_drives()):
        app.add_api_route(
            route.path,  # type: ignore[attr-defined]  # those of the API have it
            pass_on,
            methods=sorted(route.methods),  # type: ignore[attr-defined]
            include_in_schema=False,
        )
