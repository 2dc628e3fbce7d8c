"""PTCP frames: as captured, round and round, and as Wireshark reads them."""

from uuid import UUID

import pytest
from hypothesis import given
from hypothesis import strategies as st
from wireshark import tshark_fields

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.frame_id import FrameClass, classify_frame_id
from pnfarm.protocols.profinet.wire.ptcp import PTCP_NAMES, PtcpPdu, PtcpTlv, TlvType, emit_ptcp, parse_ptcp

#: A port's request, as a device of GE sent it.
CAPTURED = bytes.fromhex("ff40" + "00" * 12 + "001c 0000 00000000 0c06 00099143e068 0000") + bytes(16)
SUBDOMAIN = bytes.fromhex("020000000001") + UUID(int=7).bytes

tlvs = st.builds(PtcpTlv, st.integers(1, 0x7F), st.binary(max_size=60))
pdus = st.builds(
    PtcpPdu, st.sampled_from(sorted(PTCP_NAMES)), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF),
    st.lists(tlvs, max_size=4).map(tuple), st.binary(min_size=12, max_size=12), st.binary(min_size=2, max_size=2),
)  # fmt: skip


def test_a_captured_request_for_the_delay_of_a_cable():
    pdu = parse_ptcp(CAPTURED)
    assert (pdu.frame_id, pdu.sequence, pdu.delay_ns) == (0xFF40, 28, 0)
    assert pdu.port_mac == bytes.fromhex("00099143e068")
    assert pdu.master is pdu.subdomain is None
    assert emit_ptcp(pdu) == CAPTURED[: len(CAPTURED) - 16]


@given(pdus, st.binary(max_size=20))
def test_a_frame_survives_the_wire_and_the_padding_after_it(pdu, padding):
    assert parse_ptcp(emit_ptcp(pdu) + padding) == pdu


def test_a_missing_end_is_forgiven():
    pdu = PtcpPdu(0xFF00, 1, tlvs=(PtcpTlv(TlvType.SUBDOMAIN, SUBDOMAIN),))
    assert parse_ptcp(emit_ptcp(pdu)[:-2]) == pdu


@pytest.mark.parametrize(
    ("octets", "reason"),
    [
        (b"", "short"),
        (b"\xff", "short"),
        (CAPTURED[:20], "short"),
        (CAPTURED[:26], "short"),
        (b"\x80\x00" + bytes(40), "bad-type"),
    ],
)
def test_malformed_frames_are_refused(octets, reason):
    with pytest.raises(DecodeError) as caught:
        parse_ptcp(octets)
    assert caught.value.reason == reason


def test_a_tlv_that_does_not_fit_is_refused():
    for tlv in (PtcpTlv(0), PtcpTlv(0x80), PtcpTlv(1, bytes(512))):
        with pytest.raises(ValueError, match="does not fit"):
            emit_ptcp(PtcpPdu(0xFF40, 1, tlvs=(tlv,)))


def test_short_tlvs_name_no_station():
    pdu = PtcpPdu(0x0080, 1, tlvs=(PtcpTlv(TlvType.SUBDOMAIN, b"\x02"), PtcpTlv(TlvType.DELAY_PARAMETER, b"\x02")))
    assert pdu.master is pdu.subdomain is pdu.port_mac is None


def test_every_frame_id_of_ptcp_has_a_name():
    assert {i for i in range(0x10000) if classify_frame_id(i) is FrameClass.PTCP} == set(PTCP_NAMES)


def test_wireshark_reads_the_same(tmp_path):
    from scapy.layers.l2 import Ether
    from scapy.utils import wrpcap

    tlv = PtcpTlv(TlvType.SUBDOMAIN, SUBDOMAIN)
    sent = [PtcpPdu(frame_id, 100 + n, tlvs=(tlv,)) for n, frame_id in enumerate(PTCP_NAMES)]
    head = bytes.fromhex("010ecf000400 020000000009 8892")
    path = tmp_path / "ptcp.pcap"
    wrpcap(str(path), [Ether((head + emit_ptcp(pdu)).ljust(60, b"\0")) for pdu in sent])
    fields = ["pn_rt.frame_id", "pn_ptcp.sequence_id", "pn_ptcp.master_source_address", "pn_ptcp.subdomain_uuid"]
    assert tshark_fields(path, *fields) == [
        [str(pdu.frame_id), str(pdu.sequence), pdu.master.hex(":"), str(pdu.subdomain)] for pdu in sent
    ]
