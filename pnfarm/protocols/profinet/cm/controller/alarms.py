"""The controller's side of an AR's alarms, for :class:`~pnfarm.protocols.profinet.cm.controller.cmctl.CmController`.

The alarm channel opens with the confirmation of Connect and closes with the AR; a device may send alarms at any time
between, before ApplicationReady as well (ALPMR is activated with the AR, IEC 61158-6-10).  Each alarm becomes an event
with a text, and is acknowledged at once: before, the device sends no other alarm of that priority.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.alarms.channel import (
    AlarmAcknowledged,
    AlarmChannel,
    AlarmFailed,
    AlarmReceived,
    PeerAborted,
)
from pnfarm.protocols.profinet.cm.controller.events import AlarmIndicated
from pnfarm.protocols.profinet.wire.alarms.rta import parse_rta
from pnfarm.protocols.profinet.wire.alarms.texts import alarm_in_words

if TYPE_CHECKING:
    from collections import Counter

    from pnfarm.protocols.profinet.cm.controller.plan import ArPlan
    from pnfarm.protocols.profinet.cm.controller.response import ConnectAnswer
    from pnfarm.wire.ethernet import VlanTag

__all__ = ["ControllerAlarms"]


class ControllerAlarms:
    """``dropped`` is the owner's; reasons begin with ``rta-``."""

    def __init__(self, plan: ArPlan, dropped: Counter[str]) -> None:
        self._plan = plan
        self._dropped = dropped
        self._channel: AlarmChannel | None = None
        self._device_mac = b""

    @property
    def channel(self) -> AlarmChannel | None:
        """None before the device accepted the Connect."""
        return self._channel

    def open(self, accepted: ConnectAnswer) -> None:
        """The device accepted the Connect: alarms may come."""
        cr = self._plan.alarm_cr
        self._device_mac = accepted.device_mac
        self._channel = AlarmChannel(
            cr.local_alarm_reference, accepted.alarm_reference, cr, accepted.max_alarm_data_length
        )

    def receive(self, payload: bytes, source_mac: bytes, now: int) -> None:
        """An RTA frame, octets after the EtherType."""
        if self._channel is None or source_mac != self._device_mac:
            self._dropped["rta-of-another-station"] += 1
            return
        try:
            pdu = parse_rta(payload)
        except DecodeError as exc:
            self._dropped[f"rta-{exc.reason}"] += 1
            return
        if pdu.destination != self._plan.alarm_cr.local_alarm_reference:
            self._dropped["rta-of-another-ar"] += 1
            return
        self._channel.receive(pdu, now)

    def take(self, now: int) -> list[AlarmIndicated | AlarmFailed | PeerAborted]:
        """What happened since the last call; alarms are acknowledged here."""
        if self._channel is None:
            return []
        out: list[AlarmIndicated | AlarmFailed | PeerAborted] = []
        for event in self._channel.events():
            match event:
                case AlarmReceived(alarm):
                    out.append(AlarmIndicated(alarm, alarm_in_words(alarm, self._plan.texts)))
                    self._channel.acknowledge(alarm, now)
                case AlarmFailed() | PeerAborted():
                    out.append(event)
                case AlarmAcknowledged():
                    pass  # a controller raises no alarms
        for reason, count in self._channel.dropped.items():
            self._dropped[f"rta-{reason}"] += count
        self._channel.dropped.clear()
        return out

    def abort(self, code: int) -> None:
        """Tell the device, if it accepted the AR, that the AR has ended."""
        if self._channel is not None:
            self._channel.abort(code)

    def close(self) -> None:
        if self._channel is not None:
            self._channel.close()

    def to_send(self) -> list[tuple[bytes, bytes, VlanTag]]:
        """Frames: destination MAC, octets after the EtherType, tag."""
        if self._channel is None:
            return []
        return [(self._device_mac, octets, tag) for tag, octets in self._channel.to_send()]

    @property
    def deadline(self) -> int | None:
        return None if self._channel is None else self._channel.next_deadline()

    def handle_timeout(self, now: int) -> None:
        if self._channel is not None:
            self._channel.handle_timeout(now)
