"""The types of stations, of devices and of their signals."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from pnfarm.api.schemas.drive import Controller  # noqa: TC001 - pydantic reads the annotations of fields
from pnfarm.web.bodies import Schema

__all__ = [
    "ChangedSignals",
    "DeviceRow",
    "DeviceView",
    "DevicesView",
    "SignalsAnswer",
    "SignalsValues",
    "StationView",
    "StationsView",
]


class StationView(Schema):
    """One node on a bus: a drive has axes, a device has none."""

    name: str = Field(description="Name in the farm file.")
    station_name: str = Field(description="Present name of station; DCP may have changed it.")
    kind: Literal["drive", "device"]
    bus: str
    model: str | None = Field(description="Of a drive.")
    models: list[str] = Field(description="What `model:NAME` means it by.")
    description: str | None = Field(description="What its maker's file calls it.")
    axes: list[str] = Field(description="Names of its axes.")
    mac: str
    ip: str | None = Field(description="Address and prefix length.")
    station_address: int | None = Field(description="Address on a serial line; null on a network.")
    powered: bool
    connected: bool = Field(description="A connection exchanges cyclic data.")


class StationsView(Schema):
    stations: tuple[StationView, ...]


class SubmoduleView(Schema):
    subslot: int
    ident: int
    name: str
    input_octets: int = Field(description="Octets that go to the controller.")
    output_octets: int = Field(description="Octets that come from the controller.")
    safety: bool = Field(description="It needs a safety protocol, which the farm does not run.")


class ModuleView(Schema):
    slot: int
    ident: int
    name: str
    submodules: list[SubmoduleView]


class DeviceConnection(Schema):
    state: str = Field(description="In its bus's words; NO_AR without one.")
    controller: Controller | None
    cycle_seconds: float | None
    watchdog_seconds: float | None = Field(description="Data hold time of the controller's data.")
    connected_seconds: float | None


class InjectedFault(Schema):
    id: str
    kind: str


class DeviceRow(StationView):
    connection: DeviceConnection
    inputs: int = Field(description="Signals that go to the controller.")
    outputs: int = Field(description="Signals that come from the controller.")
    injected: list[InjectedFault] = Field(description="Faults that wait or are in force.")


class DevicesView(Schema):
    devices: tuple[DeviceRow, ...]


class SignalState(Schema):
    name: str
    value: bool | int | float | str = Field(description="In its unit; octets are hexadecimal.")
    shown: str = Field(description="The same as text, as a write takes it.")
    good: bool = Field(description="Whether the provider status of its data is GOOD.")
    owner: Literal["controller", "fault", "force", "plant", "value", "default"] = Field(
        description="Whose value it is: an output is the controller's; of an input the strongest of a fault, a user's "
        "force, and a value of a program or of this API; default: it was never written."
    )
    forced: bool | int | float | str | None = Field(
        description="The value of a user's force, which a fault may overrule; null without one."
    )


class SignalView(SignalState):
    direction: Literal["input", "output"] = Field(description="The controller's: an input goes to it.")
    type: str = Field(description="bool, int16, float32, octets[4] ...")
    unit: str
    scale: float = Field(description="In units, of one step of the raw number.")
    place: str = Field(description="slot.subslot.octet, and .bit of a bit.")


class DeviceView(DeviceRow):
    identity: dict[str, int | str] = Field(description="What its bus identifies it by, and its order number.")
    access_point: str
    modules: list[ModuleView]
    details: dict[str, Any] = Field(description="What only stations on its bus have.")
    signals: list[SignalView] = Field(description="In the order of the file.")


class SignalsValues(Schema):
    device: str
    revision: int = Field(description="Counts the changes of values that were seen.")
    signals: list[SignalView] = Field(description="In the order of the file; those of one direction are of one time.")


class SignalsAnswer(SignalsValues):
    overruled: dict[str, Literal["fault", "force"]] = Field(
        description="Signals of the request that a stronger owner has now; the written value takes effect after that."
    )


class ChangedSignals(Schema):
    """A message ``values`` of ``GET live``; a long one comes as several, of one revision."""

    device: str
    revision: int = Field(description="As of `GET devices/NAME/signals`.")
    tag: str = Field(description="The ETag of that state, for If-Match.")
    signals: list[SignalState] = Field(description="Those that changed since the message before; at first all.")
