"""The alarms of a device: one alarm channel for each AR, and the queue before it.

An AR gets alarms only while it is in DATA and no parameters are being written (CMPBE); other alarms wait
here.  Alarms of low priority report diagnosis and submodules, those of high priority the process.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.deadlines import earliest
from pnfarm.protocols.profinet.alarms.channel import (
    AlarmAcknowledged,
    AlarmChannel,
    AlarmFailed,
    AlarmReceived,
    AlarmRefusedError,
    PeerAborted,
)
from pnfarm.protocols.profinet.cm.device.events import AlarmConfirmed
from pnfarm.protocols.profinet.errors import AlarmAckError, ConnectFault, ErrorCode, pnio_error, rta_status
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmNotification, AlarmType
from pnfarm.protocols.profinet.wire.alarms.rta import parse_rta

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.protocols.profinet.cm.ar import Ar, ExpectedKey
    from pnfarm.protocols.profinet.description import Plugged
    from pnfarm.protocols.profinet.errors import PnioStatus
    from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem
    from pnfarm.wire.ethernet import VlanTag

__all__ = ["AlarmEnded", "AlarmFrame", "DeviceAlarms"]

#: The AlarmAck to a controller's own alarm.
ALARM_NOT_SUPPORTED = pnio_error(ErrorCode.ALARM_ACK, ConnectFault.ALARM_ACK, AlarmAckError.ALARM_TYPE_NOT_SUPPORTED)
#: Alarms that wait for an AR that gets none yet.
WAITING_MAX = 64


@dataclass(frozen=True, slots=True)
class AlarmFrame:
    """``payload`` follows EtherType 0x8892."""

    destination: bytes
    tag: VlanTag
    payload: bytes


@dataclass(frozen=True, slots=True)
class AlarmEnded:
    """A channel failed, or the controller ended it; the AR ends."""

    status: PnioStatus
    reason: str
    by_peer: bool


@dataclass(slots=True)
class _Line:
    """One AR's channel; ``waiting`` are alarms that it must not get yet, or that its queue had no room for."""

    channel: AlarmChannel
    peer: bytes
    waiting: list[tuple[int, AlarmNotification]] = field(default_factory=list)
    hears: bool = False
    #: The channel's handles of alarms, by the device's own numbers.
    numbers: dict[int, int] = field(default_factory=dict)


