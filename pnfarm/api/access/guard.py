"""Access control of the API: an ASGI layer before everything else.

With tokens, every client must send one: in ``Authorization: Bearer TOKEN``, or for browsers in a cookie, which is
set by ``/?token=TOKEN`` and by the login page at ``/`` (:mod:`pnfarm.api.access.login`).  What it may do, its role says
(:mod:`pnfarm.api.access.rights`).  Without tokens the farm listens on loopback only; then requests must
address this machine, so that a web page elsewhere cannot reach the farm through a browser on this machine: the Host
header must name loopback (against DNS rebinding), and a request from another origin may change nothing.
"""

from __future__ import annotations

import contextlib
import re
from http import HTTPStatus
from typing import TYPE_CHECKING
from urllib.parse import parse_qs, urlsplit

import anyio
from starlette.requests import Request, cookie_parser
from starlette.responses import RedirectResponse

from pnfarm.api.access.keys import Keys
from pnfarm.api.access.login import login_page, typed_token
from pnfarm.api.access.throttle import refuse
from pnfarm.api.problems import problem
from pnfarm.config.values import is_loopback
from pnfarm.web.roles import Role

if TYPE_CHECKING:
    from collections.abc import Iterator

    from starlette.responses import Response
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from pnfarm.api.access.token_file import Holder

__all__ = ["COOKIE", "OPEN_PATHS", "ROLE", "SAFE_METHODS", "WHO", "Guard"]

COOKIE = "pnfarm_token"
#: Key of a request's scope: the token's name (``token`` and ``read_token`` are the farm's own), ``loopback`` where none
#: is needed, ``anybody`` on an open path.
WHO = "pnfarm.who"
#: Key of a request's scope: the client's role.
ROLE = "pnfarm.role"
#: Open without a token: for orchestrators, or without confidential content.
OPEN_PATHS = frozenset({"/api/v1/healthz", "/api/v1/readyz", "/openapi.json"})
#: Where a request without a good token may let the farm wait, for the form or behind a long answer; and how many there
#: are of them at once, as each has one of the places that all share.
_WAITING_PATHS = frozenset({"/", "/openapi.json"})
MOST_STRANGERS = 4
#: Host and port as RFC 9110 writes them, an IPv6 address in brackets.
_HOST = re.compile(r"(?:\[([0-9A-Fa-f:.]+)\]|([A-Za-z0-9.-]+))(?::[0-9]{1,5})?")
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})


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


class _TokenEndedError(Exception):
    """A response ended with its client's token: what makes it is to stop."""


