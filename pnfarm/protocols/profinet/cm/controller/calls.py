"""The calls of one controller's AR: in order, one at a time, each with its time limit.

The queue knows the purpose of a call and its records; :mod:`cmctl` decides what the end of a call means for the AR.
The end of a record's call depends on nothing else and is reported here.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.errors import RemoteError
from pnfarm.protocols.named import Named
from pnfarm.protocols.profinet.cm.controller.events import ControllerCall, RecordRead, RecordWriteDone
from pnfarm.protocols.profinet.cm.controller.request import (
    RecordAddress,
    args_maximum,
    groups_of_records,
    multiple_write_payload,
    read_payload,
    write_payload,
)
from pnfarm.protocols.profinet.cm.controller.response import check_read, check_write
from pnfarm.protocols.profinet.errors import OK, PnioStatus, describe_status
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence
    from uuid import UUID

    from pnfarm.protocols.profinet.cm.controller.plan import ArPlan, ParameterRecord

__all__ = ["Answer", "CallQueue", "Kind", "Pending", "first_refusal", "read_result", "write_results"]


class Kind(Named):
    """What a call is for; the value is its name in messages."""

    CONNECT = "Connect"
    PARAMETERS = "Write"
    PARAMETER_END = "PrmEnd"
    RELEASE = "Release"
    #: Release of a connection that the device accepted and the controller cannot use; its end is not awaited.
    RELEASE_UNUSABLE = "Release of an unusable connection"
    READ = "Read"
    WRITE = "Write of a record"
    READ_IMPLICIT = "ReadImplicit"
    # while data flow (:mod:`rounds`)
    ROUND_BEGIN = "PrmBegin"
    ROUND_WRITE = "Write of a parameter"
    ROUND_END = "PrmEnd after PrmBegin"
    ROUND_END_PLUG = "PrmEnd.plug"


#: Calls that make sense without the AR, too.
_OUTLIVE_THE_AR = {Kind.READ_IMPLICIT, Kind.RELEASE, Kind.RELEASE_UNUSABLE}

#: The longest that a call may take; the RPC client repeats it within.
_CALL_NS = 10_000_000_000
_RELEASE_NS = 5_000_000_000


@dataclass(slots=True)
class Pending:
    """A call that is queued or in progress.

    ``tags`` and ``wants`` belong together, one for each record; ``length`` is the maximum of a read; ``owner`` is
    the owner of the call, if the kind does not determine it.
    """

    kind: Kind
    call: ControllerCall
    timeout_ns: int
    wants: tuple[RecordAddress, ...] = ()
    tags: tuple[Hashable, ...] = ()
    length: int = 0
    owner: object = None
    deadline: int = 0


@dataclass(frozen=True, slots=True)
class Answer:
    """How a call ended: with a status and a payload, or with ``status`` None for ``reason``."""

    status: PnioStatus | None
    payload: bytes = b""
    reason: str = ""

    @property
    def ok(self) -> bool:
        return self.status is not None and self.status.ok

    @property
    def failure(self) -> str:
        """Why it is not ok."""
        return self.reason if self.status is None else describe_status(self.status)


class CallQueue:
    """First in, first out; the next call goes out when the one before has ended."""

    def __init__(self) -> None:
        self._waiting: deque[Pending] = deque()
        self._under_way: Pending | None = None
        self._next_key = 1
        self._next_sequence = 0

    def sequence_number(self) -> int:
        """The next SeqNumber of the AR's reads and writes (u16, wraps)."""
        number = self._next_sequence
        self._next_sequence = (number + 1) & 0xFFFF
        return number

    def address(self, api: int, slot: int, subslot: int, index: int) -> RecordAddress:
        """The place of a record, with a sequence number of its own."""
        return RecordAddress(self.sequence_number(), api, slot, subslot, index)

    def put(
        self,
        kind: Kind,
        opnum: Opnum,
        payload: bytes,
        wants: tuple[RecordAddress, ...] = (),
        tags: tuple[Hashable, ...] = (),
        length: int = 0,
        owner: object = None,
    ) -> None:
        """Append a call."""
        call = ControllerCall(self._next_key, int(opnum), args_maximum(opnum, payload, len(wants), length), payload)
        self._next_key += 1
        limit = _RELEASE_NS if kind in {Kind.RELEASE, Kind.RELEASE_UNUSABLE} else _CALL_NS
        self._waiting.append(Pending(kind, call, limit, wants, tags, length, owner))

    def put_read(self, kind: Kind, ar_uuid: UUID, place: tuple[int, int, int, int], length: int, tag: Hashable) -> None:
        """Append the read of a record: ``place`` is API, slot, subslot and index."""
        at = self.address(*place)
        opnum = Opnum.READ if kind is Kind.READ else Opnum.READ_IMPLICIT
        self.put(kind, opnum, read_payload(ar_uuid, at, length), (at,), (tag,), length)

    def put_records(
        self, kind: Kind, plan: ArPlan, records: Sequence[ParameterRecord], *, owner: object = None
    ) -> None:
        """Append the writes of parameter records, one by one or many in a call, as the plan says."""
        size = plan.multiple_write_octets if plan.multiple_write else 0
        for group in groups_of_records(records, size):
            outer = self.sequence_number() if plan.multiple_write else 0
            wants = tuple(self.address(r.api, r.slot, r.subslot, r.index) for r in group)
            writes = [(at, record.data) for at, record in zip(wants, group, strict=True)]
            if plan.multiple_write:
                payload = multiple_write_payload(plan.ar_uuid, outer, writes)
            else:
                payload = write_payload(plan.ar_uuid, *writes[0])
            self.put(kind, Opnum.WRITE, payload, wants, group, owner=owner)

    def next_calls(self, now: int) -> list[ControllerCall]:
        """The next call, if none is under way; its time limit runs from here."""
        if self._under_way is not None or not self._waiting:
            return []
        self._under_way = self._waiting.popleft()
        self._under_way.deadline = now + self._under_way.timeout_ns
        return [self._under_way.call]

    def take(self, key: int) -> Pending | None:
        """The call under way, if it is ``key``; it has ended with this."""
        pending = self._under_way
        if pending is None or pending.call.key != key:
            return None
        self._under_way = None
        return pending

    def take_expired(self, now: int) -> Pending | None:
        """The call under way, if its time is over; it has ended with this."""
        pending = self._under_way
        if pending is None or now < pending.deadline:
            return None
        self._under_way = None
        return pending

    @property
    def deadline(self) -> int | None:
        return None if self._under_way is None else self._under_way.deadline

    def is_under_way(self, kind: Kind) -> bool:
        return self._under_way is not None and self._under_way.kind is kind

    def drop_owned(self, owner: object, reason: str) -> list[RecordWriteDone]:
        """Forget the waiting calls of ``owner``; the ends of the records among them."""
        dropped = [pending for pending in self._waiting if pending.owner is owner]
        self._waiting = deque(pending for pending in self._waiting if pending.owner is not owner)
        return [end for pending in dropped for end in write_results(pending, Answer(None, reason=reason))]

    def drop_waiting(self, reason: str) -> list[RecordRead | RecordWriteDone]:
        """Forget the waiting calls that need the AR; the ends of the records among them."""
        ends: list[RecordRead | RecordWriteDone] = []
        waiting, self._waiting = self._waiting, deque()
        for pending in waiting:
            if pending.kind in _OUTLIVE_THE_AR:
                self._waiting.append(pending)
            elif pending.kind is Kind.READ:
                ends.append(read_result(pending, Answer(None, reason=reason)))
            elif pending.kind in {Kind.WRITE, Kind.ROUND_WRITE}:
                ends += write_results(pending, Answer(None, reason=reason))
        return ends


