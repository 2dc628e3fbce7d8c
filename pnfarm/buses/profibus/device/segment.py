"""Which telegrams concern a slave: everybody on the line hears all of them, and most are for one."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profibus.device.fast_path import FastPath
from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.wire.telegram import (
    BODY,
    BROADCAST,
    EXTENDED,
    Sap,
    Telegram,
    body_of_data,
    parse_telegram,
)
from pnfarm.station.absent import Absent
from pnfarm.station.visits import Caller

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from pnfarm.buses.profibus.device.parts import SlaveParts

__all__ = ["ProfibusSegment"]

#: What is counted of all slaves: requests that came again, diagnoses read, Set_Prm and Chk_Cfg that did not fit.
COUNTED = ("repeated", "diagnosis", "refused")


class ProfibusSegment:
    """See :class:`pnfarm.buses.bus.Segment`.

    A slave that is addressed gets its telegram; one that seeks the baud rate, any; the others learn that the line
    lives.
    """

    def __init__(self, devices: Sequence[SlaveParts]) -> None:
        self._devices = {device.port.index: device for device in devices}
        #: Ports that a telegram to an address concerns.
        self._by_address: dict[int | None, list[int]] = {}
        self.absent = Absent()
        #: When a telegram came last.
        self.heard_ns = 0
        self._ports = [device.port.index for device in devices]
        self._fast_path: FastPath | None = None
        if devices:
            self._fast_path = FastPath(len(devices), devices[0].station.image.base)
            for row, device in enumerate(devices):
                device.image.join(self._fast_path, row)
        self._are_addressed = False
        for device in devices:
            device.line = self

    def admits(self, port: int, frame: bytes, now: int) -> bool:
        del port, frame
        self.heard_ns = now
        return True

    def audience(self, frame: bytes, now: int, besides: Collection[int] = ()) -> Sequence[int] | None:
        del besides
        place = BODY.get(frame[0]) if frame else None
        destination = frame[place] & 0x7F if place is not None and len(frame) > place else None
        if destination == BROADCAST:
            return None
        found = self._by_address.get(destination)
        if found is None:
            found = [
                port
                for port, device in self._devices.items()
                if device.slave.address == destination or not device.slave.found
            ]
            # whose answer is due comes first
            found.sort(key=lambda port: self._devices[port].slave.address != destination)
            self._by_address[destination] = found
        if not found:
            # :meth:`admits` is asked of what concerns a slave; other stations' telegrams keep the rate as well
            self.heard_ns = now
            if destination is not None:
                self._look(frame, destination, now)
        return found

    def _look(self, frame: bytes, destination: int, now: int) -> None:
        """A master reads the diagnosis of a slave that is not there: it is in its configuration."""
        try:
            telegram = parse_telegram(frame)
        except DecodeError:
            return
        if isinstance(telegram, Telegram) and telegram.is_request and telegram.dsap == Sap.SLAVE_DIAGNOSIS:
            self.absent.note(str(destination), Caller(str(telegram.source)), now)

    def changed(self) -> None:
        """A slave has another address, or found or lost the baud rate."""
        self._by_address.clear()
        self._are_addressed = False

    def counts(self) -> Mapping[str, int]:
        found: Counter[str] = Counter(dict.fromkeys(COUNTED, 0))
        for device in self._devices.values():
            found.update(device.counted())
        return found

    def addressed(self, octets: bytes) -> int | None:
        """See :class:`pnfarm.buses.bus.LineSegment`: one whole telegram with data and without access points."""
        begin = body_of_data(octets)
        if not begin or octets[begin] & EXTENDED or octets[begin + 1] & EXTENDED:
            return None
        found = self._by_address.get(octets[begin])
        return found[0] if found is not None and len(found) == 1 else None

    def answer(self, octets: Any, length: int, now: int) -> tuple[int, memoryview] | None:
        fast_path = self._fast_path
        if fast_path is None:
            return None
        if not self._are_addressed:
            self._address(fast_path)
        found = fast_path.answer(octets, length, now)
        if found is None:
            return None
        self.heard_ns = now
        row, answer = found
        return self._ports[row], answer

    def _address(self, fast_path: FastPath) -> None:
        """Addresses that one slave alone has; none while a slave seeks the rate, as any telegram concerns it."""
        devices = list(self._devices.values())
        count = Counter(device.slave.address for device in devices)
        seeking = any(not device.slave.found for device in devices)
        fast_path.addresses(
            [
                (device.slave.address, row)
                for row, device in enumerate(devices)
                if not seeking and count[device.slave.address] == 1
            ]
        )
        self._are_addressed = True

    def poll(self, port: int, octets: bytes, now: int) -> bytes | None:
        answer = self._devices[port].poll(octets, now)
        if answer is not None:
            self.heard_ns = now
        return answer

    def answered(self, port: int, now: int) -> None:
        device = self._devices.get(port)
        if device is not None:
            device.follow(now)

    def least_reply_bits(self, port: int) -> int:
        """See :class:`pnfarm.buses.bus.LineSegment`: min T_SDR, as the master set it."""
        return self._devices[port].slave.min_tsdr_bits

    def settled(self, port: int) -> None:
        del port
