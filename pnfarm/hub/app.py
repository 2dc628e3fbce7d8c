"""The hub's application: the paths of a farm's ``/api/v1``, its page, and the same access checks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from fastapi import FastAPI, Query, Request
from starlette.responses import Response, StreamingResponse

from pnfarm.api.access.guard import Guard
from pnfarm.api.access.throttle import Throttle
from pnfarm.api.app import LIVE_STREAM, describe_problems
from pnfarm.api.changes import Changes
from pnfarm.api.page import add_page
from pnfarm.api.problems import install_handlers, problem
from pnfarm.api.scenarios import add_scenario_routes
from pnfarm.api.schemas import PROBLEMS
from pnfarm.hub.faults import HubFaults, RefusedError
from pnfarm.hub.live import HubLive
from pnfarm.hub.routes.drives import add_hub_drives, described_drives, passed_on
from pnfarm.hub.routes.farm import add_hub_farm
from pnfarm.hub.routes.faults import add_hub_faults
from pnfarm.hub.routes.traces import add_hub_traces
from pnfarm.hub.scenarios import HubScenarios
from pnfarm.version import __version__
from pnfarm.web.bodies import PREFIX

if TYPE_CHECKING:
    from pnfarm.hub.hub import Hub

__all__ = ["make_hub_app"]


def make_hub_app(hub: Hub, *, token: str | None = None, read_token: str | None = None) -> FastAPI:
    """The API of one hub; tokens as :func:`pnfarm.api.app.make_app` takes them."""
    app = FastAPI(
        title="pnfarm hub",
        version=__version__,
        description="The virtual drives of several farms as of one.",
        docs_url=None,
        redoc_url=None,
        openapi_url="/openapi.json",
        responses=PROBLEMS,
    )
    app.state.context = hub
    app.state.views = HubLive(hub)
    install_handlers(app)
    app.add_exception_handler(RefusedError, _refused)
    faults = HubFaults(hub)
    add_hub_drives(app, hub)
    add_hub_faults(app, hub, faults)
    add_hub_traces(app, hub)
    add_scenario_routes(app, HubScenarios(hub, faults), hub.now)
    add_hub_farm(app, hub)
    _add_live(app, hub)
    add_page(app)
    describe_problems(app, _of_drives)
    app.add_middleware(Changes, record=hub.record)
    app.add_middleware(Guard, token=token, read_token=read_token)
    # outermost: a request above the limits is refused before its token is checked
    app.add_middleware(Throttle)
    return app


def _of_drives(described: dict[str, Any]) -> None:
    """A drive's own paths: the shard answers them, and they are described as its own."""
    own = described_drives().openapi()
    for path, operations in own["paths"].items():
        if path.startswith(f"{PREFIX}/drives/{{name}}"):
            described["paths"][path] = operations
    schemas = described.setdefault("components", {}).setdefault("schemas", {})
    for name, schema in own["components"]["schemas"].items():
        schemas.setdefault(name, schema)


def _refused(request: Request, exc: Exception) -> Response:
    """A shard's refusal, as the shard words it."""
    assert isinstance(exc, RefusedError)
    try:
        found = exc.answer.object()
        members = {key: found[key] for key in ("errors", "error_number") if key in found}
        return problem(exc.answer.status, str(found["detail"]), request, **members)
    except (ValueError, KeyError):
        return passed_on(exc.answer)


def _add_live(app: FastAPI, hub: Hub) -> None:
    views: HubLive = app.state.views

    @app.get(
        f"{PREFIX}/live",
        tags=["farm"],
        summary="What the page shows, as server-sent events: all drives, and one in detail",
        response_class=StreamingResponse,
        responses={200: {"content": {"text/event-stream": {"schema": LIVE_STREAM}}}},
    )
    async def live(
        request: Request,
        drive: Annotated[str | None, Query(description="The drive in detail.")] = None,
        follow: Annotated[bool, Query(description="Keep sending; false: end after the first of each.")] = True,
    ) -> Response:
        if drive is not None:
            hub.shards.known(drive)
        stream = views.stream(request.scope, drive, follow=follow)
        return StreamingResponse(stream, media_type="text/event-stream", headers={"Cache-Control": "no-store"})
