"""The fast path of polls answers what the slow path would, and leaves the drive as that would."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pnfarm.buses.profibus.device.fast_path import FastPath, answer_poll
from pnfarm.drives.catalogue import model
from pnfarm.engine.columns import allocate
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.protocols.profibus.wire.dp import Parameters, PrmStatus
from pnfarm.protocols.profibus.wire.telegram import Sap, Telegram, emit_telegram, parse_telegram
from pnfarm.table.compiling.compiled import IS_COMPILED
from pnfarm.table.image import IMAGE
from pnfarm.testing import Line

FARM = """
farm: dp
link: {{kind: memory}}
drives:
  - {{name: 'msd-{{n:02}}', count: 2, model: moog-msd-dp, address: 11, behaviour: {{eight-octet-answers: {answers}}}}}
"""
DEVICES = """
farm: dp
link: {{kind: memory}}
devices:
  - {{name: 'valve-{{n}}', count: 2, gsd: {file}, address: 11}}
"""
#: Readings of the open point, and how answers with eight octets of data begin.
BEGINS = {"variable-length": 0x68, "fixed-length": 0xA2}
MASTER, FIRST, MS = 2, 11, 1_000_000
SRD, SDN, FCB, FCV = 0x4D, 0x46, 0x20, 0x10
CONTROL_WORDS = (0x0000, 0x0476, 0x0477, 0x047F, 0x04FF)
LOCK = PrmStatus.LOCK_REQ | PrmStatus.WD_ON | PrmStatus.SYNC_REQ | PrmStatus.FREEZE_REQ
CLEAR, UNFREEZE, FREEZE, UNSYNC, SYNC = 0x02, 0x04, 0x08, 0x10, 0x20


class Bench:
    """A farm that hears telegrams one by one.

    ``way``: with "short" each is tried as a poll first, with "shortest" as one like the one before as well.
    """

    def __init__(self, way: str, telegram: int = 1, answers: str = "variable-length") -> None:
        self.begin(way, FARM.format(answers=answers))
        self.ident = self.core.axes[0].model.profidrive.identity.device_id
        known = self.core.axes[0].model.profidrive.telegrams[telegram]
        self.identifiers, self.octets = known.identifiers, 2 * len(known.output)

    def begin(self, way: str, farm: str) -> None:
        self.line = Line.from_text(farm)
        self.line.run(0.1)
        self.core = self.line.core
        self.user = b"\x80\x00\x00"
        self.way, self.taken, self.repeated = way, 0, 0
        self.sent: list[tuple[int, bytes]] = []
        self.core.link.inner.send = lambda port, octets: self.sent.append((port, bytes(octets)))

    def hear(self, octets: bytes) -> None:
        now = self.line.now_ns
        found = None
        if self.way == "shortest":
            # what lies behind the telegram in the buffer is of others
            found = self.core.answer(np.frombuffer(octets + octets, np.uint8), len(octets), now)
            self.repeated += found is not None
        if found is None and self.way != "long":
            found = self.core.poll(octets, now)
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
                data = self.outputs(value)
                self.hear(emit_telegram(Telegram(address, MASTER, function, data=data)))
            case "first":
                data = self.outputs(value)
                self.hear(emit_telegram(Telegram(address, MASTER, SRD | FCB, data=data)))
            case "length":
                self.hear(emit_telegram(Telegram(address, MASTER, function, data=bytes(value % 8 + 1))))
            case "stranger":
                self.hear(emit_telegram(Telegram(address, MASTER + 3, function, data=bytes(self.octets))))
            case "broken":
                octets = bytearray(emit_telegram(Telegram(address, MASTER, function, data=bytes(self.octets))))
                octets[value % len(octets)] ^= 1 + value % 255
                self.hear(bytes(octets))
            case "set-up":
                user = Parameters(LOCK, (5, 1), 11, self.ident, 1, self.user).emit()
                self.ask(address, Sap.SET_PARAMETERS, user, FCB)
                self.ask(address, Sap.CHECK_CONFIGURATION, self.identifiers, FCV)
            case "diagnosis":
                self.ask(address, Sap.SLAVE_DIAGNOSIS, b"", function & ~SRD & 0x3F)
            case "control":
                command = (CLEAR, FREEZE, UNFREEZE, SYNC, UNSYNC, 0)[value % 6]
                self.hear(emit_telegram(Telegram(127, MASTER, SDN, 58, 62, bytes((command, 0)))))
            case "fault":
                self.core.axes[slave].raise_fault("32-1", hold=False)
            case "wait":
                self.line.run(0.001 * (value % 70))
            case "power":
                self.core.axes[slave].station.power_cycle(self.line.now_ns)
            case "inject":
                self.line.inject("wrong-ident", on=f"msd-{slave + 1:02}", **{"for": "20ms"})
        self.line.run(0.0005)

    def outputs(self, value: int) -> bytes:
        """STW1, then octets of all values, that of a negative number's first one among them."""
        rest = (value * 0x9E3779B97F4A7C15).to_bytes(12, "big") * 4
        return (value.to_bytes(2, "big") + rest)[: self.octets]

    def ask(self, address: int, sap: int, data: bytes, toggle: int) -> None:
        self.hear(emit_telegram(Telegram(address, MASTER, SRD | toggle, sap, 62, data)))

    def state(self) -> list:
        found = []
        for station in self.core.axes:
            device = station.device
            device.catch_up_polls()
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


