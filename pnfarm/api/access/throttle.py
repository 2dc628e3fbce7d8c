"""Limits the load of all requests together: an ASGI layer around the application.

A request above the limit is refused with the advice to retry.  A large response is sent in pieces, each when the client
has read the one before, so that a slow client takes the memory of the response only once.
"""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING

from starlette.requests import Request

from pnfarm.api.problems import problem

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["MOST_REQUESTS", "MOST_STREAMS", "PIECE", "Throttle"]

#: Requests that are served at the same time, and event streams open beside them.
MOST_REQUESTS = 32
MOST_STREAMS = 64
#: Octets of a response that are sent at once.
PIECE = 65_536
#: Time after which a refused client may retry.
AGAIN_SECONDS = 1
#: Paths that stay open; their load is their own matter.
STREAMS = frozenset({"/api/v1/events", "/api/v1/live"})


class Throttle:
    """The ASGI layer."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        #: Requests at work, and streams that are open.
        self._open = {False: 0, True: 0}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        stays = scope["path"] in STREAMS
        if self._open[stays] >= (MOST_STREAMS if stays else MOST_REQUESTS):
            streams = f"{MOST_STREAMS} event streams are open, the most that a farm has"
            requests = f"{MOST_REQUESTS} requests are being answered; try again"
            await _refuse(scope, receive, send, streams if stays else requests)
            return
        self._open[stays] += 1
        try:
            await self._app(scope, receive, send if stays else _in_pieces(send))
        finally:
            self._open[stays] -= 1


async def _refuse(scope: Scope, receive: Receive, send: Send, sentence: str) -> None:
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
