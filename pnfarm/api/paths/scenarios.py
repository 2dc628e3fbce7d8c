"""Paths of scenarios, which the farm or the hub carries out itself: start, list, look at, cancel."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any, Literal

import anyio.to_thread
from fastapi import Query, Request
from pydantic import BaseModel, ConfigDict, Field
from starlette.responses import Response

from pnfarm.api.access.guard import ROLE
from pnfarm.api.paths.at import At, start_ns
from pnfarm.api.paths.faults import FaultEvidence  # noqa: TC001 - pydantic reads the annotations of fields
from pnfarm.scenario.running import BarredStepError
from pnfarm.vocabulary.issues import FarmFileError
from pnfarm.web.bodies import PREFIX, Json, Schema, body_of, checked, read_object
from pnfarm.web.errors import RequestError, named_by_path
from pnfarm.web.paths import text
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from pnfarm.api.paths.host import Host
    from pnfarm.scenario.running import KeptScenarios, RunningScenario
    from pnfarm.web.paths import Paths

__all__ = ["add_scenarios"]

#: Kinds of steps that do what only a path for this role does.
ADMIN_STEPS = frozenset({"restore"})

#: A report has its scripts in it: it is shown as a page of no origin, which cannot call the API.
REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
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
    failed_code: list[str] = Field(description="Programs and models of the user that raised an error, with the place.")
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


class ScenarioText(Schema):
    """A scenario to run."""

    text: str = Field(description="A scenario file's text (YAML); `farm:` in it is ignored.")
    variables: dict[str, int | float | str] = Field(
        default={}, max_length=64, description="Values that replace those of its `variables:`."
    )
    part: bool = Field(
        default=False,
        description="Of a client's own, such as a wait, or a hub's part on a farm: without traces, not listed.",
    )


def add_scenarios(path: Paths, scenarios: KeptScenarios, host: Host) -> None:
    """Declare them."""

    def known(scenario_id: str) -> RunningScenario:
        with named_by_path():
            found = scenarios.get(scenario_id)
        if (failure := found.failure) is not None:
            raise failure
        return found

    @path("GET scenarios", Scenarios)
    async def get_scenarios() -> Json:
        """Scenarios at work, and the last that ended."""
        return Json({"scenarios": [found.summary() for found in scenarios.list()]})

    @path("POST scenarios", {201: ScenarioRecord}, body=body_of(ScenarioText), role=Role.INJECT)
    async def post_scenario(request: Request, at: At = None) -> Json:
        """Check a scenario against the farm and begin it."""
        wanted = checked(await read_object(request), ScenarioText, hint='send {"text": a scenario file as text}')
        try:
            # a step takes no more than the path that does the same
            barred = () if request.scope[ROLE].covers(Role.ADMIN) else ADMIN_STEPS
            found = scenarios.start(
                wanted.text, wanted.variables, part=wanted.part, barred=barred, at_ns=start_ns(at, host)
            )
        except BarredStepError as exc:
            sentence = f"{exc}: that needs a token with the role {Role.ADMIN}"
            raise RequestError(sentence, status=HTTPStatus.FORBIDDEN) from exc
        except FarmFileError as exc:
            errors = [
                {"line": str(issue.line), "field": issue.field, "what": issue.what, "allowed": issue.allowed}
                for issue in exc.issues
            ]
            raise RequestError(str(exc).replace("\n", "; "), errors) from exc
        return Json(found.as_dict(), HTTPStatus.CREATED, headers={"Location": f"{PREFIX}/scenarios/{found.id}"})

    @path("GET scenarios/{scenario_id}", ScenarioRecord | ScenarioProgress)
    async def get_scenario(
        scenario_id: str,
        cases_from: Annotated[
            int | None,
            Query(ge=0, description="Only its progress, and the ended cases after this many."),
        ] = None,
    ) -> Json:
        """One scenario: verdict, cases, timeline; while it runs, what there is so far."""
        found = known(scenario_id)
        return Json(found.as_dict() if cases_from is None else found.progress(cases_from, host.now()))

    @path("GET scenarios/{scenario_id}/report", text("text/html"), response_class=Response)
    async def get_report(scenario_id: str) -> Response:
        """The report of a scenario that ended, as a page for a browser."""
        from pnfarm.scenario.report.page import report_html  # noqa: PLC0415 - only for those who open one

        found = known(scenario_id)
        if not found.run.finished:
            raise RequestError(f"{scenario_id} still runs; its report is there at its end", status=HTTPStatus.CONFLICT)
        page = await anyio.to_thread.run_sync(report_html, found.as_dict())
        return Response(page, media_type="text/html", headers={"Content-Security-Policy": REPORT_POLICY})

    @path("DELETE scenarios/{scenario_id}", ScenarioRecord, role=Role.INJECT)
    async def delete_scenario(scenario_id: str) -> Json:
        """End a scenario: its faults are cleared."""
        known(scenario_id)
        return Json(scenarios.cancel(scenario_id).as_dict())
