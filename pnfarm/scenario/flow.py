"""The course of a scenario, wherever its drives are: sequences, branches, searches, and to what each step is reported.

:meth:`Flow.advance` carries out what is due and says when to come back.  Steps are generators that yield the time of
their next check, so that branches of ``parallel`` run side by side.  What a step does to drives is a subclass's:
:class:`pnfarm.scenario.run.ScenarioRun` for a farm of this process; a hub has one for farms behind their APIs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError, PnfarmError
from pnfarm.scenario.definition.file import walk
from pnfarm.scenario.find import Search, number_of
from pnfarm.scenario.measures import measured
from pnfarm.scenario.report.record import Case, Record, Verdict

if TYPE_CHECKING:
    from pnfarm.scenario.definition.binding import Binding
    from pnfarm.scenario.definition.steps import MetricName, Step
    from pnfarm.scenario.measures import Reading

__all__ = ["TRIES", "EndedError", "Flow", "Life", "Tell"]

#: Most trials of a `find` with one value, as long as the farm itself is late in each.
TRIES = 3

Life = Generator[int, None, None]
#: Of a scenario that begins later: a first step that watches conditions looks so long before, to be in time; what is
#: true then is true at the begin.
EARLY_NS = 5_000_000

#: Called with each step that begins (case None) and each case that ends.
Tell = Callable[["Step", "Case | None"], None]


class EndedError(Exception):
    """The scenario cannot go on."""


class Flow(ABC):
    """See the module's docstring; ``begin`` is when the first step begins, now or later."""

    def __init__(self, binding: Binding, farm: str, begin: int, tell: Tell | None = None) -> None:
        self.binding = binding
        self.record = Record(binding.scenario, farm, list(binding.drives), begin)
        self.finished = False
        self._tell = tell or _silent
        self._now = begin
        #: Faults of a trial, by step.
        self._by_step: dict[int, str] = {}
        #: What the expectations of a trial showed, by step.
        self._outcomes: dict[int, tuple[Verdict, str]] = {}
        every = list(binding.scenario.every_step())
        self._numbers = {id(step): number for number, step in enumerate(every)}
        self.steps = len(every)
        #: When the present step is over at the latest.
        self.due_ns = begin
        self._life = self._sequence(binding.scenario.steps)
        self._waits = False
        #: How long after its moment one that had to wait for it began.
        self._began_late_ns = 0
        #: Steps that began, for progress.
        self.steps_begun = 0
        #: The step that began last.
        self.step = ""
        #: Begin and end of the `wait` for a time that ended last.
        self._rest = begin, begin - 1

    def advance(self, now: int) -> int:
        """Do what is due; when to call again at the latest."""
        if now < (begin := self.record.origin_ns):
            early = begin - (EARLY_NS if self.binding.scenario.steps[0].watches else 0)
            if now < early:
                self._waits = True
                return early
            now = begin
        elif self._waits:
            self._began_late_ns = now - begin
        self._waits = False
        self._now = now
        if self.finished:
            return now
        try:
            self.due_ns = next(self._life)
        except StopIteration:
            self._finish("")
        except EndedError as ended:
            self._finish(str(ended))
        else:
            return self.due_ns
        return now

    def cancel(self, now: int, why: str = "cancelled", *, broken: bool = False) -> None:
        """End before the last step; what did not run is reported as not run.

        ``broken``: because the farm ended or failed, and not at a user's request.
        """
        self._now = now
        if not self.finished:
            self._finish(why, broken=broken)

    @abstractmethod
    def _finish(self, why: str, *, broken: bool = False) -> None:
        """The run is over: undo what it changed, and give every case a verdict."""

    def _not_reached(self, why: str) -> None:
        """Expectations without a case did not run."""
        reached = {case.number for case in self.record.cases}
        for number, step in self.binding.scenario.expectations():
            if number not in reached:
                self.record.add(Case(number, step, Verdict.NOT_RUN, 0, 0, message=why or "not reached"))

    def _load(self, step: Step) -> Life:
        names, on = self._to_switch(step, (yield from self._powered()))
        if not names:
            return
        begin, over = self._now, step.get("over", 0)
        for number, name in enumerate(names):
            # each at its moment of the whole time, so that one that took longer does not delay all after it
            yield from self._sleep(max(0, begin + over * number // len(names) - self._now))
            yield from self._switch(name, on=on)
        yield from self._sleep(max(0, begin + over - self._now))

    def _to_switch(self, step: Step, powered: Callable[[str], bool]) -> tuple[list[str], bool]:
        """The drives that a `load` switches, in turn, and whether on.  Raises :class:`ConfigError`."""
        chosen = self.binding.chosen(step, "on")
        wanted = step.get("drives")
        if wanted is None:
            wanted = step.values["total"] - sum(map(powered, chosen))
        on = wanted > 0
        names = [name for name in chosen if powered(name) is not on]
        if len(names) < abs(wanted):
            word = "off" if on else "on"
            raise ConfigError(f"{abs(wanted)} drives are wanted, but only {len(names)} are {word}")
        return names[:wanted] if on else names[: wanted - 1 : -1], on

    # -- what a subclass does

    @abstractmethod
    def _act(self, step: Step) -> Life:
        """A step that changes something: a fault, clear, power, param."""

    @abstractmethod
    def _wait_until(self, step: Step) -> Life:
        """Raises :class:`EndedError` where it does not come true in time."""

    @abstractmethod
    def _expect(self, step: Step) -> Life: ...

    @abstractmethod
    def _expect_metric(self, step: Step) -> Life: ...

    @abstractmethod
    def _powered(self) -> Generator[int, None, Callable[[str], bool]]:
        """Which drives have their supply."""

    @abstractmethod
    def _switch(self, name: str, *, on: bool) -> Life:
        """A drive's supply."""

    @abstractmethod
    def _read_metric(self, metric: MetricName) -> Generator[int, None, Reading]: ...

    @abstractmethod
    def _end_fault(self, name: str) -> Life:
        """End a fault of a trial, unless it has ended."""

    @property
    def _moment(self) -> int:
        """When the step that begins now should begin: the first one may be late."""
        begin = self.record.origin_ns
        return begin if self._now == begin + self._began_late_ns else self._now

    @property
    def _told_late(self) -> str:
        """How late the farm itself was, in words."""
        return "late"

    def _case(self, step: Step, verdict: Verdict, begin: int, message: str, **values: Any) -> Case | None:
        """A step has its verdict: a case with these values, or None for what decides a trial."""
        if step.part == "trial" and verdict is not Verdict.ERROR and step.kind == "expect":
            self._outcomes[id(step)] = verdict, f"{step.title}: {message}"
            return None
        case = Case(self._numbers[id(step)], step, verdict, begin, self._now, message=message, **values)
        self.record.add(case)
        self._tell(step, case)
        return case

    # -- the course

    def _sequence(self, steps: tuple[Step, ...]) -> Life:
        for step in steps:
            self.steps_begun += 1
            self.step = step.title
            self._tell(step, None)
            self.record.step(step, self._now)
            yield from self._step(step)

    def _step(self, step: Step) -> Life:
        try:
            match step.kind:
                case "wait" if "until" in step.values:
                    yield from self._wait_until(step)
                case "wait":
                    began = self._now
                    yield from self._sleep(step.values["for"])
                    self._rest = began, self._now
                case "expect" if "metric" in step.values:
                    yield from self._expect_metric(step)
                case "expect":
                    yield from self._expect(step)
                case "load":
                    yield from self._load(step)
                case "parallel":
                    yield from self._parallel(step)
                case "find":
                    yield from self._find(step)
                case _:
                    yield from self._act(step)
        except PnfarmError as error:
            self._case(step, Verdict.ERROR, self._now, str(error), measured="could not be carried out")
            raise EndedError(f"{step.title}: {error}") from error

    def _sleep(self, duration_ns: int) -> Life:
        end = self._now + duration_ns
        while self._now < end:
            yield end

    def _parallel(self, step: Step) -> Life:
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

    def _find(self, step: Step) -> Life:
        begin = self._now
        search = Search(step.values["values"], step.get("by", "first"))
        while (place := search.next()) is not None:
            trial, then = step.branches[2 * place : 2 * place + 2]
            for _ in range(TRIES):
                verdict = yield from self._trial(step, search, place, trial)
                yield from self._sequence(then)
                if verdict is not Verdict.INCONCLUSIVE:
                    break
            else:
                late = self._told_late
                message = f"the farm was itself {late} in each of {TRIES} trials with {search.values[place]}"
                self._case(step, Verdict.INCONCLUSIVE, begin, message)
                self.record.found(step, search, Verdict.INCONCLUSIVE, message)
                return
        held, message = search.verdict(step.get("is"))
        verdict = Verdict.PASSED if held else Verdict.FAILED
        value = number_of(search.found) if search.found is not None else None
        shown = str(search.found) if search.found is not None else "no value holds"
        self._case(step, verdict, begin, message, value=value, measured=shown)
        self.record.found(step, search, verdict, message)

    def _trial(self, step: Step, search: Search, place: int, trial: tuple[Step, ...]) -> Generator[int, None, Verdict]:
        """One trial, up to its first expectation that does not hold; its faults end with it."""
        begin = self._now
        measure = step.get("measure")
        before = (yield from self._read_metric(measure.metric)) if measure is not None else {}
        decided = Verdict.PASSED, ""
        for part in trial:
            yield from self._sequence((part,))
            outcomes = [found for inner in walk((part,)) if (found := self._outcomes.pop(id(inner), None)) is not None]
            decided = next((found for found in outcomes if found[0] is not Verdict.PASSED), decided)
            if decided[0] is not Verdict.PASSED:
                break
        value = None
        if measure is not None:
            after = yield from self._read_metric(measure.metric)
            value = measured(measure.asked, before, after)
        for part in walk(trial):
            name = self._by_step.pop(id(part), None)
            if name is not None:
                yield from self._end_fault(name)
        verdict, message = decided
        if verdict is not Verdict.INCONCLUSIVE:
            at = (begin - self.record.origin_ns) / 1e9
            search.note(place, held=verdict is Verdict.PASSED, message=message, measured=value, at_seconds=at)
        return verdict


def _silent(step: Step, case: Case | None) -> None:
    del step, case
