"""Records of a slave: within its cyclic connection (MSAC1), and by connections of masters of class 2 (MSAC2).

A request is acknowledged at once; its answer is fetched by polls (requests without data) to the same access point.
Guideline 2.082; Moog MSD manual 9.1, tables 9.2 and 9.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.slave_user import AcyclicClosed, AcyclicOpened, RecordRefusedError
from pnfarm.protocols.profibus.wire.dpv1 import (
    NEGATIVE,
    Abort,
    AbortReason,
    AbortSubnet,
    Access,
    ErrorCode1,
    Function,
    Initiate,
    InitiateAnswer,
    Refusal,
    ResourceManager,
    parse_access,
    parse_initiate,
)
from pnfarm.protocols.profibus.wire.telegram import Answer, Sap, ShortAck

if TYPE_CHECKING:
    from collections import Counter

    from pnfarm.protocols.profibus.slave_user import SlaveEvent, SlaveOptions, SlaveUser
    from pnfarm.protocols.profibus.wire.telegram import Line, Telegram

__all__ = ["ClassOne", "ClassTwo"]

#: Connection access points of masters of class 2 (table 9.2).
HIGHEST_CONNECTION: Final = 48
#: A connection whose master is silent lives for so many of its send time-outs.
PATIENCE: Final = 3
#: The answer to a master that asks for less.
LEAST_SEND_TIMEOUT_NS: Final = 100_000_000


class RecordSlave(Protocol):
    """What the two channels need of their slave."""

    user: SlaveUser
    options: SlaveOptions
    dropped: Counter[str]

    def note(self, event: SlaveEvent) -> None:
        """Something happened."""

    def answer_data(self, telegram: Telegram, data: bytes) -> Line:
        """An answer with data of the services of DP-V1."""

    def answer_without(self, telegram: Telegram, answer: Answer) -> Line:
        """An answer of theirs without."""


class _Records:
    """One request at a time of one client: what it asked for, and what is to be answered."""

    def __init__(self, slave: RecordSlave, client: int) -> None:
        self._slave = slave
        self._client = client
        self._working: Access | None = None
        self._ready: bytes | None = None

    def reset(self) -> None:
        self._working = self._ready = None
        self._slave.user.client_gone(self._client)

    @property
    def busy(self) -> bool:
        return self._working is not None or self._ready is not None

    def ask(self, data: bytes, now: int) -> None:
        """A Read, Write or Data_Transport.  Raises :class:`DecodeError` for what is none."""
        access = parse_access(data)
        if access.function not in {Function.READ, Function.WRITE, Function.DATA_TRANSPORT}:
            raise DecodeError("bad-type", f"function 0x{access.function:02x}")
        if access.function != Function.READ and len(access.data) != access.length:
            raise DecodeError("bad-length", f"{len(access.data)} octets, {access.length} announced")
        self._ready = None
        self._working = access
        self.work(now)

    def refuse(self, function: int, code1: ErrorCode1) -> None:
        """The next poll gets a negative response."""
        self._working, self._ready = None, Refusal(function | NEGATIVE, code1).emit()

    def work(self, now: int) -> None:
        """Go on with what is not done yet."""
        access = self._working
        if access is None:
            return
        user, client = self._slave.user, self._client
        try:
            if access.length > self._slave.options.longest_record:
                raise RecordRefusedError(ErrorCode1.INVALID_RANGE)
            if access.function == Function.READ:
                found = user.read_record(access.slot, access.index, access.length, client, now)
                if found is None:
                    return
                answer = Access(access.function, access.slot, access.index, len(found), found)
            elif access.function == Function.WRITE:
                if not user.write_record(access.slot, access.index, access.data, client, now):
                    return
                answer = Access(access.function, access.slot, access.index, access.length)
            else:
                # the drive has no use for it (assumed: the manual lists the service and says nothing of its data)
                raise RecordRefusedError(ErrorCode1.FEATURE_NOT_SUPPORTED)
            self._ready = answer.emit()
        except RecordRefusedError as exc:
            self._ready = Refusal(access.function | NEGATIVE, exc.code1, exc.code2).emit()
        self._working = None

    def take(self, now: int) -> bytes | None:
        """The answer, once; None while there is none."""
        self.work(now)
        ready, self._ready = self._ready, None
        return ready


class ClassOne:
    """MSAC1: access point 51 on both sides."""

    def __init__(self, slave: RecordSlave) -> None:
        self._slave = slave
        self._records = _Records(slave, 0)

    def reset(self) -> None:
        """The cyclic connection ended."""
        self._records.reset()

    def request(self, telegram: Telegram, now: int) -> Line:
        """A request or a poll of the master that parametrised the slave."""
        if not telegram.data:
            answer = self._records.take(now)
            return ShortAck() if answer is None else self._slave.answer_data(telegram, answer)
        if self._records.busy:
            self._slave.dropped["busy"] += 1
            return self._slave.answer_without(telegram, Answer.RR)
        if telegram.data[0] == Function.ALARM_ACK:
            # table 9.3: alarms are not supported
            self._records.refuse(Function.ALARM_ACK, ErrorCode1.FEATURE_NOT_SUPPORTED)
            return ShortAck()
        try:
            self._records.ask(telegram.data, now)
        except DecodeError as exc:
            self._slave.dropped[exc.reason] += 1
            return self._slave.answer_without(telegram, Answer.UE)
        return ShortAck()


@dataclass(slots=True)
class _Connection:
    sap: int
    master: int
    records: _Records
    send_timeout_ns: int
    heard_ns: int
    #: What the next poll gets, before any answer of a record.
    waiting: bytes | None = None
    #: The connection is over, and an Abort may wait to be read.
    over: bool = False


class ClassTwo:
    """MSAC2: resource manager at access point 49, connections at those below."""

    def __init__(self, slave: RecordSlave) -> None:
        self._slave = slave
        self._connections: dict[int, _Connection] = {}

    @property
    def open(self) -> list[tuple[int, int]]:
        """Master and access point of each connection."""
        return [(one.master, one.sap) for one in self._connections.values() if not one.over]

    def close_all(self) -> None:
        """The drive goes: connections end without a word."""
        for sap in list(self._connections):
            self._forget(sap, AbortReason.USER)

    def request(self, telegram: Telegram, sap: int | None, now: int) -> Line:
        """A request or a poll of a master of class 2 to the slave's access point ``sap``."""
        if sap == Sap.RESOURCE_MANAGER:
            return self._initiate(telegram, now)
        connection = self._connections.get(-1 if sap is None else sap)
        if connection is None or connection.master != telegram.source:
            self._slave.dropped["no-connection"] += 1
            return self._slave.answer_without(telegram, Answer.RS)
        connection.heard_ns = now
        if not telegram.data:
            return self._poll(telegram, connection, now)
        if not connection.over:
            self._take(telegram.data, connection, now)
        return ShortAck()

    def _poll(self, telegram: Telegram, connection: _Connection, now: int) -> Line:
        if connection.waiting is not None:
            waiting, connection.waiting = connection.waiting, None
            if connection.over:
                del self._connections[connection.sap]
            return self._slave.answer_data(telegram, waiting)
        answer = None if connection.over else connection.records.take(now)
        return ShortAck() if answer is None else self._slave.answer_data(telegram, answer)

    def _initiate(self, telegram: Telegram, now: int) -> Line:
        if not telegram.data:
            return ShortAck()
        slave = self._slave
        try:
            initiate = parse_initiate(telegram.data)
        except DecodeError as exc:
            slave.dropped[exc.reason] += 1
            return slave.answer_without(telegram, Answer.UE)
        free = next((sap for sap in range(slave.options.connections) if sap not in self._connections), None)
        if free is None or free > HIGHEST_CONNECTION:
            slave.dropped["no-connection-free"] += 1
            return slave.answer_without(telegram, Answer.RR)
        timeout = max(LEAST_SEND_TIMEOUT_NS, initiate.send_timeout_ns or slave.options.send_timeout_ns)
        connection = _Connection(free, telegram.source, _Records(slave, free + 1), timeout, now)
        self._connections[free] = connection
        if initiate.s_type or initiate.d_type:
            self._abort(connection, AbortReason.ADDRESS)
        else:
            connection.waiting = _initiate_answer(initiate, slave.options.longest_record)
            slave.note(AcyclicOpened(telegram.source, free))
        return slave.answer_data(telegram, ResourceManager(free, timeout).emit())

    def _take(self, data: bytes, connection: _Connection, now: int) -> None:
        function = data[0]
        try:
            if function == Function.ABORT:
                self._forget(connection.sap, Abort.parse(data).reason)
            elif function == Function.IDLE:
                if connection.waiting is None and not connection.records.busy:
                    connection.waiting = bytes((Function.IDLE,))
            elif connection.waiting is not None or connection.records.busy:
                self._abort(connection, AbortReason.SEQUENCE)
            elif function in {Function.READ, Function.WRITE, Function.DATA_TRANSPORT}:
                connection.records.ask(data, now)
            else:
                self._abort(connection, AbortReason.INVALID)
        except DecodeError as exc:
            self._slave.dropped[exc.reason] += 1
            self._abort(connection, AbortReason.RECEIVED)

    def _abort(self, connection: _Connection, reason: AbortReason) -> None:
        """The next poll gets an Abort, then the connection is gone."""
        connection.records.reset()
        connection.over = True
        connection.waiting = Abort(AbortSubnet.NO, reason).emit()
        self._slave.note(AcyclicClosed(connection.master, connection.sap, reason))

    def _forget(self, sap: int, reason: int) -> None:
        connection = self._connections.pop(sap)
        if not connection.over:
            connection.records.reset()
            self._slave.note(AcyclicClosed(connection.master, sap, reason))

    def next_deadline(self) -> int | None:
        """When the first silent connection ends."""
        return min((self._end(one) for one in self._connections.values()), default=None)

    def handle_timeout(self, now: int) -> None:
        for connection in [one for one in self._connections.values() if self._end(one) <= now]:
            if connection.over:
                del self._connections[connection.sap]
            else:
                connection.heard_ns = now
                self._abort(connection, AbortReason.TIMEOUT)

    @staticmethod
    def _end(connection: _Connection) -> int:
        return connection.heard_ns + PATIENCE * connection.send_timeout_ns


def _initiate_answer(initiate: Initiate, longest: int) -> bytes:
    """Source and destination of the request, exchanged."""
    source, destination = initiate.source, initiate.destination
    tail = bytes((0, len(destination), 0, len(source))) + destination + source
    return InitiateAnswer(longest, (1, 0), (0, 0), initiate.profile, tail).emit()
