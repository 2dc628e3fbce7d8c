"""Puts faults in force, ends them, keeps their evidence.

One :class:`FaultManager` serves a farm.  It knows no clock: whoever runs the farm tells it the time and calls
:meth:`~FaultManager.handle_timeout` when :meth:`~FaultManager.next_deadline` says so.  A fault on several drives runs
on each of them by itself, through the states of :data:`TRANSITIONS`:

========  ====================================================================================
WAITING   for its start: a time, healthy cycles, a connection whose cycles are to be counted
ACTIVE    in force
ENDED     everything is as it was; the evidence stays
========  ====================================================================================
"""

from __future__ import annotations

import dataclasses
import heapq
import secrets
from collections import Counter, deque
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.faults.effects_connection import (
    AbortEffect,
    BusyEffect,
    ExpireEffect,
    ReadyEffect,
    RecordDelayEffect,
    RecordErrorEffect,
    RefuseEffect,
    RpcDelayEffect,
)
from pnfarm.buses.profinet.faults.told import DiagnosisEffect, ModuleEffect, StormEffect, UnacknowledgedEffect
from pnfarm.errors import ConfigError
from pnfarm.faults.catalogue import KINDS
from pnfarm.faults.effects_drive import DriveFaultEffect, PowerCycleEffect, WarningEffect
from pnfarm.faults.effects_machine import InputEffect, LimitSwitchEffect, LoadEffect, NotReadyEffect
from pnfarm.faults.frames import Effect, FramesEffect, IopsEffect, LinkEffect, TimeoutEffect, Window
from pnfarm.faults.plan import FaultSpec, matching
from pnfarm.faults.target import NOTHING, Evidence
from pnfarm.faults.words import FaultError, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.faults.gate import GatedLink
    from pnfarm.faults.target import FaultTarget

__all__ = ["ActiveFault", "DriveRun", "FaultEnded", "FaultEvent", "FaultManager", "FaultStarted", "RunState"]

#: Ended faults whose evidence can still be asked for.
KEPT = 1024
#: The longest time between two looks at a fault that waits for a connection or for healthy cycles.
WAIT_NS = 50_000_000

_EFFECTS: Mapping[str, type[Effect]] = {
    "frames": FramesEffect,
    "iops": IopsEffect,
    "timeout": TimeoutEffect,
    "link": LinkEffect,
    "ar-abort": AbortEffect,
    "connect-refuse": RefuseEffect,
    "ready": ReadyEffect,
    "record-error": RecordErrorEffect,
    "parameter-busy": BusyEffect,
    "watchdog-expire": ExpireEffect,
    "rpc-delay": RpcDelayEffect,
    "record-delay": RecordDelayEffect,
    "module": ModuleEffect,
    "alarm-storm": StormEffect,
    "alarm-unacknowledged": UnacknowledgedEffect,
    "diagnosis": DiagnosisEffect,
    "drive-fault": DriveFaultEffect,
    "drive-warning": WarningEffect,
    "limit-switch": LimitSwitchEffect,
    "not-ready": NotReadyEffect,
    "digital-input": InputEffect,
    "load": LoadEffect,
    "power-cycle": PowerCycleEffect,
}


class RunState(StrEnum):
    """Of a fault on one drive."""

    WAITING = "waiting"
    ACTIVE = "active"
    ENDED = "ended"


class _Happening(StrEnum):
    DUE = "due"
    FINISHED = "count"
    EXPIRED = "time"
    CLEARED = "cleared"
    FAILED = "failed"


#: (state, what happened) -> state.  What is not here does not happen.
TRANSITIONS: Mapping[tuple[RunState, _Happening], RunState] = {
    (RunState.WAITING, _Happening.DUE): RunState.ACTIVE,
    (RunState.WAITING, _Happening.CLEARED): RunState.ENDED,
    (RunState.WAITING, _Happening.FAILED): RunState.ENDED,
    (RunState.ACTIVE, _Happening.FAILED): RunState.ENDED,
    (RunState.ACTIVE, _Happening.FINISHED): RunState.ENDED,
    (RunState.ACTIVE, _Happening.EXPIRED): RunState.ENDED,
    (RunState.ACTIVE, _Happening.CLEARED): RunState.ENDED,
}


@dataclass(frozen=True, slots=True)
class FaultStarted:
    """A fault came in force on one drive."""

    id: str
    kind: str
    drive: str
    now: int


