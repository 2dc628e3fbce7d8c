"""The alarm channel of one AR: both priorities, seen from either end (IEC 61158-6-10, ALPMI, ALPMR, APMS, APMR).

The owner opens an :class:`AlarmChannel` after a successful Connect, passes it every RTA-PDU with the AR's references,
and takes frames and events from it. The machines of each priority are in :mod:`priority`, their states in
:mod:`states`. Alarms of one priority are sent one after the other, each after the AlarmAck of the one before;
the time for an AlarmAck is not limited. The transport acknowledgement is limited: RTARetries repetitions,
RTATimeoutFactor apart; then the channel fails and its AR has to end.

Peers with one sequence.  Each priority has its own sequence numbers.  A controller in the field (profinet-py) uses
one sequence for both, so that it takes the first alarm of the second priority for a repetition, or for out of order.
Its answer differs from any answer of a peer with two sequences:

* a NACK with the last number of the other priority, although the peer has received nothing in this one;
* an ACK whose SendSeqNum says that the peer has sent its first DATA-RTA-PDU, though none arrived in this priority,
  while its first ACK in the other priority did not say so.

From this alarm on the channel sends every alarm in the priority used first.  The sender of an alarm chooses its
priority, so this conforms to the standard.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.alarms.events import (
    AlarmAcknowledged,
    AlarmEvent,
    AlarmFailed,
    AlarmReceived,
    AlarmRefusedError,
    PeerAborted,
)
from pnfarm.protocols.profinet.alarms.priority import AlarmLine, LineSettings, Queued
from pnfarm.protocols.profinet.errors import OK, RtaError
from pnfarm.protocols.profinet.wire.alarms.rta import (
    FIRST_ACK,
    FIRST_SEND,
    RTA_VERSION,
    RtaPdu,
    RtaType,
    error_status,
    rta_error,
)
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH, ALARM_LOW
from pnfarm.wire.ethernet import VlanTag

if TYPE_CHECKING:
    from pnfarm.protocols.profinet.wire.alarms.notification import AlarmNotification
    from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq
    from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

__all__ = [
    "AlarmAcknowledged",
    "AlarmChannel",
    "AlarmEvent",
    "AlarmFailed",
    "AlarmReceived",
    "AlarmRefusedError",
    "PeerAborted",
]

#: RTATimeoutFactor counts this.
RTA_TIMEOUT_UNIT_NS = 100_000_000
#: AlarmCRProperties, bit 0: every alarm has low priority.
PRIORITY_FORCED_LOW = 0x01
#: Alarms of one priority that wait for those before them.
QUEUE_LENGTH = 32


class AlarmChannel:
    """See the module's docstring.

    ``local_reference`` is this end's alarm reference, ``remote_reference`` the peer's; ``cr`` is what the controller
    wanted in Connect, ``device_length`` the device's MaxAlarmDataLength.  ``dropped`` counts PDUs that changed nothing,
    by reason.
    """

    def __init__(
        self,
        local_reference: int,
        remote_reference: int,
        cr: AlarmCrBlockReq,
        device_length: int,
        *,
        queue_length: int = QUEUE_LENGTH,
    ) -> None:
        self.dropped: Counter[str] = Counter()
        timeout_ns = cr.rta_timeout_factor * RTA_TIMEOUT_UNIT_NS
        length = min(device_length, cr.max_alarm_data_length)
        self._settings = LineSettings(local_reference, remote_reference, timeout_ns, cr.rta_retries, length)
        self._queue_length = queue_length
        self._tags = {ALARM_HIGH: _tag(cr.tag_header_high), ALARM_LOW: _tag(cr.tag_header_low)}
        self._open = True
        self._handle = 0
        self._events: list[AlarmEvent] = []
        self._frames: list[RtaPdu] = []
        self._withheld: frozenset[int] = frozenset()
        self._high = AlarmLine(self._settings, self, high=True)
        self._low = AlarmLine(self._settings, self, high=False)
        self._only: AlarmLine | None = self._low if cr.properties & PRIORITY_FORCED_LOW else None

    @property
    def is_open(self) -> bool:
        """It has not failed, been aborted or closed."""
        return self._open

    @property
    def outstanding(self) -> Queued | None:
        """Handle and alarm of low priority, as it was sent, whose AlarmAck is awaited."""
        return self._line(high=False).outstanding

    def is_full(self, *, high: bool) -> bool:
        """Whether :meth:`notify` accepts no more alarms of this priority."""
        return len(self._line(high=high).queue) >= self._queue_length

    # Calls of the owner

    def notify(self, alarm: AlarmNotification, now: int) -> int:
        """Send an alarm, of the priority that its ``high`` says; ends in ``AlarmAcknowledged(handle, ...)``.

        The sequence number in its specifier is set when it is sent.  Returns the handle; raises AlarmRefusedError.
        """
        if not self._open:
            raise AlarmRefusedError("closed", "the alarm channel is closed")
        line = self._line(high=alarm.high)
        if self.is_full(high=alarm.high):
            raise AlarmRefusedError("queue-full", f"{len(line.queue)} alarms wait already, no more are accepted")
        octets, allowed = len(alarm.emit()), self._settings.max_alarm_data_length
        if octets > allowed:
            raise AlarmRefusedError("too-long", f"the alarm has {octets} octets, at most {allowed} were agreed on")
        self._handle += 1
        line.notify(Queued(self._handle, alarm), now)
        return self._handle

    def take_back(self) -> list[tuple[int, AlarmNotification]]:
        """Handle and alarm of each that waits for those before it, in their order; they are not sent any more."""
        lines = (self._high, self._low)
        waiting = sorted((queued for line in lines for queued in line.queue), key=lambda queued: queued.handle)
        for line in lines:
            line.queue.clear()
        return [(queued.handle, queued.alarm) for queued in waiting]

    def acknowledge(self, alarm: AlarmNotification, now: int, status: PnioStatus = OK) -> bool:
        """Send the AlarmAck of a received alarm.  False when it does not wait for one."""
        return (self._high if alarm.high else self._low).acknowledge(alarm, status, now)

    def abort(self, code: int) -> None:
        """Send an ERR-RTA-PDU (CF 81 FD ``code``, of low priority) and close; also after a failure."""
        settings, low = self._settings, self._low
        remote, local = settings.remote_reference, settings.local_reference
        pdu = rta_error(remote, local, code, low.send_sequence, low.last_received)
        self.close()
        self._frames.append(pdu)

    def close(self) -> None:
        """Forget every alarm and frame; the channel is closed."""
        self._frames.clear()
        self._shut()

    def withhold(self, *types: RtaType) -> None:
        """From now on RTA-PDUs of these types are not sent but counted in ``dropped``; none of them: all are sent.

        Without ACK the peer's alarms and AlarmAcks get no transport acknowledgement.
        """
        self._withheld = frozenset(int(kind) for kind in types)

    # What goes out

    def to_send(self, now: int = 0) -> list[tuple[VlanTag, bytes]]:
        """Frames: their VLAN tag, and the octets after the EtherType."""
        del now
        frames, self._frames = self._frames, []
        out = []
        for pdu in frames:
            if pdu.type in self._withheld:
                self.dropped["withheld"] += 1
            else:
                out.append((self._tags[pdu.frame_id], pdu.emit()))
        return out

    def events(self) -> list[AlarmEvent]:
        """What happened since the last call, in order."""
        out, self._events = self._events, []
        return out

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due; None while no acknowledgement is awaited."""
        high, low = self._high.deadline, self._low.deadline
        if high is None or low is None:
            return low if high is None else high
        return min(high, low)

    def handle_timeout(self, now: int) -> None:
        for line in (self._high, self._low):
            line.handle_timeout(now)

    # What comes in

    def receive(self, pdu: RtaPdu, now: int) -> None:
        """A PDU that :func:`~pnfarm.protocols.profinet.wire.alarms.rta.parse_rta` read, from this AR's peer."""
        if not self._open:
            self.dropped["closed"] += 1
        elif (pdu.destination, pdu.source) != (self._settings.local_reference, self._settings.remote_reference):
            self.dropped["reference"] += 1
        elif pdu.version != RTA_VERSION:
            self.dropped["version"] += 1
        elif pdu.type == RtaType.ERR:
            self._receive_error(pdu)
        elif pdu.type in {RtaType.DATA, RtaType.ACK, RtaType.NACK}:
            line, other = (self._high, self._low) if pdu.frame_id == ALARM_HIGH else (self._low, self._high)
            if self._only is None and _counts_once(line, other, pdu):
                self._use_only(other, line, now)
            else:
                line.receive(pdu, now)
        else:
            self.dropped["type"] += 1

    def _receive_error(self, pdu: RtaPdu) -> None:
        try:
            status = error_status(pdu)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            return
        self.close()
        self._events.append(PeerAborted(status))

    # Calls of the lines

    def put(self, pdu: RtaPdu) -> None:
        """A line has a frame to send."""
        self._frames.append(pdu)

    def report(self, event: AlarmEvent) -> None:
        """A line reports an event."""
        self._events.append(event)

    def fail(self, code: RtaError, reason: str) -> None:
        """A line failed, and with it the channel."""
        self._events.append(AlarmFailed(code, reason))
        self._shut()

    def _shut(self) -> None:
        if self._open:
            self._open = False
            self._high.close()
            self._low.close()

    # Choice of the priority

    def _line(self, *, high: bool) -> AlarmLine:
        if self._only is not None:
            return self._only
        return self._high if high else self._low

    def _use_only(self, line: AlarmLine, other: AlarmLine, now: int) -> None:
        """The peer has one sequence: all alarms use the priority that matches it; these follow those waiting there."""
        self._only = line
        self.dropped["peer-counts-once"] += 1
        for queued in other.withdraw(now):
            line.notify(queued, now)


def _tag(header: int) -> VlanTag:
    return VlanTag(header >> 13, bool(header & 0x1000), header & 0x0FFF)


def _counts_once(line: AlarmLine, other: AlarmLine, pdu: RtaPdu) -> bool:
    """The peer answers the first alarm of ``line`` with the numbers of ``other``; see the module's docstring."""
    first = line.send_sequence == FIRST_SEND and line.last_received == FIRST_ACK and line.notification_under_way
    if not first or other.last_sent == FIRST_ACK or pdu.body:
        return False
    if pdu.type == RtaType.NACK:
        return pdu.ack_sequence == other.last_sent
    return (
        pdu.type == RtaType.ACK
        and other.last_sent == other.last_received == FIRST_SEND
        and other.first_ack_send == FIRST_ACK
        and pdu.send_sequence == pdu.ack_sequence == FIRST_SEND
    )
