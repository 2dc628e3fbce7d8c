"""Answers of several shards as one: plain values in, plain values out.

Whoever asks tries it with each shard's answer alone: what can be joined alone can be joined with others.

Seconds of a farm's clock become seconds of the hub's (``to_hub``), so that those of several shards can be compared.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from pnfarm.api.schemas.farm import Engine
from pnfarm.farm.views.readiness import joined_controllers
from pnfarm.faults.effects.evidence import NOTHING, Evidence

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from pnfarm.hub.shards import Shard

__all__ = [
    "at_hub",
    "joined_engine",
    "joined_fault",
    "joined_health",
    "joined_readiness",
    "unreachable_drive",
    "with_fault_ids",
]

#: Faults with one id on two shards are one if they were added within this time of each other, s.
ONE_FAULT_SECONDS = 15.0
_ENGINE = tuple(Engine.model_fields)
#: That of a fault is the first of those that it has on its drives.
_STATES = ("active", "waiting", "ended")


def joined_engine(engines: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Counts of all engines together; of the lateness the largest."""
    found: dict[str, Any] = dict.fromkeys(_ENGINE, 0)
    found["lateness_max_seconds"] = 0.0
    for engine in engines:
        for key in _ENGINE:
            value = engine.get(key, 0)
            found[key] = max(found[key], value) if key == "lateness_max_seconds" else found[key] + value
    return found


def with_fault_ids(shard: Shard, view: Mapping[str, Any]) -> dict[str, Any]:
    """A drive or a device as a shard shows it, with its faults as the hub calls them."""
    found = {**view}
    if "faults_injected" in view:
        found["faults_injected"] = [shard.fault_id(one) for one in view["faults_injected"]]
    if "injected" in view:
        found["injected"] = [{**one, "id": shard.fault_id(one["id"])} for one in view["injected"]]
    return found


def unreachable_drive(last: Mapping[str, Any], why: Mapping[str, Any]) -> dict[str, Any]:
    """A drive whose shard did not answer: what does not move as it was, the rest as of a drive that nobody sees."""
    return {
        **last,
        "state": "unreachable",
        "status": [],
        "connected": False,
        "ar_state": "NO_AR",
        "controller": None,
        "cycle_seconds": None,
        "watchdog_seconds": None,
        "connected_seconds": None,
        "velocity_rpm": 0.0,
        "setpoint_rpm": 0.0,
        "current_amperes": 0.0,
        "torque_newton_metres": 0.0,
        "unreachable": why,
    }


def at_hub(fault: Mapping[str, Any], to_hub: Callable[[float], float]) -> dict[str, Any]:
    """A shard's fault with its times by the hub's clock."""

    def moved(values: Mapping[str, Any], *keys: str) -> dict[str, Any]:
        return {**values, **{key: None if values[key] is None else to_hub(values[key]) for key in keys}}

    def seen(values: Mapping[str, Any]) -> dict[str, Any]:
        return moved(values, "first_seconds", "last_seconds")

    runs = {
        name: {**moved(run, "held_seconds", "started_seconds", "ended_seconds"), "evidence": seen(run["evidence"])}
        for name, run in fault["drives"].items()
    }
    shown = moved(fault, "added_seconds", "expires_seconds")
    return {**shown, "evidence": seen(fault["evidence"]), "drives": runs}


