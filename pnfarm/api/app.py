"""The application: paths of ``/api/v1``, metrics, the web page, and the access checks."""

from __future__ import annotations

import platform
import time
from typing import TYPE_CHECKING, Annotated, Any

import anyio.to_thread
from fastapi import FastAPI, Header, Query, Request
from starlette.responses import PlainTextResponse, Response, StreamingResponse

from pnfarm.api.access.guard import Guard
from pnfarm.api.access.throttle import Throttle
from pnfarm.api.answers import Alive
from pnfarm.api.changes import Changes
from pnfarm.api.context import ApiContext
from pnfarm.api.drives import add_drives
from pnfarm.api.events import event_stream, start_of
from pnfarm.api.faults import add_faults
from pnfarm.api.health import add_health
from pnfarm.api.live import LiveViews
from pnfarm.api.page import add_page
from pnfarm.api.problems import install_handlers
from pnfarm.api.scenarios import add_scenarios
from pnfarm.api.schemas import PROBLEMS, Clock, Problem, Ready, Version, problems_of
from pnfarm.api.traces import add_traces
from pnfarm.buses.registry import BUSES
from pnfarm.errors import EnvironmentError_
from pnfarm.metrics import CONTENT_TYPE, FarmCollector
from pnfarm.version import __version__
from pnfarm.web.bodies import PREFIX, Json

if TYPE_CHECKING:
    from collections.abc import Callable
    from enum import Enum

    from pnfarm.farm.core import FarmCore

__all__ = ["EVENT_STREAM", "LIVE_STREAM", "describe_problems", "make_app"]

#: OpenAPI has no words for the parts of a stream.
EVENT_STREAM = {
    "type": "string",
    "description": "Each message: `id` is the entry's sequence number, `data` a LogEntry of the components as JSON. A "
    "message of type `gap` has in `data` how many entries were `lost`.",
}
LIVE_STREAM = {
    "type": "string",
    "description": "Messages of types farm, overview, log, drive and signals, each with one JSON object; see the "
    "documentation of the web page.",
}
#: A farm whose engine has not ticked for this time is not ready; normally it ticks every millisecond.
STALLED_NS = 1_000_000_000


def _nothing() -> None:
    pass


def make_app(
    core: FarmCore,
    *,
    now: Callable[[], int] = time.monotonic_ns,
    poke: Callable[[], None] = _nothing,
    token: str | None = None,
    read_token: str | None = None,
    collector: FarmCollector | None = None,
) -> FastAPI:
    """The API of one farm.

    ``now`` is the farm's clock and ``poke`` what makes its runtime look at a change
    (:meth:`~pnfarm.farm.realtime.RealTimeDriver.poke`).  With ``token`` every client must show it, or ``read_token``,
    with which it may change nothing; without, only requests for loopback are answered.
    """
    context = ApiContext(
        core=core,
        collector=collector or FarmCollector(core),
        now=now,
        poke=poke,
    )
    app = FastAPI(
        title="pnfarm",
        version=__version__,
        description=f"The virtual drives of farm {core.name}.",
        docs_url=None,
        redoc_url=None,
        openapi_url="/openapi.json",
        responses=PROBLEMS,
    )
    app.state.context = context
    install_handlers(app)
    add_drives(app, context)
    for one in BUSES.values():
        one.add_routes(app, context)
    add_faults(app, context)
    add_scenarios(app, context)
    add_traces(app, context)
    add_health(app, context)
    _add_farm(app, context)
    add_page(app)
    _add_outside(app, context)
    describe_problems(app)
    app.add_middleware(Changes, record=lambda event: core.log.record(context.now(), "", event))
    app.add_middleware(Guard, token=token, read_token=read_token)
    # outermost: a request above the limits is refused before its token is checked
    app.add_middleware(Throttle)
    return app


