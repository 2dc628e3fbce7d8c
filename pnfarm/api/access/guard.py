"""Access control of the API: an ASGI layer before everything else.

With a token, every client that sends it may: in ``Authorization: Bearer TOKEN``, or for browsers in a cookie, which is
set by ``/?token=TOKEN`` and by the login page at ``/`` (:mod:`pnfarm.api.access.login`).  A client with the token for
reading may read everything and change nothing. Without one the farm listens on loopback only; then requests must
address this machine, so that a web page elsewhere cannot reach the farm through a browser on this machine: the Host
header must name loopback (against DNS rebinding), and a request from another origin may change nothing.
"""

from __future__ import annotations

import hmac
import re
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from ipaddress import ip_address
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

from starlette.requests import Request
from starlette.responses import RedirectResponse

from pnfarm.api.access.login import login_page, typed_token
from pnfarm.api.problems import problem

if TYPE_CHECKING:
    from starlette.responses import Response
    from starlette.types import ASGIApp, Receive, Scope, Send

__all__ = ["COOKIE", "OPEN_PATHS", "SAFE_METHODS", "WHO", "Guard", "is_loopback"]

COOKIE = "pnfarm_token"
#: Key of a request's scope: ``token``, ``read_token``, or ``loopback`` where none is needed.
WHO = "pnfarm.who"
#: Open without a token: for orchestrators, or without confidential content.
OPEN_PATHS = frozenset({"/api/v1/healthz", "/api/v1/readyz", "/openapi.json"})
#: Host and port as RFC 9110 writes them, an IPv6 address in brackets.
_HOST = re.compile(r"(?:\[([0-9A-Fa-f:.]+)\]|([A-Za-z0-9.-]+))(?::[0-9]{1,5})?")
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})


def is_loopback(host: str) -> bool:
    """Whether a host name or address is loopback."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def _same(shown: str, token: str) -> bool:
    return hmac.compare_digest(shown.encode(errors="surrogateescape"), token.encode())


def _is_own(origin: str, request: Request) -> bool:
    """Whether a page of this origin is the farm's; by TLS only one that came by TLS, too."""
    try:
        found = urlsplit(origin)
    except ValueError:
        return False
    # without TLS the farm may be behind a proxy that speaks it
    schemes = {"https"} if request.scope["scheme"] == "https" else {"http", "https", ""}
    return found.scheme in schemes and found.netloc == request.headers.get("host", "")


def _let_in(token: str, request: Request) -> Response:
    """Redirect to the page, with a cookie for its requests; one that came by TLS is sent by TLS only."""
    response = RedirectResponse("/", status_code=HTTPStatus.SEE_OTHER)
    secure = request.scope["scheme"] == "https"
    response.set_cookie(COOKIE, token, httponly=True, samesite="strict", secure=secure)
    return response


class Guard:
    """``token`` None: only requests to loopback are answered.

    Handlers find in the request's scope under :data:`WHO` by what a client was let in.
    """

    def __init__(self, app: ASGIApp, token: str | None = None, read_token: str | None = None) -> None:
        self._app = app
        self._token = token
        self._read_token = read_token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        refusal = await self._judge(Request(scope, receive)) if scope["type"] == "http" else None
        await (refusal or self._app)(scope, receive, send)

    async def _judge(self, request: Request) -> Response | None:
        origin = request.headers.get("origin")
        host = request.headers.get("host", "")
        if request.method not in SAFE_METHODS and origin is not None and not _is_own(origin, request):
            return problem(HTTPStatus.FORBIDDEN, f"a page of {origin} may not change this farm", request)
        if self._token is None:
            request.scope[WHO] = "loopback"
            return self._judge_host(request, host)
        if self._shows(request, self._token):
            request.scope[WHO] = "token"
            return None
        reads = self._read_token is not None and self._shows(request, self._read_token)
        if reads and request.method in SAFE_METHODS:
            request.scope[WHO] = "read_token"
            return None
        if request.scope["path"] == "/":
            return await self._door(request)
        if reads:
            return problem(
                HTTPStatus.FORBIDDEN, "this token may read, and change nothing: send the farm's token", request
            )
        sentence = "this farm needs its token: send `Authorization: Bearer TOKEN`, or open /?token=TOKEN in a browser"
        return problem(HTTPStatus.UNAUTHORIZED, sentence, request, headers={"WWW-Authenticate": "Bearer"})

    async def _door(self, request: Request) -> Response:
        """The response to a browser without a valid token."""
        if request.method == "POST":
            typed = await typed_token(request)
            return _let_in(typed, request) if typed and self._is_one(typed) else login_page(wrong=True)
        asked = parse_qs(request.scope.get("query_string", b"").decode("latin-1")).get("token", [])
        if request.method == "GET" and asked and self._is_one(asked[0]):
            # removes the token from the address bar and the browser's history
            return _let_in(asked[0], request)
        return login_page()

    def _is_one(self, shown: str) -> bool:
        """Whether it is one of the farm's tokens; both are compared, so that the time tells nothing."""
        found = [_same(shown, token) for token in (self._token, self._read_token) if token is not None]
        return any(found)

    @staticmethod
    def _judge_host(request: Request, host: str) -> Response | None:
        found = _HOST.fullmatch(host)
        name = found[1] or found[2] if found else ""
        if is_loopback(name):
            return None
        sentence = (
            f"this farm answers requests to localhost only, not to {host!r}; to serve others, set a token under api:"
        )
        return problem(HTTPStatus.FORBIDDEN, sentence, request)

    @staticmethod
    def _shows(request: Request, token: str) -> bool:
        if request.scope["path"] in OPEN_PATHS:
            return True
        scheme, _, shown = request.headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and _same(shown.strip(), token):
            return True
        try:
            cookie = SimpleCookie(request.headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            return False
        return cookie is not None and _same(cookie.value, token)