@dataclass(frozen=True, slots=True)
class FaultEnded:
    """A fault is over on one drive.  ``reason``: ``count``, ``time``, ``cleared``, or why it failed."""

    id: str
    kind: str
    drive: str
    now: int
    reason: str
    evidence: Evidence


FaultEvent = FaultStarted | FaultEnded


@dataclass(slots=True, eq=False)
class DriveRun:
    """A fault on one drive.  ``stop_ns`` 0 while no end in time is known."""

    drive: str
    target: FaultTarget
    effect: Effect
    not_before: int
    cycles_before: int
    state: RunState = RunState.WAITING
    started_ns: int | None = None
    ended_ns: int | None = None
    stop_ns: int = 0
    reason: str = ""
    key: int = 0

    def evidence(self) -> Evidence:
        return self.effect.evidence() if self.state is not RunState.WAITING else NOTHING


@dataclass(slots=True, eq=False)
class ActiveFault:
    """One fault as it was asked for, with a run for each of its drives."""

    id: str
    spec: FaultSpec
    added_ns: int
    runs: dict[str, DriveRun] = field(default_factory=dict)
    #: Runs that have ended; counted, because each frame of a drive asks whether its faults are over.
    over: int = 0

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
        """Of one drive, or summed up; confirmed in the sum means on every drive."""
        if drive is not None:
            return self.runs[drive].evidence()
        parts = [run.evidence() for run in self.runs.values()]
        total = sum(parts, NOTHING)
        return dataclasses.replace(total, confirmed=all(part.confirmed for part in parts))

    def as_dict(self) -> dict[str, Any]:
        """For JSON; times are seconds of the farm's clock."""
        return {
            "id": self.id,
            "kind": self.spec.kind,
            "state": self.state.value,
            "spec": self.spec.as_dict(),
            "added_seconds": self.added_ns / 1e9,
            "evidence": _evidence_dict(self.evidence()),
            "drives": {
                name: {
                    "state": run.state.value,
                    "reason": run.reason,
                    "started_seconds": _seconds(run.started_ns),
                    "ended_seconds": _seconds(run.ended_ns),
                    "evidence": _evidence_dict(run.evidence()),
                }
                for name, run in self.runs.items()
            },
        }


def _seconds(ns: int | None) -> float | None:
    return None if ns is None else ns / 1e9


def _evidence_dict(seen: Evidence) -> dict[str, Any]:
    return {
        "checks": seen.checks,
        "activations": seen.activations,
        "first_seconds": _seconds(seen.first_ns),
        "last_seconds": _seconds(seen.last_ns),
        "confirmed": seen.confirmed,
    }


