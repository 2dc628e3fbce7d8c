"""Paths of stations, and of devices with their signals."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol

from fastapi import Query, Request
from starlette.responses import Response

from pnfarm.api.changes import SignalsForced, SignalsWritten, who
from pnfarm.api.schemas.device import DevicesView, DeviceView, SignalsAnswer, SignalsValues, StationsView
from pnfarm.vocabulary.quoting import shortened
from pnfarm.web.bodies import Json, body_of, read_object
from pnfarm.web.roles import Role
from pnfarm.web.tags import check_match, is_known

if TYPE_CHECKING:
    from pnfarm.station.event import Event
    from pnfarm.web.paths import Paths

__all__ = ["DeviceHost", "StationsHost", "add_device", "add_stations"]

#: Names of signals in one entry of the log.
MOST_NAMES = 16
_TAG = {"ETag": {"schema": {"type": "string"}}}
_TAGGED = {200: {"model": SignalsValues, "headers": _TAG}}
_WRITTEN = {200: {"model": SignalsAnswer, "headers": _TAG}}
_UNCHANGED = {304: {"description": "As it was at the ETag of If-None-Match"}}
_WRITE = {
    "type": "object",
    "description": "Name of a signal: its new value; a text is parsed by the signal's type. With `as=force`, null "
    "releases the signal, and `*: null` every signal of the device.",
    "additionalProperties": {"type": ["boolean", "number", "string", "null"]},
}


class StationsHost(Protocol):
    """Who has the stations: as the types of the answers say it."""

    async def stations(self) -> dict[str, Any]: ...

    async def devices(self) -> dict[str, Any]: ...


class DeviceHost(Protocol):
    """Who answers for one device: the farm that has it.

    All raise :class:`~pnfarm.web.errors.NotFoundError` for an unknown name.
    """

    def device(self, name: str) -> dict[str, Any]: ...

    def signals(self, name: str) -> dict[str, Any]: ...

    def tag(self, name: str) -> str:
        """An ETag of the signals as they are now."""

    def write(self, name: str, values: dict[str, Any], event: Event, *, force: bool) -> dict[str, Any]:
        """Write or force signals, all or none, and log ``event``.

        Raises :class:`~pnfarm.signals.refusal.SignalError`.
        """


def add_stations(path: Paths, stations: StationsHost) -> None:
    """Declare the lists."""

    @path("GET stations", StationsView)
    async def get_stations() -> Json:
        """Every station of the farm: drives, with their axes, and devices."""
        return Json(await stations.stations())

    @path("GET devices", DevicesView)
    async def get_devices() -> Json:
        """Every device: the stations without axes."""
        return Json(await stations.devices())


def add_device(path: Paths, devices: DeviceHost) -> None:
    """Declare what is below one device."""

    @path("GET devices/{name}", DeviceView)
    async def get_device(name: str) -> Json:
        """One device: identity, modules, connection, signals."""
        return Json(devices.device(name))

    @path("GET devices/{name}/signals", {**_TAGGED, **_UNCHANGED})
    async def get_device_signals(name: str, request: Request) -> Response:
        """The signals of a device with their values; If-None-Match with the ETag saves what has not changed."""
        tag = devices.tag(name)
        if is_known(request, tag):
            return Response(status_code=HTTPStatus.NOT_MODIFIED, headers={"ETag": tag})
        return Json(devices.signals(name), headers={"ETag": tag})

    @path(
        "PATCH devices/{name}/signals",
        _WRITTEN,
        body=body_of(_WRITE, input={"part_present": True, "pressure": 6.5}),
        role=Role.INJECT,
    )
    async def patch_device_signals(
        name: str,
        request: Request,
        how: Annotated[
            Literal["value", "force"],
            Query(alias="as", description="force: over what is written, until it is released."),
        ] = "value",
    ) -> Json:
        """Write or force inputs, all or none; If-Match with an ETag refuses it after a change (412)."""
        values = await read_object(request)
        check_match(request, devices.tag(name))
        told = SignalsWritten if how == "value" else SignalsForced
        event = told(*who(request), shortened(list(values), MOST_NAMES))
        written = devices.write(name, values, event, force=how == "force")
        return Json(written, headers={"ETag": devices.tag(name)})
