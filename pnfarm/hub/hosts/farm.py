"""All shards as one farm: clock, readiness, health, doctor, reactions; the hub's own metrics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest

from pnfarm.api.paths.farm import clock_of
from pnfarm.hub.merging import joined_health, joined_readiness
from pnfarm.hub.metrics import HubCollector
from pnfarm.hub.shards import AwayError
from pnfarm.hub.states import ShardState

if TYPE_CHECKING:
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["HubItself"]


class HubItself:
    """As :class:`~pnfarm.api.paths.farm.FarmHost`."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._registry = CollectorRegistry()
        self._registry.register(HubCollector(hub))

    def clock(self) -> dict[str, Any]:
        hub = self._hub
        return clock_of(hub, hub.shards.farm, hub.wall(), hub.log.newest, len(hub.shards.names))

    async def ready(self) -> dict[str, Any]:
        hub = self._hub
        # asked without a token, too: where the shards are and what they have is for those who may read
        if not len(hub.shards):
            raise AwayError("no shard is known yet")
        if away := hub.shards.unreachable:
            raise AwayError(f"{len(hub.shards) - len(away)} of {len(hub.shards)} shards answer; health has the others")
        if conflicts := hub.shards.conflicts():
            raise AwayError(f"{len(conflicts)} drives are claimed by several shards; health has them")
        answers = await hub.ask_all(
            "GET", "readyz", lambda _, answer: (int(answer["cycles"]), float(answer["last_tick_seconds_ago"]))
        )
        if answers.away:
            raise AwayError(f"{len(answers.good)} of {len(hub.shards)} shards are ready; health has the others")
        ready = answers.good.values()
        return {
            "ready": True,
            "cycles": sum(cycles for cycles, _ in ready),
            "last_tick_seconds_ago": max(ago for _, ago in ready),
            "shards": len(ready),
        }

    async def health(self) -> dict[str, Any]:
        hub = self._hub
        answers = await hub.ask_all("GET", "health", _healthy)
        good = answers.good
        worst = max(good, key=lambda shard: float(good[shard].get("engine_late_seconds", 0)), default=None)
        missing = list(hub.missing(answers).values())
        return {
            **joined_health(list(good.values())),
            "worst": "" if worst is None else worst.label,
            "shards": [_shown(hub, shard, good.get(shard)) for shard in hub.shards],
            "conflicts": {name: [shard.label for shard in found] for name, found in hub.shards.conflicts().items()},
            "discovery": dict(hub.discovery),
            "partial": bool(missing) or not len(hub.shards),
            "unreachable": missing,
        }

    async def doctor(self) -> dict[str, Any]:
        found = await self._hub.joined(
            "findings", lambda shard, one: {**one, "name": f"{shard.label}: {one['name']}"}, path="doctor"
        )
        found["findings"] += [
            {
                "name": f"{one['shard']}: answers",
                "ok": False,
                "detail": one["reason"],
                "remedy": "look at its machine",
                "line": 0,
                "keeps_red": False,
            }
            for one in found["unreachable"]
        ]
        return found

    async def reactions(self) -> dict[str, Any]:
        found = await self._hub.joined("reactions", lambda _, one: {**one, "seconds_ago": float(one["seconds_ago"])})
        found["reactions"].sort(key=lambda one: one["seconds_ago"])
        return found

    async def readiness(self) -> dict[str, Any]:
        answers = await self._hub.ask_all("GET", "readiness", _with_readiness)
        partial = self._hub.partial(answers)
        found = joined_readiness(answers.good)
        return {**found, "ready": found["ready"] and not partial["partial"], **partial}

    async def metrics(self) -> tuple[bytes, str]:
        return generate_latest(self._registry), CONTENT_TYPE_LATEST


def _healthy(_: Shard, answer: dict[str, Any]) -> dict[str, Any]:
    joined_health([answer])
    return answer


def _with_readiness(shard: Shard, answer: dict[str, Any]) -> dict[str, Any]:
    joined_readiness({shard: answer})
    return answer


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
