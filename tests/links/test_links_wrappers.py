import asyncio
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import EnvironmentError_
from pnfarm.links.base import Link, PortSpec, interface_below, unwrap
from pnfarm.links.capture.pcap import PcapLink, PcapngWriter
from pnfarm.links.macvlan import MacvlanLink
from pnfarm.links.memory import MemoryLink, MemorySwitch
from pnfarm.links.tap import TapLink
from pnfarm.links.veth import VethLink

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
    assert {p.sniffed_on for p in packets} == {"axis-01"}
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
    inner, outer = tmp_path / "inner.pcapng", tmp_path / "outer.pcapng"
    bench = Bench(lambda link, clock: PcapLink(PcapLink(link, inner, clock=clock), outer, clock=clock))
    assert isinstance(bench.link, Link)
    assert unwrap(bench.link) is bench.inner
    bench.from_drive(frame(PLC, DRIVE))
    assert len(bench.plc_heard) == 1
    asyncio.run(bench.link.set_carrier(bench.drive.index, False))
    asyncio.run(bench.link.set_mac(bench.drive.index, PLC))
    bench.to_drive(frame(DRIVE, PLC))
    assert bench.drive_heard == []
    asyncio.run(bench.link.close())
    for path in (inner, outer):
        assert path.read_bytes().count(frame(PLC, DRIVE)) == 1


@pytest.mark.parametrize(
    ("link", "below"),
    [(MacvlanLink("x", "eth7"), "eth7"), (VethLink("x", bridge="br7"), "br7"), (VethLink("x"), None),
     (TapLink("x", bridge="br8"), "br8"), (MemoryLink(MemorySwitch(), lambda: 0), None)],
)  # fmt: skip
def test_the_interface_below_a_link_is_its_parent_or_its_bridge(link, below, tmp_path):
    assert interface_below(link) == below
    assert interface_below(PcapLink(link, tmp_path / "x.pcapng", clock=lambda: 0)) == below
