"""Drives and their parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import anyio.lowlevel
from fastapi import Query, Request

from pnfarm.api.changes import ParameterWritten, PowerCycleRequested, PowerOffRequested, PowerOnRequested, who
from pnfarm.api.schemas import ControllerView, Drive, FarmView, ParameterList, ParameterValue, ParameterWrite
from pnfarm.drives.description.parts import fault_label
from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.fault_buffer import fault_situations
from pnfarm.farm.views.controller_view import controller_view
from pnfarm.farm.views.snapshot import drive_snapshot, engine_snapshot, injected_faults, line_snapshot
from pnfarm.firmware.causes import NUMBER_MASK
from pnfarm.web.bodies import PREFIX, Json, body_of, checked, read_object

if TYPE_CHECKING:
    from enum import Enum

    from fastapi import FastAPI

    from pnfarm.api.context import ApiContext
    from pnfarm.drives.parameters.parameter import Parameter
    from pnfarm.station.station import Station

__all__ = ["add_drives"]

#: Drives described before the event loop runs again: takes some milliseconds.
DRIVES_AT_ONCE = 64
#: Parameters in one answer.
MOST_PARAMETERS = 500


def add_drives(app: FastAPI, context: ApiContext) -> None:
    """Handlers under ``/drives``."""
    tags: list[str | Enum] = ["drives"]

    @app.get(
        f"{PREFIX}/drives",
        tags=tags,
        summary="The farm, its engine and all drives",
        responses={200: {"model": FarmView}},
    )
    async def get_drives() -> Json:
        core = context.core
        injected = injected_faults(core.injections)
        drives = []
        for place, station in enumerate(core.stations, start=1):
            drives.append(drive_snapshot(core, station, context.now(), injected=injected))
            if place % DRIVES_AT_ONCE == 0:
                await anyio.lowlevel.checkpoint()
        view = {
            "farm": core.name,
            "shard": None if core.shard is None else core.shard.as_dict(),
            "standing": None if core.leaseholder is None else core.leaseholder.as_dict(),
            "link": core.link.kind,
            "lines": [line_snapshot(core, name) for name in core.lines],
            "engine": engine_snapshot(core),
            "drives": drives,
        }
        return Json(view)

    @app.get(f"{PREFIX}/drives/{{name}}", tags=tags, summary="One drive", responses={200: {"model": Drive}})
    async def get_drive(name: str) -> Json:
        station = context.station(name)
        log = context.core.log.entries(station.configured_name)
        return Json(
            {
                **context.view(station),
                "fault_memory": _fault_memory(station),
                "events": [entry.as_dict() for entry in log],
            }
        )

    @app.get(
        f"{PREFIX}/drives/{{name}}/controller",
        tags=tags,
        summary="What the drive's controller did, seen from the drive",
        responses={200: {"model": ControllerView}},
    )
    async def get_controller(name: str) -> Json:
        return Json(controller_view(context.core, context.station(name), context.now()))

    @app.post(
        f"{PREFIX}/drives/{{name}}/power-off",
        tags=tags,
        summary="Switch off; nothing happens to a drive that is off",
        responses={200: {"model": Drive}},
    )
    async def power_off(name: str, request: Request) -> Json:
        station = context.station(name)
        context.core.log.record(context.now(), station.configured_name, PowerOffRequested(*who(request)))
        if station.powered:
            station.power_off(context.now())
            context.changed(station)
        return Json(context.view(station))

    @app.post(
        f"{PREFIX}/drives/{{name}}/power-on",
        tags=tags,
        summary="Switch on; nothing happens to a drive that is on",
        responses={200: {"model": Drive}},
    )
    async def power_on(name: str, request: Request) -> Json:
        station = context.station(name)
        context.core.log.record(context.now(), station.configured_name, PowerOnRequested(*who(request)))
        if not station.powered:
            station.power_on(context.now())
            context.changed(station)
        return Json(context.view(station))

    @app.post(
        f"{PREFIX}/drives/{{name}}/power-cycle",
        tags=tags,
        summary="Switch off and on",
        responses={200: {"model": Drive}},
    )
    async def power_cycle(name: str, request: Request) -> Json:
        station = context.station(name)
        context.core.log.record(context.now(), station.configured_name, PowerCycleRequested(*who(request)))
        station.power_cycle(context.now())
        context.changed(station)
        return Json(context.view(station))

    @app.get(
        f"{PREFIX}/drives/{{name}}/params",
        tags=tags,
        summary="A drive's parameters: all, or those with a text in their number, name or unit",
        responses={200: {"model": ParameterList}},
    )
    async def get_parameters(
        name: str,
        text: Annotated[str, Query(max_length=100, description="Text in the number, the name or the unit.")] = "",
        begin: Annotated[int, Query(alias="from", ge=0, description="Skip this many.")] = 0,
        most: Annotated[int, Query(ge=1, le=MOST_PARAMETERS)] = 100,
    ) -> Json:
        station = context.station(name)
        found = _matching(station, text)
        return Json(
            {
                "drive": station.configured_name,
                "count": len(found),
                "parameters": [_described(station, parameter) for parameter in found[begin : begin + most]],
            }
        )

    @app.get(
        f"{PREFIX}/drives/{{name}}/params/{{pnu:path}}",
        tags=tags,
        summary="A parameter by number or by the manual's name, with .SUB for one element of an array",
        responses={200: {"model": ParameterValue}},
    )
    async def get_parameter(name: str, pnu: str) -> Json:
        return Json(_parameter(_powered(context.station(name)), pnu))

    @app.put(
        f"{PREFIX}/drives/{{name}}/params/{{pnu:path}}",
        tags=tags,
        summary="Write a parameter",
        responses={200: {"model": ParameterValue}},
        openapi_extra=body_of(ParameterWrite),
    )
    async def put_parameter(name: str, pnu: str, request: Request) -> Json:
        body = await read_object(request)
        station = _powered(context.station(name))
        wanted = checked(body, ParameterWrite, allowed="value: a whole number", hint='send {"value": a whole number}')
        station.store.set(pnu, wanted.value)
        what = ParameterWritten(*who(request), pnu, wanted.value)
        context.core.log.record(context.now(), station.configured_name, what)
        context.changed(station)
        return Json(_parameter(station, pnu))


def _fault_memory(station: Station) -> list[list[dict[str, Any]]]:
    """The buffer by situation, the newest first."""
    known = station.model.faults
    found = []
    for situation in fault_situations(station.handle.axis):
        numbers = [code & NUMBER_MASK for code in situation]
        found.append(
            [
                {"number": number, "label": fault_label(number), "name": known[number].name if number in known else ""}
                for number in numbers
            ]
        )
    return found


def _matching(station: Station, text: str) -> list[Parameter]:
    wanted = text.casefold().strip()
    numbering = station.model.numbering
    return [
        parameter
        for parameter in station.model.parameters.values()
        if any(
            wanted in one.casefold()
            for one in (*numbering.names(parameter.pnu), str(parameter.pnu), parameter.name, parameter.unit)
        )
    ]


def _described(station: Station, parameter: Parameter) -> dict[str, Any]:
    """For a list: with its value where the drive has its supply and shows one."""
    try:
        value = station.store.read(parameter.pnu, 0)[0] if station.powered else None
    except ParameterError:
        value = None
    return {
        "pnu": parameter.pnu,
        "number": station.model.numbering.name(parameter.pnu) or str(parameter.pnu),
        "name": parameter.name,
        "value": value,
        "elements": parameter.elements,
        "unit": parameter.unit,
        "factor": parameter.standardisation,
        "minimum": parameter.minimum,
        "maximum": parameter.maximum,
        "default": parameter.default,
        "writable": parameter.writable,
        "after_power_on": parameter.after_power_on,
        "source": parameter.source,
        "note": parameter.note,
        "changed": station.store.changed(parameter),
    }


def _powered(station: Station) -> Station:
    if not station.powered:
        raise ParameterError(ParameterErrorNumber.OPERATING_STATE, detail=f"{station.configured_name} is switched off")
    return station


def _parameter(station: Station, wanted: str) -> dict[str, Any]:
    parameter, subindex = station.model.resolve(wanted)
    store = station.store
    values = store.read(parameter.pnu, 0, parameter.elements) if parameter.elements else None
    return {
        "drive": station.configured_name,
        "pnu": parameter.pnu,
        "subindex": subindex,
        "name": parameter.name,
        "value": store.read(parameter.pnu, subindex)[0],
        "values": values,
        "minimum": parameter.minimum,
        "maximum": parameter.maximum,
        "default": parameter.default,
        "unit": parameter.unit,
        "writable": station.model.writable(wanted),
        "changed": store.changed(parameter),
    }
