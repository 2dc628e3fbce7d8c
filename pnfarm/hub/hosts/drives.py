"""Drives at the hub: the list of all, and a drive's own paths at the shard that has it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from fastapi import FastAPI, Request
from starlette.responses import Response  # noqa: TC002 - FastAPI reads the annotations of handlers

from pnfarm.api.app import add_one_drive
from pnfarm.api.changes import changes_nothing
from pnfarm.hub.hub import passed_on, read
from pnfarm.hub.merging import joined_engine, unreachable_drive
from pnfarm.hub.shards import AwayError, no_steps
from pnfarm.web.bodies import PREFIX, Json, read_object
from pnfarm.web.errors import NotFoundError

if TYPE_CHECKING:
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["HubDrives"]


class HubDrives:
    """As :class:`~pnfarm.api.paths.drives.DrivesHost`."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    async def listed(self) -> dict[str, Any]:
        """``GET drives`` of all shards; drives of those that are away as they were seen last."""
        hub = self._hub
        answers = await hub.ask_all("GET", "drives", "drives", "engine", "lines", "link")
        for shard, answer in list(answers.good.items()):
            try:
                hub.shards.take(shard, answer)
            except (KeyError, TypeError):
                del answers.good[shard]
                answers.away[shard] = AwayError(f"{shard.label} lists drives as no farm does", slug="garbage")
        partial = hub.partial(answers)
        fresh = answers.good
        conflicts = hub.shards.conflicts()
        drives = []
        for name in hub.shards.names:
            owners = [shard for shard in hub.shards if name in shard.drives]
            shard = next(
                (one for one in owners if one in fresh), next((one for one in owners if one.asked), owners[-1])
            )
            drive = shard.drives[name]
            if shard not in fresh:
                drive = unreachable_drive(drive, shard)
            elif name in conflicts:
                drive = {**drive, "claimed_by": [one.label for one in conflicts[name]]}
            drives.append(drive)
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

    def add_drive(self, app: FastAPI) -> None:
        """What is below a drive: described as a farm's, and answered by the shard that has it."""
        farm = FastAPI()
        # their handlers are not called
        nobody: Any = None
        add_one_drive(farm, nobody, nobody)
        for route in farm.routes:
            if getattr(route, "path", "").startswith(f"{PREFIX}/drives/{{name}}"):
                methods = sorted(route.methods)  # type: ignore[attr-defined]  # those of the API have it
                app.add_api_route(route.path, self._pass_on, methods=methods, include_in_schema=False)  # type: ignore[attr-defined]
                # never reached: the one before answers
                app.router.routes.append(route)

    async def _pass_on(self, request: Request) -> Response:
        hub, name = self._hub, str(request.path_params["name"])
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
            return Json(self._shown(shard, read(shard, answer, "name")))
        return passed_on(answer)

    def _shown(self, shard: Shard, drive: dict[str, Any]) -> dict[str, Any]:
        """A drive with its events by the hub's clock."""
        if "events" in drive:
            drive = {**drive, "events": [self._hub.entry(shard, entry) for entry in drive["events"]]}
        return {**drive, "shard": shard.label}