class DeviceBench(Bench):
    """Two devices by the example of a compact slave, which supports neither Sync nor Freeze."""

    def __init__(self, way: str) -> None:
        file = Path(__file__).parents[3] / "configs" / "gsd" / "EXMP1D02.gsd"
        self.begin(way, DEVICES.format(file=file))
        self.ident, self.identifiers, self.octets, self.user = 0x1D02, b"\x11\x20", 1, b"\1\2"

    def ask(self, address: int, sap: int, data: bytes, toggle: int) -> None:
        if sap == Sap.SET_PARAMETERS:
            data = Parameters(PrmStatus.LOCK_REQ | PrmStatus.WD_ON, (5, 1), 11, self.ident, 1, self.user).emit()
        super().ask(address, sap, data, toggle)

    def outputs(self, value: int) -> bytes:
        self.core.station("valve-1").signals.set({"slot1_in_0_3": bool(value & 1), "slot1_in_1_7": bool(value & 2)})
        return bytes((value & 0xFF,))

    def state(self) -> list:
        return [
            (
                station.signals.get_all(),
                station.signals.good("slot1_out_0_0"),
                station.device.slave.state,
                station.device.slave.next_deadline(),
                (station.device.image.counts.received, station.device.image.counts.sent),
            )
            for station in self.core.stations
        ]


#: With eight octets in each direction.
OF_EIGHT_OCTETS = 106
TELEGRAMS = [number for number, one in model("moog-msd-dp").profidrive.telegrams.items() if one.identifiers]
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
@given(
    st.sampled_from(["short", "shortest", "shortest"]),
    st.sampled_from([*TELEGRAMS, *[OF_EIGHT_OCTETS] * 8]),
    st.sampled_from([*BEGINS]),
    st.lists(STEPS, min_size=1, max_size=40),
)
def test_whatever_a_line_brings_polls_by_a_short_way_answer_and_change_what_the_slow_path_does(
    way, telegram, answers, steps
):
    one, other = Bench(way, telegram, answers), Bench("long", telegram, answers)
    try:
        for step in [("set-up", 0, False, 0), ("first", 0, False, 0), *steps]:
            one.play(step)
            other.play(step)
            assert one.sent == other.sent, step
        assert one.state() == other.state()
    finally:
        one.line.close()
        other.line.close()


DEVICE_STEPS = st.tuples(
    st.sampled_from(
        ["poll"] * 12 + ["set-up", "first", "length", "stranger", "broken", "diagnosis", "control", "wait"]
    ),
    st.integers(0, 1),
    st.booleans(),
    st.integers(0, 0xFFFF),
)


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(["short", "shortest"]), st.lists(DEVICE_STEPS, min_size=1, max_size=40))
def test_polls_of_a_device_by_a_short_way_answer_and_change_what_the_slow_path_does(way, steps):
    one, other = DeviceBench(way), DeviceBench("long")
    try:
        for step in [("set-up", 0, False, 0), ("first", 0, False, 0), *steps]:
            one.play(step)
            other.play(step)
            assert one.sent == other.sent, step
        assert one.state() == other.state()
    finally:
        one.line.close()
        other.line.close()


def test_polls_of_a_device_that_exchanges_data_take_the_fast_path():
    bench = DeviceBench("shortest")
    bench.play(("set-up", 0, False, 0))
    bench.play(("poll", 0, True, 0))
    polled(bench)
    assert (bench.taken, bench.repeated) == (9, 0), "what is compiled knows words only"
    assert bench.core.station("valve-1").signals.get("slot1_out_0_0") is True
    bench.line.close()


