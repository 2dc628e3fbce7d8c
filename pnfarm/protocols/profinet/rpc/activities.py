"""The server's rows, one for each activity of a client, and the bounds on all of them together.

When a bound is reached, a new call displaces what is kept of old ones, first of the client with the most rows: a
station that floods the server does not cost the others the answers that are kept for them.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from enum import auto
from typing import TYPE_CHECKING, Final

from pnfarm.protocols.deadlines import Deadlines
from pnfarm.protocols.named import Named
from pnfarm.protocols.profinet.rpc.events import CallKey
from pnfarm.protocols.profinet.rpc.fragments import STUB_MAX, FragmentSender, Peer, Reassembly
from pnfarm.protocols.profinet.wire.rpc.pdu import PacketType, RpcPdu

if TYPE_CHECKING:
    from collections.abc import Iterator
    from ipaddress import IPv4Address
    from uuid import UUID

__all__ = ["TRANSITIONS", "Activity", "ActivityKey", "ActivityTable", "ServerEventKind", "ServerState"]

ActivityKey = tuple["IPv4Address", "UUID"]


class ServerState(Named):
    """States of one activity."""

    IDLE = auto()
    RECEIVING = auto()
    EXECUTING = auto()
    ORPHANED = auto()
    REPLYING = auto()
    REPLIED = auto()


class ServerEventKind(Named):
    """Inputs of an activity."""

    REQUEST_NEW = auto()
    REQUEST_SAME = auto()
    COMPLETED = auto()
    ANSWERED = auto()
    PING = auto()
    FACK = auto()
    ACK = auto()
    CANCEL = auto()
    ORPHAN = auto()
    DELIVERED = auto()
    RETRY = auto()
    EXPIRED = auto()


TRANSITIONS: Final[dict[tuple[ServerState, ServerEventKind], tuple[ServerState, str | None]]] = {
    (ServerState.IDLE, ServerEventKind.REQUEST_NEW): (ServerState.RECEIVING, "begin"),
    (ServerState.IDLE, ServerEventKind.REQUEST_SAME): (ServerState.IDLE, "refuse_rerun"),
    (ServerState.IDLE, ServerEventKind.PING): (ServerState.IDLE, "nocall"),
    (ServerState.IDLE, ServerEventKind.CANCEL): (ServerState.IDLE, "cancel_late"),
    (ServerState.IDLE, ServerEventKind.ORPHAN): (ServerState.IDLE, "orphan"),
    (ServerState.RECEIVING, ServerEventKind.REQUEST_NEW): (ServerState.RECEIVING, "begin"),
    (ServerState.RECEIVING, ServerEventKind.REQUEST_SAME): (ServerState.RECEIVING, "collect"),
    (ServerState.RECEIVING, ServerEventKind.COMPLETED): (ServerState.EXECUTING, "indicate"),
    (ServerState.RECEIVING, ServerEventKind.ANSWERED): (ServerState.REPLYING, "reply"),
    (ServerState.RECEIVING, ServerEventKind.PING): (ServerState.RECEIVING, "arrived"),
    (ServerState.RECEIVING, ServerEventKind.CANCEL): (ServerState.RECEIVING, "cancel_unbegun"),
    (ServerState.RECEIVING, ServerEventKind.ORPHAN): (ServerState.ORPHANED, "orphan"),
    (ServerState.EXECUTING, ServerEventKind.REQUEST_NEW): (ServerState.RECEIVING, "begin"),
    (ServerState.EXECUTING, ServerEventKind.REQUEST_SAME): (ServerState.EXECUTING, "working"),
    (ServerState.EXECUTING, ServerEventKind.ANSWERED): (ServerState.REPLYING, "reply"),
    (ServerState.EXECUTING, ServerEventKind.PING): (ServerState.EXECUTING, "working"),
    (ServerState.EXECUTING, ServerEventKind.CANCEL): (ServerState.EXECUTING, "cancel"),
    (ServerState.EXECUTING, ServerEventKind.ORPHAN): (ServerState.ORPHANED, "orphan"),
    (ServerState.EXECUTING, ServerEventKind.EXPIRED): (ServerState.EXECUTING, "abandon"),
    (ServerState.ORPHANED, ServerEventKind.REQUEST_NEW): (ServerState.RECEIVING, "begin"),
    (ServerState.ORPHANED, ServerEventKind.PING): (ServerState.ORPHANED, "nocall"),
    (ServerState.ORPHANED, ServerEventKind.CANCEL): (ServerState.ORPHANED, "cancel_late"),
    (ServerState.ORPHANED, ServerEventKind.ORPHAN): (ServerState.ORPHANED, "orphan"),
    (ServerState.ORPHANED, ServerEventKind.EXPIRED): (ServerState.IDLE, None),
    (ServerState.REPLYING, ServerEventKind.REQUEST_NEW): (ServerState.RECEIVING, "begin"),
    (ServerState.REPLYING, ServerEventKind.REQUEST_SAME): (ServerState.REPLYING, "resume"),
    (ServerState.REPLYING, ServerEventKind.PING): (ServerState.REPLYING, "resume"),
    (ServerState.REPLYING, ServerEventKind.FACK): (ServerState.REPLYING, "slide"),
    (ServerState.REPLYING, ServerEventKind.ACK): (ServerState.IDLE, "release"),
    (ServerState.REPLYING, ServerEventKind.CANCEL): (ServerState.REPLYING, "cancel_late"),
    (ServerState.REPLYING, ServerEventKind.ORPHAN): (ServerState.ORPHANED, "orphan"),
    (ServerState.REPLYING, ServerEventKind.DELIVERED): (ServerState.REPLIED, None),
    (ServerState.REPLYING, ServerEventKind.RETRY): (ServerState.REPLYING, "resume"),
    (ServerState.REPLYING, ServerEventKind.EXPIRED): (ServerState.REPLIED, None),
    (ServerState.REPLIED, ServerEventKind.REQUEST_NEW): (ServerState.RECEIVING, "begin"),
    (ServerState.REPLIED, ServerEventKind.REQUEST_SAME): (ServerState.REPLYING, "reply"),
    (ServerState.REPLIED, ServerEventKind.PING): (ServerState.REPLYING, "reply"),
    (ServerState.REPLIED, ServerEventKind.ACK): (ServerState.IDLE, "release"),
    (ServerState.REPLIED, ServerEventKind.CANCEL): (ServerState.REPLIED, "cancel_late"),
    (ServerState.REPLIED, ServerEventKind.ORPHAN): (ServerState.ORPHANED, "orphan"),
    (ServerState.REPLIED, ServerEventKind.EXPIRED): (ServerState.IDLE, "release"),
}
"""The connectionless server's transitions: next state, and the name of the server's action (C706 chapter 10)."""


@dataclass(slots=True)
class Activity:
    """One client's activity and its last call; ``request`` is the call's first PDU that arrived."""

    key: ActivityKey
    peer: Peer
    local_port: int
    request: RpcPdu
    touched: int
    state: ServerState = ServerState.IDLE
    deadline: int = 0
    reassembly: Reassembly = field(default_factory=lambda: Reassembly(STUB_MAX))
    args_maximum: int = 0
    source_mac: bytes | None = None
    reply_type: int = PacketType.RESPONSE
    reply: FragmentSender | None = None
    serial: int = 0
    tries: int = 0
    #: Only the endpoint mapper was called so far.
    lookups_only: bool = True
    #: For the table: its number for the row, and the octets of the row that its sum includes.
    number: int = 0
    accounted: int = 0

    @property
    def call(self) -> CallKey:
        return CallKey(*self.key, self.request.sequence)

    @property
    def held(self) -> int:
        """Octets of an unfinished request and of a kept reply."""
        return self.reassembly.octets + (self.reply.octets if self.reply else 0)

    @property
    def unfinished(self) -> bool:
        """Whether dropping the row loses something: fragments of a request or of a reply, or the answer itself.

        A call that its client gave up, a reply that was sent completely, and the number of an old call do not count.
        """
        match self.state:
            case ServerState.RECEIVING | ServerState.EXECUTING:
                return True
            case ServerState.REPLYING:
                return self.reply is not None and self.reply.fragmented
            case _:
                return False

    @property
    def idempotent(self) -> bool:
        """Whether the client allows that the call runs twice."""
        return self.request.idempotent

    def runs_again(self, pdu: RpcPdu) -> bool:
        """Whether a request under the last call's number is a call of its own."""
        same = (pdu.interface, pdu.opnum) == (self.request.interface, self.request.opnum)
        match self.state:
            case ServerState.IDLE:
                return not same or pdu.idempotent
            case ServerState.REPLIED:
                return not same
            case _:
                return False


