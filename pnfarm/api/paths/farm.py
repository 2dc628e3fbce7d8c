"""Paths about the whole: version, clock, readiness, health, doctor, reactions, metrics."""

from __future__ import annotations

import platform
from typing import TYPE_CHECKING, Any, Literal, Protocol

from pydantic import Field
from starlette.responses import PlainTextResponse, Response

from pnfarm.api.schemas.farm import Engine  # noqa: TC001 - pydantic reads the annotations of fields
from pnfarm.api.schemas.readiness import ReadinessView
from pnfarm.version import __version__
from pnfarm.web.bodies import Json, Schema
from pnfarm.web.paths import text

if TYPE_CHECKING:
    from pnfarm.api.paths.host import Host
    from pnfarm.web.paths import Paths

__all__ = ["FarmHost", "Findings", "Health", "Reactions", "Ready", "add_farm", "clock_of"]


class LatenessBucket(Schema):
    up_to_seconds: float | None = Field(description="Null: beyond all of them.")
    count: int = Field(description="Ticks.")


class Health(Schema):
    """How late the farm itself is."""

    engine: Engine
    lateness: list[LatenessBucket] = Field(description="Of the engine's ticks, since the start.")
    lateness_measured: bool = Field(description="False on a memory link, where no tick can be late.")
    lateness_mean_seconds: float
    last_seconds: float = Field(description="How far back the following look.")
    engine_late_seconds: float = Field(description="Sum over late ticks.")
    loop_late_seconds: float = Field(description="Longest delay of the event loop.")
    lines_late_seconds: float = Field(description="Longest time for which the kernel kept an octet of a serial line.")
    stolen_seconds: float = Field(description="Time in which the engine's thread was ready and got no CPU.")


class Finding(Schema):
    """As `pnfarm doctor` has it."""

    name: str
    ok: bool | None = Field(description="Null: works, but not at its best, or unknown.")
    detail: str
    remedy: str
    line: int = Field(description="Of the farm file; 0 for none.")
    keeps_red: bool = Field(description="The farm runs, but its PLC does not get green.")


class Findings(Schema):
    findings: list[Finding]


class ReactionStep(Schema):
    what: Literal["injected", "wire", "fault", "control", "acknowledged", "lost", "start-up"]
    text: str
    seconds: float = Field(description="After the fault, or after the loss of the connection.")


class Timeline(Schema):
    """What a controller did about a fault, or about a lost connection."""

    drive: str
    what: Literal["fault", "connection"]
    kind: str = Field(description="What was injected; none where nothing was.")
    code: str = Field(description="The fault's number as the manual writes it; empty for a connection.")
    name: str = Field(description="Of the fault, or of the controller.")
    seconds_ago: float
    reaction_seconds: float | None = Field(description="Until the enable was withdrawn, or a start-up began.")
    recovered_seconds: float | None = Field(description="Until it was acknowledged, or data flowed again.")
    steps: list[ReactionStep]


class Reactions(Schema):
    reactions: list[Timeline]


class Clock(Schema):
    kind: Literal["farm", "hub"]
    farm: str
    pnfarm: str = Field(description="Version.")
    instance: str = Field(description="Another one in each run: then event numbers and the farm's clock restart.")
    farm_seconds: float = Field(description="The farm's clock.")
    wall_seconds: float = Field(description="Seconds since the epoch, by this machine's clock.")
    newest_event: int = Field(description="Sequence number of the newest entry of the event log.")
    drives: int


class Version(Schema):
    pnfarm: str
    python: str
    api: str


class Alive(Schema):
    alive: bool = Field(description="Always true: the process answers.")


class Ready(Schema):
    ready: bool
    cycles: int
    last_tick_seconds_ago: float


class FarmHost(Protocol):
    """Who knows about the whole: as the types of the answers say it."""

    def clock(self) -> dict[str, Any]: ...

    async def ready(self) -> dict[str, Any]:
        """Raises :class:`~pnfarm.errors.EnvironmentError_` for one that is not."""

    async def health(self) -> dict[str, Any]: ...

    async def doctor(self) -> dict[str, Any]: ...

    async def reactions(self) -> dict[str, Any]: ...

    async def readiness(self) -> dict[str, Any]: ...

    async def metrics(self) -> tuple[bytes, str]:
        """Octets and their type."""


def clock_of(host: Host, farm: str, wall: float, newest: int, drives: int) -> dict[str, Any]:
    """A :class:`Clock`; ``wall`` is seconds since the epoch, ``newest`` the number of the log's newest entry."""
    return {
        "kind": host.kind,
        "farm": farm,
        "pnfarm": __version__,
        "instance": host.instance,
        "farm_seconds": host.now() / 1e9,
        "wall_seconds": wall,
        "newest_event": newest,
        "drives": drives,
    }


def add_farm(path: Paths, farm: FarmHost) -> None:
    """Declare them."""

    @path("GET health", Health)
    async def get_health() -> Json:
        """The farm's own lateness: of the engine, of its event loop, and stolen from it."""
        return Json(await farm.health())

    @path("GET doctor", Findings)
    async def get_doctor() -> Json:
        """What `pnfarm doctor` finds on the farm's machine, not older than a minute."""
        return Json(await farm.doctor())

    @path("GET reactions", Reactions)
    async def get_reactions() -> Json:
        """What controllers did about faults and lost connections, the newest first."""
        return Json(await farm.reactions())

    @path("GET readiness", ReadinessView)
    async def get_readiness() -> Json:
        """What each controller found, configured and refused, with the line of the farm file to change."""
        return Json(await farm.readiness())

    @path("GET version", Version)
    async def version() -> Response:
        """Versions of pnfarm, Python and the API."""
        return Json({"pnfarm": __version__, "python": platform.python_version(), "api": "v1"})

    @path("GET clock", Clock)
    async def clock() -> Response:
        """The farm's clock and this machine's, and which run of which farm this is."""
        return Json(farm.clock())

    @path("GET healthz", Alive)
    async def healthz() -> Response:
        """Whether the process runs."""
        return Json({"alive": True})

    @path("GET readyz", Ready)
    async def readyz() -> Response:
        """Whether the engine ticks."""
        return Json(await farm.ready())

    @path("GET metrics", text("text/plain"), outside=True, response_class=PlainTextResponse)
    async def metrics() -> Response:
        """Metrics in Prometheus's text format."""
        octets, media_type = await farm.metrics()
        return Response(octets, media_type=media_type)
