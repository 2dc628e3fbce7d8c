"""How OpenAPI describes what the hub answers beyond a farm's answers, and what it does otherwise."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import ConfigDict, Field

from pnfarm.api.paths.farm import Findings, Health, Reactions, Ready
from pnfarm.api.paths.faults import Fault, Faults, Reset, Targets
from pnfarm.api.paths.plant import PlantModelView, PlantView, WireView
from pnfarm.api.paths.states import SavedState, SavedStates
from pnfarm.api.paths.traces import Traces
from pnfarm.api.schemas.device import DeviceRow, DevicesView, StationsView, StationView
from pnfarm.api.schemas.drive import Drive
from pnfarm.api.schemas.farm import FarmView, LineView
from pnfarm.api.schemas.readiness import ReadinessView, StationReadiness
from pnfarm.web.bodies import Schema
from pnfarm.web.paths import Described

__all__ = ["DESCRIBED"]


class Gone(Schema):
    """A shard that did not answer."""

    shard: str = Field(description="HOST:PORT.")
    reason: str
    since: float = Field(description="Seconds since the epoch.")


class _Partial(Schema):
    partial: bool = Field(description="Whether the part of a shard is missing: what is not listed may exist.")
    unreachable: list[Gone] = Field(description="Whose part is missing.")


class HubDrive(Drive):
    """A drive; `state` is `unreachable` where its shard does not answer."""

    unreachable: Gone | None = Field(default=None, description="Only of a drive that is.")
    claimed_by: list[str] = Field(default=[], description="Only of a drive that several shards claim.")


class HubLine(LineView):
    shard: str = Field(default="", description="Only where there are several.")


class HubFarmView(FarmView, _Partial):
    model_config = ConfigDict(title="HubFarmView")
    lines: list[HubLine]  # type: ignore[assignment]  # each of them has its shard besides
    drives: tuple[HubDrive, ...]


class HubState(SavedState):
    shard: str


class HubStates(SavedStates, _Partial):
    states: list[HubState]  # type: ignore[assignment]  # each of them has its shard besides


class HubStation(StationView):
    shard: str


class HubStations(StationsView, _Partial):
    stations: tuple[HubStation, ...]


class HubDevice(DeviceRow):
    shard: str


class HubDevices(DevicesView, _Partial):
    devices: tuple[HubDevice, ...]


class HubPlantModel(PlantModelView):
    shard: str


class HubWire(WireView):
    shard: str


class HubPlant(PlantView, _Partial):
    models: list[HubPlantModel]  # type: ignore[assignment]  # each of them has its shard besides
    wires: list[HubWire]  # type: ignore[assignment]  # each of them has its shard besides


class NotHit(Schema):
    drive: str
    shard: str
    why: str


class HubFault(Fault):
    """A fault on drives and devices of any shards; seconds are those of the hub's clock."""

    unreachable: list[str] = Field(description="Its drives whose shards do not answer: as they were seen last.")
    partial: bool = Field(default=False, description="Only of a new fault: not all of its drives were hit.")
    hit: list[str] = Field(default=[], description="Only of a new fault.")
    not_hit: list[NotHit] = Field(default=[], description="Only of a new fault.")


class HubFaults(Faults, _Partial):
    faults: tuple[HubFault, ...]


class HubReach(Targets, _Partial):
    pass


class HubReset(Reset, _Partial):
    pass


class HubReactions(Reactions, _Partial):
    pass


class HubStationReadiness(StationReadiness):
    shard: str


class HubReadiness(ReadinessView, _Partial):
    stations: tuple[HubStationReadiness, ...]


class HubFindings(Findings, _Partial):
    pass


class HubTraces(Traces, _Partial):
    pass


class HubShard(Schema):
    """A shard as the hub knows it."""

    shard: str
    state: Literal["unknown", "up", "silent", "away"]
    reason: str = Field(description="Why it is not up; empty if it is.")
    since: float | None = Field(description="Since when it is up, or away; seconds since the epoch.")
    farm: str
    pnfarm: str
    instance: str
    drives: int
    in_dns: bool = Field(description="Also true of one that was given by its URL.")
    offset_seconds: float | None = Field(description="Its farm's clock minus the hub's.")
    offset_uncertainty_seconds: float | None
    round_trip_seconds: float
    errors: dict[str, int] = Field(description="Requests that failed, by reason.")
    notes: list[str]
    health: dict[str, Any] | None = Field(description="As the shard itself answers.")


class HubHealth(Health, _Partial):
    worst: str = Field(description="The shard whose engine was latest; empty without one.")
    shards: list[HubShard]
    conflicts: dict[str, list[str]] = Field(description="Drives that several shards claim -> these.")
    discovery: dict[str, str] = Field(description="NAME:PORT -> what is wrong with it; empty: nothing.")


class HubReady(Ready):
    shards: int


def _whole_or_not(model: type[Schema], why: str, status: int = 200) -> dict[int, Any]:
    return {status: model, 207: {"model": model, "description": why}}


_NOT_ALL = _whole_or_not(HubFault, "Not on all shards: see `unreachable`.")
#: By handler; what is not here is as of a farm.
DESCRIBED = {
    "get_drives": Described("All farms as one: every drive, also of shards that do not answer", {200: HubFarmView}),
    "get_stations": Described("Every station of every shard", {200: HubStations}),
    "get_devices": Described("Every device of every shard", {200: HubDevices}),
    "get_plant": Described("The plants of all farms", {200: HubPlant}),
    "get_faults": Described("Pending and active faults on all shards, with their evidence", {200: HubFaults}),
    "post_fault": Described(
        "Inject a fault into drives and devices of any shards at one moment; with dry_run only list them",
        {
            **_whole_or_not(HubFault, "Some shards did not answer: `hit` and `not_hit` have the drives.", 201),
            200: HubReach,
        },
    ),
    "get_fault": Described("", {200: HubFault}),
    "renew_fault": Described("", _NOT_ALL),
    "delete_fault": Described("End a fault on all shards and return its final evidence", _NOT_ALL),
    "reset": Described(
        "End every injected fault on every shard",
        _whole_or_not(HubReset, "Shards did not answer: their faults may be in force."),
    ),
    "get_states": Described(
        "Every saved state of every shard; a state is complete with the part of each", {200: HubStates}
    ),
    "put_state": Described("Save the state of every shard under this name"),
    "post_restore": Described("Put every shard into a saved state, after each has reported that it can"),
    "delete_state": Described("Delete a saved state of every shard"),
    "get_traces": Described("Every trace of every shard and its progress, without samples", {200: HubTraces}),
    "post_trace": Described("Start a trace, of drives and devices of one shard"),
    "version": Described("Version of the hub"),
    "clock": Described("The hub's clock, which its seconds are of, and this machine's"),
    "readyz": Described("Whether every shard answers and is ready, and no drive is claimed twice", {200: HubReady}),
    "get_health": Described(
        "State of each shard and of all together: whether it answers, its clock's offset, its own lateness",
        {200: HubHealth},
    ),
    "get_doctor": Described("What `pnfarm doctor` finds on the machine of each shard", {200: HubFindings}),
    "get_reactions": Described("", {200: HubReactions}),
    "get_readiness": Described("", {200: HubReadiness}),
    "events": Described("The event logs of all shards as one; Last-Event-ID resumes, also after a restart of the hub"),
    "metrics": Described("The hub's own metrics; Prometheus scrapes the shards for those of drives"),
}
