"""Two ends of an alarm channel, joined in memory in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from pnfarm.protocols.profinet.alarms.channel import (
    QUEUE_LENGTH,
    AlarmAcknowledged,
    AlarmChannel,
    AlarmEvent,
    AlarmFailed,
    AlarmReceived,
)
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmItem, AlarmNotification
from pnfarm.protocols.profinet.wire.alarms.rta import RtaPdu, parse_rta
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq

DEVICE, CONTROLLER = 0x0014, 0x0001
STEP = 100_000_000


def alarm(number: int = 0, *, high: bool = False, size: int = 2) -> AlarmNotification:
    """An alarm with a subslot of its own, by which a test finds it."""
    return AlarmNotification(1, 0x3A00, 1, number, 0x100, 0x68, 0, (AlarmItem(0x0010, bytes(size)),), high)


def channel(local: int, remote: int, *, queue_length: int = QUEUE_LENGTH, **wanted: int) -> AlarmChannel:
    """``wanted`` in Connect; the device takes the longest alarms."""
    return AlarmChannel(local, remote, AlarmCrBlockReq(**wanted), 1432, queue_length=queue_length)


def device_end(**options: int) -> AlarmChannel:
    return channel(DEVICE, CONTROLLER, **options)


def controller_end(**options: int) -> AlarmChannel:
    return channel(CONTROLLER, DEVICE, **options)


def sent(channel: AlarmChannel, now: int = 0) -> list[RtaPdu]:
    """What the channel sends, parsed."""
    return [parse_rta(octets) for _, octets in channel.to_send(now)]


def unfinished(channel: AlarmChannel) -> tuple[int, int]:
    """Alarms without their AlarmAck, and those that wait for them."""
    lines = (channel._high, channel._low)
    return sum(line.outstanding is not None for line in lines), sum(len(line.queue) for line in lines)


@dataclass
class Pair:
    """``lose`` sees each frame on its way, ("device" or "controller", pdu), and says whether it is lost."""

    device: AlarmChannel = field(default_factory=device_end)
    controller: AlarmChannel = field(default_factory=controller_end)
    now: int = 0
    lose: Callable[[str, RtaPdu], bool] = lambda _sender, _pdu: False
    acknowledges: bool = True
    device_events: list[AlarmEvent] = field(default_factory=list)
    controller_events: list[AlarmEvent] = field(default_factory=list)
    frames: list[tuple[str, RtaPdu]] = field(default_factory=list)

    def run(self) -> None:
        """Carry frames until nothing moves; each end takes alarms at once."""
        moved = True
        while moved:
            moved = False
            for name, channel, peer in (
                ("device", self.device, self.controller),
                ("controller", self.controller, self.device),
            ):
                for pdu in sent(channel, self.now):
                    moved = True
                    self.frames.append((name, pdu))
                    if not self.lose(name, pdu):
                        peer.receive(pdu, self.now)
            moved |= self._take(self.device, self.device_events) | self._take(self.controller, self.controller_events)

    def _take(self, channel: AlarmChannel, events: list[AlarmEvent]) -> bool:
        new = channel.events()
        for event in new:
            events.append(event)
            if isinstance(event, AlarmReceived) and self.acknowledges:
                assert channel.acknowledge(event.alarm, self.now)
            elif isinstance(event, AlarmFailed):
                channel.abort(event.code)
        return bool(new)

    def pass_time(self, until: int) -> None:
        """Let the timers run."""
        while True:
            deadlines = [d for d in (self.device.next_deadline(), self.controller.next_deadline()) if d is not None]
            at = min(deadlines, default=until + 1)
            if at > until:
                break
            self.now = max(self.now, at)
            for channel in (self.device, self.controller):
                channel.handle_timeout(self.now)
            self.run()
        self.now = until

    def confirmed(self, name: str = "device") -> int:
        """Alarms that the other end acknowledged."""
        events = self.device_events if name == "device" else self.controller_events
        return sum(isinstance(event, AlarmAcknowledged) for event in events)

    def received(self, name: str = "controller") -> list[AlarmNotification]:
        events = self.controller_events if name == "controller" else self.device_events
        return [event.alarm for event in events if isinstance(event, AlarmReceived)]
