"""What a run recorded: its cases with verdicts, and the timeline for the report; plain JSON values at the end."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from pnfarm.controller.program_runner import ProgramFailed
from pnfarm.farm.views.stations import json_value
from pnfarm.plant.events import PlantModelFailed
from pnfarm.scenario.watch import signals_of_event
from pnfarm.station import events
from pnfarm.vocabulary.durations import format_measured
from pnfarm.vocabulary.quoting import shortened

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from pnfarm.faults.manager import Injection
    from pnfarm.scenario.definition.file import Scenario
    from pnfarm.scenario.definition.steps import Step
    from pnfarm.scenario.find import Search
    from pnfarm.scenario.report.trace_excerpts import Excerpt
    from pnfarm.station.event_log import LogEntry

__all__ = ["EXIT_CODES", "Case", "Record", "Verdict", "worst"]

#: Most entries of the timeline: the first half of them, and the last half; those between are counted only.
MAX_TIMELINE = 20_000
#: Most times of one reaction of a drive.
MAX_REACTIONS = 2_000
#: Most sentences about users' code that failed.
MAX_CODE = 100
#: Most drives' values that cases keep altogether; beyond it, those of cases that did not pass only.
MAX_VALUES = 50_000


class Verdict(StrEnum):
    """Of one case, and of the run; ``not run`` is of a case only."""

    PASSED = "passed"
    FAILED = "failed"
    INCONCLUSIVE = "inconclusive"
    ERROR = "error"
    NOT_RUN = "not run"


#: Exit code of ``pnfarm run`` by verdict.
EXIT_CODES: Mapping[Verdict, int] = {
    Verdict.PASSED: 0,
    Verdict.FAILED: 1,
    Verdict.INCONCLUSIVE: 3,
    Verdict.ERROR: 2,
}


#: The first one that there is decides.
_ORDER = (Verdict.ERROR, Verdict.FAILED, Verdict.INCONCLUSIVE)


def worst(verdicts: Iterable[str]) -> Verdict:
    """The verdict over several cases or runs: an error, then a failure, then an inconclusive one decides."""
    found = set(verdicts)
    return next((verdict for verdict in _ORDER if verdict in found), Verdict.PASSED)


@dataclass(slots=True)
class Case:
    """One check.  ``took``: nanoseconds until it held, by drive; ``values``: the signals at its end, by drive."""

    number: int
    step: Step
    verdict: Verdict
    began_ns: int
    ended_ns: int
    message: str = ""
    value: float | None = None
    #: What was measured, in short, for a table.
    measured: str = ""
    #: How late the farm itself was in that time; None where it cannot be late.
    late_ns: int | None = None
    #: The drives on which it did not hold; empty of one that passed, and where it is not about single drives.
    drives: Sequence[str] = ()
    took: Mapping[str, int] = field(default_factory=dict)
    values: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    #: The same for people, with units.
    shown: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def as_dict(self, origin: int) -> dict[str, Any]:
        """For JSON; times are seconds from the start of the run."""
        ran = self.verdict is not Verdict.NOT_RUN
        return {
            "number": self.number,
            "name": self.step.title,
            "line": self.step.line,
            "loop": dict(self.step.loop),
            "verdict": self.verdict.value,
            "drives": list(self.drives),
            "allowed": self.step.allowed,
            "measured": self.measured,
            "message": self.message,
            "began_seconds": (self.began_ns - origin) / 1e9 if ran else None,
            "ended_seconds": (self.ended_ns - origin) / 1e9 if ran else None,
            "farm_late_seconds": self.late_ns / 1e9 if self.late_ns is not None else None,
            "value": self.value if self.value is not None and math.isfinite(self.value) else None,
            "held_after_seconds": {name: took / 1e9 for name, took in self.took.items()},
            "values": {
                name: {key: json_value(value) for key, value in values.items()} for name, values in self.values.items()
            },
            "shown": {name: dict(texts) for name, texts in self.shown.items()},
        }


class Record:
    """Grows while the scenario runs; :meth:`as_dict` at any time."""

    def __init__(self, scenario: Scenario, farm: str, drives: Sequence[str], now: int) -> None:
        self._scenario = scenario
        self._farm = farm
        self._drives = list(drives)
        #: When the run began.
        self.origin_ns = now
        self._now = now
        self._ended = self._broken = False
        self._why = ""
        self._lateness: Mapping[str, Any] | None = None
        self._timeline: list[dict[str, Any]] = []
        self._latest: deque[dict[str, Any]] = deque(maxlen=MAX_TIMELINE // 2)
        self._left_out = self._reactions_left_out = self._values = self._values_left_out = 0
        self._lost_ns: dict[str, int] = {}
        self._reactions: dict[str, dict[str, list[float]]] = {}
        self._faults: dict[Injection, dict[str, Any]] = {}
        self._finds: list[dict[str, Any]] = []
        #: Users' code that failed, by what and why: when first, and whose.
        self._failed_code: dict[tuple[str, str], tuple[int, list[str]]] = {}
        #: In the order in which they ended.
        self.cases: list[Case] = []
        #: Pictures of faults and failures (:mod:`pnfarm.scenario.report.trace_excerpts`), and why there are no more.
        self.traces: Sequence[Excerpt] = ()
        self.traces_note = ""
        #: What the controllers of the drives did (:mod:`pnfarm.scenario.controllers`).
        self.controllers: list[dict[str, Any]] = []

    @property
    def verdict(self) -> Verdict:
        """An error, then a failure, then an inconclusive case decides; a run that was cut short did not pass."""
        if self._broken:
            return Verdict.ERROR
        found = worst(case.verdict for case in self.cases)
        return Verdict.INCONCLUSIVE if found is Verdict.PASSED and self._why else found

    def add(self, case: Case) -> None:
        """A case has its verdict."""
        self._values += len(case.values)
        if self._values > MAX_VALUES and case.verdict is Verdict.PASSED:
            # a run of days checks all drives again and again
            self._values -= len(case.values)
            self._values_left_out += bool(case.values)
            case.values, case.shown, case.took = {}, {}, {}
        self.cases.append(case)

    def step(self, step: Step, now: int) -> None:
        """A step begins."""
        self._place({"seconds": self._seconds(now), "what": "step", "text": step.title, "line": step.line})

    def note(self, entry: LogEntry) -> None:
        """An entry of the farm's log."""
        changed = signals_of_event(entry)
        what = entry.what
        if changed or isinstance(what, (events.ConnectionLost, events.ConnectionReleased, events.WatchdogExpired)):
            item = {"seconds": self._seconds(entry.now_ns), "what": "event", "drive": entry.drive, "text": entry.event}
            own = getattr(what, "lateness", None)
            if own is not None:
                # whose doing it was
                item |= {"cause": own.cause, "farm_late_seconds": own.worst_ns / 1e9}
            state = changed.get("state")
            self._place(item | ({"state": state} if state is not None else {}))
        match what:
            case events.FaultReacted(after_ns=after):
                self._reaction(entry.drive, "reacted_seconds", after)
            case events.FaultsCleared(after_ns=after):
                self._reaction(entry.drive, "acknowledged_seconds", after)
            case events.ConnectionLost():
                self._lost_ns.setdefault(entry.drive, entry.now_ns)
            case events.ConnectionEstablished() if entry.drive in self._lost_ns:
                self._reaction(entry.drive, "reconnected_seconds", entry.now_ns - self._lost_ns.pop(entry.drive))
            case PlantModelFailed(model=model):
                self._note_code(entry, "the model", model)
            case _:
                pass

    def note_program(self, entry: LogEntry) -> None:
        """An entry of the log of the controller that runs in this process."""
        if isinstance(entry.what, ProgramFailed):
            self._note_code(entry, "the PLC program of", entry.drive)

    def _note_code(self, entry: LogEntry, kind: str, name: str) -> None:
        """A user's program or model failed: it does nothing any more."""
        what = entry.what
        assert isinstance(what, (ProgramFailed, PlantModelFailed))
        place = f"{what.file}:{what.line}: " if what.line else f"{what.file}: " if what.file else ""
        key = kind, f"{place}{what.error}"
        if key in self._failed_code or len(self._failed_code) < MAX_CODE:
            self._failed_code.setdefault(key, (entry.now_ns, []))[1].append(name)

    def note_told(self, now: int, drive: str, text: str, state: int | None) -> None:
        """An event of another farm, for the timeline."""
        item = {"seconds": self._seconds(now), "what": "event", "drive": drive, "text": text}
        self._place(item | ({"state": f"S{state}" if state else "boot"} if state is not None else {}))

    def _reaction(self, drive: str, what: str, after_ns: int) -> None:
        found = self._reactions.setdefault(drive, {}).setdefault(what, [])
        if len(found) < MAX_REACTIONS:
            found.append(after_ns / 1e9)
        else:
            self._reactions_left_out += 1

    def fault_began(self, injection: Injection, now: int) -> None:
        """A fault of the scenario was put in force; its id is the name that the scenario gave it, if it did."""
        self._faults[injection] = {
            "name": injection.id,
            "kind": injection.spec.kind.name,
            "drives": list(injection.drives),
            "when": injection.spec.when or "",
            "began_seconds": self._seconds(now),
            "ended_seconds": None,
        }

    def fault_ended(self, injection: Injection) -> None:
        """It was cleared, or found to have ended on its own."""
        ends = [run.ended_ns for run in injection.runs.values() if run.ended_ns is not None]
        self._faults[injection]["ended_seconds"] = self._seconds(max(ends)) if ends else None

    def end(self, now: int, why: str, lateness: Mapping[str, Any] | None, *, broken: bool = False) -> None:
        """The run is over; ``why``: what cut it short; ``broken``: it was the farm's end."""
        self._now, self._why, self._lateness, self._ended, self._broken = now, why, lateness, True, broken
        # the farm drops the evidence of old injections: what the report has is taken now
        for injection, shown in self._faults.items():
            if shown["ended_seconds"] is None:
                self.fault_ended(injection)
            shown["evidence"] = injection.as_dict()["evidence"]
            # one that had to wait began later than it was asked for, or never
            starts = [run.started_ns for run in injection.runs.values() if run.started_ns is not None]
            shown["began_seconds"] = self._seconds(min(starts)) if starts else None

    def _sorted(self) -> list[Case]:
        """In the order of the file."""
        return sorted(self.cases, key=lambda case: case.number)

    def found(self, step: Step, search: Search, verdict: Verdict, message: str) -> None:
        """A `find` is at its end."""
        measure = step.get("measure")
        self._finds.append(
            {
                "name": step.title,
                "line": step.line,
                "variable": step.values["variable"],
                "by": search.by,
                "verdict": verdict.value,
                "message": message,
                "found": search.found,
                "beyond": search.beyond,
                "unit": "s" if isinstance(step.values["values"][0], str) else "",
                "wanted": step.values["is"].text if "is" in step.values else None,
                "measure": measure.text if measure is not None else None,
                "tries": search.tries,
            }
        )

    def _seconds(self, now: int) -> float:
        return (now - self.origin_ns) / 1e9

    def _place(self, item: dict[str, Any]) -> None:
        if len(self._timeline) < MAX_TIMELINE // 2:
            self._timeline.append(item)
        else:
            self._left_out += len(self._latest) == self._latest.maxlen
            self._latest.append(item)

    def counts(self) -> dict[str, int]:
        return {verdict.value: sum(case.verdict is verdict for case in self.cases) for verdict in Verdict}

    def summary(self) -> dict[str, Any]:
        """Without cases, timeline and traces."""
        return {
            "scenario": self._scenario.title,
            "state": "ended" if self._ended else "running",
            "verdict": self.verdict.value if self._ended else None,
            "ended_early": self._why,
            "seconds": self._seconds(self._now),
            "counts": self.counts(),
        }

    def as_dict(self) -> dict[str, Any]:
        """The whole record, plain JSON values."""
        return {
            **self.summary(),
            "description": self._scenario.description,
            "file": str(self._scenario.path) if self._scenario.path is not None else "",
            "matrix": dict(self._scenario.combination),
            "farm": self._farm,
            "drives": self._drives,
            "farm_ended": self._broken,
            "cases": [case.as_dict(self.origin_ns) for case in self._sorted()],
            "finds": self._finds,
            "failed_code": [
                f"{kind} {shortened(names)} failed after {format_measured(self._seconds(first))}: {why}"
                for (kind, why), (first, names) in self._failed_code.items()
            ],
            "faults": list(self._faults.values()),
            "plc": self._reactions,
            "plc_left_out": self._reactions_left_out,
            "values_left_out": self._values_left_out,
            "controllers": self.controllers,
            "traces": [excerpt.as_dict() for excerpt in self.traces],
            "traces_note": self.traces_note,
            "timeline": [*self._timeline, *self._latest],
            "timeline_left_out": self._left_out,
            "lateness": dict(self._lateness) if self._lateness is not None else None,
        }
