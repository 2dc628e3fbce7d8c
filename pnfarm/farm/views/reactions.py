"""What controllers did about faults and lost connections, as timelines: plain JSON values, times in seconds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.farm.views.snapshot import bit_labels

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from pnfarm.farm.core import FarmCore
    from pnfarm.farm.views.controller_record import Situation, StartUp
    from pnfarm.faults.injection import Injection
    from pnfarm.station.axis import Axis

__all__ = ["MOST_REACTIONS", "reactions"]

#: In one answer; a drive's record has the last few of each.
MOST_REACTIONS = 200
#: An injection that began this long before a fault may be its cause.
CAUSE_NS = 60_000_000_000


def reactions(core: FarmCore, now: int, most: int = MOST_REACTIONS) -> list[dict[str, Any]]:
    """Of all drives, the newest first: fault situations, and start-ups after a lost connection."""
    found = [one for station in core.axes for one in _of(core, station, now)]
    found.sort(key=lambda one: one["seconds_ago"])
    return found[:most]


def _of(core: FarmCore, station: Axis, now: int) -> Iterator[dict[str, Any]]:
    record = core.controllers.of(station.configured_name)
    for situation in record.situations:
        yield _of_fault(core, station, situation, now)
    for start in record.start_ups:
        if start.lost_ns is not None:
            yield _of_loss(core, station, start, now)


def _of_fault(core: FarmCore, station: Axis, one: Situation, now: int) -> dict[str, Any]:
    labels = bit_labels(station, "STW1")
    steps = [_step("fault", f"fault {one.code}", 0)]
    cause = _cause(core.injections.of_kind(one.kind), station.configured_name, one.begin_ns)
    steps += _of_cause(cause, one.begin_ns)
    for bit, (value, after) in one.bits.items():
        steps.append(_step("control", f"stw1.{labels[bit]} = {value}", after))
    if one.acknowledged_ns is not None:
        steps.append(_step("acknowledged", "fault acknowledged", one.acknowledged_ns))
    fault = next((known for known in station.model.faults.values() if known.label == one.code), None)
    return {
        "drive": station.configured_name,
        "what": "fault",
        "kind": one.kind,
        "code": one.code,
        "name": fault.name if fault is not None else "",
        "seconds_ago": (now - one.begin_ns) / 1e9,
        "reaction_seconds": one.reaction_ns / 1e9 if one.reaction_ns is not None else None,
        "recovered_seconds": one.acknowledged_ns / 1e9 if one.acknowledged_ns is not None else None,
        "steps": sorted(steps, key=lambda step: float(step["seconds"])),
    }


def _of_loss(core: FarmCore, station: Axis, one: StartUp, now: int) -> dict[str, Any]:
    begin = one.lost_ns or 0
    cause = _cause(core.injections.that_hit(station.configured_name), station.configured_name, begin, acted=True)
    steps = [*_of_cause(cause, begin), _step("lost", "connection lost", 0)]
    steps += [_step("start-up", name, when - begin) for name, when in one.phases.items()]
    end = one.phases.get("data")
    return {
        "drive": station.configured_name,
        "what": "connection",
        "kind": cause.kind if cause is not None else "",
        "code": "",
        "name": one.controller,
        "seconds_ago": (now - begin) / 1e9,
        "reaction_seconds": (next(iter(one.phases.values())) - begin) / 1e9 if one.phases else None,
        "recovered_seconds": (end - begin) / 1e9 if end is not None else None,
        "steps": steps,
    }


def _step(what: str, text: str, after_ns: int) -> dict[str, Any]:
    return {"what": what, "text": text, "seconds": after_ns / 1e9}


@dataclass(frozen=True, slots=True)
class _Cause:
    """What was injected, when it began on the drive, and when it first acted there (None: it did not yet)."""

    kind: str
    started_ns: int
    acted_ns: int | None


def _cause(injections: Iterable[Injection], drive: str, begin_ns: int, *, acted: bool = False) -> _Cause | None:
    """The newest injection that may be the cause of what began then; ``acted``: one that had acted by then."""
    found = []
    for injection in injections:
        run = injection.runs.get(drive)
        if run is None or run.started_ns is None or not 0 <= begin_ns - run.started_ns < CAUSE_NS:
            continue
        first = run.evidence().first_ns
        if not acted or (first is not None and first <= begin_ns):
            found.append(_Cause(injection.spec.kind.name, run.started_ns, first))
    return max(found, key=lambda one: one.started_ns, default=None)


def _of_cause(cause: _Cause | None, begin_ns: int) -> list[dict[str, Any]]:
    if cause is None:
        return []
    steps = [_step("injected", f"{cause.kind} injected", cause.started_ns - begin_ns)]
    if cause.acted_ns is not None:
        steps.append(_step("wire", f"{cause.kind} acts on the drive or its frames", cause.acted_ns - begin_ns))
    return steps
