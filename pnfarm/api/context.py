"""What the handlers share: the farm's objects, its clock, and the streams that are open."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

import anyio
from starlette.requests import ClientDisconnect

from pnfarm.api.messages import Messages
from pnfarm.api.problems import ClientGoneError, NotFoundError, RequestError, TooLargeError
from pnfarm.errors import ConfigError
from pnfarm.farm.snapshot import drive_snapshot

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.requests import Request

    from pnfarm.farm.core import FarmCore
    from pnfarm.metrics import FarmCollector
    from pnfarm.station.station import Station

__all__ = ["PREFIX", "ApiContext", "read_object"]

#: Of every path of this version.
PREFIX = "/api/v1"
#: Octets of the largest body; a fault is some hundred.
MAX_BODY = 65_536


@dataclass(slots=True)
class ApiContext:
    """``now`` reads the farm's clock; ``poke`` makes the runtime look at what a handler changed."""

    core: FarmCore
    collector: FarmCollector
    now: Callable[[], int]
    poke: Callable[[], None]
    closing: bool = False
    streams: set[Callable[[], None]] = field(default_factory=set)
    rendering: anyio.Lock = field(default_factory=anyio.Lock)
    messages: Messages = field(default_factory=Messages)

    def station(self, name: str) -> Station:
        """Raises :class:`NotFoundError`."""
        try:
            return self.core.station(name)
        except ConfigError as exc:
            raise NotFoundError(str(exc)) from exc

    def view(self, station: Station) -> dict[str, Any]:
        """One drive as it is now."""
        return drive_snapshot(self.core, station, self.now())

    def changed(self, station: Station) -> None:
        """A handler changed this station: let it finish what follows, and send it."""
        self.core.settle(station, self.now())
        self.poke()

    def close(self) -> None:
        """End every open stream."""
        self.closing = True
        for wake in list(self.streams):
            wake()


async def read_object(request: Request) -> dict[str, Any]:
    """The request's body, a JSON object; raises :class:`RequestError` or :class:`TooLargeError`."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json" and not kind.endswith("+json"):
        raise RequestError(
            f"the body is {kind or 'of no stated type'}; send Content-Type: application/json",
            status=HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
        )
    body = bytearray()
    try:
        async for chunk in request.stream():
            body += chunk
            if len(body) > MAX_BODY:
                raise TooLargeError(f"the body has more than {MAX_BODY} octets; no request needs as many")
    except ClientDisconnect as exc:
        raise ClientGoneError("the client hung up before its request was whole") from exc
    try:
        value = json.loads(body)
    except RecursionError as exc:
        raise RequestError("the body is nested too deeply", status=HTTPStatus.BAD_REQUEST) from exc
    except ValueError as exc:
        # also a number with more digits than Python reads, and octets that are no UTF-8
        raise RequestError(f"the body is not JSON: {exc}", status=HTTPStatus.BAD_REQUEST) from exc
    if not isinstance(value, dict):
        raise RequestError('the body is not a JSON object such as {"value": 1}')
    return value
