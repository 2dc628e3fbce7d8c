"""Slaves and a master on one line in memory, in virtual time."""

from __future__ import annotations

from dataclasses import dataclass, field

from pnfarm.protocols.profibus.master import Master, MasterSettings
from pnfarm.protocols.profibus.master_slaves import SlavePlan
from pnfarm.protocols.profibus.slave import Slave
from pnfarm.protocols.profibus.slave_user import RecordRefusedError, SlaveOptions
from pnfarm.protocols.profibus.wire.telegram import emit_telegram, parse_telegram
from pnfarm.protocols.profibus.wire.timing import bits_ns, line_ns

IDENT = 0x0BAD
MS = 1_000_000


@dataclass
class Drive:
    """Behind a slave: what it was given, and what it says."""

    identifiers: bytes = b"\xf3\xf1"
    octets: int = 12
    outputs: list[bytes] = field(default_factory=list)
    cleared: int = 0
    exchanges: int = 0
    shown: bytes = b""
    error: bool = False
    static: bool = False
    extended: bytes = b""
    records: dict[tuple[int, int], bytes] = field(default_factory=dict)
    ready_ns: int = 0
    refuse: tuple[int, int] | None = None
    gone: list[int] = field(default_factory=list)
    wrong: str | None = None

    @property
    def output_octets(self):
        return self.octets

    def check_parameters(self, parameters):
        return self.wrong

    def check_configuration(self, identifiers):
        return identifiers == self.identifiers

    def configuration(self):
        return self.identifiers

    def take_outputs(self, data, now):
        self.outputs.append(data)

    def clear_outputs(self, now):
        self.cleared += 1

    def inputs(self):
        return self.shown or bytes(range(self.octets))

    def exchanged(self, now):
        self.exchanges += 1

    def diagnosis(self):
        return self.error, self.static, self.extended

    def read_record(self, slot, index, length, client, now):
        if self.refuse:
            raise RecordRefusedError(*self.refuse)
        if now < self.ready_ns:
            return None
        return self.records.get((slot, index), b"")[:length]

    def write_record(self, slot, index, data, client, now):
        if self.refuse:
            raise RecordRefusedError(*self.refuse)
        if now < self.ready_ns:
            return False
        self.records[slot, index] = data
        return True

    def client_gone(self, client):
        self.gone.append(client)


class DpLine:
    """``lose``: decides (from, octets) -> octets or None, for each telegram on its way."""

    def __init__(
        self, count=1, *, baud=1_500_000, watchdog=(10, 1), access="class-2", cycle_ns=2 * MS, latency_ns=0, **options
    ):
        self.now = 0
        self.baud = baud
        self.drives = [Drive() for _ in range(count)]
        self.slaves = [Slave(3 + n, drive, SlaveOptions(IDENT, **options)) for n, drive in enumerate(self.drives)]
        self.plans = [
            SlavePlan(f"s{n}", 3 + n, IDENT, drive.identifiers, drive.octets, drive.octets, bytes((0x80, 0, 0)),
                      watchdog, reconnect_ns=50 * MS, access=access)
            for n, drive in enumerate(self.drives)
        ]  # fmt: skip
        self.master = Master(MasterSettings(baud=baud, latency_ns=latency_ns, cycle_ns=cycle_ns), self.plans)
        self.lose = lambda _who, octets: octets
        self.events = []
        self.seen = []

    def run(self, seconds, until=lambda: False):
        """True once ``until`` holds."""
        end = self.now + round(seconds * 1e9)
        while not until():
            due = [self.master.next_deadline(), *(slave.next_deadline() for slave in self.slaves)]
            now = min(time for time in due if time is not None)
            if now > end:
                self.now = end
                return False
            self.now = max(self.now, now)
            for slave in self.slaves:
                if (at := slave.next_deadline()) is not None and at <= self.now:
                    slave.handle_timeout(self.now)
            self.master.handle_timeout(self.now)
            while (octets := self.master.to_send()) is not None:
                self.master.sent(self.now)
                self._deliver(octets)
                self.master.handle_timeout(self.now)
            self.events += self.master.take_events()
        return True

    def _deliver(self, octets):
        self.now += line_ns(len(octets), self.baud)
        passed = self.lose("master", octets)
        if passed is None:
            return
        self.seen.append(parse_telegram(passed))
        answers = [answer for slave in self.slaves if (answer := slave.receive(self.seen[-1], self.now)) is not None]
        assert len(answers) <= 1, "only one station answers"
        if not answers:
            return
        answer = emit_telegram(answers[0])
        self.now += bits_ns(11, self.baud) + line_ns(len(answer), self.baud)
        back = self.lose("slave", answer)
        if back is not None:
            self.seen.append(parse_telegram(back))
            self.master.receive(self.seen[-1], self.now)

    @property
    def exchanging(self):
        return all(station.exchanging for station in self.master.stations)
