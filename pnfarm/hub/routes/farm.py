"""The hub's paths about the whole: version, clock, readiness, health, doctor, reactions, events, its own metrics."""

from __future__ import annotations

import platform
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import Header, Query
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from starlette.responses import PlainTextResponse, Response, StreamingResponse

from pnfarm.api.answers import Alive
from pnfarm.api.app import EVENT_STREAM
from pnfarm.api.schemas import Clock, Version
from pnfarm.hub.answers import HubFindings, HubHealth, HubReactions, HubReady
from pnfarm.hub.events import event_stream
from pnfarm.hub.merging import joined_health
from pnfarm.hub.metrics import HubCollector
from pnfarm.hub.shards import AwayError
from pnfarm.hub.states import ShardState
from pnfarm.version import __version__
from pnfarm.web.bodies import PREFIX, Json

if TYPE_CHECKING:
    from enum import Enum

    from fastapi import FastAPI

    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["add_hub_farm"]

_HEALTH = (
    "engine", "lateness", "lateness_mean_seconds", "last_seconds", "engine_late_seconds", "loop_late_seconds",
    "stolen_seconds",
)  # fmt: skip


def add_hub_farm(app: FastAPI, hub: Hub) -> None:
    """Handlers of these paths."""
    tags: list[str | Enum] = ["farm"]

    @app.get(f"{PREFIX}/version", tags=tags, summary="Version of the hub", responses={200: {"model": Version}})
    async def version() -> Json:
        return Json({"pnfarm": __version__, "python": platform.python_version(), "api": "v1"})

    @app.get(
        f"{PREFIX}/clock",
        tags=tags,
        summary="The hub's clock, which its seconds are of, and this machine's",
        responses={200: {"model": Clock}},
    )
    async def clock() -> Json:
        return Json(
            {
                "kind": "hub",
                "farm": hub.shards.farm,
                "pnfarm": __version__,
                "instance": hub.instance,
                "farm_seconds": hub.now() / 1e9,
                "wall_seconds": hub.wall(),
                "newest_event": hub.log.newest,
                "drives": len(hub.shards.names),
            }
        )

    @app.get(f"{PREFIX}/healthz", tags=tags, summary="Whether the process runs", responses={200: {"model": Alive}})
    async def healthz() -> Json:
        return Json({"alive": True})

    @app.get(
        f"{PREFIX}/readyz",
        tags=tags,
        summary="Whether every shard answers and is ready, and no drive is claimed twice",
        responses={200: {"model": HubReady}},
    )
    async def readyz() -> Json:
        hub.check_any()
        if away := hub.shards.unreachable:
            more = f" (and {len(away) - 1} more)" if len(away) > 1 else ""
            raise AwayError(f"{len(hub.shards) - len(away)} of {len(hub.shards)} shards answer: {away[0].away()}{more}")
        if conflicts := hub.shards.conflicts():
            name, found = next(iter(conflicts.items()))
            labels = " and ".join(shard.label for shard in found)
            raise AwayError(f"{len(conflicts)} drives are claimed by several shards, such as {name} by {labels}")
        answers = await hub.ask_all(hub.shards.reachable, "GET", "readyz", "cycles", "last_tick_seconds_ago")
        for answer in answers.values():
            if isinstance(answer, AwayError):
                raise answer
        ready = [answer for answer in answers.values() if not isinstance(answer, AwayError)]
        return Json(
            {
                "ready": True,
                "cycles": sum(answer["cycles"] for answer in ready),
                "last_tick_seconds_ago": max(answer["last_tick_seconds_ago"] for answer in ready),
                "shards": len(ready),
            }
        )

    @app.get(
        f"{PREFIX}/health",
        tags=tags,
        summary="State of each shard and of all together: whether it answers, its clock's offset, its own lateness",
        responses={200: {"model": HubHealth}},
    )
    async def health() -> Json:
        answers = await hub.ask_all(hub.shards.reachable, "GET", "health", *_HEALTH)
        good = {shard: answer for shard, answer in answers.items() if not isinstance(answer, AwayError)}
        worst = max(good, key=lambda shard: float(good[shard]["engine_late_seconds"]), default=None)
        missing = [shard.told() for shard in hub.shards if shard not in good]
        return Json(
            {
                **joined_health(list(good.values())),
                "worst": "" if worst is None else worst.label,
                "shards": [_shown(hub, shard, good.get(shard)) for shard in hub.shards],
                "conflicts": {name: [shard.label for shard in found] for name, found in hub.shards.conflicts().items()},
                "discovery": dict(hub.discovery),
                "partial": bool(missing) or not len(hub.shards),
                "unreachable": missing,
            }
        )

    @app.get(
        f"{PREFIX}/doctor",
        tags=tags,
        summary="What `pnfarm doctor` finds on the machine of each shard",
        responses={200: {"model": HubFindings}},
    )
    async def doctor() -> Json:
        answers = await hub.ask_all(hub.shards.reachable, "GET", "doctor", "findings")
        partial = hub.partial(answers)
        found = []
        for shard, answer in answers.items():
            if not isinstance(answer, AwayError):
                found += [{**one, "name": f"{shard.label}: {one['name']}"} for one in answer["findings"]]
        found += [
            {"name": f"{one['shard']}: answers", "ok": False, "detail": one["reason"], "remedy": "look at its machine"}
            for one in partial["unreachable"]
        ]
        return Json({"findings": found, **partial})

    @app.get(
        f"{PREFIX}/reactions",
        tags=tags,
        summary="What controllers did about faults and lost connections, the newest first",
        responses={200: {"model": HubReactions}},
    )
    async def reactions() -> Json:
        answers = await hub.ask_all(hub.shards.reachable, "GET", "reactions", "reactions")
        partial = hub.partial(answers)
        found = [one for a in answers.values() if not isinstance(a, AwayError) for one in a["reactions"]]
        found.sort(key=lambda one: one["seconds_ago"])
        return Json({"reactions": found, **partial})

    @app.get(
        f"{PREFIX}/events",
        tags=tags,
        summary="The event logs of all shards as one; Last-Event-ID resumes, also after a restart of the hub",
        response_class=StreamingResponse,
        responses={200: {"content": {"text/event-stream": {"schema": EVENT_STREAM}}}},
    )
    async def events(
        last_event_id: Annotated[str | None, Header(description="Id of the last entry received.")] = None,
        drive: Annotated[str | None, Query(description="Only entries of this drive.")] = None,
        after: Annotated[
            int | None, Query(ge=0, description="Begin after this sequence number; 0: with the oldest entry kept.")
        ] = None,
        follow: Annotated[bool, Query(description="Keep sending new entries; false: end after the newest.")] = True,
    ) -> Response:
        if drive is not None:
            shard = hub.shards.known(drive)
            drive = (
                drive
                if drive in shard.drives
                else next(name for name, view in shard.drives.items() if view.get("station_name") == drive)
            )
        begin = last_event_id if last_event_id is not None or after is None else str(after)
        stream = event_stream(hub, begin, drive, follow=follow)
        return StreamingResponse(stream, media_type="text/event-stream", headers={"Cache-Control": "no-store"})

    registry = CollectorRegistry()
    registry.register(HubCollector(hub))

    @app.get(
        "/metrics",
        tags=tags,
        summary="The hub's own metrics; Prometheus scrapes the shards for those of drives",
        response_class=PlainTextResponse,
        responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
    )
    async def metrics() -> Response:
        return Response(generate_latest(registry), media_type=CONTENT_TYPE_LATEST)


def _shown(hub: Hub, shard: Shard, health: dict[str, Any] | None) -> dict[str, Any]:
    known = shard.clock.known
    return {
        "shard": shard.label,
        "state": shard.state.value,
        "reason": "" if shard.state is ShardState.UP else shard.reason,
        "since": shard.since_wall or None,
        "farm": str(shard.about.get("farm", "")),
        "pnfarm": str(shard.about.get("pnfarm", "")),
        "instance": shard.instance,
        "drives": len(shard.drives),
        "in_dns": shard.left_ns is None,
        "offset_seconds": shard.clock.offset_ns / 1e9 if known else None,
        "offset_uncertainty_seconds": shard.clock.uncertainty_ns(hub.now()) / 1e9 if known else None,
        "round_trip_seconds": shard.clock.round_trip_ns / 1e9,
        "errors": dict(shard.errors),
        "notes": list(shard.notes),
        "health": health,
    }
