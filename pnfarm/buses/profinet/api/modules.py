"""The modules in a drive's slots; pull and plug."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import Request  # noqa: TC002 - FastAPI reads the annotations of handlers

from pnfarm.buses.profinet.api.schemas import ModulePlug, ModulesView, PluggedView
from pnfarm.buses.profinet.device.device import ProfinetDevice
from pnfarm.buses.profinet.device.modules import modules_view, plug_module, pull_module
from pnfarm.web.bodies import PREFIX, Json, body_of, checked, read_object
from pnfarm.web.errors import NotFoundError

if TYPE_CHECKING:
    from enum import Enum

    from fastapi import FastAPI

    from pnfarm.buses.bus import RouteHost
    from pnfarm.station.station import Station

__all__ = ["add_modules"]


def add_modules(app: FastAPI, host: RouteHost) -> None:
    """Handlers under ``/drives/{name}/modules``."""
    tags: list[str | Enum] = ["modules"]
    path = f"{PREFIX}/drives/{{name}}/modules"

    @app.get(path, tags=tags, summary="The modules in a drive's slots", responses={200: {"model": ModulesView}})
    async def get_modules(name: str) -> Json:
        return Json(_view(host.station(name)))

    @app.put(
        f"{path}/{{slot}}",
        tags=tags,
        summary="Plug a module: the one that was pulled, a telegram's, or one of any ident",
        responses={200: {"model": PluggedView}},
        openapi_extra=body_of(ModulePlug),
    )
    async def plug(name: str, slot: int, request: Request) -> Json:
        wanted = checked(await read_object(request), ModulePlug, hint="allowed: telegram, module_ident, substitute")
        station = host.station(name)
        changed = plug_module(
            _device(station),
            slot,
            host.now(),
            telegram=wanted.telegram,
            ident=wanted.module_ident,
            substitute=wanted.substitute,
        )
        host.changed(station)
        return Json({**_view(station), "changed": changed})

    @app.delete(
        f"{path}/{{slot}}",
        tags=tags,
        summary="Pull a module, or one submodule of it",
        responses={200: {"model": ModulesView}},
    )
    async def pull(name: str, slot: int, subslot: int | None = None) -> Json:
        station = host.station(name)
        pull_module(_device(station), slot, subslot, host.now())
        host.changed(station)
        return Json(_view(station))


def _device(station: Station) -> ProfinetDevice:
    """Raises :class:`NotFoundError` for a drive on another bus, which has no modules."""
    if not isinstance(station.device, ProfinetDevice):
        raise NotFoundError(f"{station.configured_name} has no modules: it is a drive on {station.bus}")
    return station.device


def _view(station: Station) -> dict[str, object]:
    return {"drive": station.configured_name, "modules": modules_view(_device(station))}