class FaultManager:
    """See the module's head.  ``targets``: every drive of the farm by its name; ``gate`` holds frames back."""

    def __init__(self, targets: Mapping[str, FaultTarget], gate: GatedLink) -> None:
        self._targets = targets
        self._gate = gate
        self._faults: dict[str, ActiveFault] = {}
        self._ended: deque[ActiveFault] = deque(maxlen=KEPT)
        self._activations: Counter[tuple[str, str]] = Counter()
        self._by_drive: dict[str, list[tuple[ActiveFault, DriveRun]]] = {}
        self._due: dict[int, tuple[int, ActiveFault, DriveRun]] = {}
        self._heap: list[tuple[int, int]] = []
        self._dirty: dict[str, None] = {}
        self._events: list[FaultEvent] = []
        self._numbers = 0
        self._keys = 0

    # what users ask for

    def add(self, spec: FaultSpec, now: int) -> ActiveFault:
        """Put a fault in force, or let it wait for its start.

        Raises :class:`ConfigError`, with nothing changed on any drive, when no drive is meant, when one of them cannot
        do it, or when its name is taken.
        """
        if spec.seed is None and "seed" in spec.about.takes:
            # kept in the spec, so that the run can be had again
            spec = spec.model_copy(update={"seed": secrets.randbits(53)})
        names = matching(spec.on, {name: (t.names, t.models) for name, t in self._targets.items()})
        fault = ActiveFault(self._new_id(spec.name), spec, now)
        for name in names:
            target = self._targets[name]
            self._keys += 1
            fault.runs[name] = DriveRun(
                name,
                target,
                _EFFECTS[spec.about.effect](spec, target),
                now + spec.after_ns,
                target.cycles(),
                key=self._keys,
            )
        self._faults[fault.id] = fault
        for name, run in fault.runs.items():
            self._by_drive.setdefault(name, []).append((fault, run))
        try:
            for run in fault.runs.values():
                self._advance(fault, run, now)
        except BaseException:
            self._withdraw(fault, now)
            raise
        self._retire(fault)
        return fault

    def clear(self, fault_id: str | None, now: int) -> list[ActiveFault]:
        """End one fault, or with None all of them; what was ended.  Raises :class:`ConfigError` for an unknown id."""
        if fault_id is None:
            chosen = list(self._faults.values())
        else:
            chosen = [self._active(fault_id)]
        for fault in chosen:
            for run in fault.runs.values():
                self._happen(fault, run, _Happening.CLEARED, now)
            self._retire(fault)
        return chosen

    def get(self, fault_id: str) -> ActiveFault:
        """One fault, also one that ended not long ago; raises :class:`ConfigError` for an unknown id."""
        if fault_id in self._faults:
            return self._faults[fault_id]
        for fault in reversed(self._ended):
            if fault.id == fault_id:
                return fault
        return self._active(fault_id)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Every kind that can be put in force."""
        return tuple(KINDS)

    def of_drive(self, name: str) -> list[ActiveFault]:
        """What waits or is in force on one drive."""
        return [fault for fault, _ in self._by_drive.get(name, ())]

    def activations(self) -> dict[tuple[str, str], int]:
        """(kind, drive) -> occurrences since the farm started, also of faults that ended."""
        total = Counter(self._activations)
        for runs in self._by_drive.values():
            for fault, run in runs:
                total[fault.spec.kind, run.drive] += run.evidence().activations
        return dict(total)

    def active(self) -> dict[str, int]:
        """kind -> drives on which it is in force."""
        states = (
            fault.spec.kind for runs in self._by_drive.values() for fault, run in runs if run.state is RunState.ACTIVE
        )
        return dict(Counter(states))

    # what the farm tells

    def refresh(self, name: str, now: int) -> None:
        """A frame is about to be given to this drive, which may have rebooted."""
        if name in self._by_drive:
            self._targets[name].refresh(now)

    def poke(self, name: str, now: int) -> None:
        """Something happened on this drive, and is settled: look at its faults."""
        self.refresh(name, now)
        for fault, run in list(self._by_drive.get(name, ())):
            self._look(fault, run, now)

    def touch(self, name: str) -> None:
        """Something happens on this drive: look at its faults at the next :meth:`handle_timeout`."""
        if name in self._by_drive:
            self._dirty[name] = None

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is wanted."""
        return min((due for due in (self._first_due(), self._gate.next_deadline()) if due is not None), default=None)

    def _first_due(self) -> int | None:
        """When the next fault is to be looked at."""
        while self._heap and self._due.get(self._heap[0][1], (0,))[0] != self._heap[0][0]:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    def handle_timeout(self, now: int) -> None:
        """Let frames go that were held back; look at the drives that were touched, and at every fault that is due."""
        self._gate.handle_timeout(now)
        dirty, self._dirty = self._dirty, {}
        for name in dirty:
            self.poke(name, now)
        while (due := self._first_due()) is not None and due <= now:
            _, key = heapq.heappop(self._heap)
            _, fault, run = self._due.pop(key)
            self._look(fault, run, now)

    def events(self) -> list[FaultEvent]:
        """What started and ended since the last call."""
        drained, self._events = self._events, []
        return drained

    # inside

    def _new_id(self, wanted: str | None) -> str:
        if wanted is None:
            self._numbers += 1
            while f"fault-{self._numbers}" in self._faults:
                self._numbers += 1
            return f"fault-{self._numbers}"
        if wanted in self._faults:
            raise FaultError([("as", f"a fault named {wanted!r} is in force", "another name, or clear it first")])
        return wanted

    def _active(self, fault_id: str) -> ActiveFault:
        fault = self._faults.get(fault_id)
        if fault is None:
            known = f"there are {', '.join(self._faults)}" if self._faults else "none is in force"
            raise ConfigError(f"there is no fault {fault_id!r}{did_you_mean(fault_id, self._faults)}; {known}")
        return fault

    def _look(self, fault: ActiveFault, run: DriveRun, now: int) -> None:
        """As :meth:`_advance`, when nobody is there to be told that it cannot be done."""
        try:
            self._advance(fault, run, now)
        except ConfigError as exc:
            self._happen(fault, run, _Happening.FAILED, now, str(exc))
        self._retire(fault)

    def _advance(self, fault: ActiveFault, run: DriveRun, now: int) -> None:
        """Start, look at, or end one run; note when it is to be looked at again."""
        if run.state is RunState.WAITING:
            window = self._window(fault.spec, run, now)
            if window is not None:
                run.stop_ns = window.stop_ns
                run.effect.begin(window, now)
                self._happen(fault, run, _Happening.DUE, now)
        elif run.state is RunState.ACTIVE:
            run.effect.check(now)
        if run.state is RunState.ACTIVE:
            if run.effect.finished:
                self._happen(fault, run, _Happening.FINISHED, now)
            elif run.stop_ns and now >= run.stop_ns:
                self._happen(fault, run, _Happening.EXPIRED, now)
        self._schedule(fault, run, now)

    def _window(self, spec: FaultSpec, run: DriveRun, now: int) -> Window | None:
        """When the fault is in force, or None as long as its start cannot be told."""
        if now < run.not_before:
            return None
        connection = run.target.connection()
        window = Window()
        if spec.after_cycles:
            if run.effect.counts_frames:
                window.after = spec.after_cycles
            elif connection is None or run.target.cycles() - run.cycles_before < spec.after_cycles:
                return None
        first = now
        if spec.cycles is not None or (window.after and spec.for_ns is not None):
            if connection is None or not connection.established:
                return None
            first = max(now, connection.next_ns) + window.after * connection.cycle_ns
        stops = [first + spec.for_ns] if spec.for_ns is not None else []
        if spec.cycles is not None and connection is not None:
            # half a cycle before the first frame that is healthy again
            stops.append(first + spec.cycles * connection.cycle_ns - connection.cycle_ns // 2)
        window.stop_ns = min(stops, default=0)
        return window

    def _happen(self, fault: ActiveFault, run: DriveRun, happening: _Happening, now: int, why: str = "") -> None:
        """The one place that writes a run's state."""
        following = TRANSITIONS.get((run.state, happening))
        if following is None:
            return
        if following is RunState.ENDED:
            if run.state is RunState.ACTIVE:
                run.effect.end(now)
            run.ended_ns, run.reason = now, why or happening.value
        else:
            run.started_ns = now
        waited = run.state is RunState.WAITING
        run.state = following
        kind = fault.spec.kind
        if following is RunState.ACTIVE:
            self._events.append(FaultStarted(fault.id, kind, run.drive, now))
            return
        seen = NOTHING if waited else run.effect.evidence()
        self._events.append(FaultEnded(fault.id, kind, run.drive, now, run.reason, seen))
        fault.over += 1
        self._activations[kind, run.drive] += seen.activations
        self._forget(run)

    def _forget(self, run: DriveRun) -> None:
        remaining = [entry for entry in self._by_drive[run.drive] if entry[1] is not run]
        if remaining:
            self._by_drive[run.drive] = remaining
        else:
            del self._by_drive[run.drive]
        self._due.pop(run.key, None)

    def _retire(self, fault: ActiveFault) -> None:
        if fault.over == len(fault.runs) and self._faults.pop(fault.id, None) is not None:
            self._ended.append(fault)

    def _withdraw(self, fault: ActiveFault, now: int) -> None:
        """A fault that one of its drives cannot do: undo what the others did."""
        for run in fault.runs.values():
            self._happen(fault, run, _Happening.CLEARED, now)
        del self._faults[fault.id]
        self._events = [event for event in self._events if event.id != fault.id]

    def _schedule(self, fault: ActiveFault, run: DriveRun, now: int) -> None:
        deadlines: Iterable[int | None]
        match run.state:
            case RunState.WAITING:
                deadlines = (run.not_before if now < run.not_before else self._wait_until(fault.spec, run, now),)
            case RunState.ACTIVE:
                deadlines = (run.effect.next_deadline(), run.stop_ns or None)
            case _:
                return
        due = min((d for d in deadlines if d is not None), default=None)
        if due is None:
            self._due.pop(run.key, None)
            return
        # never in the past: what is due now was looked at just now
        due = max(due, now + 1)
        if self._due.get(run.key, (None,))[0] != due:
            heapq.heappush(self._heap, (due, run.key))
        self._due[run.key] = (due, fault, run)

    @staticmethod
    def _wait_until(spec: FaultSpec, run: DriveRun, now: int) -> int:
        """When the healthy cycles may be over, or the connection there."""
        connection = run.target.connection()
        if connection is None or not spec.after_cycles:
            return now + WAIT_NS
        missing = spec.after_cycles - (run.target.cycles() - run.cycles_before)
        return now + max(1, missing) * connection.cycle_ns

    # last, because the name hides the type in the annotations behind it
    def list(self) -> list[ActiveFault]:
        """Faults that wait or are in force, oldest first."""
        return list(self._faults.values())
