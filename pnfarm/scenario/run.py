"""A scenario at work, without a clock: :meth:`ScenarioRun.advance` carries out what is due and says when to come back.

Its rig (:mod:`pnfarm.scenario.virtual`, :mod:`pnfarm.scenario.realtime`) calls it at that time, after each entry of the
farm's log, and while :meth:`ScenarioRun.polled` at least every :data:`LOOK_NS`.  The course of the steps is
:mod:`pnfarm.scenario.flow`'s.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack
from math import inf
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError, PnfarmError
from pnfarm.farm.state.states import SavedStates
from pnfarm.faults.manager import RunState
from pnfarm.scenario.controllers import controllers
from pnfarm.scenario.definition.steps import DEFAULT_WITHIN_NS, MEASURES, POWER
from pnfarm.scenario.flow import EndedError, Flow, Life, Tell
from pnfarm.scenario.measures import check_metric, measured, read_metric, show_comparison
from pnfarm.scenario.report.record import Case, Verdict
from pnfarm.scenario.report.trace_excerpts import TraceExcerpts, named_signals, named_stations
from pnfarm.scenario.watch import Watch, as_text
from pnfarm.signals.device_signal import note_forces, releases
from pnfarm.station.events import ConnectionEstablished, ConnectionLost, StateChanged, WatchdogExpired
from pnfarm.station.lateness import Lateness
from pnfarm.vocabulary.durations import format_duration, format_measured
from pnfarm.vocabulary.quoting import shortened

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.farm.core import FarmCore
    from pnfarm.faults.manager import Injection
    from pnfarm.metrics import FarmCollector
    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.definition.steps import MetricName, Step
    from pnfarm.scenario.lateness import FarmLateness
    from pnfarm.scenario.measures import Reading
    from pnfarm.station.event_log import EventLog, LogEntry

__all__ = ["LOOK_NS", "EachLook", "ScenarioRun", "Tell"]

#: Time between two checks of signals whose changes are no events.
LOOK_NS = 1_000_000
#: Of a `wait`, so much of its end counts for the expectation after it; and a loss may be noted so long after what it
#: does to the drive.
REST_NS = 1_000_000_000
#: The state of an axis that is in operation.
OPERATION = 4
#: Drives whose values the summary of a failure shows; the record has all.
MOST_MEASURED = 3

#: Called with the run and the time while it waits; a text that it returns ends the run, and says why.
EachLook = Callable[["ScenarioRun", int], str]


class ScenarioRun(Flow):
    """``lateness`` measures the farm's own; None in virtual time, where it is never late.

    ``traced``: keep traces around faults and failures, for the report; ``plc_log``: of the controller, if it runs in
    this process.
    """

    def __init__(
        self,
        binding: Binding,
        core: FarmCore,
        collector: FarmCollector,
        now: int,
        *,
        lateness: FarmLateness | None = None,
        traced: bool = False,
        tell: Tell | None = None,
        plc_log: EventLog | None = None,
    ) -> None:
        super().__init__(binding, core.name, now, tell)
        self._core = core
        self._collector = collector
        self._lateness = lateness
        self._watches: list[Watch] = []
        #: Injections of this scenario that it has not cleared, by the name to clear them by.
        self._own: dict[str, Injection] = {}
        self._off: dict[str, None] = {}
        #: Signals that it forced, by station.
        self._forced: dict[str, set[str]] = {}
        #: Drives that lost their connection by the farm's own lateness and are not back where they were -> when.
        self._own_losses: dict[str, int] = {}
        #: When each drive lost one in this way last, whether it is back or not.
        self._last_own_losses: dict[str, int] = {}
        #: When each axis was in operation last, as far as is known; for ever while it is.
        self._operated: dict[str, float] = {}
        self._states = SavedStates(core, core.states_folder, lambda: self._now)
        self._stations = {station.configured_name: station for station in core.axes}
        #: A connection is of all axes of its station.
        self._axes: dict[str, list[str]] = {}
        for axis in core.axes:
            self._axes.setdefault(axis.station.configured_name, []).append(axis.configured_name)
        # a state and a metric are checked once, however often they are asked for
        restored: dict[str, Step] = {}
        checked: set[tuple[str, str, str]] = set()
        for step in binding.scenario.every_step():
            if step.kind == "restore":
                restored.setdefault(step.values["state"], step)
            if "metric" in step.values:
                self._check_metric(step, "metric", step.values["metric"], step.one_of(MEASURES), checked)
            if "measure" in step.values:
                measure = step.values["measure"]
                self._check_metric(step, "measure", measure.metric, measure.asked, checked)
        for step in restored.values():
            self._check_state(step)
        self._moments = TraceExcerpts(core, named_stations(binding), named_signals(binding), now) if traced else None
        # what the farm lost before may not be back yet
        before = [entry for name in {**self._axes, **self._stations} for entry in core.log.entries(name)]
        for entry in sorted(before, key=attrgetter("sequence")):
            self._note_own_loss(entry)
        subscriptions = ExitStack()
        subscriptions.callback(core.log.subscribe(self._note))
        if plc_log is not None:
            subscriptions.callback(plc_log.subscribe(self.record.note_program))
        self._unsubscribe = subscriptions.close

    def _check_metric(
        self, step: Step, key: str, metric: MetricName, asked: str, checked: set[tuple[str, str, str]]
    ) -> None:
        if (this := (metric.name, str(metric.labels), asked)) in checked:
            return
        checked.add(this)
        try:
            check_metric(self._collector, metric, asked)
        except ConfigError as error:
            raise ConfigError(str(self.binding.scenario.issue(step, key, str(error), ""))) from error

    def _check_state(self, step: Step) -> None:
        try:
            self._states.restore_at_once(step.values["state"], only_check=True)
        except PnfarmError as error:
            raise ConfigError(str(self.binding.scenario.issue(step, "", str(error), ""))) from error

    def polled(self, *, virtual: bool) -> bool:
        """Whether it wants to be called every :data:`LOOK_NS`."""
        return any(watch.polled(virtual=virtual) for watch in self._watches)

    def advance(self, now: int) -> int:
        if self._moments is not None and not self.finished:
            self._moments.look(now)
        if self._lateness is not None and not self.finished:
            self._lateness.look(now)
        return super().advance(now)

    def _finish(self, why: str, *, broken: bool = False) -> None:
        self.finished = True
        self._life.close()
        self._watches.clear()
        # one that fails does not keep the others from being undone
        with ExitStack() as undo:
            undo.callback(self._conclude, why, broken=broken)
            undo.callback(self._unsubscribe)
            for name in list(self._off):
                undo.callback(self._power, name, on=True)
            for name, signals in self._forced.items():
                undo.callback(self._set, name, dict.fromkeys(signals), force=True)
            for name in list(self._own):
                undo.callback(self._clear, name)

    def _conclude(self, why: str, *, broken: bool) -> None:
        self._not_reached(why)
        if self._moments is not None:
            self.record.traces = self._moments.close(self._now)
            self.record.traces_note = self._moments.note
        self.record.controllers = controllers(self._core, self.record.origin_ns, self._now)
        lateness = self._lateness.report(self._now) if self._lateness is not None else None
        self.record.end(self._now, why, lateness, broken=broken)

    def _note(self, entry: LogEntry) -> None:
        self.record.note(entry)
        self._note_own_loss(entry)
        for watch in self._watches:
            for name in self._concerned(entry):
                watch.note(name, entry)

    def _concerned(self, entry: LogEntry) -> list[str]:
        """The axis, those of the station, or the device to which this happened."""
        return self._axes.get(entry.drive, [entry.drive])

    def _note_own_loss(self, entry: LogEntry) -> None:
        match entry.what:
            case ConnectionLost(lateness=Lateness(late=True)) | WatchdogExpired(lateness=Lateness(late=True)):
                lost = dict.fromkeys(self._concerned(entry), entry.now_ns)
                # of several the first, if it is not over, took the drive out of operation
                self._own_losses = lost | self._own_losses
                self._last_own_losses |= lost
            case StateChanged(after=after) if after == OPERATION:
                self._operated[entry.drive] = inf
                self._own_losses.pop(entry.drive, None)
            case StateChanged(before=before) if before == OPERATION or entry.drive not in self._operated:
                self._operated[entry.drive] = entry.now_ns
            case ConnectionEstablished():
                for name in self._concerned(entry):
                    if self._is_back_with_its_connection(name):
                        self._own_losses.pop(name, None)
            case _:
                pass

    def _is_back_with_its_connection(self, name: str) -> bool:
        """Whether a device, or an axis that was not in operation when the farm lost its connection."""
        lost = self._own_losses.get(name, 0)
        return name not in self._stations or lost - self._operated.get(name, inf) > REST_NS

    # -- steps

    def _step(self, step: Step) -> Life:
        if self._lateness is not None:
            self._lateness.step(self._now)
        yield from super()._step(step)

    def _act(self, step: Step) -> Life:
        # at once, in this process
        yield from ()
        match step.kind:
            case "fault":
                injection = self._core.injections.inject(step.values["spec"], self._now)
                # a name is free again once its fault has ended
                self._own[injection.id] = injection
                if step.part == "trial":
                    self._by_step[id(step)] = injection.id
                self.record.fault_began(injection, self._now)
                if self._moments is not None:
                    self._moments.mark(step.title, injection.drives, self._now, failure=False)
            case "clear":
                wanted = step.values["fault"]
                for name in list(self._own) if wanted == "all" else [wanted]:
                    self._clear(name)
            case "power":
                word = step.one_of(POWER)
                for name in self.binding.chosen(step, word):
                    for on in POWER[word]:
                        self._power(name, on=on)
            case "set":
                for name, values in step.values["signals"].items():
                    self._set(name, values)
            case "force":
                for name, values in step.values["signals"].items():
                    self._force(name, values)
            case "release":
                for name, values in releases(step.values["signals"], self._core.signal_owners).items():
                    self._force(name, values)
            case "restore":
                for note in self._states.restore_at_once(step.values["state"]):
                    self.record.note_told(self._now, "", note, None)
            case "param":
                for name in self.binding.chosen(step):
                    for parameter, value in step.values["set"].items():
                        try:
                            self._stations[name].store.set(parameter, value)
                        except PnfarmError as error:
                            raise ConfigError(f"{name}, {parameter}: {error}") from error
                    self._core.settle(self._stations[name].station, self._now)

    def _set(self, name: str, values: Mapping[str, Any], *, force: bool = False) -> None:
        station, signals = self._core.with_signals(name)
        try:
            overruled = (signals.force if force else signals.set)(values)
        except PnfarmError as error:
            raise ConfigError(f"{name}: {error}") from error
        for signal, owner in overruled.items():
            self.record.note_told(self._now, name, f"{signal} waits: a {owner} has it", None)
        self._core.settle_owner(station, self._now)

    def _force(self, name: str, values: Mapping[str, Any]) -> None:
        self._set(name, values, force=True)
        note_forces(self._forced, name, values)

    def _end_fault(self, name: str) -> Life:
        yield from ()
        if name in self._own:
            self._clear(name)

    def _read_metric(self, metric: MetricName) -> Generator[int, None, Reading]:
        found = read_metric(self._collector, metric)
        # reading takes time: what follows begins now
        yield self._now
        return found

    @property
    def _told_late(self) -> str:
        return (self._lateness.told if self._lateness is not None else "") or "late"

    def _clear(self, name: str) -> None:
        """End it, unless it has ended on its own or was cleared before."""
        injection = self._own.pop(name, None)
        if injection is None:
            return
        if injection.state is not RunState.ENDED:
            self._core.injections.clear(injection.id, self._now)
        self.record.fault_ended(injection)

    def _power(self, name: str, *, on: bool) -> None:
        station = self._stations[name].station
        if on:
            self._off.pop(name, None)
        elif not station.switched_off:
            self._off[name] = None
        if station.switch(self._now, on=on):
            self._core.settle(station, self._now)

    def _powered(self) -> Generator[int, None, Callable[[str], bool]]:
        yield from ()
        return lambda name: self._stations[name].powered

    def _switch(self, name: str, *, on: bool) -> Life:
        yield from ()
        self._power(name, on=on)

    def _wait_until(self, step: Step) -> Life:
        begin = self._moment
        end = begin + step.get("within", DEFAULT_WITHIN_NS)
        watch = self._open(step)
        try:
            while True:
                watch.look(self._now)
                if watch.all_ns is not None and watch.all_ns <= end + LOOK_NS:
                    return
                if self._now >= end:
                    break
                yield end
        finally:
            self._watches.remove(watch)
        missing = [name for name in watch.values() if name not in watch.held_ns]
        waited = format_duration(end - begin)
        message = f"not true within {waited} on {_few(missing or list(watch.values()))}"
        self._fail(step, begin, message, watch, missing, unseen=self._is_unseen(watch))
        raise EndedError(f"{step.title}: {message}")

    def _open(self, step: Step) -> Watch:
        watch = Watch(self.binding.conditions(step), self._stations, self._core.signal_owners)
        self._watches.append(watch)
        return watch

    def _expect(self, step: Step) -> Life:
        begin = self._moment
        within, hold = step.get("within", 0), step.get("for", 0)
        watch = self._open(step)
        try:
            watch.look(self._now)
            while not watch.all_held and self._now < begin + within:
                yield begin + within
                watch.look(self._now)
            # who looks late sees what came true too late
            latest = begin + within + LOOK_NS
            missing = [name for name in watch.values() if watch.held_ns.get(name, latest + 1) > latest]
            if missing:
                limit = f"within {format_duration(within)}" if within else "at once"
                # what is true at the first check after the end may have been so in time
                end = begin + within if watch.all_held and within else None
                unseen = self._is_unseen(watch, end)
                self._fail(step, begin, f"not true {limit} on {_few(missing)}", watch, missing, unseen=unseen)
                return
            if hold:
                yield from self._hold(watch, hold)
            if watch.broken_ns:
                after = _time(min(watch.broken_ns.values()) - begin)
                broken = list(watch.broken_ns)
                self._fail(step, begin, f"true, but no longer after {after} on {_few(broken)}", watch, broken)
                return
            if hold and self._is_unseen(watch):
                message = f"true, but the farm, being late, did not look for {_time(watch.unseen_ns)}"
                self._case(step, Verdict.INCONCLUSIVE, begin, message, watch=watch)
                return
            took = max(watch.held_ns.values()) - begin
            message = f"true after {_time(took)}" if took else "true at once"
            shown = _time(took) if took else "at once"
            if hold:
                held = f"held for {_time(hold)}"
                message += f", {held}"
                shown = f"{shown}, {held}" if took else held
            self._case(step, Verdict.PASSED, begin, message, watch=watch, measured=shown)
        finally:
            self._watches.remove(watch)

    def _is_unseen(self, watch: Watch, end: int | None = None) -> bool:
        """Whether something whose changes are no events was not looked at for too long, or not just before ``end``."""
        if self._lateness is None or not watch.polled(virtual=False):
            return False
        return self._lateness.is_unseen(watch.unseen_ns, 0 if end is None else end - watch.before_ns)

    def _hold(self, watch: Watch, hold_ns: int) -> Life:
        end = self._now + hold_ns
        watch.hold(self._now)
        while not watch.broken_ns and self._now < end:
            yield end
            watch.look(self._now)

    def _expect_metric(self, step: Step) -> Life:
        begin = self._now
        metric, asked = step.values["metric"], step.one_of(MEASURES)
        before = read_metric(self._collector, metric)
        yield from self._sleep(step.get("for", 0))
        value = measured(asked, before, read_metric(self._collector, metric))
        bound = step.values[asked]
        holds = bound.holds(value)
        named = [metric.labels["drive"]] if "drive" in metric.labels else []
        own = "" if holds else self._own_part(begin, named or list(self._stations))
        verdict = Verdict.PASSED if holds else Verdict.INCONCLUSIVE if own else Verdict.FAILED
        shown, wanted = show_comparison(metric.name, value, bound)
        message = f"{asked} {shown}, wanted {wanted}{own}"
        drives = named if verdict is not Verdict.PASSED else []
        self._case(step, verdict, begin, message, value=value, measured=shown, drives=drives)
        # reading takes time: the next step begins now
        yield self._now

    # -- cases

    def _own_part(self, begin: int, names: Sequence[str]) -> str:
        """Why the farm itself may be the reason for what became of these drives since ``begin``; else empty."""
        if self._lateness is None:
            return ""
        rested, ended = self._rest
        # a step that takes no time is about the end of the `wait` before it
        since = max(rested, begin - REST_NS) if ended == begin else begin
        if self._lateness.was_late(since, self._now):
            return f"; the farm was itself {self._lateness.told}"
        lost = {name: self._own_losses[name] for name in names if name in self._own_losses and self._is_out(name)}
        lost |= {name: when for name in names if (when := self._last_own_losses.get(name, -1)) >= begin}
        if not lost:
            return ""
        ago = _time(self._now - min(lost.values()))
        return f"; the farm itself, being late, lost the connection of {_few(list(lost))} {ago} before"

    def _is_out(self, name: str) -> bool:
        """Whether a drive is not in operation; one whose other connection was lost is."""
        axis = self._stations.get(name)
        return axis is None or not axis.device.connected or int(axis.handle.axis.drive.state) != OPERATION

    def _fail(
        self, step: Step, begin: int, message: str, watch: Watch, drives: list[str], *, unseen: bool = False
    ) -> None:
        """A condition was not true on ``drives``: failed, unless the farm itself is the reason, or did not look."""
        own = self._own_part(begin, drives or list(watch.values()))
        if not own and unseen:
            own = f"; the farm, being late, did not look for {_time(watch.unseen_ns)}"
        if not own and self._began_late_ns and begin == self.record.origin_ns:
            own = f"; the farm, being late, began to look {_time(self._began_late_ns)} after the moment"
        verdict = Verdict.INCONCLUSIVE if own else Verdict.FAILED
        message += own
        shown = watch.shown()
        measured = "; ".join(f"{name}: {as_text(shown[name])}" for name in drives[:MOST_MEASURED] if name in shown)
        self._case(step, verdict, begin, message, watch=watch, measured=measured, drives=drives)

    def _case(
        self, step: Step, verdict: Verdict, begin: int, message: str, *, watch: Watch | None = None, **values: Any
    ) -> Case | None:
        if watch is not None:
            took = {name: when - begin for name, when in watch.held_ns.items()}
            values |= {"values": watch.values(), "shown": watch.shown(), "took": took}
        if self._lateness is not None:
            values["late_ns"] = self._lateness.worst_ns(begin, self._now)
        case = super()._case(step, verdict, begin, message, **values)
        if case is not None and verdict is not Verdict.PASSED and self._moments is not None:
            self._moments.mark(f"{verdict}: {step.title}", case.drives, self._now, failure=True)
        return case


def _time(ns: int) -> str:
    return format_measured(ns / 1e9)


def _few(names: list[str]) -> str:
    return shortened(names, 5, ", ")