_EVICTABLE: Final = (
    ServerState.IDLE,
    ServerState.REPLIED,
    ServerState.ORPHANED,
    ServerState.RECEIVING,
    ServerState.REPLYING,
)
"""What is dropped for a new call, in this order; never a call that the application holds and a client waits for."""


class ActivityTable:
    """At most ``rows_max`` activities that hold at most ``octets_max`` octets; ``dropped`` counts calls lost by it.

    Sums and the earliest deadline are kept up to date instead of being searched for: call :meth:`settle` after each
    change of a row.
    """

    def __init__(self, rows_max: int, octets_max: int, dropped: Counter[str]) -> None:
        self._rows_max = rows_max
        self._octets_max = octets_max
        self._dropped = dropped
        self._rows: dict[ActivityKey, Activity] = {}
        self._by_number: dict[int, Activity] = {}
        self._deadlines = Deadlines()
        self._last_number = 0
        self._octets = 0
        self._states: Counter[ServerState] = Counter()

    def __iter__(self) -> Iterator[Activity]:
        return iter(self._rows.values())

    def get(self, key: ActivityKey) -> Activity | None:
        return self._rows.get(key)

    @property
    def held_octets(self) -> int:
        return self._octets

    def count(self, state: ServerState) -> int:
        return self._states[state]

    def next_deadline(self) -> int | None:
        return self._deadlines.first()

    def due(self, now: int) -> list[Activity]:
        """Rows whose deadline has passed; the caller settles or forgets each."""
        return [self._by_number[number] for number in self._deadlines.take(now)]

    def add(self, activity: Activity) -> bool:
        """Add a row; False when every row holds an open call."""
        if not self.make_room(None):
            return False
        self._last_number += 1
        activity.number = self._last_number
        self._rows[activity.key] = self._by_number[activity.number] = activity
        self._states[activity.state] += 1
        return True

    def move(self, activity: Activity, state: ServerState) -> None:
        """Write a row's state."""
        self._states[activity.state] -= 1
        self._states[state] += 1
        activity.state = state

    def settle(self, activity: Activity) -> None:
        if activity.number in self._by_number:
            self._octets += activity.held - activity.accounted
            activity.accounted = activity.held
            self._deadlines.set(activity.number, activity.deadline)

    def forget(self, activity: Activity, reason: str) -> None:
        """Drop a row; one whose call was not finished is counted."""
        if self._rows.pop(activity.key, None) is not None:
            del self._by_number[activity.number]
            self._deadlines.set(activity.number, None)
            self._states[activity.state] -= 1
            self._octets -= activity.accounted
            if activity.unfinished:
                self._dropped[reason] += 1

    def make_room(self, keeper: Activity | None, octets: int = 0) -> bool:
        """Drop what matters least until ``octets`` more (and, without ``keeper``, one more row) fit."""
        if keeper is not None:
            self.settle(keeper)
        if self._fits(keeper, octets):
            return True
        for state in _EVICTABLE:
            share = Counter(row.key[0] for row in self)
            rows = [row for row in self if row.state is state and row is not keeper]
            for row in sorted(rows, key=lambda row: (-share[row.key[0]], row.touched)):
                self.forget(row, "evicted")
                if self._fits(keeper, octets):
                    return True
        return False

    def _fits(self, keeper: Activity | None, octets: int) -> bool:
        if keeper is None and len(self._rows) >= self._rows_max:
            return False
        return self._octets + octets <= self._octets_max
