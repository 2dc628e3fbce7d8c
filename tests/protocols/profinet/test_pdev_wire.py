from ipaddress import IPv4Address
from uuid import UUID

import pytest
from cm_support import CAPTURE_NAMES, calls
from hypothesis import given, settings
from hypothesis import strategies as st
from wireshark import tshark

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.any_block import parse_block
from pnfarm.protocols.profinet.wire.block import Block, RawBlock, split_blocks
from pnfarm.protocols.profinet.wire.records import iod
from pnfarm.protocols.profinet.wire.records import pdev as p
from pnfarm.protocols.profinet.wire.records import pdev_port as b
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    OK,
    RPC_PORT,
    UUID_PNIO_DEVICE,
    PacketType,
    ResponseArgs,
    RpcPdu,
    emit_response_args,
    emit_rpc,
)

u8, u16, u32 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)
mac = st.binary(min_size=6, max_size=6)
name = st.binary(max_size=60)
ip = u32.map(IPv4Address)


def many(strategy, maximum=3):
    return st.lists(strategy, max_size=maximum).map(tuple)


subs = st.one_of(
    st.builds(b.CheckPeers, many(st.builds(b.ExpectedPeer, name, name))),
    st.builds(b.CheckLineDelay, u32),
    st.builds(b.CheckMauType, u16),
    st.builds(b.CheckLinkState, u8, u8),
    st.builds(b.CheckSyncDifference, u16),
    st.builds(b.CheckMauTypeDifference, u16),
    st.builds(b.AdjustDomainBoundary, u32, st.none() | u32, u16),
    st.builds(b.AdjustMulticastBoundary, u32, u16),
    st.builds(b.AdjustMauType, u16, u16),
    st.builds(b.AdjustLinkState, u8, u8, u16),
    st.builds(b.AdjustPeerToPeerBoundary, u32, u16),
    st.builds(b.AdjustDcpBoundary, u32, u16),
    st.builds(b.AdjustPreambleLength, u16, u16),
    st.builds(RawBlock, st.integers(0x4000, 0x7FFF), name, u16),
)
raws = st.builds(RawBlock, st.integers(0x4000, 0x7FFF), name, u16)
BLOCKS = {
    "port-real": st.builds(
        p.PortDataReal, u16, u16, name, many(st.builds(p.PeerReal, name, name, u32, mac)),
        u16, u32, u32, u8, u8, u32, u16,
    ),
    "interface-real": st.builds(p.InterfaceDataReal, name, mac, ip, ip, ip, u16),
    "statistic": st.builds(p.PortStatistic, u32, u32, u32, u32, u32, u32),
    "statistic-1.1": st.builds(p.PortStatistic, u32, u32, u32, u32, u32, u32, u16, st.just(0x0101)),
    "check": st.builds(p.PortDataCheck, u16, u16, many(subs), u16),
    "adjust": st.builds(p.PortDataAdjust, u16, u16, many(subs), u16),
    "interface-adjust": st.builds(p.InterfaceAdjust, u32, u16),
    "multiple": st.builds(p.MultipleBlock, u32, u16, u16, many(raws), u16),
}  # fmt: skip


@pytest.mark.parametrize("kind", BLOCKS)
def test_what_is_emitted_is_parsed_back(kind):
    @settings(max_examples=60)
    @given(BLOCKS[kind])
    def run(value):
        (raw,) = split_blocks(value.emit())
        assert parse_block(raw) == value

    run()


#: Types of the blocks of the physical device.
PDEV_BLOCKS = {block_type for block_type, kind in Block.KINDS.items() if kind.__module__ == p.__name__}


@given(st.sampled_from(sorted(PDEV_BLOCKS)), st.binary(max_size=200), u16)
def test_any_octets_are_a_value_or_a_decode_error(kind, body, version):
    try:
        value = parse_block(RawBlock(kind, body, version))
    except DecodeError:
        return
    (raw,) = split_blocks(value.emit())
    assert parse_block(raw) == value


