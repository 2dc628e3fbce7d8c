"""Shares the event streams among the clients: an ASGI layer after the guard, which has found whose token a request has.

While all are open, a newcomer gets the place of the newest stream of the token that has most of them, if that has more
than the newcomer's own would have; with equal tokens the same holds between the clients of one token, by address.  So
nobody keeps all others out, and a token that is alone has as many as there are.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

import anyio

from pnfarm.api.access.guard import WHO
from pnfarm.api.access.throttle import refuse

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["MOST_STREAMS", "STREAMS", "Streams"]

#: Event streams that are open at the same time.
MOST_STREAMS = 64
#: Paths that stay open.
STREAMS = frozenset({"/api/v1/events", "/api/v1/live"})


class _Client(NamedTuple):
    token: str
    address: str


class Streams:
    """The ASGI layer."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        #: Those that are open, in the order of their coming.
        self._open: dict[anyio.CancelScope, _Client] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["path"] not in STREAMS:
            await self._app(scope, receive, send)
            return
        sentence = f"{MOST_STREAMS} event streams are open, the most that a farm has"
        client = _Client(scope[WHO], scope["client"][0] if scope.get("client") else "")
        if len(self._open) >= MOST_STREAMS:
            if (place := self._to_give_up(client)) is None:
                await refuse(scope, receive, send, sentence)
                return
            del self._open[place]
            place.cancel()
        begun = ended = False

        async def watched(message: Message) -> None:
            nonlocal begun, ended
            begun = True
            ended = message["type"] == "http.response.body" and not message.get("more_body", False)
            await send(message)

        with anyio.CancelScope() as own:
            self._open[own] = client
            try:
                await self._app(scope, receive, watched)
            finally:
                self._open.pop(own, None)
        if own.cancelled_caught and not begun:
            await refuse(scope, receive, send, sentence)
        elif own.cancelled_caught and not ended:
            # its client may ask again, as after each end of a stream
            await send({"type": "http.response.body", "body": b""})

    def _to_give_up(self, newcomer: _Client) -> anyio.CancelScope | None:
        """The stream whose place a newcomer gets, None: it has its share."""
        tokens = Counter(client.token for client in self._open.values())
        token, count = tokens.most_common(1)[0]
        if count <= tokens[newcomer.token] + 1:
            token = newcomer.token
        addresses = Counter(client.address for client in self._open.values() if client.token == token)
        if not addresses:
            return None
        address, count = addresses.most_common(1)[0]
        if token == newcomer.token and count <= addresses[newcomer.address] + 1:
            return None
        return next(place for place, client in reversed(self._open.items()) if client == (token, address))
