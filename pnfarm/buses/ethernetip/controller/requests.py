"""Explicit requests of the scanner's owner to a device: one under way at a time, the others wait in order.

They go as unconnected messages.  An answer that does not come in time is an error, as is everything while there is no
session.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from pnfarm.protocols.enip.originator_events import RequestAnswered, RequestFailed
from pnfarm.protocols.enip.originator_states import OriginatorState
from pnfarm.protocols.enip.status import status_text

if TYPE_CHECKING:
    from pnfarm.protocols.enip.originator import Originator
    from pnfarm.protocols.enip.originator_events import OriginatorNote
    from pnfarm.protocols.enip.wire.message import MessageReply, MessageRequest

__all__ = ["ExplicitRequest", "RequestQueue"]

#: Requests to one device that wait.
MOST_WAITING: Final = 64


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


@dataclass(slots=True)
class RequestQueue:
    """The requests to one device."""

    waiting: deque[ExplicitRequest] = field(default_factory=deque)
    #: The one under way, and its number.
    current: ExplicitRequest | None = None
    number: int | None = None
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

    def send(self, machine: Originator, now: int) -> None:
        """Send the next request, if none is under way."""
        if self.current is None and self.waiting:
            self.current = self.waiting.popleft()
            self.number = machine.request(self.current.request, now)

    def take(self, note: OriginatorNote) -> bool:
        """Whether an event of the session's machine was about a request here."""
        number = getattr(note, "number", None)
        if number is None or number != self.number or self.current is None:
            return False
        self.number = None
        match note:
            case RequestAnswered(reply=reply):
                self._end(reply=reply)
            case RequestFailed(reason=reason):
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
        self.number = None
        if self.current is not None:
            self._end(reason=reason)
        while self.waiting:
            self._fail(self.waiting.popleft(), reason)
