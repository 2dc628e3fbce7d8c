"""Paths of drives: the list of all; one, with its controller, its power and its parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol

from fastapi import Query, Request
from pydantic import Field

from pnfarm.api.changes import ParameterWritten, PowerCycleRequested, PowerOffRequested, PowerOnRequested, who
from pnfarm.api.schemas.controller import ControllerView
from pnfarm.api.schemas.drive import Drive
from pnfarm.api.schemas.farm import FarmView
from pnfarm.web.bodies import Json, Schema, body_of, checked, read_object
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from pnfarm.station.event import Event
    from pnfarm.web.paths import Paths

__all__ = ["DriveHost", "DriveSignals", "DrivesHost", "ParameterValue", "Power", "add_drive", "add_drives"]

#: Parameters in one answer.
MOST_PARAMETERS = 500
Power = Literal["off", "on", "cycle"]


class ParameterWrite(Schema):
    """A parameter's new value."""

    value: int = Field(description="Raw value as on the wire.")


class ParameterValue(Schema):
    """A parameter of one drive; numbers are raw, as on the wire."""

    drive: str
    pnu: int
    subindex: int
    name: str
    value: int
    values: list[int] | None = Field(description="All elements of an array.")
    minimum: int
    maximum: int
    default: int
    unit: str
    factor: float = Field(description="Times the raw number is the value in the unit.")
    writable: bool
    changed: bool = Field(description="Whether the value differs from the model's default.")


class ListedParameter(Schema):
    """A parameter in a list; numbers are raw, as on the wire."""

    pnu: int
    number: str = Field(description="As the maker writes it.")
    name: str
    value: int | None = Field(description="Of an array, the first element; null where none can be read.")
    elements: int = Field(description="0 unless it is an array.")
    unit: str
    factor: float = Field(description="Times the raw number is the value in the unit.")
    minimum: int
    maximum: int
    default: int
    writable: bool
    after_power_on: bool = Field(description="A write takes effect with the next power cycle.")
    source: str = Field(description="Where the manual has it, or why it is assumed.")
    note: str
    changed: bool = Field(description="Whether the value differs from the model's default.")


class ParameterList(Schema):
    drive: str
    count: int = Field(description="How many there are in all that match.")
    parameters: list[ListedParameter]


class DriveSignalView(Schema):
    """A value of a drive under the name that conditions have for it."""

    name: str
    type: Literal["number", "bit", "state", "fault", "word"]
    unit: str
    value: bool | int | float | str
    shown: str
    doc: str


class DriveSignals(Schema):
    drive: str
    signals: list[DriveSignalView]


class DrivesHost(Protocol):
    """Who has the drives."""

    async def listed(self) -> dict[str, Any]:
        """The farm, its engine and all drives."""


class DriveHost(Protocol):
    """Who answers for one drive: the farm that has it.

    All raise :class:`~pnfarm.web.errors.NotFoundError` for an unknown name.
    """

    def drive(self, name: str) -> dict[str, Any]: ...

    def controller(self, name: str) -> dict[str, Any]: ...

    def signals(self, name: str) -> dict[str, Any]: ...

    def power(self, name: str, what: Power, event: Event) -> dict[str, Any]:
        """Log ``event`` and switch; the drive as it is then."""

    def parameters(self, name: str, text: str, begin: int, most: int) -> dict[str, Any]: ...

    def parameter(self, name: str, pnu: str) -> dict[str, Any]:
        """Raises :class:`~pnfarm.drives.parameters.parameter.ParameterError`."""

    def check_powered(self, name: str) -> None:
        """Raises :class:`~pnfarm.drives.parameters.parameter.ParameterError` for one that is switched off."""

    def write(self, name: str, pnu: str, value: int, event: Event) -> dict[str, Any]:
        """As :meth:`parameter`, of a parameter that is written before; logs ``event``."""


def add_drives(path: Paths, drives: DrivesHost) -> None:
    """Declare the list."""

    @path("GET drives", FarmView)
    async def get_drives() -> Json:
        """The farm, its engine and all drives."""
        return Json(await drives.listed())


def add_drive(path: Paths, drives: DriveHost) -> None:
    """Declare what is below one drive."""

    @path("GET drives/{name}", Drive)
    async def get_drive(name: str) -> Json:
        """One drive."""
        return Json(drives.drive(name))

    @path("GET drives/{name}/controller", ControllerView)
    async def get_controller(name: str) -> Json:
        """What the drive's controller did, seen from the drive."""
        return Json(drives.controller(name))

    @path("GET drives/{name}/signals", DriveSignals)
    async def get_drive_signals(name: str) -> Json:
        """What a drive's signals are now, by the names of conditions."""
        return Json(drives.signals(name))

    @path("POST drives/{name}/power-off", Drive, role=Role.INJECT)
    async def power_off(name: str, request: Request) -> Json:
        """Switch off; nothing happens to a drive that is off."""
        return Json(drives.power(name, "off", PowerOffRequested(*who(request))))

    @path("POST drives/{name}/power-on", Drive, role=Role.INJECT)
    async def power_on(name: str, request: Request) -> Json:
        """Switch on; nothing happens to a drive that is on."""
        return Json(drives.power(name, "on", PowerOnRequested(*who(request))))

    @path("POST drives/{name}/power-cycle", Drive, role=Role.INJECT)
    async def power_cycle(name: str, request: Request) -> Json:
        """Switch off and on."""
        return Json(drives.power(name, "cycle", PowerCycleRequested(*who(request))))

    @path("GET drives/{name}/params", ParameterList)
    async def get_parameters(
        name: str,
        text: Annotated[str, Query(max_length=100, description="Text in the number, the name or the unit.")] = "",
        begin: Annotated[int, Query(alias="from", ge=0, description="Skip this many.")] = 0,
        most: Annotated[int, Query(ge=1, le=MOST_PARAMETERS)] = 100,
    ) -> Json:
        """A drive's parameters: all, or those with a text in their number, name or unit."""
        return Json(drives.parameters(name, text, begin, most))

    @path("GET drives/{name}/params/{pnu:path}", ParameterValue)
    async def get_parameter(name: str, pnu: str) -> Json:
        """A parameter by number or by the manual's name, with .SUB for one element of an array."""
        return Json(drives.parameter(name, pnu))

    @path("PUT drives/{name}/params/{pnu:path}", ParameterValue, body=body_of(ParameterWrite), role=Role.INJECT)
    async def put_parameter(name: str, pnu: str, request: Request) -> Json:
        """Write a parameter."""
        body = await read_object(request)
        drives.check_powered(name)
        wanted = checked(body, ParameterWrite, allowed="value: a whole number", hint='send {"value": a whole number}')
        return Json(drives.write(name, pnu, wanted.value, ParameterWritten(*who(request), pnu, wanted.value)))
