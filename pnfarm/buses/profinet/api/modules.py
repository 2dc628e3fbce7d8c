"""The modules in a drive's slots; pull and plug."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import Request  # noqa: TC002 - FastAPI reads the annotations of handlers

from pnfarm.buses.profinet.api.schemas import ModulePlug, ModulesView, PluggedView
from pnfarm.buses.profinet.device.device import ProfinetDevice
from pnfarm.buses.profinet.device.modules import modules_view, plug_module, pull_module
from pnfarm.web.bodies import Json, body_of, checked, read_object
from pnfarm.web.errors import NotFoundError
from pnfarm.web.paths import Paths
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from fastapi import FastAPI

    from pnfarm.buses.bus import RouteHost
    from pnfarm.station.station import Station

__all__ = ["add_modules"]


def add_modules(app: FastAPI, host: RouteHost) -> None:
    """Handlers under ``/drives/{name}/modules``."""
    path = Paths(app, "modules")

    @path("GET drives/{name}/modules", ModulesView)
    async def get_modules(name: str) -> Json:
        """The modules in a drive's slots."""
        return Json(_view(host.station(name)))

    @path("PUT drives/{name}/modules/{slot}", PluggedView, body=body_of(ModulePlug), role=Role.INJECT)
    async def plug(name: str, slot: int, request: Request) -> Json:
        """Plug a module: the one that was pulled, a telegram's, or one of any ident."""
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

    @path("DELETE drives/{name}/modules/{slot}", ModulesView, role=Role.INJECT)
    async def pull(name: str, slot: int, subslot: int | None = None) -> Json:
        """Pull a module, or one submodule of it."""
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
