"""The short way of polls answers what the long way would, and leaves the drive as that would."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pnfarm.farm.snapshot import drive_snapshot
from pnfarm.protocols.profibus.wire.dp import Parameters, PrmStatus, emit_parameters
from pnfarm.protocols.profibus.wire.telegram import Sap, Telegram, emit_telegram
from pnfarm.testing import Line

FARM = """
farm: dp
link: {kind: memory}
drives:
  - {name: 'msd-{n:02}', count: 2, model: moog-msd-dp, address: 11}
"""
MASTER, FIRST, MS = 2, 11, 1_000_000
SRD, SDN, FCB, FCV = 0x4D, 0x46, 0x20, 0x10
#: Telegram 1: two words each way.
OCTETS = 4
CONTROL_WORDS = (0x0000, 0x0476, 0x0477, 0x047F, 0x04FF)
LOCK = PrmStatus.LOCK_REQ | PrmStatus.WD_ON | PrmStatus.SYNC_REQ | PrmStatus.FREEZE_REQ
CLEAR, UNFREEZE, FREEZE, UNSYNC, SYNC = 0x02, 0x04, 0x08, 0x10, 0x20


class Bench:
    """A farm that hears telegrams one by one; with ``short`` each is tried as a poll first."""

    def __init__(self, *, short: bool) -> None:
        self.line = Line.from_text(FARM)
        self.line.run(0.1)
        self.core = self.line.core
        self.short, self.taken = short, 0
        self.sent: list[tuple[int, bytes]] = []
        self.core.link.inner.send = lambda port, octets: self.sent.append((port, bytes(octets)))
        self.ident = self.core.stations[0].model.profidrive.identity.device_id
        self.identifiers = self.core.stations[0].model.profidrive.telegrams[1].identifiers

    def hear(self, octets: bytes) -> None:
        now = self.line.now_ns
        found = self.core.poll(octets, now) if self.short else None
        if found is not None:
            self.taken += 1
            self.core.link.send(*found)
            return
        wanted = self.core._line_audience(octets)
        ports = [station.port.index for station in self.core.stations] if wanted is None else wanted
        for port in tuple(ports):
            self.core.receive(port, octets, now)

    def play(self, step: tuple) -> None:
        kind, slave, fcb, value = step
        address = FIRST + slave
        function = SRD | FCV | (FCB if fcb else 0)
        match kind:
            case "poll":
                data = value.to_bytes(2, "big") + b"\x10\x00"
                self.hear(emit_telegram(Telegram(address, MASTER, function, data=data)))
            case "first":
                data = value.to_bytes(2, "big") + b"\x10\x00"
                self.hear(emit_telegram(Telegram(address, MASTER, SRD | FCB, data=data)))
            case "length":
                self.hear(emit_telegram(Telegram(address, MASTER, function, data=bytes(value % 8 + 1))))
            case "stranger":
                self.hear(emit_telegram(Telegram(address, MASTER + 3, function, data=bytes(OCTETS))))
            case "broken":
                octets = bytearray(emit_telegram(Telegram(address, MASTER, function, data=bytes(OCTETS))))
                octets[value % len(octets)] ^= 1 + value % 255
                self.hear(bytes(octets))
            case "set-up":
                user = emit_parameters(Parameters(LOCK, (5, 1), 11, self.ident, 1, b"\x80\x00\x00"))
                self.ask(address, Sap.SET_PARAMETERS, user, FCB)
                self.ask(address, Sap.CHECK_CONFIGURATION, self.identifiers, FCV)
            case "diagnosis":
                self.ask(address, Sap.SLAVE_DIAGNOSIS, b"", function & ~SRD & 0x3F)
            case "control":
                command = (CLEAR, FREEZE, UNFREEZE, SYNC, UNSYNC, 0)[value % 6]
                self.hear(emit_telegram(Telegram(127, MASTER, SDN, 58, 62, bytes((command, 0)))))
            case "fault":
                self.core.stations[slave].raise_fault("32-1", hold=False)
            case "wait":
                self.line.run(0.001 * (value % 70))
            case "power":
                self.core.stations[slave].power_cycle(self.line.now_ns)
            case "inject":
                self.line.inject("wrong-ident", on=f"msd-{slave + 1:02}", **{"for": "20ms"})
        self.line.run(0.0005)

    def ask(self, address: int, sap: int, data: bytes, toggle: int) -> None:
        self.hear(emit_telegram(Telegram(address, MASTER, SRD | toggle, sap, 62, data)))

    def state(self) -> list:
        found = []
        for station in self.core.stations:
            device = station.device
            slave = device.slave
            found.append(
                (
                    drive_snapshot(self.core, station, self.line.now_ns),
                    list(station.handle.image.received),
                    (slave.state, slave.master, slave.repeated, slave.diagnoses, slave.refusals, dict(slave.dropped)),
                    (slave.exchanging, slave.watchdog_ns, slave.next_deadline(), slave._remembered, slave._cyclic),
                    (device.image.counts.received, device.image.counts.sent, list(device.image.counts.intervals)),
                )
            )
        return found


STEPS = st.tuples(
    st.sampled_from(
        ["poll"] * 12
        + ["set-up", "control", "control"] * 3
        + ["first", "length", "stranger", "broken", "diagnosis", "fault", "wait", "power", "inject"]
    ),
    st.integers(0, 1),
    st.booleans(),
    st.one_of(st.sampled_from(CONTROL_WORDS), st.integers(0, 0xFFFF)),
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(STEPS, min_size=1, max_size=40))
def test_whatever_a_line_brings_polls_by_the_short_way_answer_and_change_what_the_long_way_does(steps):
    one, other = Bench(short=True), Bench(short=False)
    try:
        for step in [("set-up", 0, False, 0), ("first", 0, False, 0), *steps]:
            one.play(step)
            other.play(step)
            assert one.sent == other.sent, step
        assert one.state() == other.state()
    finally:
        one.line.close()
        other.line.close()


def polled(bench, count=10):
    for number in range(count):
        bench.play(("poll", 0, number % 2 == 0, 0x047F))


def test_polls_of_a_drive_that_exchanges_data_take_the_short_way():
    bench = Bench(short=True)
    bench.play(("set-up", 0, False, 0))
    bench.play(("poll", 0, True, 0))
    assert bench.taken == 0, "the first one begins the exchange"
    polled(bench)
    # the first of these repeats the FCB of the one before
    assert bench.taken == 9
    bench.line.close()


@pytest.mark.parametrize(
    ("why", "value"), [("inject", 0), ("control", 0), ("control", 1), ("control", 3), ("fault", 0), ("power", 0)]
)
def test_what_concerns_more_than_cyclic_data_takes_the_long_way(why, value):
    bench = Bench(short=True)
    for step in (("set-up", 0, False, 0), ("poll", 0, True, 0), ("poll", 0, False, 0)):
        bench.play(step)
    if why == "fault":
        bench.core.stations[0].store.set("P-1256", 1)
    bench.play((why, 0, False, value))
    before = bench.taken
    bench.play(("poll", 0, True, 0x047F))
    assert bench.taken == before
    bench.line.close()
