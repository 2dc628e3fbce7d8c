"""A drive's modules: what stands in its slots; pull and plug."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import Request  # noqa: TC002 - FastAPI reads the annotations of handlers
from pydantic import ValidationError

from pnfarm.api.context import PREFIX, ApiContext, read_object
from pnfarm.api.problems import Json, RequestError
from pnfarm.api.schemas import ModulePlug, ModulesView, PluggedView
from pnfarm.buses.profinet.device.device import ProfinetDevice
from pnfarm.buses.profinet.device.modules import modules_view, plug_module, pull_module

if TYPE_CHECKING:
    from enum import Enum

    from fastapi import FastAPI

    from pnfarm.station.station import Station

__all__ = ["add_modules"]

_PLUG_BODY = {
    "requestBody": {
        "required": True,
        "content": {"application/json": {"schema": ModulePlug.model_json_schema()}},
    }
}


def add_modules(app: FastAPI, context: ApiContext) -> None:
    """Handlers under ``/drives/{name}/modules``."""
    tags: list[str | Enum] = ["modules"]
    path = f"{PREFIX}/drives/{{name}}/modules"

    @app.get(path, tags=tags, summary="What stands in a drive's slots", responses={200: {"model": ModulesView}})
    async def get_modules(name: str) -> Json:
        return Json(_view(context.station(name)))

    @app.put(
        f"{path}/{{slot}}",
        tags=tags,
        summary="Plug a module: the one that was pulled, a telegram's, or one of any ident",
        responses={200: {"model": PluggedView}},
        openapi_extra=_PLUG_BODY,
    )
    async def plug(name: str, slot: int, request: Request) -> Json:
        body = await read_object(request)
        try:
            wanted = ModulePlug.model_validate(body)
        except ValidationError as exc:
            errors = [
                {"field": ".".join(map(str, e["loc"])), "what": e["msg"], "allowed": ""}
                for e in exc.errors(include_url=False)
            ]
            sentence = "; ".join(f"{e['field']}: {e['what']}" for e in errors)
            raise RequestError(f"{sentence}; allowed: telegram, module_ident, substitute", errors) from exc
        station = context.station(name)
        changed = plug_module(
            _device(station),
            slot,
            context.now(),
            telegram=wanted.telegram,
            ident=wanted.module_ident,
            substitute=wanted.substitute,
        )
        context.changed(station)
        return Json({**_view(station), "changed": changed})

    @app.delete(
        f"{path}/{{slot}}",
        tags=tags,
        summary="Pull a module, or one submodule of it",
        responses={200: {"model": ModulesView}},
    )
    async def pull(name: str, slot: int, subslot: int | None = None) -> Json:
        station = context.station(name)
        pull_module(_device(station), slot, subslot, context.now())
        context.changed(station)
        return Json(_view(station))


def _device(station: Station) -> ProfinetDevice:
    """Raises :class:`RequestError` for a drive on another bus, which has no modules."""
    if not isinstance(station.device, ProfinetDevice):
        raise RequestError(f"{station.configured_name} has no modules: its bus is {station.model.bus}")
    return station.device


def _view(station: Station) -> dict[str, object]:
    return {"drive": station.configured_name, "modules": modules_view(_device(station))}
