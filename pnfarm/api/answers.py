"""Types of what the API answers about faults, traces, scenarios and the event log: for its OpenAPI description."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from pnfarm.web.bodies import Schema

__all__ = [
    "Alive",
    "Fault",
    "FaultKinds",
    "Faults",
    "ScenarioProgress",
    "ScenarioRecord",
    "Scenarios",
    "SignalsView",
    "TraceRecording",
    "TraceView",
    "Traces",
]


class Alive(Schema):
    alive: bool = Field(description="Always true: the process answers.")


# faults


class KindParameter(Schema):
    type: str = Field(description="number, whole number, yes or no, duration, word, fault, mac or octets.")
    default: Any
    required: bool
    unit: str
    minimum: float | None
    maximum: float | None
    words: list[str]
    allowed: str
    doc: str


class KindOnBus(Schema):
    """What is different of a kind on drives of one bus; empty texts are as for any bus."""

    params: list[str] = Field(description="Parameters that only drives on this bus take.")
    wire: str
    reports: str
    refused: str = Field(description="Why drives on this bus have no such fault; empty if they have.")


class FaultKind(Schema):
    """A kind of fault as it is in the catalogue."""

    kind: str
    family: str
    doc: str
    occurrence: str = Field(description="What `count` and `probability` refer to.")
    wire: str = Field(description="What a capture shows.")
    reports: str = Field(description="What controllers report.")
    buses: dict[str, KindOnBus] = Field(description="What differs on a bus, by its name.")
    params: dict[str, KindParameter]
    directions: list[str] = Field(description="The first one is the default; empty for a kind that has none.")
    takes: list[str] = Field(description="The common fields that it takes.")


class FaultKinds(Schema):
    kinds: list[FaultKind]


class FaultEvidence(Schema):
    """Seconds are those of the farm's clock."""

    checks: int = Field(description="Occurrences that were possible.")
    activations: int = Field(description="Those of them that happened.")
    first_seconds: float | None
    last_seconds: float | None
    confirmed: bool = Field(description="It was seen on the wire; of several drives, on every one.")
    confirmation: Literal["confirmed", "contradicted", "inconclusive"]
    reason: str = Field(description="Why it is not confirmed; empty when it is.")


RunState = Literal["waiting", "active", "ended"]


class FaultRun(Schema):
    """A fault on one of its drives."""

    state: RunState
    waits_for: str = Field(description="Empty once it has begun.")
    reason: str = Field(description="Why it ended; empty before.")
    starts: int = Field(description="How often it began; more than once only with `rate`.")
    held_seconds: float | None = Field(description="When its condition (`when`) held.")
    started_seconds: float | None
    ended_seconds: float | None
    evidence: FaultEvidence


class Fault(Schema):
    """A fault that was injected; seconds are those of the farm's clock."""

    id: str
    kind: str
    state: RunState = Field(description="Active while it is on any drive, ended once it is on all.")
    spec: dict[str, Any] = Field(description="As it was asked for, in the form of the request.")
    added_seconds: float
    expires_seconds: float | None = Field(description="When its time to live ends unless it is renewed.")
    evidence: FaultEvidence = Field(description="Summed over the drives.")
    drives: dict[str, FaultRun]


class Faults(Schema):
    faults: list[Fault]


# traces


class TraceSignal(Schema):
    signal: str
    unit: str
    form: str = Field(description="real, integer, bit, or the kind of code.")
    doc: str


class SignalsView(Schema):
    drive: str
    signals: list[TraceSignal]


class _TraceCommon(Schema):
    id: str
    state: Literal["waiting", "running", "complete", "deleted"]
    triggered: bool
    triggered_by: str
    samples: int
    missed: int = Field(description="Samples that were due while the engine did not step.")
    interval_seconds: float


class TraceView(_TraceCommon):
    """A trace without its samples."""

    drives: list[str]
    request: dict[str, Any] = Field(description="As it was asked for, with the defaults.")


class TraceColumn(Schema):
    drive: str
    signal: str
    unit: str
    form: str
    values: list[float]
    labels: dict[str, str] = Field(default={}, description="Of a code: its names by value; left out without.")