def wrapped(*subs_octets):
    """PDPortDataCheck of 0/0x8001 with sub-blocks as they are."""
    return RawBlock(0x0200, bytes.fromhex("0000 0000 8001") + b"".join(subs_octets))


PEERS = b.CheckPeers((b.ExpectedPeer(b"port-001", b"switch-1"),))
#: CheckPeers as p-net writes it: its length ends with the last name, the padding lies behind it.
UNPADDED = bytes.fromhex("020a 0015 0100 01 08") + b"port-001\x08switch-1"


def test_padding_may_be_inside_or_after_a_block_or_be_missing():
    mau = bytes.fromhex("020c 0004 0100 0010")
    inside = UNPADDED[:3] + bytes([0x16]) + UNPADDED[4:] + b"\0"
    assert len(UNPADDED) == 25
    for octets in (UNPADDED + b"\0\0\0" + mau, UNPADDED + mau, inside + mau, inside + b"\0\0" + mau, mau + UNPADDED):
        assert set(p.PortDataCheck.of(wrapped(octets)).blocks) == {PEERS, b.CheckMauType(0x10)}


@pytest.mark.parametrize("filler", [b"\x0f", b"\x02", b"\xff"])
def test_padding_may_hold_anything(filler):
    mau = bytes.fromhex("020c 0004 0100 0010")
    inside = UNPADDED[:3] + bytes([0x16]) + UNPADDED[4:] + filler
    wide = bytes.fromhex("020c 0006 0100 0010") + filler * 2 + filler * 2
    behind = UNPADDED + filler * 3
    for octets in (behind + mau, inside + filler * 2 + mau, wide + behind, mau + behind, wide + inside + filler * 2):
        assert set(p.PortDataCheck.of(wrapped(octets)).blocks) == {PEERS, b.CheckMauType(0x10)}


def test_every_block_ends_on_four_octets():
    for sub in (
        PEERS,
        b.CheckMauType(16),
        b.CheckLineDelay(1),
        b.AdjustPeerToPeerBoundary(1),
        b.AdjustDomainBoundary(1, 2),
    ):
        kind = p.PortDataCheck(0, 0x8001, (sub, b.CheckMauType(1)))
        assert len(kind.emit()) % 4 == 0


@pytest.mark.parametrize(
    ("octets", "reason"),
    [
        (b"\x02\x0a\x00", "short"),
        (bytes.fromhex("020a 0010 0100 01"), "short"),
        (bytes.fromhex("020a 0001 0100 01"), "bad-length"),
        (bytes.fromhex("020a 0008 0100 01 ff 70 6f 72 74"), "short"),
        (bytes.fromhex("020c 0008 0100 0010 00000000"), "trailing"),
    ],
)
def test_a_check_of_the_wrong_shape_is_refused(octets, reason):
    with pytest.raises(DecodeError) as caught:
        p.PortDataCheck.of(wrapped(octets))
    assert caught.value.reason == reason


@pytest.mark.parametrize("capture", CAPTURE_NAMES[1:])
def test_what_real_controllers_write_is_reemitted_octet_for_octet(capture):
    seen = []
    for call in calls(capture):
        if call.opnum == 3 and call.request:
            for write in iod.parse_write_request(call.payload).writes:
                if write.header.index in {0x802B, 0x802F, 0x8071}:
                    (raw,) = split_blocks(write.data)
                    value = parse_block(raw)
                    assert value.emit() == write.data
                    seen.append(value)
    assert seen == [p.InterfaceAdjust(1)]


# -- an independent dissector


def dissected(tmp_path, records):
    """What tshark says of read answers with these (index, subslot, octets)."""
    from scapy.layers.inet import IP, UDP
    from scapy.layers.l2 import Ether
    from scapy.utils import wrpcap

    packets = []
    for number, (index, subslot, octets) in enumerate(records):
        header = iod.IodReadResHeader(number, UUID(int=0), 0, 0, subslot, index, len(octets))
        payload = iod.emit_read_response(header, octets)
        args = emit_response_args(ResponseArgs(OK, payload, 4096), little_endian=False)
        answer = RpcPdu(
            PacketType.RESPONSE, UUID_PNIO_DEVICE, UUID(int=number + 1), sequence=number, opnum=5, body=args
        )
        ends = {"src": "10.0.0.1", "dst": "10.0.0.2"}
        packets.append(Ether() / IP(**ends) / UDP(sport=RPC_PORT, dport=40000) / emit_rpc(answer))
    path = tmp_path / "pdev.pcap"
    wrpcap(str(path), packets)
    text = tshark(path, "-V")
    assert "Malformed" not in text
    assert "Expert Info (Warn" not in text
    assert "Expert Info (Error" not in text
    assert "Undecoded" not in text
    return text


