"""One priority of one AR's alarms: APMS, APMR, ALPMI and ALPMR (IEC 61158-6-10) with their sequence numbers.

An alarm takes four frames::

    initiator                       responder
    DATA AlarmNotification   -->
                             <--    ACK
                             <--    DATA AlarmAck
    ACK                      -->

Every DATA-RTA-PDU carries the number of the last one received, which acknowledges it as well as an ACK would; so the
following DATA replaces a lost ACK.  One DATA-RTA-PDU per direction is under way at a time; of several that
wait, an AlarmAck goes first.  The state tables are in :mod:`states`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.alarms.events import AlarmAcknowledged, AlarmEvent, AlarmReceived
from pnfarm.protocols.profinet.alarms.states import (
    ALPMI,
    ALPMR,
    APMR,
    APMS,
    AlpmiState,
    AlpmrState,
    ApmrState,
    ApmsState,
    Sign,
)
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.protocols.profinet.wire.alarms.notification import (
    SEQUENCE_MASK,
    AlarmAck,
    AlarmNotification,
    acknowledge,
    parse_alarm,
)
from pnfarm.protocols.profinet.wire.alarms.rta import (
    FIRST_ACK,
    FIRST_SEND,
    RTA_VERSION,
    TACK,
    WINDOW_SIZE,
    RtaPdu,
    RtaType,
    next_sequence,
)
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH, ALARM_LOW

if TYPE_CHECKING:
    from collections import Counter

    from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

__all__ = ["AlarmLine", "LineOwner", "LineSettings", "Queued"]


@dataclass(frozen=True, slots=True)
class LineSettings:
    """The agreed parameters of the AlarmCR; see :class:`~pnfarm.protocols.profinet.alarms.channel.AlarmChannel`."""

    local_reference: int
    remote_reference: int
    timeout_ns: int
    retries: int
    max_alarm_data_length: int


@dataclass(frozen=True, slots=True)
class Queued:
    """An alarm with its owner's handle."""

    handle: int
    alarm: AlarmNotification


@dataclass(slots=True)
class _UnderWay:
    """The PDU that APMS has sent and that awaits its acknowledgement; ``machine`` gets the confirmation."""

    pdu: RtaPdu
    machine: str
    retries_left: int


class LineOwner(Protocol):
    """The channel, as a line calls it."""

    dropped: Counter[str]

    def put(self, pdu: RtaPdu) -> None: ...

    def report(self, event: AlarmEvent) -> None: ...

    def fail(self, code: RtaError, reason: str) -> None: ...


