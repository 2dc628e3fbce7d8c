"""Puts injections in force, ends them, keeps their evidence.

One :class:`InjectionManager` serves a farm.  It knows no clock: the farm's runtime passes the time and calls
:meth:`~InjectionManager.handle_timeout` at :meth:`~InjectionManager.next_deadline`.  An injection on several
drives runs on each of them independently, through the states of :data:`TRANSITIONS`:

========  ====================================================================================
WAITING   for its start: a time, healthy cycles, a connection whose cycles are to be counted
ACTIVE    in force
ENDED     everything is as it was; the evidence stays
========  ====================================================================================
"""

from __future__ import annotations

import dataclasses
import heapq
import math
import secrets
from collections import Counter, deque
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.errors import ConfigError
from pnfarm.faults.connection import CONNECTION
from pnfarm.faults.effect import Window, seed_of
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.events import InjectionBegan, InjectionEnded
from pnfarm.faults.evidence import NOTHING, Evidence
from pnfarm.faults.reach import check_parts, chosen, reach_of
from pnfarm.station.splitmix import SplitMix64
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pnfarm.faults.catalogue import Catalogue
    from pnfarm.faults.connection import Connection
    from pnfarm.faults.effect import Effect
    from pnfarm.faults.parts import InjectedDrive
    from pnfarm.faults.plan import InjectionSpec
    from pnfarm.faults.reach import Reach

__all__ = [
    "DriveRun",
    "Injection",
    "InjectionManager",
    "RunState",
]

#: Number of ended injections whose evidence is kept.
KEPT = 1024
#: Longest interval between two checks of an injection that waits for a connection or for healthy cycles.
WAIT_NS = 50_000_000


class RunState(StrEnum):
    """State of an injection on one drive."""

    WAITING = "waiting"
    ACTIVE = "active"
    ENDED = "ended"


class _RunEvent(StrEnum):
    DUE = "due"
    FINISHED = "count"
    EXPIRED = "time"
    CLEARED = "cleared"
    LAPSED = "ttl"
    AGAIN = "again"
    FAILED = "failed"


#: (state, what happened) -> state.  Other transitions do not occur.
TRANSITIONS: Mapping[tuple[RunState, _RunEvent], RunState] = {
    (RunState.WAITING, _RunEvent.DUE): RunState.ACTIVE,
    (RunState.WAITING, _RunEvent.CLEARED): RunState.ENDED,
    (RunState.WAITING, _RunEvent.FAILED): RunState.ENDED,
    (RunState.ACTIVE, _RunEvent.FAILED): RunState.ENDED,
    (RunState.ACTIVE, _RunEvent.FINISHED): RunState.ENDED,
    (RunState.ACTIVE, _RunEvent.EXPIRED): RunState.ENDED,
    (RunState.ACTIVE, _RunEvent.CLEARED): RunState.ENDED,
    (RunState.WAITING, _RunEvent.LAPSED): RunState.ENDED,
    (RunState.ACTIVE, _RunEvent.LAPSED): RunState.ENDED,
    # with a rate, until `times` are over
    (RunState.ACTIVE, _RunEvent.AGAIN): RunState.WAITING,
}


class Timed(Protocol):
    """What injections left to be done at a time: frames to release, addresses to restore."""

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""
        ...

    def handle_timeout(self, now: int) -> None:
        """Do what is due."""
        ...


@dataclass(frozen=True, slots=True)
class Happened:
    """What happened to an injection on one drive."""

    now: int
    drive: str
    event: InjectionBegan | InjectionEnded


