"""An injection that was requested, and what it does on each of its drives."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.faults.effects.evidence import NOTHING, Evidence
from pnfarm.faults.run_states import RunState
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Effect
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.plan import InjectionSpec
    from pnfarm.faults.when import ConditionWatch
    from pnfarm.station.splitmix import SplitMix64

__all__ = ["DriveRun", "Injection"]


@dataclass(slots=True, eq=False)
class DriveRun:
    """An injection on one drive.  ``stop_ns`` 0 while no end in time is known."""

    drive: str
    injected: InjectedDrive
    effect: Effect
    not_before: int
    cycles_before: int
    state: RunState = RunState.WAITING
    #: The moment that was set for its start, until it is there; 0: none.
    at_ns: int = 0
    started_ns: int | None = None
    ended_ns: int | None = None
    stop_ns: int = 0
    reason: str = ""
    key: int = 0
    #: With ``when``: what it waits for, and when that held; None while it does not wait for it, or as long as it waits.
    watch: ConditionWatch | None = None
    held_ns: int | None = None
    #: It is being begun or ended; what that sets off on the drive is no reason to look at it again.
    busy: bool = False
    #: With a rate: evidence of the occurrences before the present one, how often it began, when it begins next.
    done: Evidence = NOTHING
    starts: int = 0
    random: SplitMix64 | None = None

    def evidence(self) -> Evidence:
        return self.done if self.state is RunState.WAITING else self.done + self.effect.evidence()

    def waits_for(self, spec: InjectionSpec) -> str:
        """What is still ahead of it, in words; empty for one that does not wait."""
        if self.state is not RunState.WAITING:
            return ""
        if spec.when is not None and self.held_ns is None:
            return spec.when if spec.rate is None or self.watch is not None else f"a random time, then {spec.when}"
        if spec.rate is not None and spec.when is None:
            return "a random time"
        if self.at_ns:
            return "the moment of its start"
        times = [format_duration(spec.after_ns)] if spec.after_ns else []
        cycles = [f"{spec.after_cycles} healthy cycles"] if spec.after_cycles else []
        return " and ".join((*times, *cycles)) or "a connection"


@dataclass(slots=True, eq=False)
class Injection:
    """One injection as requested, with a run for each of its drives."""

    id: str
    spec: InjectionSpec
    added_ns: int
    runs: dict[str, DriveRun] = field(default_factory=dict)
    #: Runs that have ended; counted, because each frame of a drive asks whether its injections are over.
    over: int = 0
    #: When its time to live ends, 0: it has none.
    expires_ns: int = 0

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives that it is on."""
        return tuple(self.runs)

    @property
    def state(self) -> RunState:
        """Active while it is on any drive, ended once it is on all."""
        states = {run.state for run in self.runs.values()}
        return next(state for state in (RunState.ACTIVE, RunState.WAITING, RunState.ENDED) if state in states)

    def evidence(self, drive: str | None = None) -> Evidence:
        """Evidence of one drive, or the sum; confirmed in the sum means on every drive."""
        if drive is not None:
            return self.runs[drive].evidence()
        parts = [run.evidence() for run in self.runs.values()]
        total = sum(parts, NOTHING)
        return dataclasses.replace(total, confirmed=all(part.confirmed for part in parts))

    def as_dict(self) -> dict[str, Any]:
        """For JSON; times are seconds of the farm's clock."""
        return {
            "id": self.id,
            "kind": self.spec.kind.name,
            "state": self.state.value,
            "spec": self.spec.as_dict(),
            "added_seconds": self.added_ns / 1e9,
            "expires_seconds": self.expires_ns / 1e9 if self.expires_ns else None,
            "evidence": self.evidence().as_dict(),
            "drives": {
                name: {
                    "state": run.state.value,
                    "waits_for": run.waits_for(self.spec),
                    "reason": run.reason,
                    "starts": run.starts,
                    "held_seconds": _seconds(run.held_ns),
                    "started_seconds": _seconds(run.started_ns),
                    "ended_seconds": _seconds(run.ended_ns),
                    "evidence": run.evidence().as_dict(),
                }
                for name, run in self.runs.items()
            },
        }


def _seconds(ns: int | None) -> float | None:
    return None if ns is None else ns / 1e9