class DeviceAlarms:
    """The channels of one device, by the key of their AR.  An alarm's number, given by :meth:`send`, is unique here."""

    def __init__(self, plugged: Plugged) -> None:
        self._plugged = plugged
        self._dropped: Counter[str] = Counter()
        self._lines: dict[int, _Line] = {}
        self._last: list[AlarmFrame] = []
        self._events: list[tuple[int, AlarmConfirmed | AlarmEnded]] = []
        self._number = 0

    @property
    def dropped(self) -> Counter[str]:
        """Discarded PDUs and alarms, by reason, over all past and present channels."""
        total = Counter(self._dropped)
        for line in self._lines.values():
            total.update(_reasons(line))
        return total

    @property
    def last_number(self) -> int:
        """That of the latest alarm; 0 before the first."""
        return self._number

    # the ARs

    def open(self, ar: Ar, max_alarm_data_length: int) -> None:
        """An AR was connected; without an AlarmCR there is nothing to open."""
        if ar.alarm_cr is not None:
            references = ar.local_alarm_reference, ar.remote_alarm_reference
            channel = AlarmChannel(*references, ar.alarm_cr, max_alarm_data_length)
            self._lines[ar.key] = _Line(channel, ar.initiator_mac)

    def hold(self, ar_key: int) -> None:
        """Hold alarms back from now on, also those that the channel has not sent yet."""
        line = self._lines.get(ar_key)
        if line is not None:
            line.hears = False
            unsent = [(line.numbers.pop(handle), alarm) for handle, alarm in line.channel.take_back()]
            line.waiting = [*unsent, *line.waiting]

    def release(self, ar_key: int, now: int) -> None:
        """Send alarms from now on, first those that wait."""
        line = self._lines.get(ar_key)
        if line is None:
            return
        line.hears = True
        self._drain(line, now)

    def _drain(self, line: _Line, now: int) -> None:
        """Send waiting alarms in order; those for which the channel's queue has no room keep waiting."""
        still: list[tuple[int, AlarmNotification]] = []
        full: set[bool] = set()
        for number, alarm in line.waiting:
            if alarm.high not in full and line.channel.is_full(high=alarm.high):
                full.add(alarm.high)
            if alarm.high in full:
                still.append((number, alarm))
            else:
                self._notify(line, number, alarm, now)
        line.waiting = still

    def end(self, ar_key: int, status: PnioStatus) -> None:
        """End the AR with an ERR-RTA."""
        line = self._lines.get(ar_key)
        if line is not None:
            line.channel.abort(status.error_code2)
            self._collect(line)

    def close(self, ar_key: int) -> None:
        line = self._lines.pop(ar_key, None)
        if line is not None:
            self._dropped.update(_reasons(line))

    # alarms

    def send(
        self,
        ar_key: int,
        alarm_type: int,
        key: ExpectedKey,
        now: int,
        *,
        items: tuple[AlarmItem, ...] = (),
        specifier: int = 0,
        high: bool = False,
    ) -> int | None:
        """Send an alarm about a submodule, or about a module (subslot 0); its number.

        None when the AR has no alarm channel, or accepts no more: that is counted.
        """
        line = self._lines.get(ar_key)
        if line is None:
            return None
        api, slot, subslot = key
        module, sub = self._plugged.module(slot), self._plugged.get((slot, subslot))
        gone = alarm_type in {AlarmType.PULL, AlarmType.PULL_MODULE}
        alarm = AlarmNotification(
            alarm_type,
            api,
            slot,
            subslot,
            module_ident=module.module_ident if module is not None and not gone else 0,
            submodule_ident=sub.submodule_ident if sub is not None and not gone else 0,
            specifier=specifier,
            items=items,
            high=high,
        )
        self._number += 1
        if line.hears and not any(earlier.high == high for _, earlier in line.waiting):
            return self._notify(line, self._number, alarm, now)
        if len(line.waiting) >= WAITING_MAX:
            self._dropped["alarm-queue-full"] += 1
            return None
        line.waiting.append((self._number, alarm))
        return self._number

    def _notify(self, line: _Line, number: int, alarm: AlarmNotification, now: int) -> int | None:
        try:
            line.numbers[line.channel.notify(alarm, now)] = number
        except AlarmRefusedError as exc:
            self._dropped[f"alarm-{exc.reason}"] += 1
            return None
        return number

    def number_of(self, ar_key: int, sequence: int) -> int | None:
        """The alarm of low priority with this sequence number whose AlarmAck is still awaited."""
        line = self._lines.get(ar_key)
        found = line.channel.outstanding if line is not None else None
        if line is None or found is None or found.alarm.sequence_number != sequence:
            return None
        return line.numbers.get(found.handle)

    # frames and time

    def receive(self, payload: bytes, source_mac: bytes, ars: Mapping[int, Ar], now: int) -> None:
        """An alarm frame's octets, from the frame id on."""
        try:
            pdu = parse_rta(payload)
        except DecodeError as exc:
            self._dropped[f"rta-{exc.reason}"] += 1
            return
        for key, line in self._lines.items():
            ar = ars[key]
            references = (ar.local_alarm_reference, ar.remote_alarm_reference)
            if line.peer == source_mac and references == (pdu.destination, pdu.source):
                line.channel.receive(pdu, now)
                self._take(key, line, now)
                return
        self._dropped["rta-unknown-reference"] += 1

    def to_send(self) -> list[AlarmFrame]:
        frames, self._last = self._last, []
        for line in self._lines.values():
            frames += [AlarmFrame(line.peer, tag, octets) for tag, octets in line.channel.to_send()]
        return frames

    def events(self) -> list[tuple[int, AlarmConfirmed | AlarmEnded]]:
        """(key of the AR, event)."""
        drained, self._events = self._events, []
        return drained

    def next_deadline(self) -> int | None:
        return earliest(*(line.channel for line in self._lines.values())) if self._lines else None

    def handle_timeout(self, now: int) -> None:
        for key, line in list(self._lines.items()):
            line.channel.handle_timeout(now)
            self._take(key, line, now)

    def _collect(self, line: _Line) -> None:
        """Frames of a channel that is about to go."""
        self._last += [AlarmFrame(line.peer, tag, octets) for tag, octets in line.channel.to_send()]

    def _take(self, key: int, line: _Line, now: int) -> None:
        for event in line.channel.events():
            match event:
                case AlarmAcknowledged(handle, alarm, status):
                    number = line.numbers.pop(handle, 0)
                    self._events.append((key, _confirmed(key, number, alarm, status)))
                    if line.hears and line.waiting:
                        self._drain(line, now)
                case AlarmReceived(alarm):
                    # a controller's alarm: a drive accepts none
                    line.channel.acknowledge(alarm, now, ALARM_NOT_SUPPORTED)
                case AlarmFailed(code, reason):
                    self._events.append((key, AlarmEnded(rta_status(code), reason, by_peer=False)))
                case PeerAborted(status):
                    self._events.append((key, AlarmEnded(status, "", by_peer=True)))


def _reasons(line: _Line) -> dict[str, int]:
    return {f"alarm-{reason}": count for reason, count in line.channel.dropped.items()}


def _confirmed(key: int, number: int, alarm: AlarmNotification, status: PnioStatus) -> AlarmConfirmed:
    return AlarmConfirmed(
        key,
        alarm.alarm_type,
        alarm.api,
        alarm.slot,
        alarm.subslot,
        number=number,
        sequence=alarm.sequence_number,
        high=alarm.high,
        status=status,
    )
