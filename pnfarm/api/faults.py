"""The catalogue of injections, and starting, listing and ending them."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote

from fastapi import Query, Request

from pnfarm.api.answers import Fault, FaultKinds, Faults
from pnfarm.api.changes import FaultCleared, FaultRequested, changes_nothing, shortened, who
from pnfarm.api.schemas import Reset, Targets
from pnfarm.buses.registry import fault_kinds
from pnfarm.errors import ConfigError
from pnfarm.web.bodies import PREFIX, Json, read_object
from pnfarm.web.errors import NotFoundError, RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from enum import Enum

    from fastapi import FastAPI

    from pnfarm.api.context import ApiContext
    from pnfarm.faults.manager import Injection, InjectionManager

__all__ = ["MOST_AHEAD_SECONDS", "SPEC_BODY", "add_faults"]

#: How far ahead the start of a fault may be set by the clock.
MOST_AHEAD_SECONDS = 10.0
SPEC_BODY = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": fault_kinds().schema(),
                "examples": {"f702": {"value": {"kind": "f702", "on": "axis-01", "for": "2s"}}},
            }
        },
    }
}


def _moment(at: float | None, now: int) -> int:
    """The start in ns of the farm's clock, 0 for at once; raises :class:`RequestError` for one that is not ahead."""
    if at is None:
        return 0
    ahead = at - now / 1e9
    # a NaN is not in the range either
    if not 0 <= ahead <= MOST_AHEAD_SECONDS:
        what = f"is {-ahead:.3f} s ago" if ahead < 0 else f"is {ahead:.3f} s ahead"
        allowed = f"a moment of the farm's clock at most {MOST_AHEAD_SECONDS:g} s ahead; `after` has no such limit"
        raise RequestError(f"at: {what}; allowed: {allowed}", [{"field": "at", "what": what, "allowed": allowed}])
    return round(at * 1e9)


def add_faults(app: FastAPI, context: ApiContext) -> None:
    """Handlers of injections; their paths say ``faults``, as the command does."""
    tags: list[str | Enum] = ["faults"]
    one: dict[int | str, dict[str, Any]] = {200: {"model": Fault}}

    def manager() -> InjectionManager:
        return context.core.injections

    def told(request: Request, event: type[FaultRequested | FaultCleared], injections: Sequence[Injection]) -> None:
        for injection in injections:
            what = event(*who(request), injection.id, injection.spec.kind.name, shortened(injection.drives))
            context.core.log.record(context.now(), "", what)

    @app.get(
        f"{PREFIX}/fault-kinds",
        tags=tags,
        summary="Every kind of fault with its parameters",
        responses={200: {"model": FaultKinds}},
    )
    async def get_kinds() -> Json:
        return Json({"kinds": [kind.as_dict() for kind in manager().catalogue.values()]})

    @app.get(
        f"{PREFIX}/faults",
        tags=tags,
        summary="Pending and active faults, with their evidence",
        responses={200: {"model": Faults}},
    )
    async def get_faults() -> Json:
        return Json({"faults": [injection.as_dict() for injection in manager().list()]})

    @app.post(
        f"{PREFIX}/faults",
        tags=tags,
        summary="Inject a fault; with dry_run only list the drives that it would hit, and why others cannot",
        status_code=201,
        responses={201: {"model": Fault}, 200: {"model": Targets}},
        openapi_extra=SPEC_BODY,
    )
    async def post_fault(
        request: Request,
        *,
        dry_run: bool = False,
        at: Annotated[
            float | None,
            Query(
                description="Begin at this moment of the farm's clock (`GET clock`), seconds; it lies ahead, by at "
                f"most {MOST_AHEAD_SECONDS:g} s."
            ),
        ] = None,
    ) -> Json:
        if dry_run:
            changes_nothing(request)
            return Json(manager().reach(await read_object(request)).as_dict())
        body = await read_object(request)
        now = context.now()
        injection = manager().inject(body, now, at_ns=_moment(at, now))
        told(request, FaultRequested, [injection])
        context.poke()
        place = f"{PREFIX}/faults/{quote(injection.id, safe='')}"
        return Json(injection.as_dict(), HTTPStatus.CREATED, headers={"Location": place})

    @app.get(
        f"{PREFIX}/faults/{{fault_id}}",
        tags=tags,
        summary="One fault, also one that has ended recently",
        responses=one,
    )
    async def get_fault(fault_id: str) -> Json:
        try:
            return Json(manager().get(fault_id).as_dict())
        except ConfigError as exc:
            raise NotFoundError(str(exc)) from exc

    @app.post(
        f"{PREFIX}/faults/{{fault_id}}/renew",
        tags=tags,
        summary="Restart a fault's time to live (ttl)",
        responses=one,
    )
    async def renew_fault(fault_id: str, request: Request) -> Json:
        # every few seconds, by a client whose fault has its entry
        changes_nothing(request)
        if all(injection.id != fault_id for injection in manager().list()):
            # told as for an unknown one: its client is to begin it again
            raise NotFoundError(f"the fault {fault_id!r} is not in force, so that nothing can be renewed")
        injection = manager().renew(fault_id, context.now())
        context.poke()
        return Json(injection.as_dict())

    @app.delete(
        f"{PREFIX}/faults/{{fault_id}}",
        tags=tags,
        summary="End a fault and return its final evidence",
        responses=one,
    )
    async def delete_fault(fault_id: str, request: Request) -> Json:
        try:
            (injection,) = manager().clear(fault_id, context.now())
        except ConfigError as exc:
            raise NotFoundError(str(exc)) from exc
        told(request, FaultCleared, [injection])
        context.poke()
        return Json(injection.as_dict())

    @app.post(f"{PREFIX}/reset", tags=tags, summary="End every injected fault", responses={200: {"model": Reset}})
    async def reset(request: Request) -> Json:
        cleared = manager().clear(None, context.now())
        told(request, FaultCleared, cleared)
        context.poke()
        view: dict[str, Any] = {
            "cleared": [injection.id for injection in cleared],
            "faults": [
                {"id": injection.id, "kind": injection.spec.kind.name, "drives": list(injection.drives)}
                for injection in cleared
            ],
        }
        return Json(view)
