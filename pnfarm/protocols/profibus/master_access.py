"""Records that a master asks a slave for: in the cyclic connection (MSAC1), or by one of class 2 (MSAC2)."""

from __future__ import annotations

from collections import deque
from enum import StrEnum
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.wire.dpv1 import (
    NEGATIVE,
    Abort,
    AbortReason,
    AbortSubnet,
    Function,
    Initiate,
    InitiateAnswer,
    ResourceManager,
)
from pnfarm.protocols.profibus.wire.telegram import Answer, Sap, Telegram

if TYPE_CHECKING:
    from pnfarm.protocols.profibus.record_request import RecordRequest
    from pnfarm.protocols.profibus.wire.telegram import Line

__all__ = ["Access", "AccessState", "Connection", "failure"]

#: Access points of slave and master, and data.
Access = tuple[int, int, bytes]
#: Requests that wait for one slave at most.
MOST_WAITING: Final = 64
SEND_TIMEOUT_NS: Final = 1_000_000_000


_FAILED: Final = frozenset({Answer.UE, Answer.RR, Answer.RS, Answer.NR})


def failure(telegram: Line) -> Answer | None:
    """The function of an answer that is no success."""
    return Answer(telegram.code) if isinstance(telegram, Telegram) and telegram.code in _FAILED else None


class AccessState(StrEnum):
    """A connection of class 2; one within the cyclic connection is always open."""

    CLOSED = "closed"
    INITIATING = "initiating"
    OPENING = "opening"
    OPEN = "open"


class Connection:
    """To one slave; ``kind`` is ``class-1`` or ``class-2``."""

    def __init__(self, kind: str, timeout_ns: int) -> None:
        self.is_class_one = kind == "class-1"
        self.state = AccessState.OPEN if self.is_class_one else AccessState.CLOSED
        self.opened = self.answered_requests = self.failed = 0
        self._timeout_ns = timeout_ns
        self._waiting: deque[RecordRequest] = deque()
        self._sap = 0
        self._send_timeout_ns = SEND_TIMEOUT_NS
        self._spoke_ns = 0
        self._idle_asked = False
        self._idle_ns = 0
        #: The slave is busy with a request that was given up: the next poll may fetch the answer to it.
        self._busy = False

    def ask(self, request: RecordRequest, now: int) -> None:
        """Queue a request; one too many fails at once."""
        if len(self._waiting) >= MOST_WAITING:
            request.fail(f"{MOST_WAITING} requests wait already")
            return
        request.due_ns = now + self._timeout_ns
        self._waiting.append(request)

    @property
    def busy(self) -> bool:
        return bool(self._waiting)

    def wants(self, now: int) -> bool:
        """Whether there is something to send."""
        self._expire(now)
        if self._waiting:
            return True
        return self.is_connected and (self._idle_asked or now - self._spoke_ns >= self._send_timeout_ns // 2)

    @property
    def is_connected(self) -> bool:
        """Whether the slave holds a connection of class 2."""
        return self.state is AccessState.OPEN and not self.is_class_one

    def request(self, now: int) -> Access | None:
        """What to send now."""
        if not self.wants(now):
            return None
        self._spoke_ns = now
        if self.is_class_one:
            return Sap.MSAC1, Sap.MSAC1, self._head()
        match self.state:
            case AccessState.CLOSED:
                self.state = AccessState.INITIATING
                return Sap.RESOURCE_MANAGER, Sap.MASTER_2, Initiate(SEND_TIMEOUT_NS).emit()
            case AccessState.INITIATING:
                return Sap.RESOURCE_MANAGER, Sap.MASTER_2, b""
            case AccessState.OPENING:
                return self._sap, Sap.MASTER_2, b""
            case _ if self._waiting and not self._idle_asked:
                return self._sap, Sap.MASTER_2, self._head()
            case _:
                # a slave that holds the answer to an Idle takes no request: it is polled for that first
                if self._idle_asked:
                    return self._sap, Sap.MASTER_2, b""
                self._idle_asked, self._idle_ns = True, now
                return self._sap, Sap.MASTER_2, bytes((Function.IDLE,))

    def end(self) -> Access | None:
        """An Abort, after which there is no connection; None where there is none."""
        if not self.is_connected:
            return None
        self.state = AccessState.CLOSED
        return self._sap, Sap.MASTER_2, Abort(AbortSubnet.NO, AbortReason.USER).emit()

    def _head(self) -> bytes:
        """The first request, or a poll for its answer, or for that of a request that was given up."""
        head = self._waiting[0]
        if head.sent or self._busy:
            return b""
        head.sent = True
        return head.octets()

    def answered(self, telegram: Line) -> None:
        """The slave's answer to what :meth:`request` gave."""
        if (failed := failure(telegram)) is not None:
            self._refused(failed)
            return
        data = telegram.data if isinstance(telegram, Telegram) else b""
        busy, self._busy = self._busy, False
        if data and not (busy and data[0] != Function.ABORT):
            try:
                self._took(data)
            except DecodeError as exc:
                self.lost(f"an answer that cannot be read: {exc}")

    def _refused(self, failed: Answer) -> None:
        if failed == Answer.RR and self._waiting and self.state is AccessState.OPEN:
            self._waiting[0].sent, self._busy = False, True
            return
        self.lost(f"the slave answered with {failed.name}")

    def _took(self, data: bytes) -> None:
        if data[0] == Function.ABORT:
            self.lost(f"the slave ended the connection: {data[1:3].hex(' ')}")
        elif self.state is AccessState.INITIATING:
            found = ResourceManager.parse(data)
            self._sap = found.sap
            self._send_timeout_ns = max(SEND_TIMEOUT_NS // 10, found.send_timeout_ns or SEND_TIMEOUT_NS)
            self.state = AccessState.OPENING
        elif self.state is AccessState.OPENING:
            if data[0] == Function.INITIATE | NEGATIVE:
                self.lost("the slave refuses the connection")
                return
            InitiateAnswer.parse(data)
            self.state = AccessState.OPEN
            self.opened += 1
        elif data[0] == Function.IDLE:
            self._idle_asked = False
        elif self._waiting and self._waiting[0].take(data):
            request = self._waiting.popleft()
            self.answered_requests += 1
            self.failed += not request.ok

    def lost(self, why: str) -> None:
        """The connection is gone; what waits fails."""
        while self._waiting:
            self._waiting.popleft().fail(why)
            self.failed += 1
        if not self.is_class_one:
            self.state = AccessState.CLOSED
        self._idle_asked = self._busy = False

    def _expire(self, now: int) -> None:
        if self._idle_asked and now - self._idle_ns >= self._timeout_ns:
            self.lost("no answer to an Idle in time")
        while self._waiting and self._waiting[0].due_ns <= now:
            request = self._waiting.popleft()
            request.fail("no answer in time")
            self.failed += 1
            if request.sent:
                # its answer would be taken for the next one's
                self.lost("no answer in time")
