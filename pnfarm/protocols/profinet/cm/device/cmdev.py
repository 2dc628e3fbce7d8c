"""CMDEV: the device's side of context management (IEC 61158-6-10, CMDEV, CMSM and CMSU protocol machines).

Theory.  One :class:`CmDevice` serves one device and holds one :class:`~pnfarm.protocols.profinet.cm.ar.Ar` for each
controller or supervisor connected to it; the state machine is :data:`~.cmdev_states.TRANSITIONS`, and
:meth:`CmDevice._step` alone writes ``ar.state``.  :mod:`.cmdev_ownership` decides the owner of a submodule;
:mod:`.cmdev_plug` handles parameters during data exchange; alarms go through :mod:`.cmdev_alarms`.

* A server of RPC hands it calls (:meth:`CmDevice.receive_call`) and sends what :meth:`CmDevice.responses` drains.
* A client of RPC sends what :meth:`CmDevice.calls` drains (ApplicationReady) and reports back by
  :meth:`CmDevice.call_returned` or :meth:`CmDevice.call_failed`.
* The cyclic engine starts both channels at :class:`ArConnected`, in legacy and in advanced start-up: a real
  controller's captures show the device's frames even before its Connect response.  It reports the first frame
  by :meth:`CmDevice.data_received` and a silent controller by :meth:`CmDevice.watchdog_expired`, and follows
  :class:`SubmodulesChanged` when a submodule is plugged or pulled.
* The application says when it is ready (:meth:`CmDevice.application_ready`) after :class:`PrmEndReceived`; it
  may do so late or never.
* The activity timeout of the controller (CMSM) runs from Connect to DATA, and for device access as long as the AR
  exists; each record call restarts it.
* All data are BAD until :class:`SubmodulesChanged` says that the application is ready for the first time, as in a
  captured device's frames.

A Connect without a fault that has the UUID of an existing AR is refused and ends that AR (state conflict; the
controller's next try succeeds).  A Connect of the same controller with a new UUID replaces its old AR.
:mod:`.cmdev_admission` decides whether it is the same controller.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.cm.ar import Ar, CmdevState
from pnfarm.protocols.profinet.cm.device.admission import Caller, admit, rerun_refusal
from pnfarm.protocols.profinet.cm.device.alarms import AlarmEnded, DeviceAlarms
from pnfarm.protocols.profinet.cm.device.check import RefusedError, check_connect, check_plugged, parse_connect
from pnfarm.protocols.profinet.cm.device.connect import connect_response, fill
from pnfarm.protocols.profinet.cm.device.control import check_list, confirms, read_control, refuse_call
from pnfarm.protocols.profinet.cm.device.diff import expected_idents, unusable_submodules
from pnfarm.protocols.profinet.cm.device.events import (
    ApplicationReadyConfirmed,
    ArAborted,
    ArConnected,
    ArReleased,
    ConnectRefused,
    DiagnosisChanged,
    PrmEndReceived,
    SubmodulesChanged,
)
from pnfarm.protocols.profinet.cm.device.modules import Modules
from pnfarm.protocols.profinet.cm.device.ownership import claim, pass_on, settle_claim
from pnfarm.protocols.profinet.cm.device.plug import CmpbeEvent, CmpbeState, Plug, PlugsmEvent
from pnfarm.protocols.profinet.cm.device.ready import OutgoingCall, ReadyCalls
from pnfarm.protocols.profinet.cm.device.records import serve_read, serve_write
from pnfarm.protocols.profinet.cm.device.states import TRANSITIONS, CmdevEvent
from pnfarm.protocols.profinet.errors import (
    OK,
    CmrpcError,
    ConnectFault,
    ControlField,
    ErrorCode,
    RtaError,
    describe_status,
    pnio_error,
    rta_status,
)
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem, AlarmSpecifier
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.control import control_response
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable
    from uuid import UUID

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey
    from pnfarm.protocols.profinet.cm.device.alarms import AlarmFrame
    from pnfarm.protocols.profinet.cm.device.check import ConnectRequest
    from pnfarm.protocols.profinet.cm.device.control import ControlCall
    from pnfarm.protocols.profinet.cm.device.events import CmEvent
    from pnfarm.protocols.profinet.cm.device.modules import Before
    from pnfarm.protocols.profinet.description import DeviceDescription, ModuleDescription, Plugged, SlotState
    from pnfarm.protocols.profinet.diagnosis import DiagnosisStore
    from pnfarm.protocols.profinet.records.handler import RecordHandler
    from pnfarm.protocols.profinet.rpc.fragments import Peer
    from pnfarm.protocols.profinet.wire.cm.connect import ArBlockReq
    from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

__all__ = ["CmDevice", "OutgoingCall"]


class CmDevice:
    """Context management of one device.  See the module's docstring for its callers.

    ``station_name`` may change while the machine lives.  ``refuse_connect``, when set, is called for every
    acceptable Connect and returns a PNIOStatus to refuse it with, or None; ``has_room`` returns whether its CRs
    can be opened; ``moved`` is called when something was pulled or plugged, before a controller is notified.  Changes
    of ``diagnosis`` are reported by alarms and in the ModuleDiffBlock.
    """

    def __init__(
        self,
        description: DeviceDescription,
        plugged: Plugged,
        records: RecordHandler,
        *,
        mac: bytes,
        station_name: str,
        diagnosis: DiagnosisStore,
    ) -> None:
        self.description = description
        self.plugged = plugged
        self.station_name = station_name
        self.refuse_connect: Callable[[ArBlockReq], PnioStatus | None] | None = None
        self.has_room: Callable[[], bool] = lambda: True
        self.moved: Callable[[], None] = lambda: None
        self._dropped: Counter[str] = Counter()
        self._mac = mac
        self._records = records
        self._ars: dict[int, Ar] = {}
        self._deadlines: dict[int, int] = {}
        self._next_key = 1
        self._events: list[CmEvent] = []
        self._responses: list[tuple[Hashable, PnioStatus, bytes]] = []
        self._ready = ReadyCalls()
        self.alarms = DeviceAlarms(plugged)
        self.diagnosis = diagnosis
        self._modules = Modules(plugged, self.alarms, diagnosis)

    # state for observers

    @property
    def ars(self) -> tuple[Ar, ...]:
        """The present ARs, oldest first."""
        return tuple(self._ars.values())

    def ar(self, ar_key: int) -> Ar | None:
        return self._ars.get(ar_key)

    @property
    def dropped(self) -> Counter[str]:
        """Discarded PDUs, by reason."""
        return self._dropped + self.alarms.dropped

    def events(self) -> list[CmEvent]:
        drained, self._events = self._events, []
        return drained

    def responses(self) -> list[tuple[Hashable, PnioStatus, bytes]]:
        """Answers to calls: (call, status, payload)."""
        drained, self._responses = self._responses, []
        return drained

    def calls(self) -> list[OutgoingCall]:
        """ApplicationReady, to be carried to controllers."""
        return self._ready.to_send()

    def awaits(self, token: int) -> bool:
        """Whether the response to a call is still needed: its AR exists."""
        return self._ready.under_way(token)

    def rta_to_send(self) -> list[AlarmFrame]:
        """Alarm frames: destination MAC, VLAN priority, octets after EtherType 0x8892."""
        return self.alarms.to_send()

    def next_deadline(self) -> int | None:
        first = min(self._deadlines.values()) if self._deadlines else None
        alarm = self.alarms.next_deadline()
        return first if alarm is None or (first is not None and first < alarm) else alarm

    def handle_timeout(self, now: int) -> None:
        """Abort every AR whose controller was inactive too long during start-up; repeat alarms."""
        for key in [k for k, deadline in self._deadlines.items() if deadline <= now]:
            self.abort(key, RtaError.CMI_TIMEOUT, now)
        self.alarms.handle_timeout(now)
        self._take_alarms(now)

    # inputs

    def receive_call(
        self,
        call: Hashable,
        opnum: int,
        payload: bytes,
        args_maximum: int,
        peer: Peer,
        now: int,
        *,
        source_mac: bytes | None = None,
    ) -> None:
        """One complete call on the device interface; exactly one response follows from :meth:`responses`.

        ``source_mac``: the Ethernet address that it came from.
        """
        match opnum:
            case Opnum.CONNECT:
                status, answer = self._connect(payload, args_maximum, Caller(peer.ip, source_mac), now)
            case Opnum.RELEASE:
                status, answer = self._release(payload, now)
            case Opnum.CONTROL:
                status, answer = self._control(payload, now)
            case Opnum.WRITE:
                served = serve_write(payload, self._by_uuid, self._records, now, args_maximum)
                status, answer = served.status, served.payload
                self._events += served.events
                self._touch(served.ar, now)
            case Opnum.READ | Opnum.READ_IMPLICIT:
                implicit = opnum == Opnum.READ_IMPLICIT
                served = serve_read(payload, args_maximum, self._by_uuid, self._records, now, implicit=implicit)
                status, answer = served.status, served.payload
                self._touch(served.ar, now)
            case _:
                status, answer = pnio_error(ErrorCode.PNIO, ConnectFault.CMRPC, CmrpcError.STATE_CONFLICT), b""
        self._responses.append((call, status, answer))

    def call_returned(self, token: int, status: PnioStatus, payload: bytes, now: int) -> None:
        """The controller answered an ApplicationReady."""
        call, ar = self._called(token)
        if call is None or ar is None:
            self._dropped["late-call-result"] += 1
            return
        if not status.ok:
            self.abort(ar.key, RtaError.RPC_CLIENT_CALL_FAILED, now)
            return
        if not confirms(ar, payload, call.block_type, call.sequence):
            self.abort(ar.key, RtaError.PROTOCOL_VIOLATION, now)
            return
        self._ready_confirmed(ar, call, now)

    def call_failed(self, token: int, reason: str, now: int) -> None:
        """ApplicationReady was not answered; ``reason`` is the RPC client's."""
        call, ar = self._called(token)
        if call is None or ar is None:
            self._dropped["late-call-result"] += 1
            return
        self._abort(ar, rta_status(RtaError.RPC_CLIENT_CALL_FAILED), now, f"ApplicationReady: {reason}")

    def _called(self, token: int) -> tuple[OutgoingCall | None, Ar | None]:
        call = self._ready.ended(token)
        return call, None if call is None else self._ars.get(call.ar_key)

    def data_received(self, ar_key: int, now: int, iocr_reference: int | None = None) -> None:
        """The first valid frame arrived, on one output CR or (None) on every one of them."""
        ar = self._ars.get(ar_key)
        if ar is None:
            return
        references = {c.iocr_reference for c in ar.output_crs}
        ar.data_seen |= references if iocr_reference is None else references & {iocr_reference}
        if ar.data_seen == references and ar.state is CmdevState.WDATA:
            self._step(ar, CmdevEvent.DATA_POSSIBLE, now)

    def watchdog_expired(self, ar_key: int, now: int) -> None:
        """An output CR's data hold timer ran out."""
        self.abort(ar_key, RtaError.CONSUMER_DHT_EXPIRED, now)

    def receive_rta(self, payload: bytes, source_mac: bytes, now: int) -> None:
        """An alarm frame's octets, from the frame id on; an ERR-RTA of an AR's controller ends that AR."""
        self.alarms.receive(payload, source_mac, self._ars, now)
        self._take_alarms(now)

    # calls of the application

    def application_ready(self, ar_key: int, now: int, sequence: int | None = None) -> bool:
        """Tell the controller that the application is ready.  False when the AR does not wait for that.

        ``sequence`` is that of :class:`PrmEndReceived`: None for the whole AR, an alarm's for one plugged submodule.
        """
        ar = self._ars.get(ar_key)
        if ar is None:
            return False
        if sequence is not None:
            return self._plug_ready(ar, sequence)
        if ar.state is CmdevState.DATA and self._modules.begin(ar_key).step(CmpbeEvent.APPLICATION_READY_REQ):
            self._call_ready(ar)
            return True
        if ar.state is not CmdevState.W_ARDY:
            return False
        self._call_ready(ar)
        self._events.append(SubmodulesChanged(ar.key, self._modules.unusable(ar), starting=True))
        self._step(ar, CmdevEvent.APPLICATION_READY_REQ, now)
        return True

    def abort(self, ar_key: int, reason: int, now: int) -> None:
        """End an AR with an ERR-RTA to its controller; ``reason`` is an :class:`RtaError` or any octet."""
        ar = self._ars.get(ar_key)
        if ar is not None:
            self._abort(ar, rta_status(reason), now)

    def abort_all(self, reason: int, now: int) -> None:
        for ar in self.ars:
            self.abort(ar.key, reason, now)

    def supply_gone(self) -> None:
        """No AR is left, and no controller is notified."""
        self._ars.clear()
        self._deadlines.clear()

    def pull(self, slot: int, subslot: int | None, now: int) -> None:
        """Pull a module, or one submodule of it, from a slot."""
        before = self._modules.before(self.ars, slot)
        self.plugged.pull(slot, subslot)
        self._moved(slot, before, now, whole=subslot is None)

    def plug(self, slot: int, module: ModuleDescription | None, now: int, *, substitute: bool = False) -> None:
        """Plug a module into a slot; None for the one that was pulled.  See :meth:`Plugged.plug`."""
        before = self._modules.before(self.ars, slot)
        self.plugged.plug(slot, module, substitute=substitute)
        self._moved(slot, before, now, whole=True)

    def put(self, slot: int, state: SlotState, now: int) -> None:
        """Set a slot to ``state`` (:meth:`Plugged.put`), whatever it holds now."""
        before = self._modules.before(self.ars, slot)
        self.plugged.put(slot, state)
        self._moved(slot, before, now, whole=True)

    def alarm(
        self,
        alarm_type: int,
        key: ExpectedKey,
        now: int,
        *,
        items: tuple[AlarmItem, ...] = (),
        specifier: int | None = None,
        high: bool = False,
    ) -> tuple[int, ...]:
        """An alarm about one submodule to every AR that owns it; the alarms' numbers, without those refused.

        ``specifier`` has the submodule's flags, by default those of its diagnosis now."""
        told: list[int] = []
        own = self.diagnosis.alarm_specifier(key) if specifier is None else specifier
        for ar in self.ars:
            if key in ar.owned and ar.alarm_cr is not None:
                ar_state = AlarmSpecifier.AR_DIAGNOSIS_STATE if self.diagnosis.has_fault(ar.owned) else 0
                flags = own | ar_state
                number = self.alarms.send(ar.key, alarm_type, key, now, items=items, specifier=flags, high=high)
                told += [] if number is None else [number]
        self._take_alarms(now)
        return tuple(told)

    def replug(self, ar_key: int, key: ExpectedKey, now: int) -> None:
        """Send one AR a plug alarm for a submodule of its own, as after a pull, and wait for its parameters.

        Nothing happens when the submodule is not there, or not the AR's.
        """
        ar = self._ars[ar_key]
        if self._modules.replug(ar, key, now):
            self._changed(ar)
        self._take_alarms(now)

    def report_diagnosis(self, now: int) -> bool:
        """Alarms for what has changed in :attr:`diagnosis`, and the ARs' DataStatus; False when nothing has."""
        changes = self.diagnosis.events()
        for change in changes:
            items = tuple(AlarmItem(usi, data) for usi, data in change.emit_items())
            place = change.entry.place
            self.alarm(change.alarm_type, place, now, items=items, specifier=change.alarm_specifier)
            self._events.append(DiagnosisChanged(change))
        if changes:
            self._renew_diffs()
        return bool(changes)

    # Connect

    def _connect(self, payload: bytes, args_maximum: int, caller: Caller, now: int) -> tuple[PnioStatus, bytes]:
        peer_ip = caller.ip
        heads: list[ArBlockReq] = []
        older: list[Ar] = []

        def judge(head: ArBlockReq) -> None:
            heads.append(head)
            older.extend(admit(head, caller, self.ars, self.description.limits))

        def refused(status: PnioStatus, detail: str) -> ConnectRefused:
            known = [(head.station_name.decode("latin-1"), head.initiator_mac) for head in heads]
            return ConnectRefused(peer_ip, status, detail, *(known[0] if known else ("", caller.mac or b"")))

        try:
            request = parse_connect(payload, self.description, judge)
            layouts = check_connect(request, self.description)
            wanted = self.refuse_connect(request.ar) if self.refuse_connect else None
            if wanted is not None:
                raise RefusedError(wanted, "refused on purpose")
            modules = self._modules.following(request.expected, [ar for ar in self.ars if ar not in older])
            # all that can be wrong with it comes before: a faulty Connect ends nothing
            check_plugged(request, modules)
            self._make_way(request, older, now)
            self.plugged.take(modules)
        except RefusedError as exc:
            self._events.append(refused(exc.status, exc.detail))
            return exc.status, b""
        ar = Ar(self._next_key, request.ar, peer_ip, CmdevState.W_CIND, caller.mac)
        fill(ar, request, layouts, self.ars)
        claimed = claim(request.ar, request.expected, self.ars)
        ar.owned, ar.locked = claimed.owned, claimed.locked
        ar.module_diff = self._modules.diff(ar)
        length = self.description.limits.max_alarm_data_length
        answer = connect_response(ar, request, self._mac, self.station_name, length)
        if len(answer) > args_maximum:
            status = pnio_error(ErrorCode.CONNECT, ConnectFault.CMRPC, CmrpcError.ARGS_LENGTH_INVALID)
            detail = f"the response has {len(answer)} octets, the caller accepts {args_maximum}"
            self._events.append(refused(status, detail))
            return status, b""
        settle_claim(claimed, ar, self.ars)
        self._next_key += 1
        self._ars[ar.key] = ar
        self._modules.open(ar.key)
        self.alarms.open(ar, length)
        self._step(ar, CmdevEvent.CONNECT_IND, now)
        self._events.append(
            ArConnected(
                ar_key=ar.key,
                uuid=ar.uuid,
                initiator_name=ar.initiator_name,
                initiator_ip=peer_ip,
                initiator_mac=ar.initiator_mac,
                iocrs=ar.iocrs,
                unusable=unusable_submodules(ar.expected, ar.module_diff),
                advanced_startup=ar.advanced_startup,
                device_access=ar.device_access,
            )
        )
        if ar.device_access:
            self._step(ar, CmdevEvent.CONNECT_RSP_DEVICE_ACCESS, now)
        else:
            self._step(ar, CmdevEvent.CONNECT_RSP, now)
            self._step(ar, CmdevEvent.STARTUP_CNF, now)
        self._touch(ar, now)
        for loser, keys in claimed.taken.items():
            self._modules.taken_over(self._ars[loser], keys, now)
            self._changed(self._ars[loser])
        self._renew_diffs()
        self._take_alarms(now)
        return OK, answer

    def _make_way(self, request: ConnectRequest, older: list[Ar], now: int) -> None:
        """End the initiator's older ARs; the Connect has no fault."""
        for ar in older:
            self.abort(ar.key, RtaError.RE_RUN_ABORTS_EXISTING, now)
        if any(ar.uuid == request.ar.ar_uuid for ar in older):
            raise rerun_refusal()
        if request.iocrs and not self.has_room():
            status = pnio_error(
                ErrorCode.CONNECT, ConnectFault.CMRPC, CmrpcError.OUT_OF_PROVIDER_CONSUMER_ALARM_RESOURCES
            )
            raise RefusedError(status, "the channels of ARs that just ended are not free yet")

    # Control, Release

    def _control(self, payload: bytes, now: int) -> tuple[PnioStatus, bytes]:
        try:
            call = read_control(payload, ErrorCode.CONTROL, self._by_uuid)
            self._command(call, now)
        except RefusedError as exc:
            return exc.status, b""
        return OK, control_response(call.block).emit()

    def _command(self, call: ControlCall, now: int) -> None:
        """Carry out one control command; raises :class:`RefusedError`."""
        ar = call.ar
        begin = self._modules.begin(ar.key)
        match call.block.block_type:
            case BlockType.PRM_END_REQ if ar.state is CmdevState.W_PEIND:
                self._step(ar, CmdevEvent.PRM_END_IND, now)
                self._step(ar, CmdevEvent.PRM_END_RSP, now)
                return
            case BlockType.PRM_END_REQ if begin.step(CmpbeEvent.PRM_END_IND):
                begin.step(CmpbeEvent.PRM_END_RSP)
                self._events.append(PrmEndReceived(ar.key))
                return
            case BlockType.PRM_BEGIN_REQ if call.submodules is not None and ar.state is CmdevState.DATA:
                check_list(call.submodules, ar)
                if begin.step(CmpbeEvent.PRM_BEGIN_IND):
                    begin.step(CmpbeEvent.PRM_BEGIN_RSP)
                    self.alarms.hold(ar.key)
                    return
                if begin.state is CmpbeState.WFREQ:
                    # PrmBegin before the application was ready: the AR ends (CMPBE)
                    self.abort(ar.key, RtaError.PROTOCOL_VIOLATION, now)
            case BlockType.PRM_END_PLUG_REQ if ar.state is CmdevState.DATA:
                sequence = call.block.alarm_sequence_number
                plug = self._modules.plug(ar.key, sequence)
                if plug is None:
                    refuse_call(ErrorCode.CONTROL, ConnectFault.CONTROL_BLOCK_PLUG, ControlField.ALARM_SEQUENCE_NUMBER)
                if plug.step(PlugsmEvent.PRM_END_IND):
                    self._events.append(PrmEndReceived(ar.key, sequence))
                    return
        refuse_call(ErrorCode.CONTROL, ConnectFault.CMRPC, CmrpcError.STATE_CONFLICT)

    def _release(self, payload: bytes, now: int) -> tuple[PnioStatus, bytes]:
        try:
            call = read_control(payload, ErrorCode.RELEASE, self._by_uuid)
        except RefusedError as exc:
            return exc.status, b""
        self._step(call.ar, CmdevEvent.RELEASE_IND, now)
        self._events.append(ArReleased(call.ar.key))
        self._forget(call.ar, now)
        return OK, control_response(call.block).emit()

    # ApplicationReady

    def _call_ready(self, ar: Ar, plug: Plug | None = None) -> None:
        ar.module_diff = self._modules.diff(ar)
        self._ready.call(ar, plug)

    def _plug_ready(self, ar: Ar, sequence: int) -> bool:
        plug = self._modules.plug(ar.key, sequence)
        if plug is None or not plug.step(PlugsmEvent.APPLICATION_READY_REQ):
            return False
        # its parameters are there: from now on the submodule is as ApplicationReady says
        ar.pending.discard(plug.key)
        self._call_ready(ar, plug)
        self._changed(ar)
        return True

    def _ready_confirmed(self, ar: Ar, call: OutgoingCall, now: int) -> None:
        if call.block_type == BlockType.APPLICATION_READY_PLUG_REQ:
            self._modules.plug_confirmed(ar.key, call.sequence)
            self._events.append(ApplicationReadyConfirmed(ar.key, call.sequence))
            return
        self._events.append(ApplicationReadyConfirmed(ar.key))
        if self._modules.begin(ar.key).step(CmpbeEvent.APPLICATION_READY_CNF):
            self._let_alarms_go(ar, now)
            return
        ready = len(ar.data_seen) == len(ar.output_crs)
        self._step(ar, CmdevEvent.APPLICATION_READY_CNF_DATA if ready else CmdevEvent.APPLICATION_READY_CNF, now)

    # modules

    def _renew_diffs(self) -> None:
        for ar in self.ars:
            ar.module_diff = self._modules.diff(ar)

    def _changed(self, ar: Ar) -> None:
        ar.module_diff = self._modules.diff(ar)
        self._events.append(SubmodulesChanged(ar.key, self._modules.unusable(ar)))

    def _moved(self, slot: int, before: Before, now: int, *, whole: bool) -> None:
        """Something was pulled from or plugged into ``slot``: report it to every AR that expects something there.

        What is gone takes its diagnosis with it.
        """
        # a slot that is no longer held gets what its oldest controller expects
        module, idents = expected_idents(e for ar in self.ars for e in ar.expected).get(slot, (0, {}))
        self.plugged.follow(slot, module, idents)
        for key in self._modules.gone(slot, before):
            self.diagnosis.forget(key)
        self.moved()
        for ar in self.ars:
            if self._modules.moved(ar, slot, before, now, whole=whole):
                self._changed(ar)
        self._take_alarms(now)

    # alarms

    def _take_alarms(self, now: int) -> None:
        """Handle the events of the alarm channels."""
        for ar_key, event in self.alarms.events():
            ar = self._ars.get(ar_key)
            if ar is None:
                continue
            if isinstance(event, AlarmEnded):
                self._abort(ar, event.status, now, event.reason, by_peer=event.by_peer)
                continue
            self._modules.alarm_confirmed(ar, event, now)
            self._events.append(event)

    def _let_alarms_go(self, ar: Ar, now: int) -> None:
        self.alarms.release(ar.key, now)
        self._take_alarms(now)

    # the machine

    def _step(self, ar: Ar, event: CmdevEvent, now: int) -> None:
        """The only writer of an AR's state."""
        ar.state, reported = TRANSITIONS[ar.state, event]
        if reported is not None:
            self._events.append(reported(ar.key))
        if ar.state is CmdevState.DATA:
            self._deadlines.pop(ar.key, None)
            self._modules.begin(ar.key).step(CmpbeEvent.DATA)
            self._let_alarms_go(ar, now)

    def _touch(self, ar: Ar | None, now: int) -> None:
        """The initiator was active: restart its timeout.

        In DATA the cyclic data are monitored instead; device access has none, so its AR ends when no call
        arrives within the timeout.
        """
        if ar is None or ar.key not in self._ars:
            return
        if ar.state is not CmdevState.DATA or ar.device_access:
            self._deadlines[ar.key] = now + ar.activity_timeout_ns

    def _abort(self, ar: Ar, status: PnioStatus, now: int, reason: str = "", *, by_peer: bool = False) -> None:
        self._step(ar, CmdevEvent.ABORT, now)
        if not by_peer:
            self.alarms.end(ar.key, status)
        reason = reason or describe_status(status)
        self._events.append(ArAborted(ar.key, status.error_code1, status.error_code2, reason, by_peer))
        self._forget(ar, now)

    def _forget(self, ar: Ar, now: int) -> None:
        self._ars.pop(ar.key, None)
        self._modules.close(ar.key)
        self._deadlines.pop(ar.key, None)
        self.alarms.close(ar.key)
        self._ready.forget(ar.key)
        for heir_key, keys in pass_on(ar, self.ars).items():
            self._modules.inherited(self._ars[heir_key], keys, now)
            self._changed(self._ars[heir_key])
        self._renew_diffs()
        self._take_alarms(now)

    def _by_uuid(self, uuid: UUID) -> Ar | None:
        return next((ar for ar in self._ars.values() if ar.uuid == uuid), None)