class AlarmLine:
    """``high`` names the priority; the machines start active."""

    def __init__(self, settings: LineSettings, owner: LineOwner, *, high: bool) -> None:
        self.high = high
        self.frame_id = ALARM_HIGH if high else ALARM_LOW
        self.apms = ApmsState.CLOSED
        self.apmr = ApmrState.CLOSED
        self.alpmi = AlpmiState.W_START
        self.alpmr = AlpmrState.W_START
        self.queue: list[Queued] = []
        #: When APMS repeats.
        self.deadline: int | None = None
        # SendSeqCount and ExpSeqCount with their predecessors, as APMS and APMR keep them
        self.send_sequence = FIRST_SEND
        self.last_sent = FIRST_ACK
        self.expected_sequence = FIRST_SEND
        self.last_received = FIRST_ACK
        #: SendSeqNum of the peer's first ACK.
        self.first_ack_send: int | None = None
        self._settings = settings
        self._owner = owner
        self._alarm_sequence = 0
        self._outstanding: Queued | None = None
        self._taken: AlarmNotification | None = None
        self._ack: AlarmAck | None = None
        self._under_way: _UnderWay | None = None
        for machine in ("apms", "apmr", "alpmi", "alpmr"):
            self._step(machine, Sign.ACTIVATE, None, 0)

    @property
    def outstanding(self) -> Queued | None:
        """The alarm whose AlarmAck is awaited."""
        return self._outstanding if self.alpmi is AlpmiState.W_ACK else None

    @property
    def notification_under_way(self) -> bool:
        """The outstanding alarm has not been acknowledged by the peer's APMR."""
        return self.outstanding is not None and self._under_way is not None and self._under_way.machine == "alpmi"

    # Calls of the owner

    def notify(self, queued: Queued, now: int) -> None:
        self.queue.append(queued)
        self._go_on(now)

    def acknowledge(self, alarm: AlarmNotification, status: PnioStatus, now: int) -> bool:
        """Send the AlarmAck.  False when this alarm does not wait for it."""
        if self.alpmr is not AlpmrState.W_USER_ACK or alarm != self._taken:
            return False
        self._step("alpmr", Sign.ACK_REQ, acknowledge(alarm, status), now)
        self._go_on(now)
        return True

    def withdraw(self, now: int) -> list[Queued]:
        """Take back every alarm that the peer has not received, in order."""
        found = list(self.queue)
        self.queue.clear()
        if self.notification_under_way and self._outstanding is not None:
            found.insert(0, self._outstanding)
            self._step("apms", Sign.WITHDRAW, None, now)
            self._step("alpmi", Sign.WITHDRAW, None, now)
        return found

    def close(self) -> None:
        self.queue.clear()
        for machine in ("apms", "apmr", "alpmi", "alpmr"):
            self._step(machine, Sign.CLOSE, None, 0)

    def handle_timeout(self, now: int) -> None:
        if self._under_way is not None and self.deadline is not None and now >= self.deadline:
            self._step("apms", Sign.TIMER if self._under_way.retries_left else Sign.RETRIES_SPENT, None, now)
            self._go_on(now)

    # What comes in

    def receive(self, pdu: RtaPdu, now: int) -> None:
        """A DATA, ACK or NACK of this priority, its references and version checked."""
        if pdu.type == RtaType.DATA:
            self._receive_data(pdu, now)
        elif pdu.body:
            self._drop("length")
        elif pdu.type == RtaType.ACK:
            if self.first_ack_send is None:
                self.first_ack_send = pdu.send_sequence
            self._acknowledged(pdu, now)
        else:
            # the timer repeats what was not accepted
            self._drop("nack")
        self._go_on(now)

    def _receive_data(self, pdu: RtaPdu, now: int) -> None:
        if not pdu.tack:
            self._drop("no-tack")
            return
        if pdu.send_sequence == self.last_received:
            self._acknowledged(pdu, now)
            self._step("apmr", Sign.DUPLICATE_IND, None, now)
            return
        if pdu.send_sequence != self.expected_sequence:
            self._step("apmr", Sign.SEQUENCE_IND, None, now)
            return
        if len(pdu.body) > self._settings.max_alarm_data_length:
            self._owner.fail(RtaError.ALARM_DATA_TOO_LONG, f"the peer's alarm data have {len(pdu.body)} octets")
            return
        try:
            alarm = parse_alarm(pdu.body)
        except DecodeError as exc:
            self._owner.fail(RtaError.ALARM_IND_ERROR, f"faulty alarm PDU: {exc}")
            return
        if alarm.high != self.high:
            self._owner.fail(RtaError.ALARM_IND_ERROR, "an alarm PDU of the other priority")
            return
        self._acknowledged(pdu, now)
        self._step("apmr", Sign.DATA_IND, None, now)
        self._step("apmr", Sign.DATA_CNF, alarm, now)

    def _acknowledged(self, pdu: RtaPdu, now: int) -> None:
        if pdu.ack_sequence == self.send_sequence and self.apms is ApmsState.WTACK:
            self._step("apms", Sign.TACK, None, now)
        elif pdu.type == RtaType.ACK:
            self._drop("late-ack")

    # The machines

    def _step(self, machine: str, sign: Sign, detail: Any, now: int) -> None:
        """The only writer of the four states."""
        row = _TABLES[machine].get((getattr(self, machine), sign))
        if row is None:
            self._drop(f"out-of-turn-{machine}-{sign.name.lower().replace('_', '-')}")
            return
        state, action = row
        setattr(self, machine, state)
        if action:
            getattr(self, f"_{action}")(detail, now)

    def _go_on(self, now: int) -> None:
        """Send the next PDU in the queue, once APMS is free."""
        if self.apms is not ApmsState.OPEN:
            return
        if self._ack is not None:
            ack, self._ack = self._ack, None
            self._step("apms", Sign.DATA_REQ, ("alpmr", ack.emit()), now)
        elif self.queue and self.alpmi is AlpmiState.W_ALARM:
            self._step("alpmi", Sign.ALARM_REQ, self.queue.pop(0), now)

    def _drop(self, reason: str) -> None:
        self._owner.dropped[reason] += 1

    def _pdu(self, kind: RtaType, send_sequence: int, body: bytes = b"") -> RtaPdu:
        return RtaPdu(
            self.frame_id,
            self._settings.remote_reference,
            self._settings.local_reference,
            RTA_VERSION << 4 | kind,
            WINDOW_SIZE | (TACK if kind is RtaType.DATA else 0),
            send_sequence,
            self.last_received,
            body,
        )

    # APMS

    def _send_data(self, wanted: tuple[str, bytes], now: int) -> None:
        machine, body = wanted
        pdu = self._pdu(RtaType.DATA, self.send_sequence, body)
        self._under_way = _UnderWay(pdu, machine, self._settings.retries)
        self.deadline = now + self._settings.timeout_ns
        self._owner.put(pdu)

    def _repeat_data(self, _detail: None, now: int) -> None:
        assert self._under_way is not None
        self._under_way.retries_left -= 1
        self.deadline = now + self._settings.timeout_ns
        self._owner.put(self._under_way.pdu)

    def _stop_timer(self, _detail: None, _now: int) -> None:
        self.deadline = None
        self._under_way = None

    def _confirm_sent(self, _detail: None, now: int) -> None:
        self.last_sent = self.send_sequence
        self.send_sequence = next_sequence(self.send_sequence)
        self._confirm(Sign.SENT, now)

    def _confirm_not_sent(self, _detail: None, now: int) -> None:
        self._confirm(Sign.NOT_SENT, now)

    def _confirm(self, sign: Sign, now: int) -> None:
        assert self._under_way is not None
        machine = self._under_way.machine
        self._stop_timer(None, now)
        self._step(machine, sign, None, now)

    # APMR

    def _accept_data(self, _detail: None, now: int) -> None:
        self.last_received = self.expected_sequence
        self.expected_sequence = next_sequence(self.expected_sequence)
        self._send_ack(None, now)

    def _send_ack(self, _detail: None, _now: int) -> None:
        self._owner.put(self._pdu(RtaType.ACK, self.last_sent))

    def _send_nack(self, _detail: None, _now: int) -> None:
        self._drop("sequence")
        self._owner.put(self._pdu(RtaType.NACK, self.last_sent))

    def _deliver_data(self, alarm: AlarmNotification | AlarmAck, now: int) -> None:
        if isinstance(alarm, AlarmAck):
            self._step("alpmi", Sign.ALARM_ACK_IND, alarm, now)
        else:
            self._step("alpmr", Sign.NOTIFICATION_IND, alarm, now)

    # ALPMI

    def _send_notification(self, queued: Queued, now: int) -> None:
        alarm = queued.alarm
        specifier = alarm.specifier & ~SEQUENCE_MASK | self._alarm_sequence
        self._alarm_sequence = (self._alarm_sequence + 1) & SEQUENCE_MASK
        alarm = replace(alarm, specifier=specifier, high=self.high)
        self._outstanding = Queued(queued.handle, alarm)
        self._step("apms", Sign.DATA_REQ, ("alpmi", alarm.emit()), now)

    def _confirm_alarm(self, ack: AlarmAck, _now: int) -> None:
        assert self._outstanding is not None
        handle, alarm = self._outstanding.handle, self._outstanding.alarm
        self._outstanding = None
        if ack.answers(alarm):
            self._owner.report(AlarmAcknowledged(handle, alarm, ack.status))
        else:
            self._owner.fail(RtaError.ALARM_IND_ERROR, "an AlarmAck that answers another alarm")

    def _fail_notification(self, _detail: None, _now: int) -> None:
        self._owner.fail(RtaError.ALARM_SEND_FAILED, f"an alarm was sent {self._tries} times without a transport ACK")

    # ALPMR

    def _indicate_alarm(self, alarm: AlarmNotification, _now: int) -> None:
        self._taken = alarm
        self._owner.report(AlarmReceived(alarm))

    def _keep_ack(self, ack: AlarmAck, _now: int) -> None:
        self._taken = None
        self._ack = ack

    def _fail_protocol(self, _alarm: AlarmNotification, _now: int) -> None:
        self._owner.fail(RtaError.PROTOCOL_VIOLATION, "an alarm before the AlarmAck of the one before was confirmed")

    def _fail_ack(self, _detail: None, _now: int) -> None:
        self._owner.fail(
            RtaError.ALARM_ACK_SEND_FAILED, f"an AlarmAck was sent {self._tries} times without a transport ACK"
        )

    @property
    def _tries(self) -> int:
        return self._settings.retries + 1


_TABLES: dict[str, dict[tuple[Any, Sign], tuple[Any, str]]] = {
    "apms": dict(APMS),
    "apmr": dict(APMR),
    "alpmi": dict(ALPMI),
    "alpmr": dict(ALPMR),
}
