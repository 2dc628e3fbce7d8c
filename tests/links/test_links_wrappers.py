import asyncio
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import EnvironmentError_
from pnfarm.links.base import Link, PortSpec, unwrap
from pnfarm.links.impair import Evidence, ImpairedLink, LinkImpairment, SplitMix64
from pnfarm.links.memory import MemoryLink, MemorySwitch
from pnfarm.links.pcap import PcapLink, PcapngWriter

DRIVE, PLC = (bytes([2, 0, 0, 0, 0, n]) for n in (1, 2))
ARP = 0x0806


def frame(destination, source, ethertype=0x8892, text=b""):
    return destination + source + struct.pack(">H", ethertype) + text


class Bench:
    """A wrapped drive and a bare controller on one switch, in virtual time."""

    def __init__(self, wrap):
        self.now = 1_000
        self.switch = MemorySwitch()
        self.inner = MemoryLink(self.switch, self.clock)
        self.link = wrap(self.inner, self.clock)
        self.drive_heard, self.plc_heard = [], []
        self.link.set_receiver(lambda index, data, now: self.drive_heard.append(data))
        (self.drive,) = asyncio.run(self.link.open([PortSpec("axis-01", DRIVE)]))
        self.plc = self.switch.attach(PLC, lambda index, data, now: self.plc_heard.append(data))

    def clock(self):
        return self.now

    def to_drive(self, data):
        self.switch.send(self.plc.index, data, self.now)
        self.switch.deliver(self.now)

    def from_drive(self, data):
        self.link.send(self.drive.index, data)
        self.switch.deliver(self.now)


# -- impair


@pytest.fixture
def bench():
    return Bench(lambda inner, clock: ImpairedLink(inner, clock=clock))


def test_without_impairments_everything_passes(bench):
    assert isinstance(bench.link, Link)
    assert bench.link.kind == "memory"
    assert unwrap(bench.link) is bench.inner
    bench.to_drive(frame(DRIVE, PLC))
    bench.from_drive(frame(PLC, DRIVE))
    assert len(bench.drive_heard) == len(bench.plc_heard) == 1
    assert bench.link.counters.as_dict() == {"received": 1, "sent": 1}


@pytest.mark.parametrize(("direction", "heard"), [("in", (0, 1)), ("out", (1, 0)), ("both", (0, 0))])
def test_silence_has_a_direction_and_ends_when_removed(bench, direction, heard):
    key = bench.link.add(LinkImpairment(bench.drive.index, direction=direction))
    bench.to_drive(frame(DRIVE, PLC))
    bench.from_drive(frame(PLC, DRIVE))
    assert (len(bench.drive_heard), len(bench.plc_heard)) == heard
    assert bench.link.remove(key).activations == 2 - sum(heard)
    bench.to_drive(frame(DRIVE, PLC))
    bench.from_drive(frame(PLC, DRIVE))
    assert (len(bench.drive_heard), len(bench.plc_heard)) == (heard[0] + 1, heard[1] + 1)
    with pytest.raises(KeyError):
        bench.link.evidence(key)


def test_evidence_says_what_was_done_and_when(bench):
    key = bench.link.add(LinkImpairment(bench.drive.index, ethertype=ARP, direction="out"))
    assert bench.link.evidence(key) == Evidence()
    for now, ethertype in ((2_000, 0x8892), (3_000, ARP), (4_000, ARP), (5_000, 0x8892)):
        bench.now = now
        bench.from_drive(frame(PLC, DRIVE, ethertype))
    assert bench.link.evidence(key) == Evidence(checks=2, activations=2, first_ns=3_000, last_ns=4_000)
    assert len(bench.plc_heard) == 2


def test_other_ports_are_not_touched(bench):
    key = bench.link.add(LinkImpairment(bench.drive.index + 7))
    bench.to_drive(frame(DRIVE, PLC))
    assert len(bench.drive_heard) == 1
    assert bench.link.evidence(key).checks == 0


def test_loss_follows_its_probability_and_its_seed(bench):
    def lost_with(seed):
        key = bench.link.add(LinkImpairment(bench.drive.index, probability=0.25, seed=seed, direction="in"))
        bench.drive_heard.clear()
        for n in range(2_000):
            bench.to_drive(frame(DRIVE, PLC, text=struct.pack(">H", n)))
        evidence = bench.link.remove(key)
        assert evidence.checks == 2_000
        assert evidence.activations == 2_000 - len(bench.drive_heard)
        return [int.from_bytes(data[14:], "big") for data in bench.drive_heard]

    first = lost_with(7)
    assert 0.70 < len(first) / 2_000 < 0.80
    assert lost_with(7) == first
    assert lost_with(8) != first


