"""A scenario at work, without a clock: :meth:`ScenarioRun.advance` carries out what is due and says when to come back.

Its rig (:mod:`pnfarm.scenario.virtual`, :mod:`pnfarm.scenario.realtime`) calls it at that time, after each entry of the
farm's log, and while :attr:`ScenarioRun.polled` at least every :data:`LOOK_NS`.  Steps are generators that yield the
time of their next look, so that branches of ``parallel`` run side by side.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError, PnfarmError
from pnfarm.faults.manager import RunState
from pnfarm.scenario.measures import check_metric, measured, read_metric
from pnfarm.scenario.record import Case, Record, Verdict
from pnfarm.scenario.steps import QUANTILES
from pnfarm.scenario.watch import Watch
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from pnfarm.farm.core import FarmCore
    from pnfarm.metrics import FarmCollector
    from pnfarm.scenario.binding import Binding
    from pnfarm.scenario.lateness import Lateness
    from pnfarm.scenario.steps import Step
    from pnfarm.station.event_log import LogEntry

__all__ = ["LOOK_NS", "ScenarioRun", "Tell"]

#: Time between two looks at signals whose changes are no events.
LOOK_NS = 1_000_000
#: ``wait: {until: ...}`` without ``within``.
DEFAULT_WITHIN_NS = 30_000_000_000

_Life = Generator[int, None, None]
#: Called with each step that begins (case None) and each case that ends.
Tell = Callable[["Step", "Case | None"], None]


class _EndedError(Exception):
    """The scenario cannot go on."""


class ScenarioRun:
    """``lateness`` measures the farm's own; None in virtual time, where it is never late."""

    def __init__(
        self,
        binding: Binding,
        core: FarmCore,
        collector: FarmCollector,
        now: int,
        *,
        lateness: Lateness | None = None,
        tell: Tell | None = None,
    ) -> None:
        self.binding = binding
        self.record = Record(binding.scenario, core.name, list(binding.drives), now)
        self.finished = False
        self._core = core
        self._collector = collector
        self._lateness = lateness
        self._tell = tell or _silent
        self._now = now
        self._watches: list[Watch] = []
        self._faults: dict[str, str] = {}
        self._own: list[str] = []
        self._off: dict[str, None] = {}
        self._stations = {station.configured_name: station for station in core.stations}
        for step in binding.scenario.every_step():
            if "metric" in step.values:
                self._check_metric(step)
        self._life = self._sequence(binding.scenario.steps)
        self._begun = 0
        self._unsubscribe = core.log.subscribe(self._note)

    def _check_metric(self, step: Step) -> None:
        asked = _asked(step)
        try:
            check_metric(self._collector, step.values["metric"], asked)
        except ConfigError as error:
            raise ConfigError(str(self.binding.scenario.issue(step, "metric", str(error), ""))) from error

    @property
    def steps_begun(self) -> int:
        """Steps that began, for progress."""
        return self._begun

    @property
    def polled(self) -> bool:
        """Whether it wants to be called every :data:`LOOK_NS`."""
        return any(watch.polled for watch in self._watches)

    def advance(self, now: int) -> int:
        """Do what is due; when to call again at the latest."""
        self._now = now
        if self.finished:
            return now
        try:
            return next(self._life)
        except StopIteration:
            self._finish("")
        except _EndedError as ended:
            self._finish(str(ended))
        return now

    def cancel(self, now: int, why: str = "cancelled") -> None:
        """End before the last step; what did not run is reported as not run."""
        self._now = now
        if not self.finished:
            self._finish(why)

    def _finish(self, why: str) -> None:
        self.finished = True
        self._life.close()
        self._watches.clear()
        for name in list(self._own):
            self._clear(name)
        for name in list(self._off):
            self._power(name, on=True)
        self._unsubscribe()
        reached = {case.number for case in self.record.cases}
        for number, step in enumerate(self.binding.scenario.every_step()):
            if step.kind == "expect" and number not in reached:
                self.record.add(Case(number, step, Verdict.NOT_RUN, 0, 0, message=why or "not reached"))
        self.record.end(self._now, why, self._lateness.report(self._now) if self._lateness is not None else None)

    def _note(self, entry: LogEntry) -> None:
        self.record.note(entry)
        for watch in self._watches:
            watch.note(entry)

    # -- steps

    def _sequence(self, steps: tuple[Step, ...]) -> _Life:
        for step in steps:
            self._begun += 1
            self._tell(step, None)
            self.record.step(step, self._now)
            yield from self._step(step)

    def _step(self, step: Step) -> _Life:
        try:
            match step.kind:
                case "wait" if "until" in step.values:
                    yield from self._wait_until(step)
                case "wait":
                    yield from self._sleep(step.values["for"])
                case "expect" if "metric" in step.values:
                    yield from self._expect_metric(step)
                case "expect":
                    yield from self._expect(step)
                case "load":
                    yield from self._load(step)
                case "parallel":
                    yield from self._parallel(step)
                case _:
                    self._act(step)
        except PnfarmError as error:
            self._case(step, Verdict.ERROR, self._now, str(error))
            raise _EndedError(f"{step.title}: {error}") from error

    def _act(self, step: Step) -> None:
        match step.kind:
            case "fault":
                injection = self._core.injections.inject(step.values["spec"], self._now)
                name = step.values["spec"].get("as") or injection.id
                self._faults[name] = injection.id
                self._own.append(name)
                self.record.fault_began(injection, name, self._now)
            case "clear":
                wanted = step.values["fault"]
                for name in list(self._own) if wanted == "all" else [wanted]:
                    self._clear(name)
            case "power":
                word = next(word for word in ("off", "on", "cycle") if word in step.values)
                for name in self.binding.chosen(step, word):
                    if word in {"off", "cycle"}:
                        self._power(name, on=False)
                    if word in {"on", "cycle"}:
                        self._power(name, on=True)
            case "param":
                for name in self.binding.chosen(step):
                    for parameter, value in step.values["set"].items():
                        try:
                            self._stations[name].store.set(parameter, value)
                        except PnfarmError as error:
                            raise ConfigError(f"{name}, {parameter}: {error}") from error
                    self._core.settle(self._stations[name], self._now)

    def _clear(self, name: str) -> None:
        manager = self._core.injections
        injection = manager.get(self._faults[name])
        if injection.state is not RunState.ENDED:
            manager.clear(injection.id, self._now)
        if name in self._own:
            self._own.remove(name)
        self.record.fault_ended(injection, name, self._now)

    def _power(self, name: str, *, on: bool) -> None:
        station = self._stations[name]
        if station.powered is on:
            return
        if on:
            station.power_on(self._now)
            self._off.pop(name, None)
        else:
            station.power_off(self._now)
            self._off[name] = None
        self._core.settle(station, self._now)

    def _sleep(self, duration_ns: int) -> _Life:
        end = self._now + duration_ns
        while self._now < end:
            yield end

    def _load(self, step: Step) -> _Life:
        wanted = step.values["drives"]
        names = [name for name in self.binding.chosen(step, "on") if self._stations[name].powered is not (wanted > 0)]
        if len(names) < abs(wanted):
            word = "off" if wanted > 0 else "on"
            raise ConfigError(f"{abs(wanted)} drives are wanted, but only {len(names)} are {word}")
        chosen = names[:wanted] if wanted > 0 else names[: wanted - 1 : -1]
        begin, over = self._now, step.get("over", 0)
        for number, name in enumerate(chosen):
            yield from self._sleep(max(0, begin + over * number // len(chosen) - self._now))
            self._power(name, on=wanted > 0)
        yield from self._sleep(max(0, begin + over - self._now))

    def _parallel(self, step: Step) -> _Life:
        branches = [self._sequence(branch) for branch in step.branches]
        try:
            while branches:
                looks = []
                for branch in list(branches):
                    try:
                        looks.append(next(branch))
                    except StopIteration:
                        branches.remove(branch)
                if branches:
                    yield min(looks)
        finally:
            for branch in branches:
                branch.close()

    def _wait_until(self, step: Step) -> _Life:
        begin = self._now
        end = begin + step.get("within", DEFAULT_WITHIN_NS)
        watch = self._open(step)
        try:
            while True:
                watch.look(self._now)
                if watch.all_now:
                    return
                if self._now >= end:
                    break
                yield end
        finally:
            self._watches.remove(watch)
        missing = [name for name in watch.values() if name not in watch.held_ns]
        waited = format_duration(end - begin)
        message = f"not true within {waited} on {_few(missing or list(watch.values()))}"
        self._case(step, self._failure(begin), begin, message, watch=watch)
        raise _EndedError(f"{step.title}: {message}")

    def _open(self, step: Step) -> Watch:
        watch = Watch(self.binding.conditions(step), self._stations)
        self._watches.append(watch)
        return watch

    def _expect(self, step: Step) -> _Life:
        begin = self._now
        within, hold = step.get("within", 0), step.get("for", 0)
        watch = self._open(step)
        try:
            watch.look(self._now)
            while not watch.all_held and self._now < begin + within:
                yield begin + within
                watch.look(self._now)
            if not watch.all_held:
                missing = [name for name in watch.values() if name not in watch.held_ns]
                limit = f"within {format_duration(within)}" if within else "at once"
                self._case(step, self._failure(begin), begin, f"not true {limit} on {_few(missing)}", watch=watch)
                return
            if hold:
                yield from self._hold(watch, hold)
            if watch.broken_ns:
                after = format_duration(min(watch.broken_ns.values()) - begin)
                message = f"true, but no longer after {after} on {_few(list(watch.broken_ns))}"
                self._case(step, self._failure(begin), begin, message, watch=watch)
                return
            took = max(watch.held_ns.values()) - begin
            self._case(step, Verdict.PASSED, begin, f"true after {format_duration(took)}", watch=watch)
        finally:
            self._watches.remove(watch)

    def _hold(self, watch: Watch, hold_ns: int) -> _Life:
        end = self._now + hold_ns
        watch.must_hold = True
        watch.look(self._now)
        while not watch.broken_ns and self._now < end:
            yield end
            watch.look(self._now)

    def _expect_metric(self, step: Step) -> _Life:
        begin = self._now
        metric, asked = step.values["metric"], _asked(step)
        before = read_metric(self._collector, metric)
        yield from self._sleep(step.get("for", 0))
        value = measured(asked, before, read_metric(self._collector, metric))
        bound = step.values[asked]
        verdict = Verdict.PASSED if bound.holds(value) else self._failure(begin)
        message = f"{asked} {value:g}, wanted {bound.sign} {bound.value:g}"
        self._case(step, verdict, begin, message, value=value)

    # -- cases

    def _failure(self, begin: int) -> Verdict:
        if self._lateness is not None and self._lateness.was_late(begin, self._now):
            return Verdict.INCONCLUSIVE
        return Verdict.FAILED

    def _case(
        self,
        step: Step,
        verdict: Verdict,
        begin: int,
        message: str,
        *,
        watch: Watch | None = None,
        value: float | None = None,
    ) -> None:
        steps = list(self.binding.scenario.every_step())
        number = next(place for place, other in enumerate(steps) if other is step)
        case = Case(number, step, verdict, begin, self._now, message=message, value=value)
        if watch is not None:
            case.values = watch.values()
            case.took = {name: when - begin for name, when in watch.held_ns.items()}
        if verdict is Verdict.INCONCLUSIVE and self._lateness is not None:
            case.message = f"{message}; the farm was itself {self._lateness.told} late"
        self.record.add(case)
        self._tell(step, case)


def _silent(step: Step, case: Case | None) -> None:
    del step, case


def _asked(step: Step) -> str:
    return next(key for key in ("increases", "value", *QUANTILES) if key in step.values)


def _few(names: list[str], most: int = 5) -> str:
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest
