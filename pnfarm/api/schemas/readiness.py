"""The type of what controllers found, configured and refused."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pnfarm.web.bodies import Schema

__all__ = ["MissingStation", "ReadinessView", "StationReadiness"]


class _InFile(Schema):
    file: str = Field(description="The farm file; empty where nothing in it would help.")
    line: int = Field(description="The line of `key`, or of the nearest key above it that the file has; 0 without one.")
    key: str = Field(description="What to change, such as `devices[1].slots.3`.")


class RefusalView(_InFile):
    text: str = Field(description="What the controller expects, and what is there.")
    place: str = Field(description="slot, or slot.subslot; empty where it is about the whole station.")
    works: bool = Field(description="Accepted nevertheless, such as a substitute.")
    count: int = Field(description="How often, in attempts that came to the same.")


class Steps(Schema):
    """When each was made that holds now, in seconds of the farm's clock; what is not made is left out."""

    searched: float | None = Field(
        default=None, description="DCP Identify for its name; ListIdentity or a session; FDL status or diagnosis."
    )
    named: float | None = Field(default=None, description="DCP set its name.")
    addressed: float | None = Field(default=None, description="DCP set its address, or Set_Slave_Add.")
    connected: float | None = Field(default=None, description="Connect, Forward_Open or Set_Prm was accepted.")
    parameters: float | None = Field(default=None, description="The parameters were written.")
    ready: float | None = Field(default=None, description="ApplicationReady was confirmed; PROFINET.")
    data: float | None = Field(default=None, description="Data are exchanged.")


class Visit(Schema):
    controller: int = Field(description="Place in `controllers`.")
    state: Literal["found", "refused", "starting", "data", "ended"]
    steps: Steps
    cycle_seconds: float | None = Field(description="Of an open connection, where its bus agrees one.")
    watchdog_seconds: float | None
    ended: str = Field(description="How its last connection ended; empty while one exists.")
    refusals: list[RefusalView]
    refusals_left_out: int = Field(description="Refusals beyond those that are kept.")


class StationReadiness(_InFile):
    name: str = Field(description="Name in the farm file.")
    station_name: str
    kind: Literal["drive", "device"]
    axes: list[str] = Field(description="Names of its axes.")
    bus: str
    state: Literal["ready", "partly", "refused", "starting", "ended", "found", "unseen", "off"] = Field(
        description="partly: data are exchanged, and something is refused; found: it was searched for, and not "
        "configured; unseen: no controller asked for it."
    )
    visits: list[Visit] = Field(description="What each controller did with it since it was powered on.")


class ControllerSeen(Schema):
    bus: str
    address: str = Field(description="IPv4 address, or address on the line; empty where only DCP was seen.")
    mac: str
    name: str = Field(description="Name of station, or vendor and serial number of an originator.")
    exchanging: int = Field(description="Stations with which it exchanges data.")
    refused: int = Field(description="Stations that refuse something of it.")
    stations: int = Field(description="Stations that it found.")


class MissingStation(_InFile):
    name: str = Field(description="A name of station, or an address.")
    bus: str
    controller: int = Field(description="Place in `controllers`; -1 of one that is not listed.")
    since_seconds: float = Field(description="First asked for, by the farm's clock.")
    nearest: str = Field(description="A station of the farm file with a similar name; empty without one.")
    text: str


class ReadinessView(Schema):
    ready: bool = Field(description="Every station exchanges data, and nothing is refused.")
    controllers: list[ControllerSeen]
    stations: tuple[StationReadiness, ...] = Field(description="In the order of the file.")
    missing: list[MissingStation] = Field(
        description="Names and addresses that were requested within the last minute and that no station has."
    )
