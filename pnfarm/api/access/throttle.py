"""Limits the load of all requests together: an ASGI layer around the application.

A request above the limit is refused with the advice to retry; event streams have a limit of their own
(:mod:`pnfarm.api.access.streams`).  A large response is sent in pieces, each when the client
has read the one before, so that a slow client takes the memory of the response only once.
"""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING

from starlette.requests import Request

from pnfarm.api.problems import problem

if TYPE_CHECKING:
    from collections.abc import Collection

    from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["MOST_REQUESTS", "PIECE", "Throttle", "refuse"]

#: Requests that are served at the same time.
MOST_REQUESTS = 32
#: Octets of a response that are sent at once.
PIECE = 65_536
#: Time after which a refused client may retry.
AGAIN_SECONDS = 1


class Throttle:
    """The ASGI layer; ``without``: paths that have no part in it."""

    def __init__(self, app: ASGIApp, without: Collection[str] = ()) -> None:
        self._app = app
        self._without = without
        self._open = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["path"] in self._without:
            await self._app(scope, receive, send)
            return
        if self._open >= MOST_REQUESTS:
            await refuse(scope, receive, send, f"{MOST_REQUESTS} requests are being answered; try again")
            return
        self._open += 1
        try:
            await self._app(scope, receive, _in_pieces(send))
        finally:
            self._open -= 1


async def refuse(scope: Scope, receive: Receive, send: Send, sentence: str) -> None:
    """Answer 503: the client may retry soon."""
    headers = {"Retry-After": str(AGAIN_SECONDS)}
    response = problem(HTTPStatus.SERVICE_UNAVAILABLE, sentence, Request(scope), headers=headers)
    await response(scope, receive, send)


def _in_pieces(send: Send) -> Send:
    async def send_in_pieces(message: Message) -> None:
        body = message.get("body", b"")
        if message["type"] != "http.response.body" or len(body) <= PIECE:
            await send(message)
            return
        whole = memoryview(body)
        for start in range(0, len(whole), PIECE):
            last = start + PIECE >= len(whole)
            more = message.get("more_body", False) if last else True
            await send({**message, "body": bytes(whole[start : start + PIECE]), "more_body": more})

    return send_in_pieces
