"""The drives of one farm, and their parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import anyio.lowlevel

from pnfarm.drives.description.parts import fault_label
from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.fault_buffer import fault_situations
from pnfarm.farm.views.controller_view import controller_view
from pnfarm.farm.views.snapshot import drive_snapshot, engine_snapshot, injected_kinds, line_snapshot
from pnfarm.farm.views.stations import drive_signals
from pnfarm.table.axis_codes import NUMBER_MASK

if TYPE_CHECKING:
    from pnfarm.api.context import ApiContext
    from pnfarm.api.paths.drives import Power
    from pnfarm.drives.parameters.parameter import Parameter
    from pnfarm.station.axis import Axis
    from pnfarm.station.event import Event

__all__ = ["FarmDrives"]

#: Drives described before the event loop runs again: takes some milliseconds.
DRIVES_AT_ONCE = 64


class FarmDrives:
    """As :class:`~pnfarm.api.paths.drives.DrivesHost` and :class:`~pnfarm.api.paths.drives.DriveHost`."""

    def __init__(self, context: ApiContext) -> None:
        self._context = context

    async def listed(self) -> dict[str, Any]:
        core = self._context.core
        injected = injected_kinds(core.injections)
        drives = []
        for place, station in enumerate(core.axes, start=1):
            drives.append(drive_snapshot(core, station, self._context.now(), injected=injected))
            if place % DRIVES_AT_ONCE == 0:
                await anyio.lowlevel.checkpoint()
        return {
            "farm": core.name,
            "shard": None if core.shard is None else core.shard.as_dict(),
            "standing": None if core.leaseholder is None else core.leaseholder.as_dict(),
            "link": core.link.kind,
            "lines": [line_snapshot(core, name) for name in core.lines],
            "engine": engine_snapshot(core),
            "drives": drives,
        }

    def drive(self, name: str) -> dict[str, Any]:
        station = self._context.axis(name)
        events = [entry.as_dict() for entry in self._context.core.log.entries(station.configured_name)]
        return {**self._context.view(station), "fault_memory": _fault_memory(station), "events": events}

    def controller(self, name: str) -> dict[str, Any]:
        return controller_view(self._context.core, self._context.axis(name), self._context.now())

    def signals(self, name: str) -> dict[str, Any]:
        station = self._context.axis(name)
        return {"drive": station.configured_name, "signals": list(drive_signals(station))}

    def power(self, name: str, what: Power, event: Event) -> dict[str, Any]:
        context = self._context
        station = context.axis(name)
        context.record(event, station.configured_name)
        if what == "cycle":
            station.station.power_cycle(context.now())
        elif not station.station.switch(context.now(), on=what == "on"):
            return context.view(station)
        context.changed(station.station)
        return context.view(station)

    def parameters(self, name: str, text: str, begin: int, most: int) -> dict[str, Any]:
        station = self._context.axis(name)
        found = _matching(station, text)
        shown = [_described(station, parameter) for parameter in found[begin : begin + most]]
        return {"drive": station.configured_name, "count": len(found), "parameters": shown}

    def parameter(self, name: str, pnu: str) -> dict[str, Any]:
        return _parameter(_powered(self._context.axis(name)), pnu)

    def check_powered(self, name: str) -> None:
        _powered(self._context.axis(name))

    def write(self, name: str, pnu: str, value: int, event: Event) -> dict[str, Any]:
        station = self._context.axis(name)
        station.store.set(pnu, value)
        self._context.record(event, station.configured_name)
        self._context.changed(station.station)
        return _parameter(station, pnu)


def _fault_memory(station: Axis) -> list[list[dict[str, Any]]]:
    """The buffer by situation, the newest first."""
    known = station.model.faults
    return [
        [
            {"number": number, "label": fault_label(number), "name": known[number].name if number in known else ""}
            for number in (code & NUMBER_MASK for code in situation)
        ]
        for situation in fault_situations(station.handle.axis)
    ]


def _matching(station: Axis, text: str) -> list[Parameter]:
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


def _described(station: Axis, parameter: Parameter) -> dict[str, Any]:
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


def _powered(station: Axis) -> Axis:
    if not station.powered:
        raise ParameterError(ParameterErrorNumber.OPERATING_STATE, detail=f"{station.configured_name} is switched off")
    return station


def _parameter(station: Axis, wanted: str) -> dict[str, Any]:
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
        "factor": parameter.standardisation,
        "writable": station.model.writable(wanted),
        "changed": store.changed(parameter),
    }
