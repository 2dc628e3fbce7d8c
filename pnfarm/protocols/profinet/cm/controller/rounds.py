"""Parameters that a controller writes during data exchange: after an alarm, or with PrmBegin (IEC 61158-6-10).

Each is one :class:`Round` over some submodules, from the call that opens it to the device's ApplicationReady:

State     waits for                                            and then
--------  ---------------------------------------------------  ---------------------------------------
W_PBCNF   DControl.cnf (PrmBegin); not after an alarm          writes the records
W_WCNF    Write.cnf of each record of these submodules         PrmEnd, after an alarm PrmEnd.plug
W_PECNF   DControl.cnf                                         awaits the application, or takes its call
W_ARDY    CControl.ind (ApplicationReady, ApplicationReady.plug)   confirms it
W_LATE    the same, after its time limit (after an alarm)          confirms it
DONE      nothing

Rounds after alarms are distinguished by the alarm's sequence number, and several may be in progress; of the other kind
there is one at a time.  If a device refuses a call of a round after an alarm, the submodules stay unusable and
the AR continues.  If it does not answer at all, this AR cannot bring them into use: the AR ends, and a new
start-up parametrises everything.  A round that began with PrmBegin cannot be abandoned, as the device holds back
its alarms meanwhile: the AR ends with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

from pnfarm.errors import RemoteError
from pnfarm.protocols.named import Named
from pnfarm.protocols.profinet.cm.controller import request, response
from pnfarm.protocols.profinet.cm.controller.calls import Answer, Kind, Pending, first_refusal, write_results
from pnfarm.protocols.profinet.errors import OK, PnioStatus, RtaError
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Callable, Iterable

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.cm.controller.calls import CallQueue
    from pnfarm.protocols.profinet.cm.controller.events import RecordWriteDone
    from pnfarm.protocols.profinet.cm.controller.plan import ArPlan

__all__ = ["ROUND_TRANSITIONS", "Ready", "Round", "RoundEnded", "RoundSignal", "RoundState", "Rounds"]


class RoundState(StrEnum):
    """Named like the states of CMCTL, by what is awaited."""

    W_PBCNF = "W_PBCNF"
    W_WCNF = "W_WCNF"
    W_PECNF = "W_PECNF"
    W_ARDY = "W_ARDY"
    W_LATE = "W_LATE"
    DONE = "DONE"


class RoundSignal(Named):
    PRM_BEGIN_CNF = "dcontrol.cnf of PrmBegin"
    RECORDS_WRITTEN = "write.cnf of the last record"
    PRM_END_CNF = "dcontrol.cnf of PrmEnd"
    READY_IND = "ccontrol.ind"
    OVERDUE = "no ccontrol.ind in time"
    FAULT = "the round cannot go on"
    GONE = "the submodule is gone again"


_S, _E = RoundState, RoundSignal

#: (state, signal) -> (next state, name of the action).  What is not here changes nothing.
ROUND_TRANSITIONS: dict[tuple[RoundState, RoundSignal], tuple[RoundState, str]] = {
    (_S.W_PBCNF, _E.PRM_BEGIN_CNF): (_S.W_WCNF, "write"),
    (_S.W_WCNF, _E.RECORDS_WRITTEN): (_S.W_PECNF, "end"),
    (_S.W_PECNF, _E.READY_IND): (_S.W_PECNF, "hold"),
    (_S.W_PECNF, _E.PRM_END_CNF): (_S.W_ARDY, "await"),
    (_S.W_ARDY, _E.READY_IND): (_S.DONE, "ready"),
    (_S.W_ARDY, _E.OVERDUE): (_S.W_LATE, "overdue"),
    (_S.W_LATE, _E.READY_IND): (_S.DONE, "ready"),
    **{
        (state, signal): (_S.DONE, action)
        for state in (_S.W_PBCNF, _S.W_WCNF, _S.W_PECNF, _S.W_ARDY, _S.W_LATE)
        for signal, action in ((_E.FAULT, "failed"), (_E.GONE, "forget"))
    },
}


@dataclass(frozen=True, slots=True)
class Ready:
    """An ApplicationReady of the device: its call and its content."""

    call: Any
    content: response.ReadyCall


@dataclass(slots=True, eq=False)
class Round:
    """``sequence``: the alarm's sequence number, None when PrmBegin opened the round."""

    keys: tuple[ExpectedKey, ...]
    sequence: int | None
    state: RoundState
    records_open: int = 0
    deadline: int | None = None
    held: Ready | None = None

    @property
    def begins(self) -> bool:
        return self.sequence is None


