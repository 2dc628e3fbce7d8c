"""CMCTL: context management of one AR on the initiator's side (IEC 61158-6-10).

One :class:`CmController` establishes, maintains and releases one AR; a new attempt is a new machine with a new AR
UUID.  It uses RPC calls, each ``(opnum, args_maximum, payload)``: :meth:`CmController.calls` gives the next one,
``call_returned`` or ``call_failed`` end it, and one call is in progress at a time.  Calls of the device
(ApplicationReady) enter by ``receive_call`` and are answered by :meth:`CmController.responses`.

State     waits for                                    and then
--------  -------------------------------------------  -------------------------------------------------
IDLE      the owner                                    Connect
W_CCNF    Connect.cnf                                  checks every block, ``Connected``: cyclic data starts
W_WCNF    Write.cnf of each parameter record           PrmEnd
W_PECNF   DControl.cnf (PrmEnd)                        ``Parametrised``
W_ARDY    CControl.ind (ApplicationReady)              confirms it, ``ArEstablished``
DATA      records, Release, the end
W_RLCNF   Release.cnf                                  ``ArReleased``
CLOSED    nothing

Alarms are taken from Connect.cnf to the end (:mod:`alarms`); too many repetitions of an AlarmAck abort the AR.
:mod:`submodules` knows the usable submodules; :mod:`rounds` parametrises during data exchange.
An AR for device access has neither data nor alarms and is in DATA as soon as the Connect is confirmed.

The legacy and the advanced start-up go through the same states; they differ in ARProperties and in the RT class that
they allow.  A captured S7-1500 (advanced) sends its outputs from Connect.cnf on, before PrmEnd; here both do.

An ApplicationReady that overtakes the confirmation of PrmEnd is kept and answered after it.  A start-up that fails
after the device has accepted the Connect is reported to the device: by Release if the response to Connect is unusable,
by an RTA error afterwards.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

from pnfarm.errors import RemoteError
from pnfarm.protocols.profinet.alarms.channel import AlarmFailed, PeerAborted
from pnfarm.protocols.profinet.cm.controller import calls as cmctl_calls
from pnfarm.protocols.profinet.cm.controller import request, response
from pnfarm.protocols.profinet.cm.controller.alarms import ControllerAlarms
from pnfarm.protocols.profinet.cm.controller.calls import Answer, CallQueue, Kind, Pending
from pnfarm.protocols.profinet.cm.controller.events import (
    AlarmIndicated,
    ApplicationReadyReceived,
    ArAborted,
    ArEstablished,
    ArFailed,
    ArReleased,
    CmctlEvent,
    Connected,
    ControllerCall,
    ParametersEnded,
    Parametrised,
    RecordRead,
    RecordWriteDone,
)
from pnfarm.protocols.profinet.cm.controller.frames import plan_frames
from pnfarm.protocols.profinet.cm.controller.rounds import Ready
from pnfarm.protocols.profinet.cm.controller.states import (
    CONNECTED,
    PHASES,
    TRANSITIONS,
    CmctlEnd,
    CmctlSignal,
    CmctlState,
)
from pnfarm.protocols.profinet.cm.controller.submodules import ControllerSubmodules
from pnfarm.protocols.profinet.errors import OK, PnioStatus, RtaError
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.records.iod import NIL_UUID
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable

    from pnfarm.protocols.profinet.alarms.channel import AlarmChannel
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.cm.controller.plan import ArPlan
    from pnfarm.wire.ethernet import VlanTag

__all__ = ["CmController", "CmctlState"]


class CmController:
    """One AR, seen from its controller.  Times are integer nanoseconds; see the module for the states.

    ``dropped`` counts unexpected inputs, by reason.
    """

    def __init__(self, plan: ArPlan) -> None:
        """Computes the layout of the frames.  Raises ConfigError if the plan's data do not fit."""
        self.plan = plan
        self.layouts = plan_frames(plan)
        self.dropped: Counter[str] = Counter()
        self._state = CmctlState.IDLE
        self._device_mac: bytes | None = None
        self._calls = CallQueue()
        self._parameters_open = 0
        self._held_ready: Ready | None = None
        self._ready_deadline: int | None = None
        self._events: list[CmctlEvent] = []
        self._responses: list[tuple[Any, PnioStatus, bytes]] = []
        self._alarms = ControllerAlarms(plan, self.dropped)
        self._submodules = ControllerSubmodules(plan, self._calls, self.dropped)

    @property
    def state(self) -> CmctlState:
        return self._state

    @property
    def device_mac(self) -> bytes | None:
        """Source MAC address of the device's cyclic frames; None before it accepted the Connect."""
        return self._device_mac

    @property
    def alarms(self) -> AlarmChannel | None:
        """The AR's alarm channel; None before the device accepted the Connect."""
        return self._alarms.channel

    @property
    def unusable(self) -> dict[ExpectedKey, str]:
        """Planned submodules, (api, slot, subslot), that cannot be used now, and why."""
        return self._submodules.unusable

    # Calls of the owner

    def connect(self, now: int) -> None:
        """Start.  A machine connects once; a further call is counted in ``dropped`` and changes nothing."""
        self._signal(CmctlSignal.CONNECT, None, now)

    def release(self, now: int) -> None:
        """Release the AR; ends in ArReleased.  Records that have not been sent end with a reason."""
        self._signal(CmctlSignal.RELEASE, None, now)

    def abort(
        self, now: int, error_code2: int = RtaError.ABORT_REQUEST, reason: str = "aborted by the controller"
    ) -> None:
        """Break the AR off: the device gets an RTA error of class RTA_ERR_CLS_PROTOCOL with ``error_code2``."""
        self._signal(CmctlSignal.ABORT, CmctlEnd(reason, rta=error_code2, error_code2=error_code2), now)

    def watchdog_expired(self, now: int) -> None:
        """The consumer of the input CR had no valid frame for its data hold time: abort with code 5."""
        self.abort(now, RtaError.CONSUMER_DHT_EXPIRED, "no input data within the data hold time")

    def read_record(self, tag: Hashable, api: int, slot: int, subslot: int, index: int, length: int) -> None:
        """Read up to ``length`` octets of a record; ends in ``RecordRead(tag, ...)``."""
        if self._state not in CONNECTED:
            self._events.append(RecordRead(tag, None, reason=f"there is no connection (state {self._state})"))
            return
        self._calls.put_read(Kind.READ, self.plan.ar_uuid, (api, slot, subslot, index), length, tag)

    def read_implicit(self, tag: Hashable, api: int, slot: int, subslot: int, index: int, length: int) -> None:
        """Read a record outside of the AR (ReadImplicit), in any state; ends in ``RecordRead(tag, ...)``."""
        self._calls.put_read(Kind.READ_IMPLICIT, NIL_UUID, (api, slot, subslot, index), length, tag)

    def write_record(self, tag: Hashable, api: int, slot: int, subslot: int, index: int, data: bytes) -> None:
        """Write a record; ends in ``RecordWriteDone(tag, ...)``."""
        if self._state not in CONNECTED:
            self._events.append(RecordWriteDone(tag, None, f"there is no connection (state {self._state})"))
            return
        at = self._calls.address(api, slot, subslot, index)
        self._calls.put(Kind.WRITE, Opnum.WRITE, request.write_payload(self.plan.ar_uuid, at, data), (at,), (tag,))

    def reparametrise(self, submodules: Iterable[ExpectedKey] | None = None) -> bool:
        """Write the records of these submodules again, of all usable ones when None; ends in ``ParametersEnded``.

        False when there is no data exchange, when there is nothing to parametrise, or during such a round.
        """
        return self._state is CmctlState.DATA and self._submodules.begin(submodules)

    # What goes out

    def calls(self, now: int) -> list[ControllerCall]:
        """The next call to make, once the one before has ended; its timeout runs from here."""
        return self._calls.next_calls(now)

    def responses(self) -> list[tuple[Any, PnioStatus, bytes]]:
        """Answers to the device's calls: ``(call, status, payload)``."""
        out, self._responses = self._responses, []
        return out

    def rta_to_send(self) -> list[tuple[bytes, bytes, VlanTag]]:
        """RTA frames: ``(destination MAC, octets after the EtherType, tag)``."""
        return self._alarms.to_send()

    def events(self) -> list[CmctlEvent]:
        """What happened since the last call, in order."""
        out, self._events = self._events, []
        return out

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""
        rounds = self._submodules.rounds.deadline
        deadlines = (self._ready_deadline, self._calls.deadline, self._alarms.deadline, rounds)
        return min((at for at in deadlines if at is not None), default=None)

    def handle_timeout(self, now: int) -> None:
        self._alarms.handle_timeout(now)
        self._take_alarms(now)
        pending = self._calls.take_expired(now)
        if pending is not None:
            reason = f"no answer to {pending.kind.value} within {pending.timeout_ns / 1e9:g} s"
            self._ended(pending, Answer(None, reason=reason), now)
        if self._ready_deadline is not None and now >= self._ready_deadline:
            seconds = self.plan.application_ready_ns / 1e9
            reason = f"no ApplicationReady from the device within {seconds:g} s"
            self._signal(CmctlSignal.FAULT, CmctlEnd(reason, rta=RtaError.ABORT_REQUEST), now)
        self._submodules.rounds.handle_timeout(now)
        self._take_submodules(now)

    # What comes in

    def call_returned(self, key: int, status: PnioStatus, payload: bytes, now: int) -> None:
        """The device answered call ``key``."""
        self._returned(key, Answer(status, payload), now)

    def call_failed(self, key: int, reason: str, now: int) -> None:
        """Call ``key`` ended without a PNIOStatus: silence, reject, fault."""
        self._returned(key, Answer(None, reason=reason), now)

    def receive_call(self, call: Any, opnum: int, payload: bytes, now: int) -> None:
        """A call of the device to the controller's interface.  ``call`` comes back in :meth:`responses`.

        The AR UUID and the session key identify the AR, whoever calls.
        """
        try:
            content = response.check_ready(self.plan, opnum, payload)
        except response.CallRefusedError as exc:
            self.dropped[exc.reason] += 1
            self._responses.append((call, exc.status, b""))
            return
        if (self._state, CmctlSignal.READY_IND) not in TRANSITIONS:
            self.dropped["ready-out-of-turn"] += 1
            self._responses.append((call, response.STATE_CONFLICT, b""))
            return
        self._signal(CmctlSignal.READY_IND, Ready(call, content), now)

    def receive_rta(self, payload: bytes, source_mac: bytes, now: int) -> None:
        """An RTA frame (octets after the EtherType): alarms, or an RTA error, which ends the AR."""
        self._alarms.receive(payload, source_mac, now)
        self._take_alarms(now)

    def _take_alarms(self, now: int) -> None:
        for event in self._alarms.take(now):
            match event:
                case AlarmIndicated(alarm=alarm):
                    self._events.append(event)
                    self._submodules.alarm(alarm, now, data=self._state is CmctlState.DATA)
                case AlarmFailed(code=code, reason=reason):
                    self.abort(now, code, f"the alarm channel failed: {reason}")
                case PeerAborted(status=status):
                    self._signal(CmctlSignal.ABORT, CmctlEnd.of_device(status), now)
        self._take_submodules(now)

    def _take_submodules(self, now: int) -> None:
        """Handle the changes of submodules and their parameters."""
        for event in self._submodules.events():
            self._events.append(event)
            if isinstance(event, ParametersEnded) and event.code is not None:
                self.abort(now, event.code, event.reason)
        self._responses += self._submodules.rounds.responses()

    # Ends of calls

    def _returned(self, key: int, answer: Answer, now: int) -> None:
        pending = self._calls.take(key)
        if pending is None:
            self.dropped["late-answer"] += 1
            return
        self._ended(pending, answer, now)

    def _ended(self, pending: Pending, answer: Answer, now: int) -> None:
        self._ENDED[pending.kind](self, pending, answer, now)

    def _round_ended(self, pending: Pending, answer: Answer, now: int) -> None:
        self._submodules.rounds.call_ended(pending, answer, now)
        self._take_submodules(now)

    def _connect_ended(self, _pending: Pending, answer: Answer, now: int) -> None:
        if not answer.ok:
            self._signal(CmctlSignal.FAULT, CmctlEnd(answer.failure, answer.status), now)
            return
        try:
            if self.plan.device_access:
                mac = response.check_access(self.plan, answer.payload)
                self._signal(CmctlSignal.ACCESS_CNF, mac, now)
                return
            accepted = response.check_connect(self.plan, self.layouts, answer.payload)
        except RemoteError as exc:
            if self._state is CmctlState.W_CCNF:  # in other states a Release is queued already
                self._say_farewell()
            self._signal(CmctlSignal.FAULT, CmctlEnd(str(exc)), now)
        else:
            self._signal(CmctlSignal.CONNECT_CNF, accepted, now)

    def _parameters_ended(self, pending: Pending, answer: Answer, now: int) -> None:
        results = cmctl_calls.write_results(pending, answer)
        self._events += results
        self._parameters_open -= len(results)
        refusal = cmctl_calls.first_refusal(pending, results)
        if refusal is not None:
            self._signal(CmctlSignal.FAULT, CmctlEnd(*refusal, RtaError.RPC_WRITE_ERROR), now)
        elif self._parameters_open == 0:
            self._signal(CmctlSignal.RECORDS_WRITTEN, None, now)

    def _parameter_end_ended(self, _pending: Pending, answer: Answer, now: int) -> None:
        end = CmctlEnd(answer.failure, answer.status, RtaError.RPC_CONTROL_ERROR)
        if answer.ok:
            try:
                response.check_control(self.plan, answer.payload, BlockType.PRM_END_RES, "PrmEnd")
            except RemoteError as exc:
                end = replace(end, status=None, reason=str(exc))
            else:
                self._signal(CmctlSignal.PRM_END_CNF, None, now)
                return
        self._signal(CmctlSignal.FAULT, end, now)

    def _release_ended(self, _pending: Pending, answer: Answer, now: int) -> None:
        reason = "" if answer.ok else answer.failure
        if answer.ok:
            try:
                response.check_control(self.plan, answer.payload, BlockType.RELEASE_RES, "Release")
            except RemoteError as exc:
                reason = str(exc)
        # after an unconfirmed Release, an RTA error makes sure that the device ends the AR
        self._signal(CmctlSignal.RELEASE_CNF, CmctlEnd(reason, rta=RtaError.ABORT_REQUEST if reason else None), now)

    def _release_unusable_ended(self, _pending: Pending, answer: Answer, _now: int) -> None:
        if not answer.ok:
            self.dropped["farewell-unconfirmed"] += 1

    def _read_ended(self, pending: Pending, answer: Answer, _now: int) -> None:
        self._events.append(cmctl_calls.read_result(pending, answer))

    def _write_ended(self, pending: Pending, answer: Answer, _now: int) -> None:
        self._events += cmctl_calls.write_results(pending, answer)

    _ENDED: ClassVar[dict[Kind, Callable[[CmController, Pending, Answer, int], None]]] = {
        Kind.CONNECT: _connect_ended,
        Kind.PARAMETERS: _parameters_ended,
        Kind.PARAMETER_END: _parameter_end_ended,
        Kind.RELEASE: _release_ended,
        Kind.RELEASE_UNUSABLE: _release_unusable_ended,
        Kind.READ: _read_ended,
        Kind.WRITE: _write_ended,
        Kind.READ_IMPLICIT: _read_ended,
        **dict.fromkeys((Kind.ROUND_BEGIN, Kind.ROUND_WRITE, Kind.ROUND_END, Kind.ROUND_END_PLUG), _round_ended),
    }

    # The state machine

    def _signal(self, signal: CmctlSignal, detail: Any, now: int) -> None:
        row = TRANSITIONS.get((self._state, signal))
        if row is None:
            self.dropped[f"{signal.name}-in-{self._state}".lower().replace("_", "-")] += 1
            return
        state, action = row
        before = self._state
        self._enter(state)
        getattr(self, f"_do_{action}")(before, detail, now)

    def _enter(self, state: CmctlState) -> None:
        self._state = state
        if state is not CmctlState.W_ARDY:
            self._ready_deadline = None

    def _do_send_connect(self, _before: CmctlState, _detail: None, _now: int) -> None:
        payload = request.connect_payload(self.plan, *self.layouts)
        self._calls.put(Kind.CONNECT, Opnum.CONNECT, payload)

    def _do_connected(self, _before: CmctlState, accepted: response.ConnectAnswer, now: int) -> None:
        answered = zip(self.layouts, accepted.frame_ids, strict=True)
        self.layouts = tuple(replace(layout, frame_id=frame_id) for layout, frame_id in answered)
        self._device_mac = accepted.device_mac
        self._alarms.open(accepted)
        self._events.append(Connected(self.layouts, accepted.device_mac, accepted.module_diff))
        self._submodules.differ(accepted.module_diff)
        self._take_submodules(now)
        self._send_parameters()
        if not self._parameters_open:
            self._signal(CmctlSignal.RECORDS_WRITTEN, None, now)

    def _send_parameters(self) -> None:
        """The records of the submodules that are there; another's would be refused."""
        away = self._submodules.unusable
        records = [r for r in self.plan.records if (r.api, r.slot, r.subslot) not in away]
        for record in self.plan.records:
            why = away.get((record.api, record.slot, record.subslot))
            if why is not None:
                self._events.append(RecordWriteDone(record, None, why))
        self._parameters_open = len(records)
        self._calls.put_records(Kind.PARAMETERS, self.plan, records)

    def _do_accessible(self, _before: CmctlState, device_mac: bytes, _now: int) -> None:
        self._device_mac = device_mac
        self._events.append(ArEstablished())

    def _do_send_parameter_end(self, _before: CmctlState, _detail: None, _now: int) -> None:
        self._calls.put(Kind.PARAMETER_END, Opnum.CONTROL, request.parameter_end_payload(self.plan))

    def _do_parametrised(self, _before: CmctlState, _detail: None, now: int) -> None:
        self._ready_deadline = now + self.plan.application_ready_ns
        self._events.append(Parametrised())
        if self._held_ready is not None:
            held, self._held_ready = self._held_ready, None
            self._signal(CmctlSignal.READY_IND, held, now)

    def _do_hold_ready(self, _before: CmctlState, ready: Ready, _now: int) -> None:
        if self._held_ready is not None:
            self.dropped["ready-twice"] += 1
            self._responses.append((self._held_ready.call, response.STATE_CONFLICT, b""))
        self._held_ready = ready

    def _do_established(self, _before: CmctlState, ready: Ready, now: int) -> None:
        self._confirm(ready)
        self._submodules.differ(ready.content.module_diff)
        self._take_submodules(now)
        self._events.append(ArEstablished())

    def _do_ready_again(self, _before: CmctlState, ready: Ready, now: int) -> None:
        if not self._submodules.rounds.ready(ready, now):
            self._confirm(ready)
        self._take_submodules(now)

    def _confirm(self, ready: Ready) -> None:
        self._events.append(ApplicationReadyReceived(ready.content.module_diff, ready.content.after_plug))
        self._responses.append((ready.call, OK, ready.content.answer))

    def _do_send_release(self, _before: CmctlState, _detail: None, now: int) -> None:
        self._clear("the connection is being released", now)
        self._calls.put(Kind.RELEASE, Opnum.RELEASE, request.release_payload(self.plan))

    def _say_farewell(self) -> None:
        self._calls.put(Kind.RELEASE_UNUSABLE, Opnum.RELEASE, request.release_payload(self.plan))

    def _do_never_connected(self, _before: CmctlState, _detail: object, _now: int) -> None:
        self._events.append(ArReleased("there was no connection"))

    def _do_released(self, _before: CmctlState, end: CmctlEnd, _now: int) -> None:
        self._notify_device(end)
        confirmed = end.by_device and end.error_code2 == RtaError.RELEASE_RECEIVED
        self._events.append(ArReleased("" if confirmed else end.reason))

    def _do_failed(self, before: CmctlState, end: CmctlEnd, now: int) -> None:
        self._clear("the connection failed", now)
        self._notify_device(end)
        self._events.append(ArFailed(PHASES[before], end.status, end.reason))

    def _do_connect_given_up(self, before: CmctlState, end: CmctlEnd, now: int) -> None:
        self._do_failed(before, end, now)
        if self._calls.is_under_way(Kind.CONNECT):  # the device may still accept it
            self._say_farewell()

    def _do_aborted(self, _before: CmctlState, end: CmctlEnd, now: int) -> None:
        self._clear("the connection was aborted", now)
        self._notify_device(end)
        self._events.append(ArAborted(end.by_device, end.error_code1, end.error_code2, end.reason))

    def _clear(self, reason: str, now: int) -> None:
        """Forget what belongs to the AR: calls that were not sent yet, and the device's call that was kept."""
        self._submodules.rounds.close(now)
        self._take_submodules(now)
        self._events += self._calls.drop_waiting(reason)
        if self._held_ready is not None:
            self._responses.append((self._held_ready.call, response.STATE_CONFLICT, b""))
            self._held_ready = None

    def _notify_device(self, end: CmctlEnd) -> None:
        """The AR has ended: notify the device if it does not know, and accept no more alarms."""
        if end.rta is None:
            self._alarms.close()
        else:
            self._alarms.abort(end.rta)