def read_result(pending: Pending, answer: Answer) -> RecordRead:
    """The end of a read."""
    (tag,), (at,) = pending.tags, pending.wants
    if not answer.ok:
        return RecordRead(tag, None, answer.status, answer.reason)
    try:
        return RecordRead(tag, check_read(at, answer.payload, pending.length), OK)
    except RemoteError as exc:
        return RecordRead(tag, None, reason=str(exc))


def write_results(pending: Pending, answer: Answer) -> list[RecordWriteDone]:
    """The end of each record of a write, in order; a multiple write that failed as a whole failed for each."""
    statuses: Sequence[PnioStatus | None] = [answer.status] * len(pending.tags)
    reason = answer.reason
    if answer.ok:
        try:
            statuses = check_write(pending.wants, answer.payload)
            reason = "the answer to Write does not name the record"
        except RemoteError as exc:
            statuses, reason = [None] * len(pending.tags), str(exc)
    return [
        RecordWriteDone(tag, status, reason if status is None else "")
        for tag, status in zip(pending.tags, statuses, strict=True)
    ]


def first_refusal(pending: Pending, results: Sequence[RecordWriteDone]) -> tuple[str, PnioStatus | None] | None:
    """The first record of a write that the device did not take: a sentence, and the device's status if it gave one."""
    for at, result in zip(pending.wants, results, strict=True):
        if not result.ok:
            why = result.reason if result.status is None else describe_status(result.status)
            return f"slot {at.slot} subslot 0x{at.subslot:04X} index 0x{at.index:04X}: {why}", result.status
    return None
