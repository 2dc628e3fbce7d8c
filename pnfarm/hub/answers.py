"""Types of what the hub answers beyond a farm's answers: for its OpenAPI description."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import ConfigDict, Field

from pnfarm.api.answers import Fault, Faults, Traces, TraceView
from pnfarm.api.schemas import Drive, FarmView, Findings, Health, Reactions, Reset, Targets
from pnfarm.web.bodies import Schema

__all__ = [
    "Gone",
    "HubFarmView",
    "HubFault",
    "HubFaults",
    "HubFindings",
    "HubHealth",
    "HubReach",
    "HubReactions",
    "HubReady",
    "HubReset",
    "HubTraces",
]


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


class HubFarmView(FarmView, _Partial):
    model_config = ConfigDict(title="HubFarmView")
    drives: list[HubDrive]  # type: ignore[assignment]  # a list of more


class NotHit(Schema):
    drive: str
    shard: str
    why: str


class HubFault(Fault):
    """A fault on drives of any shards; seconds are those of the hub's clock."""

    unreachable: list[str] = Field(description="Its drives whose shards do not answer: as they were seen last.")
    partial: bool = Field(default=False, description="Only of a new fault: not all of its drives were hit.")
    hit: list[str] = Field(default=[], description="Only of a new fault.")
    not_hit: list[NotHit] = Field(default=[], description="Only of a new fault.")


class HubFaults(Faults, _Partial):
    faults: list[HubFault]  # type: ignore[assignment]


class HubReach(Targets, _Partial):
    pass


class HubReset(Reset, _Partial):
    pass


class HubReactions(Reactions, _Partial):
    pass


class HubFindings(Findings, _Partial):
    pass


class HubTraces(Traces, _Partial):
    traces: list[TraceView]


class ShardView(Schema):
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
    shards: list[ShardView]
    conflicts: dict[str, list[str]] = Field(description="Drives that several shards claim -> these.")
    discovery: dict[str, str] = Field(description="NAME:PORT -> what is wrong with it; empty: nothing.")


class HubReady(Schema):
    ready: bool
    cycles: int
    last_tick_seconds_ago: float
    shards: int