@dataclass(frozen=True, slots=True)
class RoundEnded:
    """``reason`` is empty when the device is ready; ``code`` is what the AR ends with, None when it goes on.

    ``overdue``: the device's ApplicationReady may still come, and another of these follows then.
    """

    keys: tuple[ExpectedKey, ...]
    after_plug: bool
    reason: str = ""
    code: int | None = None
    overdue: bool = False


#: What a row of the table does: the machine, the round, detail of the signal, now.
_Action: TypeAlias = "Callable[[Rounds, Round, Any, int], None]"


class Rounds:
    """The rounds of one AR.  ``calls`` and ``dropped`` are the AR's."""

    def __init__(self, plan: ArPlan, calls: CallQueue, dropped: Counter[str]) -> None:
        self._plan = plan
        self._calls = calls
        self._dropped = dropped
        self._rounds: list[Round] = []
        self._events: list[RoundEnded | RecordWriteDone | Ready] = []
        self._responses: list[tuple[Any, PnioStatus, bytes]] = []

    # what opens and ends a round

    def begin(self, keys: tuple[ExpectedKey, ...]) -> bool:
        """Parametrise these submodules again.  False while a round of this kind is in progress."""
        if not keys or any(r.begins for r in self._rounds):
            return False
        fresh = Round(keys, None, RoundState.W_PBCNF)
        self._rounds.append(fresh)
        payload = request.parameter_begin_payload(self._plan, keys)
        self._calls.put(Kind.ROUND_BEGIN, Opnum.CONTROL, payload, owner=fresh)
        return True

    def plugged(self, keys: tuple[ExpectedKey, ...], sequence: int, now: int) -> None:
        """An alarm said that these submodules are there; it has been acknowledged."""
        self.gone(keys, now)
        fresh = Round(keys, sequence, RoundState.W_WCNF)
        self._rounds.append(fresh)
        self._write(fresh, None, now)

    def gone(self, keys: Iterable[ExpectedKey], now: int) -> None:
        """These submodules were removed: cancel rounds after alarms that concern only them."""
        lost = set(keys)
        for standing in list(self._rounds):
            if not standing.begins and lost.issuperset(standing.keys):
                self._signal(standing, RoundSignal.GONE, None, now)

    def close(self, now: int) -> None:
        """The AR is over."""
        for standing in list(self._rounds):
            self._signal(standing, RoundSignal.GONE, None, now)

    # what comes in

    def call_ended(self, pending: Pending, answer: Answer, now: int) -> None:
        """A call of a round ended."""
        standing = pending.owner
        if not isinstance(standing, Round) or standing.state is RoundState.DONE:
            self._dropped["answer-of-a-void-round"] += 1
            return
        if pending.kind is Kind.ROUND_WRITE:
            self._written(standing, pending, answer, now)
            return
        begins = pending.kind is Kind.ROUND_BEGIN
        end_type = BlockType.PRM_END_RES if standing.begins else BlockType.PRM_END_PLUG_RES
        reason = "" if answer.ok else answer.failure
        if answer.ok:
            block_type = BlockType.PRM_BEGIN_RES if begins else end_type
            try:
                response.check_control(
                    self._plan, answer.payload, block_type, pending.kind.value, standing.sequence or 0
                )
            except RemoteError as exc:
                reason = str(exc)
        if reason:
            refused = answer.status is not None and not answer.ok
            # a device that refused PrmBegin has not started anything: the AR continues as before
            goes_on = refused if begins else not standing.begins and answer.status is not None
            code = None if goes_on else RtaError.RPC_CONTROL_ERROR
            self._signal(standing, RoundSignal.FAULT, (f"{pending.kind.value}: {reason}", code), now)
        else:
            self._signal(standing, RoundSignal.PRM_BEGIN_CNF if begins else RoundSignal.PRM_END_CNF, None, now)

    def _written(self, standing: Round, pending: Pending, answer: Answer, now: int) -> None:
        results = write_results(pending, answer)
        self._events += results
        standing.records_open -= len(results)
        refusal = first_refusal(pending, results)
        if refusal is not None:
            goes_on = not standing.begins and answer.status is not None
            code = None if goes_on else RtaError.RPC_WRITE_ERROR
            self._signal(standing, RoundSignal.FAULT, (refusal[0], code), now)
        elif standing.records_open == 0:
            self._signal(standing, RoundSignal.RECORDS_WRITTEN, None, now)

    def ready(self, ready: Ready, now: int) -> bool:
        """An ApplicationReady of the device; False when no round waits for it."""
        sequence = ready.content.sequence if ready.content.after_plug else None
        standing = next((r for r in self._rounds if r.sequence == sequence), None)
        if standing is None or (standing.state, RoundSignal.READY_IND) not in ROUND_TRANSITIONS:
            return False
        self._signal(standing, RoundSignal.READY_IND, ready, now)
        return True

    # time, and what goes out

    @property
    def deadline(self) -> int | None:
        return min((r.deadline for r in self._rounds if r.deadline is not None), default=None)

    def handle_timeout(self, now: int) -> None:
        for standing in list(self._rounds):
            if standing.deadline is not None and now >= standing.deadline:
                seconds = self._plan.application_ready_ns / 1e9
                reason = f"no ApplicationReady from the device within {seconds:g} s"
                if standing.begins:
                    self._signal(standing, RoundSignal.FAULT, (reason, RtaError.ABORT_REQUEST), now)
                else:
                    self._signal(standing, RoundSignal.OVERDUE, reason, now)

    def events(self) -> list[RoundEnded | RecordWriteDone | Ready]:
        """Ends of rounds and of their records, and the ApplicationReady of each successful one, in order."""
        out, self._events = self._events, []
        return out

    def responses(self) -> list[tuple[Any, PnioStatus, bytes]]:
        out, self._responses = self._responses, []
        return out

    @property
    def under_way(self) -> frozenset[ExpectedKey]:
        """Submodules whose parameters are being written after an alarm."""
        return frozenset(key for r in self._rounds if not r.begins for key in r.keys)

    # the machine

    def _signal(self, standing: Round, signal: RoundSignal, detail: Any, now: int) -> None:
        """The only writer of a round's state."""
        row = ROUND_TRANSITIONS.get((standing.state, signal))
        if row is None:
            self._dropped[f"round-{signal.name}-in-{standing.state}".lower().replace("_", "-")] += 1
            return
        standing.state, action = row
        standing.deadline = None
        if standing.state is RoundState.DONE:
            self._rounds.remove(standing)
        self._ACTIONS[action](self, standing, detail, now)

    def _write(self, standing: Round, _detail: None, now: int) -> None:
        records = [r for r in self._plan.records if (r.api, r.slot, r.subslot) in standing.keys]
        standing.records_open = len(records)
        self._calls.put_records(Kind.ROUND_WRITE, self._plan, records, owner=standing)
        if not records:
            self._signal(standing, RoundSignal.RECORDS_WRITTEN, None, now)

    def _end(self, standing: Round, _detail: None, _now: int) -> None:
        payload = request.parameter_end_payload(self._plan, standing.sequence)
        kind = Kind.ROUND_END if standing.begins else Kind.ROUND_END_PLUG
        self._calls.put(kind, Opnum.CONTROL, payload, owner=standing)

    def _hold(self, standing: Round, ready: Ready, _now: int) -> None:
        self._refuse_held(standing)
        standing.held = ready

    def _await(self, standing: Round, _detail: None, now: int) -> None:
        standing.deadline = now + self._plan.application_ready_ns
        if standing.held is not None:
            held, standing.held = standing.held, None
            self._signal(standing, RoundSignal.READY_IND, held, now)

    def _ready(self, standing: Round, ready: Ready, _now: int) -> None:
        self._responses.append((ready.call, OK, ready.content.answer))
        self._events += [ready, RoundEnded(standing.keys, not standing.begins)]

    def _overdue(self, standing: Round, reason: str, _now: int) -> None:
        self._events.append(RoundEnded(standing.keys, not standing.begins, reason, overdue=True))

    def _failed(self, standing: Round, detail: tuple[str, int | None], now: int) -> None:
        reason, code = detail
        self._forget(standing, None, now)
        self._events.append(RoundEnded(standing.keys, not standing.begins, reason, code))

    def _forget(self, standing: Round, _detail: None, _now: int) -> None:
        self._events += self._calls.drop_owned(standing, "the submodule's parameters are no longer needed")
        self._refuse_held(standing)

    def _refuse_held(self, standing: Round) -> None:
        if standing.held is not None:
            self._responses.append((standing.held.call, response.STATE_CONFLICT, b""))
            standing.held = None

    _ACTIONS: ClassVar[dict[str, _Action]] = {
        "write": _write,
        "end": _end,
        "hold": _hold,
        "await": _await,
        "ready": _ready,
        "overdue": _overdue,
        "failed": _failed,
        "forget": _forget,
    }
