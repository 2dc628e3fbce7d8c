"""Explicit requests of the scanner's owner to a device: one under way at a time, the others wait in order.

They go as unconnected messages, or over a class 3 connection, which is opened with the first one and once more after it
was lost.  An answer that does not come in time is an error, as is everything while there is no session.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from pnfarm.protocols.enip.originator_events import ConnectionMade, ConnectionNotMade, RequestAnswered, RequestFailed
from pnfarm.protocols.enip.originator_states import OriginatorState
from pnfarm.protocols.enip.status import status_text
from pnfarm.protocols.enip.wire.epath import emit_epath, logical_path
from pnfarm.protocols.enip.wire.forward_open import (
    ConnectionType,
    ForwardOpen,
    NetworkParameters,
    Priority,
    TransportClass,
    Triad,
)

if TYPE_CHECKING:
    from pnfarm.protocols.enip.originator import Originator
    from pnfarm.protocols.enip.originator_events import OriginatorNote
    from pnfarm.protocols.enip.wire.message import MessageReply, MessageRequest

__all__ = ["ExplicitRequest", "RequestQueue", "explicit_connection"]

#: Requests to one device that wait.
MOST_WAITING: Final = 64
#: Octets of a class 3 message; and its packet interval, from which the device counts its own time-out.
_SIZE: Final = 504
_RPI_US: Final = 10_000_000
_ROUTER: Final = emit_epath(logical_path(0x02, 1))


@dataclass(slots=True)
class ExplicitRequest:
    """One request and, once it is ``done``, its reply or why there is none."""

    device: str
    request: MessageRequest
    done: bool = False
    reply: MessageReply | None = None
    reason: str = ""

    @property
    def ok(self) -> bool:
        return self.reply is not None and self.reply.status == 0

    @property
    def error(self) -> str:
        """In words; empty while it is under way, and for success."""
        if not self.done or self.ok:
            return ""
        return self.reason if self.reply is None else status_text(self.reply.status, self.reply.extended)

    @property
    def data(self) -> bytes:
        """What the device answered, empty without success."""
        return self.reply.data if self.reply is not None and self.ok else b""


def explicit_connection(triad: Triad, t_to_o_id: int) -> ForwardOpen:
    """A class 3 connection to the Message Router."""
    parameters = NetworkParameters(_SIZE, ConnectionType.POINT_TO_POINT, Priority.LOW, variable=True)
    return ForwardOpen(
        triad=triad,
        o_to_t_id=0,
        t_to_o_id=t_to_o_id,
        o_to_t_rpi_us=_RPI_US,
        o_to_t=parameters,
        t_to_o_rpi_us=_RPI_US,
        t_to_o=parameters,
        transport=TransportClass(3, 2, server=True),
        path=_ROUTER,
        timeout_multiplier=3,
    )


@dataclass(slots=True)
class RequestQueue:
    """The requests to one device; ``connected``: over class 3."""

    connected: bool
    waiting: deque[ExplicitRequest] = field(default_factory=deque)
    #: The one under way, and its number, or that of the Forward_Open that has to come first.
    current: ExplicitRequest | None = None
    number: int | None = None
    #: The class 3 connection's id from here to the device.
    connection_id: int | None = None
    answered: int = 0
    failed: int = 0

    def add(self, request: ExplicitRequest, machine: Originator | None) -> None:
        """A request of the owner's; it fails at once without a session, and beyond the bound."""
        if machine is None or machine.state is not OriginatorState.ESTABLISHED:
            self._fail(request, "there is no session")
        elif len(self.waiting) >= MOST_WAITING:
            self._fail(request, "too many requests are waiting")
        else:
            self.waiting.append(request)

    def send(self, machine: Originator, opening: ForwardOpen | None, now: int) -> bool:
        """Send the next request, if none is under way; whether something was sent.

        ``opening`` is the connection to open first, where one is needed.
        """
        if self.current is not None or not self.waiting:
            return False
        self.current = self.waiting.popleft()
        if opening is not None:
            self.number = machine.forward_open(opening, now)
        else:
            self._ask(machine, now)
        return True

    def needs_connection(self) -> bool:
        """Whether a class 3 connection has to be opened before the next request."""
        return self.connected and self.connection_id is None

    def _ask(self, machine: Originator, now: int) -> None:
        assert self.current is not None
        if self.connection_id is not None:
            self.number = machine.connected_request(self.connection_id, self.current.request, now)
        else:
            self.number = machine.request(self.current.request, now)

    def take(self, note: OriginatorNote, machine: Originator, now: int) -> bool:
        """Whether an event of the session's machine was about a request here."""
        number = getattr(note, "number", None)
        if number is None or number != self.number or self.current is None:
            return False
        self.number = None
        match note:
            case ConnectionMade(reply=reply):
                self.connection_id = reply.o_to_t_id
                self._ask(machine, now)
            case ConnectionNotMade(reason=reason):
                self._end(reason=f"no class 3 connection: {reason}")
            case RequestAnswered(reply=reply):
                self._end(reply=reply)
            case RequestFailed(reason=reason):
                # the device may have closed the connection by its own time-out
                self.connection_id = None
                self._end(reason=reason)
            case _:
                self._end(reason="another answer")
        return True

    def _end(self, reply: MessageReply | None = None, reason: str = "") -> None:
        current, self.current = self.current, None
        assert current is not None
        current.done, current.reply, current.reason = True, reply, reason
        if reply is None:
            self.failed += 1
        else:
            self.answered += 1

    def _fail(self, request: ExplicitRequest, reason: str) -> None:
        request.done, request.reason = True, reason
        self.failed += 1

    def forget(self, reason: str) -> None:
        """The session has ended: every request fails."""
        self.number = self.connection_id = None
        if self.current is not None:
            self._end(reason=reason)
        while self.waiting:
            self._fail(self.waiting.popleft(), reason)