def polled(bench, count=10):
    for number in range(count):
        bench.play(("poll", 0, number % 2 == 0, 0x047F))


def test_another_task_of_the_parameter_channel_takes_no_compiled_way_and_one_that_stands_does():
    bench = Bench("shortest", 101)
    bench.play(("set-up", 0, False, 0))
    bench.play(("first", 0, False, 0))
    for number in range(3):
        bench.play(("poll", 0, number % 2 == 0, 0x1001))
    before = bench.repeated
    bench.play(("poll", 0, False, 0x1002))
    assert bench.repeated == before
    for number in range(3):
        bench.play(("poll", 0, number % 2 == 0, 0x1002))
    assert bench.repeated == before + 3
    bench.line.close()


def test_polls_of_a_drive_that_exchanges_data_take_the_fast_path():
    bench = Bench("short")
    bench.play(("set-up", 0, False, 0))
    bench.play(("poll", 0, True, 0))
    assert bench.taken == 0, "the first one begins the exchange"
    polled(bench)
    # the first of these repeats the FCB of the one before
    assert bench.taken == 9
    bench.line.close()


def test_polls_that_are_like_the_one_before_take_the_fastest_path():
    bench = Bench("shortest")
    bench.play(("set-up", 0, False, 0))
    bench.play(("poll", 0, True, 0))
    polled(bench, 100)
    # but for the first two, the drive tells of its own what happens while it is switched on, and of each 32 a mean
    assert bench.taken == 99
    assert 80 <= bench.repeated < 99
    counts = bench.core.axes[0].device.image.counts
    # the first interval counts from the second telegram: data exchange begins with the first one
    assert (counts.received, counts.sent, int(counts.intervals.sum())) == (100, 100, 98)
    bench.line.close()


@pytest.mark.parametrize("answers", [*BEGINS])
@pytest.mark.parametrize("way", ["long", "short", "shortest"])
def test_eight_octets_are_answered_on_every_way_in_the_form_that_the_farm_file_chooses(way, answers):
    bench = Bench(way, OF_EIGHT_OCTETS, answers)
    bench.play(("set-up", 0, False, 0))
    bench.play(("diagnosis", 0, True, 0))
    diagnosis = bench.sent[-1][1]
    bench.play(("poll", 0, False, 0))
    bench.play(("poll", 0, True, 0))
    polled(bench)
    answered = bench.sent[-11:]
    assert (bench.taken > 0, bench.repeated > 0) == (way != "long", way == "shortest")
    for octets in (diagnosis, *(octets for _, octets in answered)):
        assert octets[0] == BEGINS[answers]
        assert len(octets) == (17 if BEGINS[answers] == 0x68 else 14)
        assert emit_telegram(parse_telegram(octets), fixed=BEGINS[answers] == 0xA2) == octets
    bench.line.close()


@pytest.mark.skipif(not IS_COMPILED, reason="nothing is compiled")
def test_one_drive_and_many_have_the_same_machine_code():
    # a container's image has it for one, and its user may not write more
    FastPath(1, IMAGE.allocate(1))
    known = len(answer_poll.signatures)
    for stations in (1, 2, 9):
        FastPath(1, allocate(images=stations).image)
    assert len(answer_poll.signatures) == known


def test_the_diagnosis_that_a_drive_asks_for_is_not_lost_among_polls():
    bench = Bench("shortest")
    for step in (("set-up", 0, False, 0), ("poll", 0, True, 0)):
        bench.play(step)
    polled(bench, 5)
    before = bench.repeated
    assert before
    bench.core.axes[0].device.slave.diagnosis_changed()
    bench.play(("poll", 0, False, 0x047F))
    assert bench.repeated == before
    # high priority: the master is asked to read it
    assert bench.sent[-1][1][6] == 0x0A
    bench.line.close()


@pytest.mark.parametrize("way", ["short", "shortest"])
@pytest.mark.parametrize(
    ("why", "value"), [("inject", 0), ("control", 0), ("control", 1), ("control", 3), ("fault", 0), ("power", 0)]
)
def test_what_concerns_more_than_cyclic_data_takes_the_slow_path(why, value, way):
    bench = Bench(way)
    for step in (("set-up", 0, False, 0), ("poll", 0, True, 0), ("poll", 0, False, 0)):
        bench.play(step)
    if why == "fault":
        bench.core.axes[0].store.set("P-1256", 1)
    bench.play((why, 0, False, value))
    before = bench.taken
    bench.play(("poll", 0, True, 0x047F))
    assert bench.taken == before
    bench.line.close()
