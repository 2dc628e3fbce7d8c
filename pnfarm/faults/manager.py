"""Puts injections in force, ends them, keeps their evidence.

One :class:`InjectionManager` serves a farm.  It knows no clock: the farm's runtime passes the time and calls
:meth:`~InjectionManager.handle_timeout` at :meth:`~InjectionManager.next_deadline`.  An injection on several
drives runs on each of them independently, through the states of :mod:`pnfarm.faults.run_states`.
"""

from __future__ import annotations

import heapq
from collections import Counter, deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.errors import ConfigError
from pnfarm.faults.effects.evidence import NOTHING, Evidence
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.events import InjectionBegan, InjectionEnded
from pnfarm.faults.injection import DriveRun, Injection
from pnfarm.faults.run_states import TRANSITIONS, RunEvent, RunState
from pnfarm.faults.start import again, cycles_of, first_random, pause_of, seeded, wait_until, window_of
from pnfarm.faults.targets import check_parts, chosen, targets_of
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from pnfarm.faults.catalogue import Catalogue
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.faults.plan import InjectionSpec
    from pnfarm.faults.targets import Targets
    from pnfarm.faults.when import Conditions

__all__ = ["MOST_INJECTIONS", "DriveRun", "Injection", "InjectionManager", "RunState"]

#: Number of ended injections whose evidence is kept.
KEPT = 1024
#: Entries of the heap that may be out of date, beside as many as there are runs.
SPARE_ENTRIES = 256
#: Injections that wait or are in force at once.
MOST_INJECTIONS = 4096


class Timed(Protocol):
    """What injections left to be done at a time: frames to release, addresses to restore."""

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""

    def handle_timeout(self, now: int) -> None:
        """Do what is due."""


@dataclass(frozen=True, slots=True)
class Happened:
    """What happened to an injection on one drive."""

    now: int
    drive: str
    event: InjectionBegan | InjectionEnded


