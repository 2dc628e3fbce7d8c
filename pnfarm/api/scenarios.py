"""Scenarios that the farm carries out itself: start, list, look at, cancel."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any, Protocol

import anyio.to_thread
from fastapi import Query, Request
from pydantic import Field
from starlette.responses import Response

from pnfarm.api.answers import ScenarioProgress, ScenarioRecord, Scenarios
from pnfarm.errors import ConfigError
from pnfarm.scenario.running import RunningScenario, RunningScenarios
from pnfarm.vocabulary.issues import FarmFileError
from pnfarm.web.bodies import PREFIX, Json, Schema, body_of, checked, read_object
from pnfarm.web.errors import NotFoundError, RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from enum import Enum

    from fastapi import FastAPI

    from pnfarm.api.context import ApiContext

__all__ = ["ScenarioText", "add_scenario_routes", "add_scenarios"]

#: A report has its scripts in it: it is shown as a page of no origin, which cannot call the API.
REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class ScenarioText(Schema):
    """A scenario to run."""

    text: str = Field(description="A scenario file's text (YAML); `farm:` in it is ignored.")
    variables: dict[str, int | float | str] = Field(
        default={}, max_length=64, description="Values that replace those of its `variables:`."
    )
    part: bool = Field(
        default=False,
        description="A part of a scenario that a hub carries out on several farms: without traces, and not listed.",
    )


def add_scenarios(app: FastAPI, context: ApiContext) -> None:
    """Handlers under ``/scenarios``, which the farm carries out itself."""
    scenarios = RunningScenarios(context.core, context.collector, context.now, context.poke)
    context.on_close.append(scenarios.close)
    add_scenario_routes(app, scenarios, context.now)


class Scenarios_(Protocol):  # noqa: N801 - the answer has the name
    """What carries scenarios out: a farm's, or a hub's."""

    def start(
        self, text: str, variables: Mapping[str, Any] | None = None, *, part: bool = False
    ) -> RunningScenario: ...

    def get(self, wanted: str) -> RunningScenario: ...

    def cancel(self, wanted: str) -> RunningScenario: ...

    def list(self) -> list[RunningScenario]: ...


def add_scenario_routes(app: FastAPI, scenarios: Scenarios_, now: Callable[[], int]) -> None:
    """The handlers."""
    tags: list[str | Enum] = ["scenarios"]

    @app.get(
        f"{PREFIX}/scenarios",
        tags=tags,
        summary="Scenarios at work, and the last that ended",
        responses={200: {"model": Scenarios}},
    )
    async def get_scenarios() -> Json:
        return Json({"scenarios": [found.summary() for found in scenarios.list()]})

    @app.post(
        f"{PREFIX}/scenarios",
        tags=tags,
        summary="Check a scenario against the farm and begin it",
        status_code=201,
        responses={201: {"model": ScenarioRecord}},
        openapi_extra=body_of(ScenarioText),
    )
    async def post_scenario(request: Request) -> Json:
        wanted = checked(await read_object(request), ScenarioText, hint='send {"text": a scenario file as text}')
        try:
            found = scenarios.start(wanted.text, wanted.variables, part=wanted.part)
        except FarmFileError as exc:
            errors = [
                {"line": str(issue.line), "field": issue.field, "what": issue.what, "allowed": issue.allowed}
                for issue in exc.issues
            ]
            raise RequestError(str(exc).replace("\n", "; "), errors) from exc
        place = f"{PREFIX}/scenarios/{found.id}"
        return Json(found.as_dict(), HTTPStatus.CREATED, headers={"Location": place})

    @app.get(
        f"{PREFIX}/scenarios/{{scenario_id}}",
        tags=tags,
        summary="One scenario: verdict, cases, timeline; while it runs, what there is so far",
        responses={200: {"model": ScenarioRecord | ScenarioProgress}},
    )
    async def get_scenario(
        scenario_id: str,
        cases_from: Annotated[
            int | None,
            Query(ge=0, description="Only its progress, and the ended cases after this many."),
        ] = None,
    ) -> Json:
        found = _known(scenario_id)
        return Json(found.as_dict() if cases_from is None else found.progress(cases_from, now()))

    @app.get(
        f"{PREFIX}/scenarios/{{scenario_id}}/report",
        tags=tags,
        summary="The report of a scenario that ended, as a page for a browser",
        response_class=Response,
        responses={200: {"content": {"text/html": {"schema": {"type": "string"}}}}},
    )
    async def get_report(scenario_id: str) -> Response:
        from pnfarm.scenario.report.page import report_html  # noqa: PLC0415 - only for those who open one

        found = _known(scenario_id)
        if not found.run.finished:
            raise RequestError(f"{scenario_id} still runs; its report is there at its end", status=HTTPStatus.CONFLICT)
        text = await anyio.to_thread.run_sync(report_html, found.as_dict())
        return Response(text, media_type="text/html", headers={"Content-Security-Policy": REPORT_POLICY})

    @app.delete(
        f"{PREFIX}/scenarios/{{scenario_id}}",
        tags=tags,
        summary="End a scenario: its faults are cleared",
        responses={200: {"model": ScenarioRecord}},
    )
    async def delete_scenario(scenario_id: str) -> Json:
        _known(scenario_id)
        return Json(scenarios.cancel(scenario_id).as_dict())

    def _known(scenario_id: str) -> RunningScenario:
        try:
            found = scenarios.get(scenario_id)
        except ConfigError as exc:
            raise NotFoundError(str(exc)) from exc
        if (failure := found.failure) is not None:
            raise failure
        return found
