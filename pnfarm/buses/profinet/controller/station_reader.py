"""What is on a network: Identify of all stations, then records of those that are expected; no clock, no tasks.

It only asks: DCP Identify, and ReadImplicit of I&M0, APIData and RealIdentificationData, of a few devices at once.  No
connection is made, and nothing is written.  Everything ends: the search, each device's answers, and all of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pnfarm.buses.checking import CheckAnswer
from pnfarm.buses.profinet.checking import seen_facts
from pnfarm.buses.profinet.controller.identification import IM0_INDEX
from pnfarm.buses.profinet.controller.identity import read_im
from pnfarm.buses.profinet.controller.module_client import read_modules
from pnfarm.buses.profinet.controller.record_client import RecordClient, RecordTask
from pnfarm.errors import DecodeError, RemoteError
from pnfarm.protocols.profinet.dcp.client import DcpClient, IdentifyAnswered, IdentifyFinished
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, parse_ethernet

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence
    from ipaddress import IPv4Interface

    from pnfarm.buses.checking import StationFacts
    from pnfarm.buses.profinet.controller.identity import Identification
    from pnfarm.buses.profinet.controller.module_client import DeviceModule
    from pnfarm.buses.profinet.controller.records import RecordPlace

__all__ = ["StationReader"]

#: Stations that are kept; further ones are only counted.
MOST_STATIONS: Final = 20_000
#: Answers to Identify that come within 10 ms (the unit of DCP's response delay).
BURST: Final = 16
DELAY_NS: Final = 10_000_000
#: Devices that are read at once.
AT_ONCE: Final = 8
#: For the records of one device, and of all.
DEVICE_NS: Final = 6_000_000_000
ALL_NS: Final = 120_000_000_000
#: Of one record: more than the modules of any device need.
MOST_OCTETS: Final = 32_768
#: Bit of DeviceRoleDetails (IEC 61158-6-10): it is an IO device.
IO_DEVICE: Final = 1


class _Reading:
    """The records of one device, one after the other."""

    def __init__(self, station: IdentifyAnswered, client: RecordClient, subslot: int, now: int) -> None:
        self.station = station
        self.client = client
        self.im0: Identification | None = None
        self.modules: tuple[DeviceModule, ...] | None = None
        self.remarks: list[str] = []
        self.due_ns = now + DEVICE_NS
        self.done = False
        self._steps = self._asking(subslot)
        next(self._steps)
        client.start_at(station, now)

    def go_on(self, now: int) -> None:
        while not self.done and self.client.done:
            try:
                self.client.read_next(self._steps.send(self.client), now)
            except StopIteration:
                self.done = True

    def give_up(self, why: str) -> None:
        self.remarks.append(why)
        self.done = True

    def _asking(self, subslot: int) -> Generator[RecordPlace, RecordClient, None]:
        client = yield (0, 0, subslot, IM0_INDEX)
        try:
            client.check()
            self.im0 = read_im(None, client.data or b"")
        except (RemoteError, DecodeError) as exc:
            self.remarks.append(f"I&M0 cannot be read: {exc}")
            if client.status is None and client.data is None:
                return  # no station answers there
        try:
            self.modules = yield from read_modules()
        except RemoteError as exc:
            self.remarks.append(f"its modules cannot be read: {exc}")


class StationReader:
    """``mac`` and ``own`` are this end's addresses; without ``own`` no record can be read.

    Feed it frames and time until :attr:`done`.
    """

    def __init__(
        self, expected: Sequence[StationFacts], mac: bytes, own: IPv4Interface | None, seed: bytes, seconds: float
    ) -> None:
        self.done = False
        self._names = {one.name: one for one in expected}
        self._addresses = {one.address: one for one in expected if one.address}
        self._factor = max(1, -(-len(expected) // BURST))
        self._window_ns = round(seconds * 1e9) + self._factor * DELAY_NS
        self._mac, self._own, self._seed = mac, own, seed
        self._dcp = DcpClient(mac, first_xid=int.from_bytes(seed[:3], "big") | 1)
        self._searching = True
        self._found: list[IdentifyAnswered] = []
        self._waiting: list[IdentifyAnswered] = []
        self._open: dict[bytes, _Reading] = {}
        self._read: dict[bytes, _Reading] = {}
        self._unread: dict[bytes, str] = {}
        self._due_ns = 0
        self._left_out = self._controllers = 0

    def start(self, now: int) -> None:
        self._dcp.identify(now=now, delay_factor=self._factor, window_ns=self._window_ns)

    def receive(self, data: bytes, now: int) -> None:
        """One frame; those of others are ignored."""
        try:
            frame = parse_ethernet(data)
        except DecodeError:
            return
        if self._searching:
            if frame.ethertype == ETHERTYPE_PROFINET and len(self._found) < MOST_STATIONS:
                self._dcp.receive(frame, now)
            elif frame.ethertype == ETHERTYPE_PROFINET:
                self._left_out += 1
        elif (reading := self._open.get(frame.source)) is not None:
            reading.client.receive(data, now)
        self._settle(now)

    def to_send(self, now: int) -> list[bytes]:
        """Whole frames that must go out now."""
        readings = (frame for one in self._open.values() for frame in one.client.to_send(now))
        return [*(self._dcp.to_send(now) if self._searching else ()), *readings]

    def next_deadline(self) -> int | None:
        due = [self._dcp.next_deadline()] if self._searching else [self._due_ns]
        for one in self._open.values():
            due += [one.due_ns, one.client.next_deadline()]
        return None if self.done else min((each for each in due if each is not None), default=None)

    def handle_timeout(self, now: int) -> None:
        if self._searching:
            self._dcp.handle_timeout(now)
        for one in self._open.values():
            one.client.handle_timeout(now)
        self._settle(now)

    def answer(self) -> CheckAnswer:
        """What was found, once it is done."""
        stations = []
        for one in self._found:
            reading, unread = self._read.get(one.mac), self._unread.get(one.mac)
            if reading is not None:
                facts = seen_facts(one.info, one.mac, reading.im0, reading.modules, reading.remarks)
            else:
                facts = seen_facts(one.info, one.mac, remarks=() if unread is None else (unread,))
            stations.append(facts)
        remarks = []
        if self._left_out:
            remarks.append(f"more than {MOST_STATIONS} stations answer: {self._left_out} frames were not evaluated")
        if self._controllers:
            remarks.append(f"{self._controllers} stations that are no IO devices are left out")
        return CheckAnswer(stations, remarks)

    # -- inside ------------------------------------------------------------------------------------------------------

    def _settle(self, now: int) -> None:
        if self.done:
            return
        for event in self._dcp.events() if self._searching else ():
            if isinstance(event, IdentifyAnswered):
                self._take(event)
            elif isinstance(event, IdentifyFinished):
                self._searching, self._due_ns = False, now + ALL_NS
        if self._searching:
            return
        if self._own is None or now >= self._due_ns:
            why = "the interface has no IPv4 address" if self._own is None else "there are too many stations"
            self._unread |= {one.mac: f"its records were not read: {why}" for one in self._waiting}
            self._waiting.clear()
        for mac, reading in list(self._open.items()):
            reading.go_on(now)
            if not reading.done and now >= min(reading.due_ns, self._due_ns):
                reading.give_up("it does not answer to reads in time")
            if reading.done:
                del self._open[mac]
        while self._own is not None and self._waiting and len(self._open) < AT_ONCE:
            reading = self._begin(self._waiting.pop(), self._own, now)
            if not reading.done:
                self._open[reading.station.mac] = reading
        self.done = not self._open and not self._waiting

    def _take(self, event: IdentifyAnswered) -> None:
        if event.info.role is not None and not event.info.role & IO_DEVICE:
            self._controllers += 1
            return
        self._found.append(event)
        if event.info.name in self._names or str(event.info.ip) in self._addresses:
            self._waiting.append(event)

    def _begin(self, station: IdentifyAnswered, own: IPv4Interface, now: int) -> _Reading:
        wanted = self._names.get(station.info.name or "") or self._addresses.get(str(station.info.ip))
        places = [place.partition(".") for place in (wanted.modules if wanted is not None else None) or ()]
        subslot = min((int(inner, 0) for slot, _, inner in places if slot == "0" and inner), default=1)
        task = RecordTask(station.info.name or "", (0, 0, subslot, IM0_INDEX), length=MOST_OCTETS, implicit=True)
        client = RecordClient(task, self._mac, own, self._seed + station.mac)
        self._read[station.mac] = reading = _Reading(station, client, subslot, now)
        reading.go_on(now)
        return reading
