"""Faults at the hub: as a farm's paths, over the drives of all shards."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote

from fastapi import Query, Request

from pnfarm.api.answers import FaultKinds
from pnfarm.api.changes import FaultCleared, FaultRequested, changes_nothing, shortened, who
from pnfarm.api.faults import MOST_AHEAD_SECONDS, SPEC_BODY
from pnfarm.buses.registry import fault_kinds
from pnfarm.hub.answers import HubFault, HubFaults, HubReach, HubReset
from pnfarm.hub.faults import wrong_moment
from pnfarm.web.bodies import PREFIX, Json, read_object

if TYPE_CHECKING:
    from collections.abc import Mapping
    from enum import Enum

    from fastapi import FastAPI

    from pnfarm.hub.faults import HubFaults as Faults
    from pnfarm.hub.hub import Hub

__all__ = ["add_hub_faults"]


def add_hub_faults(app: FastAPI, hub: Hub, faults: Faults) -> None:
    """Handlers under ``/faults``, and ``reset``."""
    tags: list[str | Enum] = ["faults"]
    one: dict[int | str, dict[str, Any]] = {
        200: {"model": HubFault},
        207: {"model": HubFault, "description": "Not on all shards: see `unreachable`."},
    }

    def told(request: Request, event: type[FaultRequested | FaultCleared], fault: Mapping[str, Any]) -> None:
        hub.record(event(*who(request), fault["id"], fault["kind"], shortened(list(fault["drives"]))))

    def status(*, whole: bool, done: HTTPStatus = HTTPStatus.OK) -> HTTPStatus:
        return done if whole else HTTPStatus.MULTI_STATUS

    @app.get(
        f"{PREFIX}/fault-kinds",
        tags=tags,
        summary="Every kind of fault with its parameters",
        responses={200: {"model": FaultKinds}},
    )
    async def get_kinds() -> Json:
        return Json({"kinds": [kind.as_dict() for kind in fault_kinds().values()]})

    @app.get(
        f"{PREFIX}/faults",
        tags=tags,
        summary="Pending and active faults on all shards, with their evidence",
        responses={200: {"model": HubFaults}},
    )
    async def get_faults() -> Json:
        return Json(await faults.listed())

    @app.post(
        f"{PREFIX}/faults",
        tags=tags,
        summary="Inject a fault into drives of any shards at one moment; with dry_run only list the drives",
        status_code=201,
        responses={
            201: {"model": HubFault},
            200: {"model": HubReach},
            207: {"model": HubFault, "description": "Some shards did not answer: `hit` and `not_hit` have the drives."},
        },
        openapi_extra=SPEC_BODY,
    )
    async def post_fault(
        request: Request,
        *,
        dry_run: bool = False,
        at: Annotated[
            float | None, Query(description="Begin at this moment of the hub's clock (`GET clock`), seconds.")
        ] = None,
    ) -> Json:
        body = await read_object(request)
        if dry_run:
            changes_nothing(request)
            return Json(await faults.reach(body))
        wrong_moment(at, hub.now(), MOST_AHEAD_SECONDS)
        fault = await faults.inject(body, at)
        told(request, FaultRequested, fault)
        place = f"{PREFIX}/faults/{quote(fault['id'], safe='')}"
        code = status(whole=not fault["partial"], done=HTTPStatus.CREATED)
        return Json(fault, code, headers={"Location": place})

    @app.get(
        f"{PREFIX}/faults/{{fault_id}}",
        tags=tags,
        summary="One fault, also one that has ended recently",
        responses={200: {"model": HubFault}},
    )
    async def get_fault(fault_id: str) -> Json:
        return Json(await faults.get(fault_id))

    @app.post(
        f"{PREFIX}/faults/{{fault_id}}/renew",
        tags=tags,
        summary="Restart a fault's time to live (ttl)",
        responses=one,
    )
    async def renew_fault(fault_id: str, request: Request) -> Json:
        changes_nothing(request)
        fault, whole = await faults.renew(fault_id)
        return Json(fault, status(whole=whole))

    @app.delete(
        f"{PREFIX}/faults/{{fault_id}}",
        tags=tags,
        summary="End a fault on all shards and return its final evidence",
        responses=one,
    )
    async def delete_fault(fault_id: str, request: Request) -> Json:
        fault, whole = await faults.clear(fault_id)
        told(request, FaultCleared, fault)
        return Json(fault, status(whole=whole))

    @app.post(
        f"{PREFIX}/reset",
        tags=tags,
        summary="End every injected fault on every shard",
        responses={
            200: {"model": HubReset},
            207: {"model": HubReset, "description": "Shards did not answer: their faults may be in force."},
        },
    )
    async def reset(request: Request) -> Json:
        found, whole = await faults.reset()
        for fault in found["faults"]:
            told(request, FaultCleared, fault)
        changes_nothing(request)
        return Json(found, status(whole=whole))