@dataclass(slots=True, eq=False)
class DriveRun:
    """An injection on one drive.  ``stop_ns`` 0 while no end in time is known."""

    drive: str
    injected: InjectedDrive
    effect: Effect
    not_before: int
    cycles_before: int
    state: RunState = RunState.WAITING
    started_ns: int | None = None
    ended_ns: int | None = None
    stop_ns: int = 0
    reason: str = ""
    key: int = 0
    #: With a rate: evidence of the occurrences before the present one, how often it began, when it begins next.
    done: Evidence = NOTHING
    starts: int = 0
    random: SplitMix64 | None = None

    def evidence(self) -> Evidence:
        return self.done if self.state is RunState.WAITING else self.done + self.effect.evidence()


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
            "evidence": _evidence_dict(self.evidence()),
            "drives": {
                name: {
                    "state": run.state.value,
                    "reason": run.reason,
                    "starts": run.starts,
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
        "confirmation": seen.confirmation.value,
        "reason": seen.reason,
    }


class InjectionManager:
    """See the module's

    docstring. ``catalogue`` has the kinds; ``drives`` are the farm's drives by name; ``timed`` is called before them.
    """

    def __init__(self, catalogue: Catalogue, drives: Mapping[str, InjectedDrive], timed: Iterable[Timed]) -> None:
        self.catalogue = catalogue
        self._drives = drives
        self._timed = tuple(timed)
        self._injections: dict[str, Injection] = {}
        self._ended: deque[Injection] = deque(maxlen=KEPT)
        self._activations: Counter[tuple[str, str]] = Counter()
        self._by_drive: dict[str, list[tuple[Injection, DriveRun]]] = {}
        self._due: dict[int, tuple[int, Injection, DriveRun]] = {}
        self._heap: list[tuple[int, int]] = []
        self._dirty: dict[str, None] = {}
        self._events: list[Happened] = []
        self._numbers = 0
        self._keys = 0

    # requests of users

    def inject(self, fields: Mapping[str, Any], now: int) -> Injection:
        """:meth:`add` from plain values, as in a scenario's ``fault:`` step."""
        return self.add(self.catalogue.parse(fields), now)

    def add(self, spec: InjectionSpec, now: int) -> Injection:
        """Put an injection in force, or let it wait for its start.

        Raises :class:`ConfigError`, with nothing changed on any drive, when no drive matches, when one of them cannot
        do it, or when its name is taken.
        """
        spec = _seeded(spec)
        names, _ = chosen(spec, self._drives)
        for name in names:
            check_parts(self._drives[name], spec)
        injection = Injection(self._new_id(spec.name), spec, now)
        if spec.ttl_ns is not None:
            injection.expires_ns = now + spec.ttl_ns
        for name in names:
            drive = self._drives[name]
            self._keys += 1
            injection.runs[name] = DriveRun(
                name, drive, spec.kind.effect(spec, drive), now + spec.after_ns, _cycles(drive), key=self._keys
            )
            if spec.rate is not None:
                injection.runs[name].random = SplitMix64(seed_of(spec, f"rate of {name}"))
                injection.runs[name].not_before += _pause(spec, injection.runs[name])
        self._injections[injection.id] = injection
        for name, run in injection.runs.items():
            self._by_drive.setdefault(name, []).append((injection, run))
        try:
            for run in injection.runs.values():
                self._advance(injection, run, now)
        except BaseException:
            self._withdraw(injection, now)
            raise
        self._retire(injection)
        return injection

    def reach(self, fields: Mapping[str, Any]) -> Reach:
        """Whom :meth:`inject` would hit, and which drives cannot; changes nothing.  Raises as :meth:`add` does."""
        spec = _seeded(self.catalogue.parse(fields))
        if spec.name is not None and spec.name in self._injections:
            raise InjectionError([("as", f"there is an injection {spec.name} already", "another name")])
        return reach_of(spec, self._drives)

    def renew(self, injection_id: str, now: int) -> Injection:
        """Begin its time to live anew; raises :class:`ConfigError` for an unknown id, or one without such a time."""
        injection = self._active(injection_id)
        if injection.spec.ttl_ns is None:
            raise InjectionError([("ttl", f"{injection_id} has no time to live that could be renewed", "")])
        injection.expires_ns = now + injection.spec.ttl_ns
        for run in injection.runs.values():
            self._schedule(injection, run, now)
        return injection

    def clear(self, injection_id: str | None, now: int) -> list[Injection]:
        """End one, or with None all; returns those that ended.  Raises :class:`ConfigError` for an unknown id."""
        if injection_id is None:
            chosen = list(self._injections.values())
        else:
            chosen = [self._active(injection_id)]
        for injection in chosen:
            for run in injection.runs.values():
                self._transit(injection, run, _RunEvent.CLEARED, now)
            self._retire(injection)
        return chosen

    def get(self, injection_id: str) -> Injection:
        """One injection, also one that ended not long ago; raises :class:`ConfigError` for an unknown id."""
        if injection_id in self._injections:
            return self._injections[injection_id]
        for injection in reversed(self._ended):
            if injection.id == injection_id:
                return injection
        return self._active(injection_id)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Every kind that can be injected."""
        return tuple(self.catalogue)

    def of_drive(self, name: str) -> list[Injection]:
        """Injections that wait or are in force on one drive."""
        return [injection for injection, _ in self._by_drive.get(name, ())]

    def drive(self, name: str) -> InjectedDrive:
        """One drive of the farm, by its name in the farm file."""
        return self._drives[name]

    @property
    def scheduled(self) -> tuple[int, int]:
        """Runs that are to be checked, and the entries kept for them."""
        return len(self._due), len(self._heap)

    def activations(self) -> dict[tuple[str, str], int]:
        """(kind, drive) -> occurrences since the farm started, also of injections that ended."""
        total = Counter(self._activations)
        for runs in self._by_drive.values():
            for injection, run in runs:
                total[injection.spec.kind.name, run.drive] += run.evidence().activations
        return dict(total)

    def active(self) -> dict[str, int]:
        """kind -> drives on which it is in force."""
        states = (
            injection.spec.kind.name
            for runs in self._by_drive.values()
            for injection, run in runs
            if run.state is RunState.ACTIVE
        )
        return dict(Counter(states))

    # calls from the farm

    def refresh(self, name: str, now: int) -> None:
        """A frame is about to be passed to this drive, which may have rebooted."""
        if name in self._by_drive:
            self._drives[name].refresh(now)

    def poke(self, name: str, now: int) -> None:
        """Something happened on this drive and is settled: check its injections."""
        self.refresh(name, now)
        for injection, run in list(self._by_drive.get(name, ())):
            self._look(injection, run, now)

    def touch(self, name: str) -> None:
        """Something happens on this drive: check its injections at the next :meth:`handle_timeout`."""
        if name in self._by_drive:
            self._dirty[name] = None

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""
        deadlines = (self._first_due(), *(timed.next_deadline() for timed in self._timed))
        return min((due for due in deadlines if due is not None), default=None)

    def _first_due(self) -> int | None:
        """When the next injection is to be checked."""
        while self._heap and self._due.get(self._heap[0][1], (0,))[0] != self._heap[0][0]:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    def handle_timeout(self, now: int) -> None:
        """Release frames that were held back; check the drives that were touched, and every run that is due."""
        for timed in self._timed:
            timed.handle_timeout(now)
        dirty, self._dirty = self._dirty, {}
        for name in dirty:
            self.poke(name, now)
        while (due := self._first_due()) is not None and due <= now:
            _, key = heapq.heappop(self._heap)
            _, injection, run = self._due.pop(key)
            self._look(injection, run, now)

    def events(self) -> list[Happened]:
        """Injections that started and ended since the last call."""
        drained, self._events = self._events, []
        return drained

    # inside

    def _new_id(self, wanted: str | None) -> str:
        if wanted is None:
            self._numbers += 1
            while f"fault-{self._numbers}" in self._injections:
                self._numbers += 1
            return f"fault-{self._numbers}"
        if wanted in self._injections:
            raise InjectionError(
                [("as", f"an injection named {wanted!r} is in force", "another name, or clear it first")]
            )
        return wanted

    def _active(self, injection_id: str) -> Injection:
        injection = self._injections.get(injection_id)
        if injection is None:
            known = f"there are {', '.join(self._injections)}" if self._injections else "none is in force"
            raise ConfigError(
                f"there is no injection {injection_id!r}{did_you_mean(injection_id, self._injections)}; {known}"
            )
        return injection

    def _look(self, injection: Injection, run: DriveRun, now: int) -> None:
        """As :meth:`_advance`, without a caller to whom an error could be raised."""
        try:
            self._advance(injection, run, now)
        except ConfigError as exc:
            self._transit(injection, run, _RunEvent.FAILED, now, str(exc))
        self._retire(injection)

    def _advance(self, injection: Injection, run: DriveRun, now: int) -> None:
        """Start, check, or end one run; note when it is to be checked again."""
        if injection.expires_ns and now >= injection.expires_ns:
            self._transit(injection, run, _RunEvent.LAPSED, now)
            return
        if run.state is RunState.WAITING:
            window = self._window(injection.spec, run, now)
            if window is not None:
                run.stop_ns = window.stop_ns
                run.effect.begin(window, now)
                self._transit(injection, run, _RunEvent.DUE, now)
        elif run.state is RunState.ACTIVE:
            run.effect.check(now)
        if run.state is RunState.ACTIVE:
            over = _RunEvent.FINISHED if run.effect.finished else None
            if over is None and run.stop_ns and now >= run.stop_ns:
                over = _RunEvent.EXPIRED
            if over is not None and injection.spec.rate is not None and run.starts != injection.spec.times:
                self._transit(injection, run, _RunEvent.AGAIN, now, over.value)
            elif over is not None:
                self._transit(injection, run, over, now)
        self._schedule(injection, run, now)

    def _window(self, spec: InjectionSpec, run: DriveRun, now: int) -> Window | None:
        """When the injection is in force, or None as long as its start is not known."""
        if now < run.not_before:
            return None
        connection = _connection(run.injected)
        window = Window()
        if spec.after_cycles:
            if run.effect.counts_frames:
                window.after = spec.after_cycles
            elif connection is None or _cycles(run.injected) - run.cycles_before < spec.after_cycles:
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

    def _transit(self, injection: Injection, run: DriveRun, event: _RunEvent, now: int, why: str = "") -> None:
        """The one place that writes a run's state."""
        following = TRANSITIONS.get((run.state, event))
        if following is None:
            return
        if event is _RunEvent.AGAIN:
            self._pause(injection, run, now, why)
            return
        if following is RunState.ENDED:
            if run.state is RunState.ACTIVE:
                run.effect.end(now)
            run.ended_ns, run.reason = now, why or event.value
        else:
            run.started_ns = now
            run.starts += 1
        waited = run.state is RunState.WAITING
        run.state = following
        kind = injection.spec.kind.name
        if following is RunState.ACTIVE:
            self._events.append(Happened(now, run.drive, InjectionBegan(injection.id, kind)))
            return
        seen = NOTHING if waited else run.effect.evidence()
        self._tell_end(injection, run, now, run.reason, seen)
        injection.over += 1
        self._activations[kind, run.drive] += run.done.activations + seen.activations
        self._forget(run)

    def _tell_end(self, injection: Injection, run: DriveRun, now: int, reason: str, seen: Evidence) -> None:
        what = InjectionEnded(
            injection.id,
            injection.spec.kind.name,
            reason,
            seen.checks,
            seen.activations,
            seen.confirmed,
            seen.confirmation.value,
            seen.reason,
        )
        self._events.append(Happened(now, run.drive, what))

    def _pause(self, injection: Injection, run: DriveRun, now: int, why: str) -> None:
        """One of the occurrences of a rate is over: wait at random for the next one, with an effect of its own."""
        run.effect.end(now)
        seen = run.effect.evidence()
        run.done += seen
        run.state = RunState.WAITING
        run.stop_ns = 0
        self._tell_end(injection, run, now, why, seen)
        spec = injection.spec
        run.not_before = now + _pause(spec, run)
        run.cycles_before = _cycles(run.injected)
        # another seed, or each occurrence would lose the same frames
        again = spec.model_copy(update={"seed": ((spec.seed or 0) + run.starts * 0x9E3779B97F4A7C15) % (1 << 64)})
        run.effect = spec.kind.effect(again, run.injected)

    def _forget(self, run: DriveRun) -> None:
        remaining = [entry for entry in self._by_drive[run.drive] if entry[1] is not run]
        if remaining:
            self._by_drive[run.drive] = remaining
        else:
            del self._by_drive[run.drive]
        self._due.pop(run.key, None)

    def _retire(self, injection: Injection) -> None:
        if injection.over == len(injection.runs) and self._injections.pop(injection.id, None) is not None:
            self._ended.append(injection)

    def _withdraw(self, injection: Injection, now: int) -> None:
        """One of the drives cannot do the injection: undo it on the others."""
        for run in injection.runs.values():
            self._transit(injection, run, _RunEvent.CLEARED, now)
        del self._injections[injection.id]
        self._events = [happened for happened in self._events if happened.event.id != injection.id]

    def _schedule(self, injection: Injection, run: DriveRun, now: int) -> None:
        deadlines: Iterable[int | None]
        match run.state:
            case RunState.WAITING:
                deadlines = (run.not_before if now < run.not_before else self._wait_until(injection.spec, run, now),)
            case RunState.ACTIVE:
                deadlines = (run.effect.next_deadline(), run.stop_ns or None)
            case _:
                return
        due = min((d for d in (*deadlines, injection.expires_ns or None) if d is not None), default=None)
        if due is None:
            self._due.pop(run.key, None)
            return
        # never in the past: what is due now was just checked
        due = max(due, now + 1)
        if self._due.get(run.key, (None,))[0] != due:
            heapq.heappush(self._heap, (due, run.key))
        self._due[run.key] = (due, injection, run)

    @staticmethod
    def _wait_until(spec: InjectionSpec, run: DriveRun, now: int) -> int:
        """When the healthy cycles may be over, or the connection there."""
        connection = _connection(run.injected)
        if connection is None or not spec.after_cycles:
            return now + WAIT_NS
        missing = spec.after_cycles - (_cycles(run.injected) - run.cycles_before)
        return now + max(1, missing) * connection.cycle_ns

    # last, because the name hides the type in the annotations after it
    def list(self) -> list[Injection]:
        """Injections that wait or are in force, oldest first."""
        return list(self._injections.values())


def _connection(drive: InjectedDrive) -> Connection | None:
    part = drive.find(CONNECTION)
    return None if part is None else part.now()


def _cycles(drive: InjectedDrive) -> int:
    part = drive.find(CONNECTION)
    return 0 if part is None else part.cycles()


def _seeded(spec: InjectionSpec) -> InjectionSpec:
    """With a seed where one counts; it is kept in the spec, so that the run can be repeated."""
    if spec.seed is None and ("seed" in spec.kind.takes or spec.chooses):
        return spec.model_copy(update={"seed": secrets.randbits(53)})
    return spec


def _pause(spec: InjectionSpec, run: DriveRun) -> int:
    """Time to the next occurrence of a rate, ns: exponential."""
    if spec.rate is None or run.random is None:
        return 0
    return int(-math.log(1.0 - run.random.uniform()) / spec.rate[0] * 1e9)
