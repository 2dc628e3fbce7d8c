"""Traces at the hub: each is on the drives of one shard, because the samples of one trace have one engine's time."""

from __future__ import annotations

import secrets
from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any, Literal
from urllib.parse import quote

import anyio
from fastapi import Query, Request
from starlette.responses import Response  # noqa: TC002 - FastAPI reads the annotations of handlers

from pnfarm.api.answers import SignalsView, TraceRecording, TraceView
from pnfarm.api.traces import KEEP_NS, TRACE_BODY
from pnfarm.drives.catalogue import model as model_by_name
from pnfarm.errors import ConfigError
from pnfarm.faults.plan import matching
from pnfarm.hub.answers import HubTraces
from pnfarm.hub.routes.drives import passed_on
from pnfarm.hub.shards import AwayError, no_steps
from pnfarm.trace import TraceRequest
from pnfarm.trace.manager import MOST_TRACES, MOST_VALUES
from pnfarm.web.bodies import PREFIX, Json, read_object
from pnfarm.web.errors import NotFoundError, RequestError

if TYPE_CHECKING:
    from enum import Enum

    from fastapi import FastAPI

    from pnfarm.hub.client import Answer
    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["add_hub_traces"]

#: A whole recording may take longer than other answers.
RECORDING_SECONDS = 8.0


def _models(name: str) -> tuple[str, ...]:
    try:
        found = model_by_name(name)
    except ConfigError:
        return (name,)
    return (found.name, *found.aliases)


def add_hub_traces(app: FastAPI, hub: Hub) -> None:
    """Handlers under ``/traces``."""
    tags: list[str | Enum] = ["traces"]

    def chosen(wanted: TraceRequest) -> tuple[Shard, list[str]]:
        """The one shard, and its drives."""
        hub.check_any()
        known: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {}
        for name in hub.shards.names:
            view = next(shard.drives[name] for shard in hub.shards if name in shard.drives)
            known[name] = ((name, str(view.get("station_name") or name)), _models(str(view["model"])))
        names = matching(wanted.on, known)
        shards = {hub.shards.owner(name): None for name in names}
        if len(shards) > 1:
            what = f"means drives of {len(shards)} shards ({', '.join(shard.label for shard in shards)})"
            allowed = "drives of one shard: the samples of a trace have the time of one engine; start a trace for each"
            raise RequestError(
                f"trace.on: {what}; allowed: {allowed}", [{"field": "on", "what": what, "allowed": allowed}]
            )
        return next(iter(shards)), names

    async def holder(trace_id: str) -> Shard:
        """The shard that has a trace."""
        hub.check_any()
        no_steps(trace_id)
        found: list[Shard] = []
        missing = [str(shard.away()) for shard in hub.shards.unreachable]

        async def one(shard: Shard) -> None:
            try:
                answer = await hub.ask(shard, "GET", f"traces/{quote(trace_id, safe='')}", query={"format": "status"})
                if answer.good:
                    found.append(shard)
            except AwayError as exc:
                missing.append(str(exc))

        async with anyio.create_task_group() as tasks:
            for shard in hub.shards.reachable:
                tasks.start_soon(one, shard)
        if len(found) > 1:
            sentence = f"{' and '.join(shard.label for shard in found)} have a trace {trace_id!r}: ask one of them"
            raise RequestError(sentence, status=HTTPStatus.CONFLICT)
        if not found:
            if missing:
                raise AwayError(f"no shard that answers has a trace {trace_id!r}; not known is the rest: {missing[0]}")
            raise NotFoundError(f"there is no trace {trace_id!r}")
        return found[0]

    async def passed(trace_id: str, method: str, suffix: str = "", **options: Any) -> Response:
        shard = await holder(trace_id)
        answer: Answer = await hub.ask(shard, method, f"traces/{quote(trace_id, safe='')}{suffix}", **options)
        return passed_on(answer)

    @app.get(
        f"{PREFIX}/traces",
        tags=tags,
        summary="Every trace of every shard and its progress, without samples",
        responses={200: {"model": HubTraces}},
    )
    async def get_traces() -> Json:
        answers = await hub.ask_all(hub.shards.reachable, "GET", "traces", "traces")
        partial = hub.partial(answers)
        found = [one for a in answers.values() if not isinstance(a, AwayError) for one in a["traces"]]
        return Json({"traces": found, "limits": {"traces": MOST_TRACES, "values": MOST_VALUES}, **partial})

    @app.post(
        f"{PREFIX}/traces",
        tags=tags,
        summary="Start a trace, of drives of one shard",
        status_code=201,
        responses={201: {"model": TraceView}},
        openapi_extra=TRACE_BODY,
    )
    async def post_trace(request: Request) -> Response:
        body = await read_object(request)
        shard, names = chosen(TraceRequest.parse(body, keep_ns=KEEP_NS))
        # a name of its own: those that shards make up are the same on each
        named = {**body, "on": names, "as": body.get("as") or f"trace-{secrets.token_hex(4)}"}
        answer = await hub.ask(shard, "POST", "traces", body=named)
        response = passed_on(answer)
        if answer.location:
            response.headers["Location"] = answer.location
        return response

    @app.get(
        f"{PREFIX}/traces/signals/{{name}}",
        tags=tags,
        summary="The signals of a drive, with their units",
        responses={200: {"model": SignalsView}},
    )
    async def get_signals(name: str) -> Response:
        shard = hub.shards.owner(name)
        return passed_on(await hub.ask(shard, "GET", f"traces/signals/{quote(name, safe='')}"))

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
        return await passed(trace_id, "GET", query={"format": form}, seconds=RECORDING_SECONDS)

    @app.post(
        f"{PREFIX}/traces/{{trace_id}}/trigger",
        tags=tags,
        summary="Trigger a trace that waits",
        responses={200: {"model": TraceView}},
    )
    async def post_trigger(trace_id: str) -> Response:
        return await passed(trace_id, "POST", "/trigger")

    @app.delete(
        f"{PREFIX}/traces/{{trace_id}}",
        tags=tags,
        summary="End a trace and delete its samples",
        responses={200: {"model": TraceView}},
    )
    async def delete_trace(trace_id: str) -> Response:
        return await passed(trace_id, "DELETE")
