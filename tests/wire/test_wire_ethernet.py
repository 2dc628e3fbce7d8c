from pathlib import Path

import pytest
from decode_reason import reason
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.l2 import Dot1Q, Ether
from scapy.utils import PcapReader

from pnfarm.wire.ethernet import (
    ETHERTYPE_PROFINET,
    ETHERTYPE_VLAN,
    EthernetFrame,
    VlanTag,
    emit_ethernet,
    parse_ethernet,
)

CAPTURES = Path(__file__).resolve().parents[2].parent / "shared" / "captures"

macs = st.binary(min_size=6, max_size=6)
tags = st.builds(VlanTag, st.integers(0, 7), st.booleans(), st.integers(0, 4095))
frames = st.builds(
    EthernetFrame,
    destination=macs,
    source=macs,
    ethertype=st.integers(0, 0xFFFF).filter(lambda value: value != ETHERTYPE_VLAN),
    payload=st.binary(min_size=46, max_size=200),
    vlan=st.none() | tags,
)


@given(frames)
def test_a_frame_survives_the_wire(frame):
    assert parse_ethernet(emit_ethernet(frame)) == frame


@given(st.binary(max_size=100))
def test_any_octets_give_a_frame_or_a_decode_error(data):
    assert reason(parse_ethernet, data) in {None, "short"}


def test_a_short_frame_is_padded_to_sixty_octets():
    octets = emit_ethernet(EthernetFrame(b"\1" * 6, b"\2" * 6, ETHERTYPE_PROFINET, b"abc"))
    assert len(octets) == 60
    assert parse_ethernet(octets).payload == b"abc".ljust(46, b"\0")


def test_a_frame_reads_the_same_to_scapy():
    frame = EthernetFrame(
        bytes.fromhex("010ecf000000"), bytes.fromhex("020000000001"), 0x8892, b"x" * 46, VlanTag(6, dei=True, vid=5)
    )
    seen = Ether(emit_ethernet(frame))
    assert (seen.dst, seen.src) == ("01:0e:cf:00:00:00", "02:00:00:00:00:01")
    tag = seen[Dot1Q]
    assert (tag.prio, tag.dei, tag.vlan, tag.type) == (6, 1, 5, 0x8892)


@pytest.mark.parametrize(
    "frame",
    [
        EthernetFrame(b"\1" * 5, b"\2" * 6, 0x8892, b""),
        EthernetFrame(b"\1" * 6, b"\2" * 6, 0x10000, b""),
        EthernetFrame(b"\1" * 6, b"\2" * 6, 0x8892, b"", VlanTag(priority=8)),
        EthernetFrame(b"\1" * 6, b"\2" * 6, 0x8892, b"", VlanTag(vid=4096)),
    ],
)
def test_what_does_not_fit_is_our_own_mistake(frame):
    with pytest.raises(ValueError):
        emit_ethernet(frame)


@pytest.mark.skipif(not CAPTURES.is_dir(), reason="the captures of real controllers are not here")
def test_every_captured_frame_is_parsed_and_emitted_identically():
    seen = 0
    for path in sorted(CAPTURES.glob("*.pcap")):
        with PcapReader(str(path)) as reader:
            for packet in reader:
                data = bytes(packet.original)
                assert emit_ethernet(parse_ethernet(data)) == data.ljust(60, b"\0")
                seen += 1
    assert seen > 1000
