"""Who changed what through the API, as entries of the event log."""

from __future__ import annotations

from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING

from pnfarm.api.access.guard import SAFE_METHODS, WHO
from pnfarm.station.event import Event, event

if TYPE_CHECKING:
    from collections.abc import Callable

    from fastapi import Request
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = [
    "Changes",
    "FaultCleared",
    "FaultRequested",
    "ParameterWritten",
    "PowerCycleRequested",
    "PowerOffRequested",
    "PowerOnRequested",
    "SignalsForced",
    "SignalsWritten",
    "changes_nothing",
    "who",
]

#: Characters of a path in one entry.
MOST_PATH = 200
#: Key of a request's scope: it has an entry of its own, or needs none.
_TOLD = "pnfarm.told"


@dataclass(frozen=True, slots=True)
class _Change(Event):
    """``who``: the token's name, or ``loopback`` where none is needed; ``peer`` is the client's address."""

    who: str
    peer: str


@event("fault requested", "warning")
class FaultRequested(_Change):
    """A client injected a fault."""

    id: str
    kind: str
    drives: str


@event("fault cleared by a client")
class FaultCleared(_Change):
    """A client cleared a fault, or reset them all."""

    id: str
    kind: str
    drives: str


@event("parameter written by a client")
class ParameterWritten(_Change):
    """A client wrote a parameter."""

    parameter: str
    value: int


@event("signals written by a client")
class SignalsWritten(_Change):
    """A client wrote signals of a device."""

    signals: str


@event("signals forced by a client")
class SignalsForced(_Change):
    """A client forced signals of a device, or released them."""

    signals: str


@event("power cycle requested")
class PowerCycleRequested(_Change):
    """A client switched the drive off and on."""


@event("power off requested")
class PowerOffRequested(_Change):
    """A client switched the drive off."""


@event("power on requested")
class PowerOnRequested(_Change):
    """A client switched the drive on."""


@event("changed by a client")
class Changed(_Change):
    """A client changed something that has no event of its own: a scenario, a trace, a module."""

    method: str
    path: str


def who(request: Request) -> tuple[str, str]:
    """By what the client was let in, and its address, for an event of one's own."""
    request.scope[_TOLD] = True
    return _who(request.scope)


def changes_nothing(request: Request) -> None:
    """This request needs no entry."""
    request.scope[_TOLD] = True


def _who(scope: Scope) -> tuple[str, str]:
    client = scope.get("client")
    return str(scope.get(WHO, "unknown")), str(client[0]) if client else "unknown"


class Changes:
    """ASGI layer: an entry for each request that changed something and has no event of its own.

    ``record(event)`` writes it.
    """

    def __init__(self, app: ASGIApp, record: Callable[[Event], object]) -> None:
        self._app = app
        self._record = record

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def watched(message: Message) -> None:
            if (
                message["type"] == "http.response.start"
                and message["status"] < HTTPStatus.BAD_REQUEST
                and _TOLD not in scope
            ):
                self._record(Changed(*_who(scope), scope["method"], scope["path"][:MOST_PATH]))
            await send(message)

        changes = scope["type"] == "http" and scope["method"] not in SAFE_METHODS
        await self._app(scope, receive, watched if changes else send)
