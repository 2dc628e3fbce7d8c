from ipaddress import IPv4Address

import pytest
from decode_reason import reason
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.l2 import ARP

from pnfarm.errors import DecodeError
from pnfarm.wire.arp import OPERATION_REPLY, OPERATION_REQUEST, ArpPacket, emit_arp, parse_arp

macs = st.binary(min_size=6, max_size=6)
packets = st.builds(ArpPacket, st.integers(0, 0xFFFF), macs, st.ip_addresses(v=4), macs, st.ip_addresses(v=4))


@given(packets, st.binary(max_size=18))
def test_a_packet_survives_the_wire_and_padding(packet, padding):
    assert parse_arp(emit_arp(packet) + padding) == packet


@given(st.binary(max_size=40))
def test_any_octets_give_a_packet_or_a_decode_error(data):
    assert reason(parse_arp, data) in {None, "short", "bad-type"}


def test_scapy_reads_our_request_and_we_read_its_reply():
    ask = ArpPacket(OPERATION_REQUEST, b"\2\0\0\0\0\1", IPv4Address("10.0.0.1"), bytes(6), IPv4Address("10.0.0.2"))
    seen = ARP(emit_arp(ask))
    assert (seen.op, seen.hwsrc, seen.psrc, seen.pdst) == (1, "02:00:00:00:00:01", "10.0.0.1", "10.0.0.2")
    reply = bytes(ARP(op=2, hwsrc="02:00:00:00:00:02", psrc="10.0.0.2", hwdst="02:00:00:00:00:01", pdst="10.0.0.1"))
    assert parse_arp(reply) == ArpPacket(
        OPERATION_REPLY, b"\2\0\0\0\0\2", IPv4Address("10.0.0.2"), b"\2\0\0\0\0\1", IPv4Address("10.0.0.1")
    )


def test_other_hardware_is_refused():
    with pytest.raises(DecodeError, match="bad-type"):
        parse_arp(bytes(ARP(hwtype=6)))


def test_a_mac_of_other_length_is_our_own_mistake():
    with pytest.raises(ValueError):
        emit_arp(ArpPacket(1, b"", IPv4Address(0), bytes(6), IPv4Address(0)))