def test_each_impairment_has_its_own_sequence(bench):
    alone = bench.link.add(LinkImpairment(bench.drive.index, probability=0.5, seed=1, direction="in"))
    for _ in range(100):
        bench.to_drive(frame(DRIVE, PLC))
    expected = bench.link.remove(alone).activations
    key = bench.link.add(LinkImpairment(bench.drive.index, probability=0.5, seed=1, direction="in"))
    bench.link.add(LinkImpairment(bench.drive.index, probability=0.5, seed=2, direction="in"))
    for _ in range(100):
        bench.to_drive(frame(DRIVE, PLC))
    assert bench.link.evidence(key).activations == expected


@pytest.mark.parametrize("probability", [-0.1, 1.1, float("nan")])
def test_a_probability_lies_between_0_and_1(probability):
    with pytest.raises(ValueError, match="between 0 and 1"):
        LinkImpairment(1, probability)


def test_the_generator_gives_the_published_numbers():
    # the reference implementation's output for seed 1234567
    generator = SplitMix64(1234567)
    assert [generator.next_u64() for _ in range(3)] == [6457827717110365317, 3203168211198807973, 9817491932198370423]


@given(st.integers())
def test_uniform_numbers_lie_in_their_interval(seed):
    generator = SplitMix64(seed)
    assert all(0.0 <= generator.uniform() < 1.0 for _ in range(20))


# -- pcap


def test_a_capture_holds_both_directions_with_names_and_times(tmp_path):
    from scapy.utils import PcapNgReader

    path = tmp_path / "farm.pcapng"
    bench = Bench(lambda inner, clock: PcapLink(inner, path, clock=clock, epoch_ns=1_700_000_000_000_000_000))
    assert isinstance(bench.link, Link)
    sent, received, cyclic = (
        frame(PLC, DRIVE, text=b"123"),
        frame(DRIVE, PLC, ARP, b"1"),
        frame(PLC, DRIVE, text=b"\x80\x01"),
    )
    bench.now = 5_000
    bench.from_drive(sent)
    bench.now = 6_001
    bench.to_drive(received)
    bench.link.record(bench.drive.index, cyclic, 7_000, "out")
    bench.link.record(99, cyclic, 7_000, "out")
    asyncio.run(bench.link.close())
    bench.link.record(bench.drive.index, cyclic, 8_000, "out")
    with PcapNgReader(str(path)) as reader:
        packets = list(reader)
    assert [(bytes(p), p.direction) for p in packets] == [(sent, 2), (received, 1), (cyclic, 2)]
    assert {p.sniffed_on for p in packets} == {"axis-01 (axis-01)"}
    assert int(packets[1].time * 1_000_000_000) == 1_700_000_000_000_006_001
    assert len(bench.drive_heard) == len(bench.plc_heard) == 1


def test_a_capture_that_cannot_be_written_is_refused_at_the_start(tmp_path):
    with pytest.raises(EnvironmentError_, match="cannot be written: No such file"):
        PcapngWriter(tmp_path / "nowhere" / "farm.pcapng")


def test_a_full_disk_ends_the_recording_and_not_the_farm():
    from pathlib import Path

    bench = Bench(lambda inner, clock: PcapLink(inner, Path("/dev/full"), clock=clock))
    for n in range(10):
        bench.now += 2_000_000_000
        bench.from_drive(frame(PLC, DRIVE, text=bytes([n])))
    assert len(bench.plc_heard) == 10
    asyncio.run(bench.link.close())
    assert isinstance(bench.link.failed, EnvironmentError_)


@given(st.lists(st.tuples(st.binary(max_size=1600), st.integers(0, 2**63), st.sampled_from(["in", "out"])), max_size=8))
def test_every_block_of_a_capture_says_its_length_twice(tmp_path_factory, frames):
    path = tmp_path_factory.mktemp("capture") / "any.pcapng"
    writer = PcapngWriter(path)
    interface = writer.add_interface("axis-01")
    for data, wall_ns, direction in frames:
        writer.write(interface, data, wall_ns, direction)
    writer.close()
    content = path.read_bytes()
    blocks = 0
    while content:
        length = int.from_bytes(content[4:8], "little")
        assert length % 4 == 0
        assert content[length - 4 : length] == content[4:8]
        content = content[length:]
        blocks += 1
    assert blocks == len(frames) + 2


def test_wrappers_go_around_wrappers(tmp_path):
    path = tmp_path / "farm.pcapng"
    bench = Bench(lambda inner, clock: PcapLink(ImpairedLink(inner, clock=clock), path, clock=clock))
    assert unwrap(bench.link) is bench.inner
    bench.link.inner.add(LinkImpairment(bench.drive.index, direction="out"))
    bench.from_drive(frame(PLC, DRIVE))
    assert bench.plc_heard == []
    asyncio.run(bench.link.set_carrier(bench.drive.index, False))
    asyncio.run(bench.link.set_mac(bench.drive.index, PLC))
    bench.to_drive(frame(DRIVE, PLC))
    assert bench.drive_heard == []
    asyncio.run(bench.link.close())