def _add_farm(app: FastAPI, context: ApiContext) -> None:
    tags: list[str | Enum] = ["farm"]

    @app.get(
        f"{PREFIX}/version", tags=tags, summary="Name and version of the farm", responses={200: {"model": Version}}
    )
    async def version() -> Response:
        return Json({"pnfarm": __version__, "python": platform.python_version(), "api": "v1"})

    @app.get(
        f"{PREFIX}/clock",
        tags=tags,
        summary="The farm's clock and this machine's, and which run of which farm this is",
        responses={200: {"model": Clock}},
    )
    async def clock() -> Response:
        core = context.core
        return Json(
            {
                "kind": "farm",
                "farm": core.name,
                "pnfarm": __version__,
                "instance": context.instance,
                "farm_seconds": context.now() / 1e9,
                "wall_seconds": time.time(),
                "newest_event": core.log.newest,
                "drives": len(core.stations),
            }
        )

    @app.get(f"{PREFIX}/healthz", tags=tags, summary="Whether the process runs", responses={200: {"model": Alive}})
    async def healthz() -> Response:
        return Json({"alive": True})

    @app.get(f"{PREFIX}/readyz", tags=tags, summary="Whether the engine ticks", responses={200: {"model": Ready}})
    async def readyz() -> Response:
        engine = context.core.columns.engine[0]
        cycles, age = int(engine.cycles), context.now() - int(engine.now_ns)
        if not cycles or age > STALLED_NS:
            since = f"for {age / 1e9:.1f} s" if cycles else "since the farm was made"
            raise EnvironmentError_(f"the engine has not ticked {since}; the drives do not run")
        holder = context.core.leaseholder
        if holder is not None and not holder.is_ready:
            raise EnvironmentError_("the drives are mute: their lease is not held, see `pnfarm inspect`")
        return Json({"ready": True, "cycles": cycles, "last_tick_seconds_ago": age / 1e9})

    @app.get(
        f"{PREFIX}/events",
        tags=tags,
        summary="The event log as server-sent events; Last-Event-ID resumes a stream",
        response_class=StreamingResponse,
        responses={200: {"content": {"text/event-stream": {"schema": EVENT_STREAM}}}},
    )
    async def events(
        last_event_id: Annotated[str | None, Header(description="Sequence number of the last entry received.")] = None,
        drive: Annotated[str | None, Query(description="Only entries of this drive.")] = None,
        after: Annotated[
            int | None, Query(ge=0, description="Begin after this sequence number; 0: with the oldest entry kept.")
        ] = None,
        follow: Annotated[bool, Query(description="Keep sending new entries; false: end after the newest.")] = True,
    ) -> Response:
        if drive is not None:
            drive = context.station(drive).configured_name
        begin = last_event_id if last_event_id is not None or after is None else str(after)
        stream = event_stream(context, start_of(context, begin), drive, follow=follow)
        return StreamingResponse(stream, media_type="text/event-stream", headers={"Cache-Control": "no-store"})

    views = app.state.views = LiveViews(context)

    @app.get(
        f"{PREFIX}/live",
        tags=tags,
        summary="What the farm's page shows, as server-sent events: all drives, and one in detail",
        response_class=StreamingResponse,
        responses={200: {"content": {"text/event-stream": {"schema": LIVE_STREAM}}}},
    )
    async def live(
        request: Request,
        drive: Annotated[str | None, Query(description="The drive in detail.")] = None,
        follow: Annotated[bool, Query(description="Keep sending; false: end after the first of each.")] = True,
    ) -> Response:
        station = None if drive is None else context.station(drive)
        stream = views.stream(request.scope, station, follow=follow)
        return StreamingResponse(stream, media_type="text/event-stream", headers={"Cache-Control": "no-store"})


def _add_outside(app: FastAPI, context: ApiContext) -> None:
    """Routes outside of ``/api``."""

    @app.get(
        "/metrics",
        tags=["farm"],
        summary="Metrics in Prometheus's text format",
        response_class=PlainTextResponse,
        responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
    )
    async def metrics() -> Response:
        async with context.rendering:
            scrape = context.collector.gather()
            # a thousand drives make megabytes of text, and the event loop must not block meanwhile
            text = await anyio.to_thread.run_sync(scrape.text)
            process = context.collector.process_text()
        return Response(text + process, media_type=CONTENT_TYPE)


def describe_problems(app: FastAPI, more: Callable[[dict[str, Any]], None] | None = None) -> None:
    """Add the schema that every operation's errors refer to, and drop FastAPI's own for validation.

    ``more`` adds paths that the application has and does not describe itself.
    """
    generate = app.openapi

    def openapi() -> dict[str, object]:
        described = app.openapi_schema
        if described is None:
            described = generate()
            if more is not None:
                more(described)
            schemas = described.setdefault("components", {}).setdefault("schemas", {})
            problem = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
            schemas.update(problem.pop("$defs", {}))
            schemas["Problem"] = problem
            for place, path in described["paths"].items():
                for method, operation in path.items():
                    # FastAPI's own 422 is of another form
                    operation["responses"].pop("422", None)
                    operation["responses"].update(problems_of(method, place, operation))
            schemas.pop("HTTPValidationError", None)
            schemas.pop("ValidationError", None)
            app.openapi_schema = described
        return described

    app.openapi = openapi  # type: ignore[method-assign]  # the documented way to extend the description