class TraceRecording(TraceView):
    """A trace with its samples so far."""

    trigger: str
    time: list[float] = Field(description="Seconds from the trigger, from the start while it has not fired.")
    columns: list[TraceColumn]


class TraceLimits(Schema):
    traces: int
    values: int


class Traces(Schema):
    traces: list[TraceView]
    limits: TraceLimits = Field(description="Most traces, and most values of all of them.")


# scenarios


CaseVerdict = Literal["passed", "failed", "inconclusive", "error", "not run"]


class ScenarioCase(Schema):
    """An expectation; seconds from the start of the run."""

    number: int
    name: str
    line: int
    loop: dict[str, Any] = Field(description="The variables of the loops that it is in.")
    verdict: CaseVerdict
    drives: list[str] = Field(description="On which it did not hold.")
    allowed: str
    measured: str
    message: str
    began_seconds: float | None
    ended_seconds: float | None
    farm_late_seconds: float | None = Field(description="How late the farm itself was; null in virtual time.")
    value: float | None
    held_after_seconds: dict[str, float] = Field(description="By drive.")
    values: dict[str, dict[str, Any]] = Field(description="The signals at its end, by drive.")
    shown: dict[str, dict[str, str]] = Field(description="The same for people, with units.")


class ScenarioSummary(Schema):
    id: str
    scenario: str
    state: Literal["running", "ended"]
    verdict: CaseVerdict | None = Field(description="Null while it runs.")
    ended_early: str = Field(description="What cut it short; empty if nothing did.")
    seconds: float
    counts: dict[str, int] = Field(description="Cases by verdict.")


class Scenarios(Schema):
    scenarios: list[ScenarioSummary]


class ScenarioProgress(ScenarioSummary):
    """What `cases_from` asks for."""

    step: str
    steps_begun: int
    steps: int
    left_seconds: float = Field(description="Until the present step ends at the latest.")
    cases: list[ScenarioCase] = Field(description="In the order in which they ended.")


class ScenarioFault(Schema):
    name: str
    kind: str
    drives: list[str]
    when: str
    began_seconds: float | None
    ended_seconds: float | None
    evidence: FaultEvidence | None = Field(default=None, description="Once the scenario has ended.")


class ScenarioTry(Schema):
    value: Any
    number: float | None
    held: bool
    message: str
    measured: float | None
    began_seconds: float


class ScenarioFind(Schema):
    name: str
    line: int
    variable: str
    by: str
    verdict: CaseVerdict
    message: str
    found: Any = Field(description="The last value that held; null if none did.")
    beyond: Any = Field(description="The first value that did not hold; null if all held.")
    unit: str
    wanted: str | None
    measure: str | None
    tries: list[ScenarioTry]


class TimelineEntry(BaseModel):
    """A step or an event; an event may have more members."""

    model_config = ConfigDict(extra="allow")

    seconds: float
    what: Literal["step", "event"]
    text: str


class ScenarioRecord(ScenarioSummary):
    """The record of a scenario, so far if it runs; seconds from the start of the run."""

    description: str
    file: str
    matrix: dict[str, Any] = Field(description="Values of the matrix in this run.")
    farm: str
    drives: list[str]
    farm_ended: bool = Field(description="The farm stopped before the scenario's end.")
    cases: list[ScenarioCase] = Field(description="In the order of the file.")
    finds: list[ScenarioFind]
    faults: list[ScenarioFault]
    plc: dict[str, dict[str, list[float]]] = Field(
        description="By drive: seconds of every reaction, acknowledgement and reconnection."
    )
    plc_left_out: int = Field(description="How many of them are not kept.")
    values_left_out: int = Field(description="How many cases' measured series are not kept.")
    controllers: list[dict[str, Any]] = Field(description="What the controller of each drive did.")
    traces: list[dict[str, Any]] = Field(description="Pictures of faults and failures.")
    traces_note: str
    timeline: list[TimelineEntry]
    timeline_left_out: int
    lateness: dict[str, Any] | None = Field(description="The farm's own, at the end; null in virtual time.")
