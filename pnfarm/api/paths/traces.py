"""Paths of traces: start, read, trigger, delete; the signals that a drive has."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol
from urllib.parse import quote

from fastapi import Query, Request
from pydantic import Field
from starlette.responses import Response  # noqa: TC002 - FastAPI reads the annotations of handlers

from pnfarm.trace import TraceRequest
from pnfarm.trace.manager import MOST_TRACES, MOST_VALUES
from pnfarm.web.bodies import PREFIX, Json, Schema, body_of, read_object
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.web.paths import Paths

__all__ = ["KEEP_NS", "Form", "TraceView", "Traces", "TracesHost", "add_traces"]

#: How long a trace stays while no client asks for it, unless its request says so.
KEEP_NS = 600_000_000_000
#: Forms of a trace.
Form = Literal["json", "csv", "status"]


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
    values: list[float | None] = Field(description="None: not a finite number.")
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


class TracesHost(Protocol):
    """Who has the traces.  All raise :class:`~pnfarm.web.errors.NotFoundError` for an unknown id or drive."""

    async def kept(self) -> dict[str, Any]:
        """All, without samples."""

    async def start(self, fields: Mapping[str, Any]) -> dict[str, Any]: ...

    async def signals(self, name: str) -> dict[str, Any]:
        """Those of a drive or a device."""

    async def read(self, trace_id: str, form: Form) -> Response:
        """One, with its samples unless ``form`` is status."""

    async def fire(self, trace_id: str) -> dict[str, Any]:
        """Trigger one that waits."""

    async def delete(self, trace_id: str) -> dict[str, Any]: ...


def add_traces(path: Paths, traces: TracesHost) -> None:
    """Declare them."""

    @path("GET traces", Traces)
    async def get_traces() -> Json:
        """Every trace and how far it is, without samples."""
        limits = {"traces": MOST_TRACES, "values": MOST_VALUES}
        return Json({"traces": [], "limits": limits, **await traces.kept()})

    @path(
        "POST traces",
        {201: TraceView},
        body=body_of(
            TraceRequest.schema(),
            fault={
                "on": "axis-01",
                "signals": ["velocity", "zsw1.fault_present"],
                "trigger": "fault 702",
                "pre": "200ms",
                "length": "2s",
            },
        ),
        role=Role.INJECT,
    )
    async def post_trace(request: Request) -> Json:
        """Start a trace."""
        found = await traces.start(await read_object(request))
        return Json(found, 201, headers={"Location": f"{PREFIX}/traces/{quote(found['id'], safe='')}"})

    @path("GET traces/signals/{name}", SignalsView)
    async def get_signals(name: str) -> Json:
        """The signals of a drive or a device, with their units."""
        return Json(await traces.signals(name))

    @path(
        "GET traces/{trace_id}",
        {200: {"model": TraceRecording | TraceView, "content": {"text/csv": {"schema": {"type": "string"}}}}},
    )
    async def get_trace(
        trace_id: str,
        form: Annotated[Form, Query(alias="format", description="csv: times and values as text.")] = "json",
    ) -> Response:
        """A trace with its samples so far; status without them."""
        return await traces.read(trace_id, form)

    @path("POST traces/{trace_id}/trigger", TraceView, role=Role.INJECT)
    async def post_trigger(trace_id: str) -> Json:
        """Trigger a trace that waits."""
        return Json(await traces.fire(trace_id))

    @path("DELETE traces/{trace_id}", TraceView, role=Role.INJECT)
    async def delete_trace(trace_id: str) -> Json:
        """End a trace and forget its samples."""
        return Json(await traces.delete(trace_id))
