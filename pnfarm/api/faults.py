"""The catalogue of faults, and faults put in force and taken back."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from fastapi import APIRouter, Request

from pnfarm.api.context import ApiContext, read_object
from pnfarm.api.problems import Json, NotFoundError
from pnfarm.api.schemas import Reset
from pnfarm.errors import ConfigError, InternalError
from pnfarm.faults.catalogue import KINDS
from pnfarm.faults.plan import FaultSpec

if TYPE_CHECKING:
    from pnfarm.faults.manager import FaultManager

__all__ = ["router"]

_SPEC_BODY = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": FaultSpec.model_json_schema(by_alias=True),
                "examples": {"f702": {"value": {"kind": "f702", "on": "axis-01", "for": "2s"}}},
            }
        },
    }
}


def router(context: ApiContext) -> APIRouter:
    """Handlers of faults."""
    routes = APIRouter(tags=["faults"])

    def manager() -> FaultManager:
        found = context.core.faults
        if found is None:
            raise InternalError("this farm runs without a fault manager")
        return found

    @routes.get("/fault-kinds", summary="Every kind of fault with its parameters")
    async def get_kinds() -> Json:
        return Json({"kinds": [kind.as_dict() for kind in KINDS.values()]})

    @routes.get("/faults", summary="Faults that wait or are in force, with their evidence")
    async def get_faults() -> Json:
        return Json({"faults": [fault.as_dict() for fault in manager().list()]})

    @routes.post("/faults", summary="Put a fault in force", status_code=201, openapi_extra=_SPEC_BODY)
    async def post_fault(request: Request) -> Json:
        spec = FaultSpec.parse(await read_object(request))
        fault = manager().add(spec, context.now())
        context.poke()
        place = f"/api/v1/faults/{quote(fault.id, safe='')}"
        return Json(fault.as_dict(), HTTPStatus.CREATED, headers={"Location": place})

    @routes.get("/faults/{fault_id}", summary="One fault, also one that ended not long ago")
    async def get_fault(fault_id: str) -> Json:
        try:
            return Json(manager().get(fault_id).as_dict())
        except ConfigError as exc:
            raise NotFoundError(str(exc)) from exc

    @routes.delete("/faults/{fault_id}", summary="End a fault; its last evidence")
    async def delete_fault(fault_id: str) -> Json:
        try:
            (fault,) = manager().clear(fault_id, context.now())
        except ConfigError as exc:
            raise NotFoundError(str(exc)) from exc
        context.poke()
        return Json(fault.as_dict())

    @routes.post("/reset", summary="End every injected fault", responses={200: {"model": Reset}})
    async def reset() -> Json:
        cleared = manager().clear(None, context.now())
        context.poke()
        view: dict[str, Any] = {"cleared": [fault.id for fault in cleared]}
        return Json(view)

    return routes
