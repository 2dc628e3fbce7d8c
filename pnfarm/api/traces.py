"""Starting, reading and deleting traces; the signals that a drive has."""

from __future__ import annotations

import json
from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any, Literal
from urllib.parse import quote

import anyio.to_thread
from fastapi import Query, Request
from starlette.responses import Response

from pnfarm.api.answers import SignalsView, TraceRecording, Traces, TraceView
from pnfarm.errors import ConfigError
from pnfarm.trace import TraceRequest
from pnfarm.trace.manager import MOST_TRACES, MOST_VALUES
from pnfarm.trace.signals import signals_of
from pnfarm.web.bodies import PREFIX, Json, read_object
from pnfarm.web.errors import NotFoundError

if TYPE_CHECKING:
    from enum import Enum

    from fastapi import FastAPI

    from pnfarm.api.context import ApiContext
    from pnfarm.trace import Trace

__all__ = ["KEEP_NS", "TRACE_BODY", "add_traces"]

#: How long a trace stays while nobody asks for it, unless its request says so.
KEEP_NS = 600_000_000_000

TRACE_BODY = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": TraceRequest.schema(),
                "examples": {
                    "fault": {
                        "value": {
                            "on": "axis-01",
                            "signals": ["velocity", "zsw1.fault_present"],
                            "trigger": "fault 702",
                            "pre": "200ms",
                            "length": "2s",
                        }
                    }
                },
            }
        },
    }
}


def add_traces(app: FastAPI, context: ApiContext) -> None:
    """Handlers under ``/traces``."""
    tags: list[str | Enum] = ["traces"]

    def found(trace_id: str) -> Trace:
        try:
            return context.core.traces.get(trace_id, context.now())
        except ConfigError as exc:
            raise NotFoundError(str(exc)) from exc

    @app.get(
        f"{PREFIX}/traces",
        tags=tags,
        summary="Every trace and its progress, without samples",
        responses={200: {"model": Traces}},
    )
    async def get_traces() -> Json:
        limits = {"traces": MOST_TRACES, "values": MOST_VALUES}
        return Json({"traces": [trace.as_dict() for trace in context.core.traces.kept()], "limits": limits})

    @app.post(
        f"{PREFIX}/traces",
        tags=tags,
        summary="Start a trace",
        status_code=201,
        responses={201: {"model": TraceView}},
        openapi_extra=TRACE_BODY,
    )
    async def post_trace(request: Request) -> Json:
        trace = context.core.traces.start(await read_object(request), context.now(), keep_ns=KEEP_NS)
        context.poke()
        place = f"{PREFIX}/traces/{quote(trace.id, safe='')}"
        return Json(trace.as_dict(), HTTPStatus.CREATED, headers={"Location": place})

    @app.get(
        f"{PREFIX}/traces/signals/{{name}}",
        tags=tags,
        summary="The signals of a drive, with their units",
        responses={200: {"model": SignalsView}},
    )
    async def get_signals(name: str) -> Json:
        station = context.station(name)
        signals = [signal.as_dict() for signal in signals_of(station).values()]
        return Json({"drive": station.configured_name, "signals": signals})

    @app.get(
        f"{PREFIX}/traces/{{trace_id}}",
        tags=tags,
        summary="A trace with its samples so far; status without them",
        responses={200: {"model": TraceRecording | TraceView, "content": {"text/csv": {"schema": {"type": "string"}}}}},
    )
    async def get_trace(
        trace_id: str,
        form: Annotated[
            Literal["json", "csv", "status"], Query(alias="format", description="csv: times and values as text.")
        ] = "json",
    ) -> Response:
        trace = found(trace_id)
        if form == "status":
            return Json(trace.as_dict())
        # the samples are copied here, once; text of a million numbers takes a second, which is a thread's
        recording = trace.recording()
        if form == "csv":
            text = await anyio.to_thread.run_sync(recording.csv)
            return Response(text, media_type="text/csv")
        status = trace.as_dict()

        def rendered() -> str:
            body: dict[str, Any] = {**status, **recording.as_dict()}
            return json.dumps(body, allow_nan=False, separators=(",", ":"))

        return Response(await anyio.to_thread.run_sync(rendered), media_type="application/json")

    @app.post(
        f"{PREFIX}/traces/{{trace_id}}/trigger",
        tags=tags,
        summary="Trigger a trace that waits",
        responses={200: {"model": TraceView}},
    )
    async def post_trigger(trace_id: str) -> Json:
        found(trace_id)
        trace = context.core.traces.fire(trace_id, context.now())
        context.poke()
        return Json(trace.as_dict())

    @app.delete(
        f"{PREFIX}/traces/{{trace_id}}",
        tags=tags,
        summary="End a trace and delete its samples",
        responses={200: {"model": TraceView}},
    )
    async def delete_trace(trace_id: str) -> Json:
        found(trace_id)
        trace = context.core.traces.delete(trace_id, context.now())
        context.poke()
        return Json(trace.as_dict())
