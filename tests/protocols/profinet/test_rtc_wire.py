from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scapy.utils import PcapReader

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.frame_id import FrameClass, classify_frame_id
from pnfarm.protocols.profinet.wire.rtc import DataStatus, RtcPdu, emit_rtc, pad_data, parse_rtc
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, parse_ethernet

CAPTURE = Path(__file__).resolve().parents[3].parent / "shared" / "captures" / "dacookie_connectrequest.pcap"

pdus = st.builds(
    RtcPdu,
    frame_id=st.integers(0, 0xFFFF),
    data=st.binary(max_size=100),
    cycle_counter=st.integers(0, 0xFFFF),
    data_status=st.integers(0, 0xFF).map(DataStatus),
    transfer_status=st.integers(0, 0xFF),
)


@given(pdus)
def test_a_cyclic_frame_survives_the_wire(pdu):
    assert parse_rtc(emit_rtc(pdu)) == pdu


@given(st.binary(max_size=60))
def test_any_octets_give_a_cyclic_frame_or_a_decode_error(data):
    try:
        assert emit_rtc(parse_rtc(data)) == data
    except DecodeError:
        assert len(data) < 6


def test_data_are_padded_to_the_shortest_frame():
    assert pad_data(b"abc") == b"abc" + bytes(37)
    assert pad_data(bytes(41)) == bytes(41)


def test_a_healthy_provider_says_0x35():
    octets = emit_rtc(RtcPdu(0x8000, pad_data(b""), 0x1234))
    assert octets[-4:] == b"\x12\x34\x35\x00"


@pytest.mark.skipif(not CAPTURE.is_file(), reason="the captures of real controllers are not here")
def test_cyclic_frames_of_a_real_controller_are_parsed_and_emitted_identically():
    counters = []
    with PcapReader(str(CAPTURE)) as reader:
        for packet in reader:
            frame = parse_ethernet(bytes(packet.original))
            if frame.ethertype != ETHERTYPE_PROFINET:
                continue
            if not classify_frame_id(int.from_bytes(frame.payload[:2], "big")).is_cyclic:
                continue
            pdu = parse_rtc(frame.payload)
            assert emit_rtc(pdu) == frame.payload
            assert pdu.data_status & DataStatus.VALID
            counters.append(pdu.cycle_counter)
    assert len(counters) > 4000


@pytest.mark.parametrize(
    ("frame_id", "frame_class"),
    [
        (0x0020, FrameClass.PTCP),
        (0x00FF, FrameClass.RESERVED),
        (0x0100, FrameClass.RTC3),
        (0x0FFF, FrameClass.RTC3),
        (0x1000, FrameClass.RESERVED),
        (0x7FFF, FrameClass.RESERVED),
        (0x8000, FrameClass.RTC1_UNICAST),
        (0xBBF0, FrameClass.RTC1_UNICAST),
        (0xBBFF, FrameClass.RTC1_UNICAST),
        (0xBC00, FrameClass.RTC1_MULTICAST),
        (0xBFFF, FrameClass.RTC1_MULTICAST),
        (0xC000, FrameClass.RT_UDP_UNICAST),
        (0xF7FF, FrameClass.RT_UDP_UNICAST),
        (0xF800, FrameClass.RT_UDP_MULTICAST),
        (0xFBFF, FrameClass.RT_UDP_MULTICAST),
        (0xFC00, FrameClass.RESERVED),
        (0xFC01, FrameClass.ALARM_HIGH),
        (0xFE01, FrameClass.ALARM_LOW),
        (0xFE02, FrameClass.RSI),
        (0xFEFC, FrameClass.DCP),
        (0xFEFF, FrameClass.DCP),
        (0xFF40, FrameClass.PTCP),
        (0xFF80, FrameClass.FRAGMENT),
        (0xFFFF, FrameClass.RESERVED),
    ],
)
def test_every_frame_id_has_its_protocol(frame_id, frame_class):
    assert classify_frame_id(frame_id) is frame_class


def test_only_process_data_are_cyclic():
    assert classify_frame_id(0x8000).is_cyclic
    assert classify_frame_id(0x0100).is_cyclic
    assert not classify_frame_id(0xFC01).is_cyclic
    assert not classify_frame_id(0xFEFE).is_cyclic