def test_a_dissector_reads_what_is(tmp_path):
    port = p.PortDataReal(
        0, 0x8001, b"port-001", (p.PeerReal(b"port-003", b"switch", 0, bytes.fromhex("02aabbccddee")),), 0x10
    )
    interface = p.InterfaceDataReal(
        b"axis-1", bytes(range(6)), IPv4Address("10.77.0.11"), IPv4Address("255.255.255.0"), IPv4Address("10.77.0.1")
    )
    statistic = p.PortStatistic(1, 2, 3, 4, 5, 6)
    partial = p.PortStatistic(1, 2, 3, 4, 5, 6, 0x3F, 0x0101)
    real = [port.emit(), interface.emit(), statistic.emit()]
    both = p.MultipleBlock(0, 0, 0x8001, tuple(b for octets in (real[0], real[2]) for b in split_blocks(octets)))
    text = dissected(
        tmp_path,
        [
            (0x802A, 0x8001, real[0]),
            (0x8080, 0x8000, real[1]),
            (0x8072, 0x8001, real[2]),
            (0x8072, 0x8001, partial.emit()),
            (0xF841, 0, both.emit() * 2),
        ],
    )
    assert text.count("PeerChassisID: switch") == 3
    assert text.count("PeerPortID: port-003") == 3
    assert text.count("MAUType: 100BASETXFD (0x0010)") == 3
    assert text.count("LinkState.Link: up (0x01)") == 3
    assert text.count("MediaType: Copper cable (0x00000001)") == 3
    assert ": axis-1\n" in text
    assert "StandardGateway: 10.77.0.1" in text
    assert text.count("ifOutErrors: 0x00000006") == 4


def test_a_dissector_reads_what_is_wanted(tmp_path):
    checks = (PEERS, b.CheckLineDelay(70), b.CheckMauType(0x10), b.CheckLinkState(0, 1), b.CheckSyncDifference(3),
              b.CheckMauTypeDifference(1))  # fmt: skip
    adjusts = (b.AdjustDomainBoundary(1), b.AdjustDomainBoundary(1, 2), b.AdjustMulticastBoundary(3),
               b.AdjustMauType(0x10), b.AdjustLinkState(0, 1), b.AdjustPeerToPeerBoundary(1), b.AdjustDcpBoundary(1),
               b.AdjustPreambleLength(1))  # fmt: skip
    text = dissected(
        tmp_path,
        [
            *[(0x802B, 0x8001, p.PortDataCheck(0, 0x8001, (check,)).emit()) for check in checks],
            *[(0x802F, 0x8001, p.PortDataAdjust(0, 0x8001, (adjust,)).emit()) for adjust in adjusts],
            (0x802B, 0x8001, p.PortDataCheck(0, 0x8001, checks).emit()),
            (0x802F, 0x8001, p.PortDataAdjust(0, 0x8001, adjusts).emit()),
            (0x8071, 0x8000, p.InterfaceAdjust(1).emit()),
        ],
    )
    for words in (
        "CheckPeers: NumberOfPeers:1",
        "CheckLineDelay: LineDelay:70ns",
        "MAUType:100BASETXFD",
        "SyncMaster:1, CableDelay:1",
        "MAUTypeMode:ON",
        "Boundary:0x1",
        "BoundaryIngress:0x1, BoundaryEgress:0x2",
        "PeerPortID: port-001",
        "PeerChassisID: switch-1",
    ):
        assert text.count(words) >= 2, words
    assert "PortID of LLDP contains name of port and NameOfStation" in text