class InjectionManager:
    """See the module's docstring.

    ``catalogue`` has the kinds; ``drives`` are the farm's drives by name; ``timed`` is called before them; without
    ``conditions``, no injection can wait for one.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        drives: Mapping[str, InjectedDrive],
        timed: Iterable[Timed],
        conditions: Conditions | None = None,
    ) -> None:
        self.catalogue = catalogue
        self._conditions = conditions
        self._drives = drives
        self._timed = tuple(timed)
        self._injections: dict[str, Injection] = {}
        self._ended: deque[Injection] = deque(maxlen=KEPT)
        self._activations: Counter[tuple[str, str]] = Counter()
        #: By the run's key, in the order in which they were added.
        self._by_drive: dict[str, dict[int, tuple[Injection, DriveRun]]] = {}
        self._due: dict[int, tuple[int, Injection, DriveRun]] = {}
        self._heap: list[tuple[int, int]] = []
        self._dirty: dict[str, None] = {}
        #: Drives without an injection that have not taken yet what the last one's end asks of them: they are off.
        self._late: set[str] = set()
        self._events: list[Happened] = []
        self._numbers = 0
        self._keys = 0

    # requests of users

    def inject(self, fields: Mapping[str, Any], now: int, *, at_ns: int = 0) -> Injection:
        """:meth:`add` from plain values, as in a scenario's ``fault:`` step."""
        return self.add(self.catalogue.parse(fields), now, at_ns=at_ns)

    def add(self, spec: InjectionSpec, now: int, *, at_ns: int = 0) -> Injection:
        """Put an injection in force, or let it wait for its start, which is not before ``at_ns``.

        Raises :class:`ConfigError`, with nothing changed on any drive, when no drive matches, when one of them cannot
        do it, when its name is taken, or when there are :data:`MOST_INJECTIONS`.
        """
        spec = seeded(spec)
        names, _ = chosen(spec, self._drives, lambda name: self._drives[name].hit_by(spec.kind.effect.needs))
        for name in names:
            check_parts(self._drives[name], spec)
            self._check_condition(name, spec)
        if len(self._injections) >= MOST_INJECTIONS:
            raise ConfigError(f"{MOST_INJECTIONS} faults wait or are in force, the maximum: clear some")
        injection = Injection(self._new_id(spec.name), spec, now)
        first = max(now, at_ns)
        if spec.ttl_ns is not None:
            injection.expires_ns = first + spec.ttl_ns
        for name in names:
            drive = self._drives[name]
            self._keys += 1
            injection.runs[name] = DriveRun(
                name, drive, spec.kind.effect(spec, drive), first, cycles_of(drive), key=self._keys
            )
            run = injection.runs[name]
            run.at_ns = at_ns if at_ns > now else 0
            run.random = first_random(spec, name)
            run.not_before += pause_of(spec, run) + (spec.after_ns if spec.when is None else 0)
        self._injections[injection.id] = injection
        for name, run in injection.runs.items():
            self._by_drive.setdefault(name, {})[run.key] = (injection, run)
        try:
            for run in injection.runs.values():
                self._advance(injection, run, now)
        except BaseException:
            self._withdraw(injection, now)
            raise
        self._retire(injection)
        return injection

    def reach(self, fields: Mapping[str, Any]) -> Targets:
        """Whom :meth:`inject` would hit, and which drives cannot; changes nothing.  Raises as :meth:`add` does."""
        spec = seeded(self.catalogue.parse(fields))
        if spec.name is not None and spec.name in self._injections:
            raise InjectionError([("as", f"there is an injection {spec.name} already", "another name")])
        return targets_of(spec, self._drives, self._check_condition)

    def renew(self, injection_id: str, now: int) -> Injection:
        """Restart its time to live; raises :class:`ConfigError` for an unknown id, or one without such a time."""
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
                self._transit(injection, run, RunEvent.CLEARED, now)
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
        """Injections that wait or are in force on one drive, with those of an axis's node."""
        if not self._by_drive:
            return []
        drive = self._drives.get(name)
        names = [name] if drive is None or drive.node is None else [name, drive.node.name]
        return [injection for one in names for injection, _ in self._by_drive.get(one, {}).values()]

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
            for injection, run in runs.values():
                total[injection.spec.kind.name, run.drive] += run.evidence().activations
        return dict(total)

    def active(self) -> dict[str, int]:
        """kind -> drives on which it is in force."""
        states = (
            injection.spec.kind.name
            for runs in self._by_drive.values()
            for injection, run in runs.values()
            if run.state is RunState.ACTIVE
        )
        return dict(Counter(states))

    @property
    def conditions_watched(self) -> int:
        """Conditions that the engine checks."""
        return 0 if self._conditions is None else self._conditions.watched

    # calls from the farm

    def condition_held(self, row: int, serial: int, now: int) -> None:
        """The engine saw the condition in this row of the table hold at ``now``."""
        drive = None if self._conditions is None else self._conditions.reported(row, serial, now)
        if drive is not None:
            self._dirty[drive] = None

    def catch_up(self, now: int) -> None:
        """Reports of the engine were lost: take from its rows which conditions held."""
        if self._conditions is not None:
            self._dirty.update(dict.fromkeys(self._conditions.catch_up(now)))

    def concern(self, name: str) -> bool:
        """Whether an injection on this drive waits or is in force: else the calls below do nothing."""
        return name in self._by_drive

    @property
    def concerned(self) -> Collection[str]:
        """The drives that :meth:`concern` is true for."""
        return self._by_drive.keys()

    def refresh(self, name: str, now: int) -> None:
        """A frame is about to be passed to this drive, which may have rebooted."""
        if name in self._by_drive:
            self._drives[name].refresh(now)

    def poke(self, name: str, now: int) -> None:
        """Something happened on this drive and is settled: check its injections."""
        if name not in self._by_drive and name not in self._late:
            return
        drive = self._drives[name]
        drive.refresh(now)
        if name not in self._by_drive:
            if not drive.in_force():
                self._late.discard(name)
            return
        for injection, run in list(self._by_drive[name].values()):
            self._look(injection, run, now)

    def touch(self, name: str) -> None:
        """Something happens on this drive: check its injections at the next :meth:`handle_timeout`."""
        if name in self._by_drive or name in self._late:
            self._dirty[name] = None

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""
        first = self._first_due()
        for timed in self._timed:
            due = timed.next_deadline()
            if due is not None and (first is None or due < first):
                first = due
        return first

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
                f"there is no fault {injection_id!r}{did_you_mean(injection_id, self._injections)}; {known}"
            )
        return injection

    def _check_condition(self, name: str, spec: InjectionSpec) -> None:
        """Raises :class:`InjectionError` for a condition that this drive does not understand."""
        if spec.when is None:
            return
        if self._conditions is None:
            raise InjectionError([("when", "the drives of this farm have no signals that could be watched", "")])
        self._conditions.bind(name, spec.when)

    def _look(self, injection: Injection, run: DriveRun, now: int) -> None:
        """As :meth:`_advance`, without a caller to whom an error could be raised."""
        try:
            self._advance(injection, run, now)
        except ConfigError as exc:
            run.busy = False
            self._transit(injection, run, RunEvent.FAILED, now, str(exc))
        self._retire(injection)

    def _advance(self, injection: Injection, run: DriveRun, now: int) -> None:
        """Start, check, or end one run; note when it is to be checked again."""
        if run.busy:
            return
        if injection.expires_ns and now >= injection.expires_ns:
            self._transit(injection, run, RunEvent.LAPSED, now)
            return
        if run.at_ns and now >= run.at_ns:
            run.at_ns = 0
        if run.state is RunState.WAITING and self._may_begin(injection.spec, run, now):
            window = window_of(injection.spec, run, now)
            if window is not None:
                run.stop_ns = window.stop_ns
                run.busy = True
                run.effect.window = window
                # a drive without a fault may have booted unseen
                run.injected.refresh(now)
                run.effect.begin(now)
                run.busy = False
                self._transit(injection, run, RunEvent.DUE, now)
        elif run.state is RunState.ACTIVE:
            run.effect.check(now)
        if run.state is RunState.ACTIVE:
            over = RunEvent.FINISHED if run.effect.finished else None
            if over is None and run.stop_ns and now >= run.stop_ns:
                over = RunEvent.EXPIRED
            if over is not None and injection.spec.rate is not None and run.starts != injection.spec.times:
                self._transit(injection, run, RunEvent.AGAIN, now, over.value)
            elif over is not None:
                self._transit(injection, run, over, now)
        self._schedule(injection, run, now)

    def _may_begin(self, spec: InjectionSpec, run: DriveRun, now: int) -> bool:
        """Whether its condition has held, if it has one; then its start counts from there."""
        if spec.when is None or run.held_ns is not None:
            return True
        if now < run.not_before:
            return False
        if run.watch is None:
            assert self._conditions is not None
            run.watch = self._conditions.watch(run.drive, spec.when)
        run.held_ns = run.watch.look(now)
        if run.held_ns is None:
            return False
        run.watch.close()
        run.watch = None
        run.not_before = run.held_ns + spec.after_ns
        run.cycles_before = cycles_of(run.injected)
        return True

    def _transit(self, injection: Injection, run: DriveRun, event: RunEvent, now: int, why: str = "") -> None:
        """The one place that writes a run's state."""
        following = TRANSITIONS.get((run.state, event))
        if following is None:
            return
        if event is RunEvent.AGAIN:
            self._pause(injection, run, now, why)
            return
        if following is RunState.ENDED:
            if run.state is RunState.ACTIVE:
                self._end_effect(run, now)
            if run.watch is not None:
                run.watch.close()
                run.watch = None
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
        self._end_effect(run, now)
        seen = run.effect.evidence()
        run.done += seen
        run.state = RunState.WAITING
        run.stop_ns = 0
        self._tell_end(injection, run, now, why, seen)
        spec = injection.spec
        run.not_before = now + pause_of(spec, run)
        run.cycles_before = cycles_of(run.injected)
        run.held_ns = None
        run.effect = spec.kind.effect(again(spec, run.starts), run.injected)

    @staticmethod
    def _end_effect(run: DriveRun, now: int) -> None:
        # frames that it held may arrive at once, and the drive's answers are a reason to look at its injections
        run.busy = True
        try:
            run.effect.end(now)
        finally:
            run.busy = False

    def _forget(self, run: DriveRun) -> None:
        runs = self._by_drive[run.drive]
        del runs[run.key]
        if not runs:
            del self._by_drive[run.drive]
            if run.injected.in_force():
                self._late.add(run.drive)
        self._due.pop(run.key, None)

    def _retire(self, injection: Injection) -> None:
        if injection.over == len(injection.runs) and self._injections.pop(injection.id, None) is not None:
            self._ended.append(injection)

    def _withdraw(self, injection: Injection, now: int) -> None:
        """One of the drives cannot do the injection: undo it on the others."""
        for run in injection.runs.values():
            self._transit(injection, run, RunEvent.CLEARED, now)
        del self._injections[injection.id]
        self._events = [happened for happened in self._events if happened.event.id != injection.id]

    def _schedule(self, injection: Injection, run: DriveRun, now: int) -> None:
        deadlines: Iterable[int | None]
        match run.state:
            case RunState.WAITING:
                deadlines = (self._wait_until(injection.spec, run, now),)
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
        if len(self._heap) > 2 * len(self._due) + SPARE_ENTRIES:
            # most are of runs that ended, or were put off: an hour's worth may wait behind one that stays
            self._heap = [(at, key) for key, (at, _, _) in self._due.items()]
            heapq.heapify(self._heap)

    @staticmethod
    def _wait_until(spec: InjectionSpec, run: DriveRun, now: int) -> int | None:
        if now < run.not_before:
            return run.not_before
        if run.watch is None:
            return wait_until(spec, run, now)
        # the engine, or what happens to the drive, shows that the condition holds, but for signals of devices
        return None if run.watch.every_ns is None else now + run.watch.every_ns

    # last, because the name hides the type in the annotations after it
    def of_kind(self, kind: str) -> Iterator[Injection]:
        """Injections of one kind, also those that ended not long ago."""
        for injection in (*self._ended, *self._injections.values()):
            if injection.spec.kind.name == kind:
                yield injection

    def that_hit(self, drive: str) -> Iterator[Injection]:
        """Injections that hit a drive, also those that ended not long ago."""
        return (one for one in (*self._ended, *self._injections.values()) if drive in one.runs)

    def list(self) -> list[Injection]:
        """Injections that wait or are in force, oldest first."""
        return list(self._injections.values())