class Guard:
    """``keys`` without tokens: only requests to loopback are answered, and these may do everything.

    The layers behind it find in the request's scope who a client is (:data:`WHO`) and its role (:data:`ROLE`).
    """

    def __init__(self, app: ASGIApp, keys: Keys | None = None) -> None:
        self._app = app
        self._keys = keys or Keys()
        #: Requests without a good token in the order of their coming, and whether their answer has begun.
        self._strangers: dict[anyio.CancelScope, bool] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope, receive)
        await self._keys.follow()
        holder = self._holder(request)
        if not self._may_wait(request, holder):
            await self._answer(request, holder, send)
        else:
            await self._answer_stranger(request, holder, send)

    async def _answer_stranger(self, request: Request, holder: Holder | None, send: Send) -> None:
        """A new request gets the place of the one for which the farm has waited longest: no client keeps others out.

        The connection ends with the answer: of several on one connection a client could leave the first ones unread.
        """
        begun = self._strangers

        async def send_and_close(message: Message) -> None:
            if message["type"] == "http.response.start":
                begun[place] = True
                message = {**message, "headers": [*message.get("headers", ()), (b"connection", b"close")]}
            await send(message)

        if len(begun) >= MOST_STRANGERS:
            longest = next((one for one, is_answered in begun.items() if not is_answered), None)
            if longest is None:
                await _busy(request, send)
                return
            del begun[longest]
            longest.cancel()
        with anyio.CancelScope() as place:
            begun[place] = False
            try:
                await self._answer(request, holder, send_and_close)
            finally:
                begun.pop(place, None)
        if place.cancelled_caught:
            await _busy(request, send)

    def _may_wait(self, request: Request, holder: Holder | None) -> bool:
        is_stranger = self._keys.needed and not (holder is not None and self._keys.is_good(holder))
        return is_stranger and request.scope["path"] in _WAITING_PATHS

    async def _answer(self, request: Request, holder: Holder | None, send: Send) -> None:
        scope, receive = request.scope, request.receive
        refusal = await self._judge(request, holder)
        if refusal is not None:
            await refusal(scope, receive, send)
            return
        with contextlib.suppress(_TokenEndedError):
            await self._app(scope, receive, send if holder is None else self._while_good(holder, send))

    async def _judge(self, request: Request, holder: Holder | None) -> Response | None:
        origin = request.headers.get("origin")
        if request.method not in SAFE_METHODS and origin is not None and not _is_own(origin, request):
            return problem(HTTPStatus.FORBIDDEN, f"a page of {origin} may not change this farm", request)
        if not self._keys.needed:
            return self._enter(request, "loopback", Role.ADMIN) or _judge_host(request)
        if (named := self._named(request)) is not None and self._keys.is_good(named[1]):
            # removes the token from the address bar and the browser's history
            return _let_in(named[0], request)
        if holder is not None and self._keys.is_good(holder):
            return self._enter(request, holder.name, holder.role)
        if request.method in SAFE_METHODS and request.scope["path"] in OPEN_PATHS:
            return self._enter(request, "anybody", Role.READ)
        if request.scope["path"] == "/":
            return await self._door(request, holder)
        if holder is not None:
            return problem(HTTPStatus.UNAUTHORIZED, _expired(holder), request, headers=_challenge("invalid_token"))
        sentence = "this farm needs its token: send `Authorization: Bearer TOKEN`, or open /?token=TOKEN in a browser"
        return problem(HTTPStatus.UNAUTHORIZED, sentence, request, headers=_challenge())

    @staticmethod
    def _enter(request: Request, who: str, role: Role) -> None:
        request.scope[WHO], request.scope[ROLE] = who, role

    async def _door(self, request: Request, holder: Holder | None) -> Response:
        """The response to a browser without a valid token."""
        if request.method == "POST":
            typed = await typed_token(request)
            known = self._keys.holder(typed) if typed else None
            if known is None:
                return login_page("Wrong token.")
            return _let_in(typed, request) if self._keys.is_good(known) else login_page(f"{_expired(known)}.")
        named = self._named(request)
        over = named[1] if named is not None else holder
        return login_page("" if over is None else f"{_expired(over)}.")

    def _named(self, request: Request) -> tuple[str, Holder] | None:
        """The token that a browser names in the page's address, and whose it is."""
        if request.method != "GET" or request.scope["path"] != "/":
            return None
        asked = parse_qs(request.scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        known = self._keys.holder(asked) if asked else None
        return None if known is None else (asked, known)

    def _holder(self, request: Request) -> Holder | None:
        """Whose token the request shows: a good one, else one that has expired."""
        known = [found for secret in _shown(request) if (found := self._keys.holder(secret)) is not None]
        return next((holder for holder in known if self._keys.is_good(holder)), next(iter(known), None))

    def _while_good(self, holder: Holder, send: Send) -> Send:
        """Ends a stream when its client's token ends: it was let in for a request, not for ever."""

        async def send_while_good(message: Message) -> None:
            if message["type"] == "http.response.body" and message.get("more_body"):
                await self._keys.follow()
                if not self._keys.is_good(holder):
                    await send({"type": "http.response.body", "body": b""})
                    raise _TokenEndedError
            await send(message)

        return send_while_good


def _expired(holder: Holder) -> str:
    return f"the token {holder.name} expired at {holder.until}"


def _challenge(error: str = "") -> dict[str, str]:
    return {"WWW-Authenticate": f'Bearer error="{error}"' if error else "Bearer"}


async def _busy(request: Request, send: Send) -> None:
    sentence = f"{MOST_STRANGERS} requests without a token are being answered; try again"
    await refuse(request.scope, request.receive, send, sentence)


def _judge_host(request: Request) -> Response | None:
    host = request.headers.get("host", "")
    found = _HOST.fullmatch(host)
    name = found[1] or found[2] if found else ""
    if is_loopback(name):
        return None
    sentence = f"this farm answers requests to localhost only, not to {host!r}; to serve others, set a token under api:"
    return problem(HTTPStatus.FORBIDDEN, sentence, request)


def _shown(request: Request) -> Iterator[str]:
    """The tokens that a request shows."""
    scheme, _, shown = request.headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer" and (secret := shown.strip()):
        yield secret
    # other programs of this host have cookies, too, and not each as it should be
    if cookie := cookie_parser(request.headers.get("cookie", "")).get(COOKIE):
        yield cookie