def joined_fault(
    parts: Sequence[tuple[Mapping[str, Any], bool]], spec: Mapping[str, Any] | None, order: Mapping[str, int]
) -> dict[str, Any]:
    """One fault of its parts on the shards: (the part by the hub's clock, whether its shard can be asked).

    ``spec``: as it was asked for, if the hub knows it; else put together.  Of a part whose shard is away, what was
    known last is shown, and ``unreachable`` names its drives: such a fault is not over.
    """
    newest = max(part["added_seconds"] for part, _ in parts)
    of_one = [(part, asked) for part, asked in parts if newest - part["added_seconds"] <= ONE_FAULT_SECONDS]
    first = of_one[0][0]
    runs = {name: run for part, _ in of_one for name, run in part["drives"].items()}
    names = sorted(runs, key=lambda name: (order.get(name, len(order)), name))
    away = [name for part, asked in of_one if not asked for name in part["drives"] if runs[name]["state"] != "ended"]
    seen = [Evidence.from_dict(runs[name]["evidence"]) for name in names]
    total = dataclasses.replace(sum(seen, NOTHING), confirmed=all(one.confirmed for one in seen))
    states = {runs[name]["state"] for name in names}
    expires = [part["expires_seconds"] for part, _ in of_one if part["expires_seconds"] is not None]
    return {
        "id": first["id"],
        "kind": first["kind"],
        "state": min(states, key=_STATES.index),
        "spec": dict(spec) if spec is not None else {**first["spec"], "on": names},
        "added_seconds": min(part["added_seconds"] for part, _ in of_one),
        "expires_seconds": min(expires, default=None),
        "evidence": total.as_dict(),
        "drives": {name: runs[name] for name in names},
        "unreachable": away,
    }


def joined_health(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The health of all farms as of one: counts added up, of times the worst."""
    bounds: dict[float | None, int] = {}
    for part in parts:
        for bucket in part["lateness"]:
            bounds[bucket["up_to_seconds"]] = bounds.get(bucket["up_to_seconds"], 0) + bucket["count"]
    order = sorted(bounds, key=lambda bound: float("inf") if bound is None else float(bound))
    ticks = [sum(bucket["count"] for bucket in part["lateness"]) for part in parts]
    mean = sum(part["lateness_mean_seconds"] * n for part, n in zip(parts, ticks, strict=True)) / max(1, sum(ticks))
    worst = {
        # a farm of an older version has not all of them
        key: max((float(part.get(key, 0.0)) for part in parts), default=0.0)
        for key in ("engine_late_seconds", "loop_late_seconds", "lines_late_seconds", "stolen_seconds")
    }
    return {
        "engine": joined_engine(part["engine"] for part in parts),
        "lateness": [{"up_to_seconds": bound, "count": bounds[bound]} for bound in order],
        "lateness_measured": any(part["lateness_measured"] for part in parts),
        "lateness_mean_seconds": mean,
        "last_seconds": max((float(part["last_seconds"]) for part in parts), default=0.0),
        **worst,
    }


def joined_readiness(answers: Mapping[Shard, Mapping[str, Any]]) -> dict[str, Any]:
    """The readiness of all farms as of one, with times by the hub's clock.

    A name that a controller misses at one shard may be a station of another, and several may see the same search.
    """
    stations: list[dict[str, Any]] = []
    missing: dict[tuple[str, ...], dict[str, Any]] = {}
    for shard, answer in answers.items():
        to_hub, controllers = shard.clock.to_hub, answer["controllers"]

        def whose(number: int, known: Sequence[Mapping[str, Any]] = controllers) -> dict[str, Any]:
            keys = ("bus", "address", "mac", "name")
            return {key: known[number][key] if 0 <= number < len(known) else "" for key in keys}

        for one in answer["stations"]:
            visits = [
                {
                    **visit,
                    "controller": whose(visit["controller"]),
                    "steps": {step: when and to_hub(when) for step, when in visit["steps"].items()},
                }
                for visit in one["visits"]
            ]
            stations.append({**one, "visits": visits, "shard": shard.label})
        for one in answer["missing"]:
            caller = whose(one["controller"])
            entry = {**one, "controller": caller, "since_seconds": to_hub(one["since_seconds"])}
            missing.setdefault((one["bus"], one["name"], caller["address"] or caller["mac"]), entry)
    names = {station["station_name"] for station in stations}
    return joined_controllers(stations, [one for one in missing.values() if one["name"] not in names])
