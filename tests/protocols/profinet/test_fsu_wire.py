import pytest
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.inet import IP, UDP
from scapy.layers.l2 import Ether
from scapy.utils import wrpcap
from wireshark import tshark_fields

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.records.directory import Index
from pnfarm.protocols.profinet.wire.block import RawBlock
from pnfarm.protocols.profinet.wire.records.fsu import (
    FsHello,
    FsuDataAdjust,
    parse_fsu_data_adjust,
)
from pnfarm.protocols.profinet.wire.records.iod import IodWriteReqHeader, emit_write_request
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    NIL_UUID,
    UUID_PNIO_DEVICE,
    Opnum,
    PacketType,
    RequestArgs,
    RpcPdu,
    emit_request_args,
    emit_rpc,
    object_uuid,
)

u32 = st.integers(0, 0xFFFF_FFFF)
version = st.integers(0, 0xFFFF)
hellos = st.builds(FsHello, u32, u32, u32, u32, version)
others = st.builds(
    RawBlock, st.integers(0, 0xFFFF).filter(lambda kind: kind != 0x0600), st.binary(max_size=20), version
)
RECORD = FsuDataAdjust((FsHello(2, 300, 5, 500),))


@given(st.builds(FsuDataAdjust, st.lists(hellos | others, max_size=4).map(tuple), version))
def test_a_record_survives_the_wire(record):
    assert parse_fsu_data_adjust(record.emit()) == record


@given(st.binary(max_size=80) | st.binary(max_size=40).map(lambda data: b"\x06\x08\0\x24\1\0\0\0\6\0\0\x14" + data))
def test_any_octets_give_a_record_or_a_decode_error(data):
    try:
        record = parse_fsu_data_adjust(data)
    except DecodeError:
        return
    assert parse_fsu_data_adjust(record.emit()) == record


def test_the_first_hello_block_counts_and_other_blocks_are_kept():
    fast = RawBlock(0x0602, b"\0\0")
    record = FsuDataAdjust((fast, FsHello(1, 30, 3, 0), FsHello(0, 30, 3, 0)))
    read = parse_fsu_data_adjust(record.emit())
    assert read.hello == FsHello(1, 30, 3, 0)
    assert read.blocks[0] == fast
    assert FsuDataAdjust((fast,)).hello is None


@pytest.mark.parametrize(
    ("octets", "reason"),
    [
        ("", "bad-length"),
        ("0608 0004 0100 0000 0608 0004 0100 0000", "bad-length"),
        ("0607 0004 0100 0000", "bad-type"),
        ("0608 0002 0100", "short"),
        ("0608 0006 0100 0000 0600", "short"),
        ("0608 000c 0100 0000 0600 0004 0100 0000", "short"),
    ],
)
def test_a_broken_record_is_refused_with_the_reason(octets, reason):
    with pytest.raises(DecodeError) as caught:
        parse_fsu_data_adjust(bytes.fromhex(octets))
    assert caught.value.reason == reason


def test_wireshark_reads_the_record_as_we_mean_it(tmp_path):
    data = RECORD.emit()
    header = IodWriteReqHeader(1, NIL_UUID, 0, 0, 0x8000, Index.INTERFACE_FSU_DATA_ADJUST)
    args = emit_request_args(RequestArgs(4096, emit_write_request(header, data)), little_endian=True)
    pdu = RpcPdu(
        PacketType.REQUEST, UUID_PNIO_DEVICE, object_uuid(4, 5, 6), object_uuid(1, 2, 3), opnum=Opnum.WRITE, body=args
    )
    wrpcap(str(tmp_path / "one.pcap"), Ether() / IP(dst="10.0.0.1") / UDP(sport=49152, dport=34964) / emit_rpc(pdu))
    hello = [f"pn_io.fs_hello_{name}" for name in ("mode", "interval", "retry", "delay")]
    # a lone datagram of type 4 could be WireGuard's as well
    alone = ("--disable-protocol", "wg")
    (row,) = tshark_fields(tmp_path / "one.pcap", *hello, "_ws.malformed", "_ws.expert.message", options=alone)
    assert [int(value, 0) for value in row[:4]] == [2, 300, 5, 500]
    assert row[4:] == ["", ""]
