"""What each route needs and each client has: an ASGI layer behind the guard.

A route names its least role where it is declared (:class:`pnfarm.web.paths.Paths`); the API's description has it as
``x-role``.  A route that names none is for the role that may do everything.
"""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Any

from starlette.requests import Request
from starlette.routing import Match

from pnfarm.api.access.guard import OPEN_PATHS, ROLE, SAFE_METHODS
from pnfarm.api.problems import problem
from pnfarm.web.paths import ROLE_KEY
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from collections.abc import Iterable

    from starlette.types import ASGIApp, Receive, Scope, Send

__all__ = ["Rights", "role_of"]


def role_of(route: Any) -> Role:
    """The least role that may use a route."""
    if getattr(route, "path", "") in OPEN_PATHS:
        return Role.READ
    return Role((getattr(route, "openapi_extra", None) or {}).get(ROLE_KEY, Role.ADMIN))


def _needed(routes: Iterable[Any], scope: Scope) -> Role:
    for route in routes:
        match, _ = route.matches(scope)
        if match is Match.FULL:
            return role_of(route)
    # no such path, or not by this method: who may change nothing learns no more than that
    return Role.READ if scope["method"] in SAFE_METHODS else Role.INJECT


class Rights:
    """The ASGI layer; the guard has written the client's role into the scope."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            has: Role = scope[ROLE]
            needed = _needed(scope["app"].routes, scope)
            if not has.covers(needed):
                await _refusal(Request(scope), has, needed)(scope, receive, send)
                return
        await self._app(scope, receive, send)


def _refusal(request: Request, has: Role, needed: Role) -> ASGIApp:
    may = "may read, and change nothing" if has is Role.READ else f"has the role {has}"
    sentence = f"this token {may}: this needs one with the role {needed}"
    return problem(HTTPStatus.FORBIDDEN, sentence, request, role=has, needed_role=needed)
