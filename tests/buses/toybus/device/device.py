"""A drive's end of the toy bus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.engine.channels.closed_channels import ClosedChannels
from pnfarm.errors import DecodeError
from pnfarm.station.device import ConnectionView
from pnfarm.station.events import ConnectionEstablished, ConnectionLost
from pnfarm.table.image import LOST_EXPIRED, LOST_NOT
from pnfarm.table.signals import NSOLL_A, STW1
from pnfarm.wire.ethernet import parse_ethernet
from toybus.frames import Report, emit_report, frame, parse_order

if TYPE_CHECKING:
    from pnfarm.station.station import Station

SILENCE_NS = 100_000_000
#: STW1 of a drive that shall run, and of one that shall not.
RUN, REST = 0x047F, 0x047E
#: What NSOLL_A 0x4000 is worth, rpm.
REFERENCE = 3000.0


@dataclass(frozen=True, slots=True)
class ToyConnected(ConnectionEstablished):
    TEXT = "toy connected"


@dataclass(frozen=True, slots=True)
class ToyLost(ConnectionLost):
    TEXT = "toy lost"


class ToyDevice:
    """See :class:`pnfarm.station.device.Device`."""

    def __init__(self, station: Station, services: object = None) -> None:
        self.station = station
        self.name = station.configured_name
        self.connects = 0
        self.watchdog_expirations = self.watchdog_expirations_by_farm = 0
        self.closed = ClosedChannels()
        self.channel_rows = ((), ())
        self.muted = 0
        self._dropped: dict[str, int] = {}
        self._losses = 0
        self._controller: bytes | None = None
        self._since = self._heard = 0
        self._replies: list[bytes] = []

    # life

    def check(self, kept: dict[str, Any]) -> None:
        pass

    def commission(self, kept: dict[str, Any]) -> None:
        pass

    def build(self, kept: dict[str, Any]) -> None:
        self._controller = None
        self._replies.clear()

    def start(self, now: int) -> list[str]:
        return []

    def stop(self, now: int) -> None:
        self._controller = None

    def leave(self, now: int) -> None:
        self._controller = None

    # frames and time

    def receive(self, data: bytes, now: int) -> None:
        try:
            order = parse_order(parse_ethernet(data).payload)
        except DecodeError:
            self._dropped["no-order"] = self._dropped.get("no-order", 0) + 1
            return
        image = self.station.image
        if self._controller is None:
            self._since = now
            self.connects += 1
            self.station.note(now, ToyConnected())
        self._controller, self._heard = data[6:12], now
        image.received[STW1] = RUN if order.enable else REST
        image.received[NSOLL_A] = round(order.speed / REFERENCE * 0x4000)
        image.frames += 1
        image.valid, image.lost = 1, LOST_NOT
        self.closed.received += 1
        if not self.muted:
            axis = self.station.axis.handle.axis
            report = Report(int(axis.profidrive.zsw1), round(float(axis.motor.velocity)))
            self._replies.append(frame(self._controller, self.station.port.mac, emit_report(report)))

    def pump(self, now: int) -> list[bytes]:
        self.station.pump_drive(now)
        replies, self._replies = self._replies, []
        self.closed.sent += len(replies)
        return replies

    def next_deadline(self) -> int | None:
        return None if self._controller is None else self._heard + SILENCE_NS

    def handle_timeout(self, now: int) -> None:
        if self._controller is not None and now >= self._heard + SILENCE_NS:
            self.watchdog_expirations += 1
            self.lose(now)

    def lose(self, now: int) -> int:
        """The connection is gone, if there was one."""
        if self._controller is None:
            return 0
        self._controller = None
        self._losses += 1
        self.station.image.valid, self.station.image.lost = 0, LOST_EXPIRED
        self.station.note(now, ToyLost())
        return 1

    # what only drives with other abilities are told

    def telegram_changed(self, axis: int) -> None:
        pass

    def channel_event(self, kind: int, row: int, when: int, value: int, now: int) -> bool:
        return False

    def catch_up(self, now: int) -> None:
        pass

    def fault_raised(self, axis: int, number: int) -> None:
        pass

    def faults_cleared(self, axis: int) -> None:
        pass

    def parameter_task(self, axis: int, value: int, now: int) -> None:
        pass

    # what there is to see

    @property
    def connected(self) -> bool:
        return self._controller is not None

    def connection(self) -> ConnectionView | None:
        if self._controller is None:
            return None
        return ConnectionView("TALKING", mac=self._controller, connected_ns=self._since, cyclic=True, exchanging=True)

    def losses(self) -> dict[str, int]:
        return {"silence": self._losses} if self._losses else {}

    def losses_by_farm(self) -> dict[str, int]:
        return {}

    def losses_in_words(self) -> dict[str, int]:
        return {"the controller fell silent": self._losses} if self._losses else {}

    def discards(self) -> dict[str, int]:
        return self._dropped

    def details(self) -> dict[str, Any]:
        return {}

    def view(self, now: int) -> dict[str, Any]:
        return {}
