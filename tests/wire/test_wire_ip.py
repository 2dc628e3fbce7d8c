from functools import partial
from ipaddress import IPv4Address

import pytest
from decode_reason import reason
from hypothesis import given
from hypothesis import strategies as st
from scapy.layers.inet import ICMP, IP, UDP, IPOption_NOP

from pnfarm.errors import DecodeError
from pnfarm.wire.icmp import TYPE_ECHO_REQUEST, IcmpMessage, emit_icmp, parse_icmp
from pnfarm.wire.ipv4 import PROTOCOL_UDP, Ipv4Packet, emit_ipv4, internet_checksum, parse_ipv4
from pnfarm.wire.udp import ChecksumState, UdpDatagram, emit_udp, parse_udp, udp_checksum

A = IPv4Address("10.0.0.1")
B = IPv4Address("10.0.0.2")

octet = st.integers(0, 0xFF)
word = st.integers(0, 0xFFFF)
addresses = st.ip_addresses(v=4)
packets = st.builds(
    Ipv4Packet,
    source=addresses,
    destination=addresses,
    protocol=octet,
    payload=st.binary(max_size=100),
    ttl=octet,
    identification=word,
    dont_fragment=st.booleans(),
    more_fragments=st.booleans(),
    fragment_offset=st.integers(0, 0x1FFF).map(lambda units: units * 8),
    tos=octet,
)


# -- the checksum ------------------------------------------------------------------------------------------------------


def plain_checksum(data: bytes) -> int:
    data += b"\0" * (len(data) % 2)
    total = sum(int.from_bytes(data[i : i + 2], "big") for i in range(0, len(data), 2))
    while total > 0xFFFF:
        total = (total & 0xFFFF) + (total >> 16)
    return total ^ 0xFFFF


@given(st.binary(max_size=200))
def test_the_checksum_is_that_of_rfc_1071(data):
    assert internet_checksum(data) == plain_checksum(data)


def test_the_checksum_of_nothing_and_of_zeros_is_all_ones():
    assert internet_checksum(b"") == internet_checksum(bytes(10)) == 0xFFFF


# -- IPv4 --------------------------------------------------------------------------------------------------------------


@given(packets, st.binary(max_size=20))
def test_a_packet_survives_the_wire_and_padding(packet, padding):
    assert parse_ipv4(emit_ipv4(packet) + padding, verify_checksum=True) == packet


@given(st.binary(max_size=60) | st.binary(min_size=20, max_size=60).map(lambda data: b"\x45\0\0\x18" + data))
def test_any_octets_give_a_packet_or_a_decode_error(data):
    assert reason(partial(parse_ipv4, verify_checksum=True), data) in {
        None,
        "short",
        "bad-version",
        "bad-length",
        "bad-checksum",
    }


def test_scapy_agrees_on_header_and_checksum():
    ours = emit_ipv4(Ipv4Packet(A, B, 17, b"payload!", ttl=3, identification=77, more_fragments=True, tos=0x60))
    assert ours == bytes(IP(src="10.0.0.1", dst="10.0.0.2", proto=17, ttl=3, id=77, flags="MF", tos=0x60) / b"payload!")


def test_options_are_stepped_over():
    data = bytes(IP(src="10.0.0.1", dst="10.0.0.2", proto=17, options=[IPOption_NOP()] * 8) / b"behind")
    packet = parse_ipv4(data, verify_checksum=True)
    assert (packet.source, packet.payload) == (A, b"behind")


def test_a_damaged_header_is_noticed_only_when_asked():
    data = bytearray(emit_ipv4(Ipv4Packet(A, B, 17, b"x")))
    data[8] ^= 0x10
    assert parse_ipv4(data).ttl == 64 ^ 0x10
    with pytest.raises(DecodeError, match="bad-checksum"):
        parse_ipv4(data, verify_checksum=True)


def test_a_total_length_beyond_the_frame_is_short():
    with pytest.raises(DecodeError, match="short"):
        parse_ipv4(emit_ipv4(Ipv4Packet(A, B, 17, b"abcd"))[:-1])


@pytest.mark.parametrize("offset", [4, -8, 0x10000])
def test_an_impossible_offset_is_our_own_mistake(offset):
    with pytest.raises(ValueError):
        emit_ipv4(Ipv4Packet(A, B, 17, b"", fragment_offset=offset))


# -- UDP ---------------------------------------------------------------------------------------------------------------


@given(word, word, st.binary(max_size=100), addresses, addresses)
def test_a_datagram_survives_the_wire(source_port, destination_port, data, source, destination):
    datagram = UdpDatagram(source_port, destination_port, data)
    octets = emit_udp(datagram, source, destination)
    assert parse_udp(octets + b"padding") == datagram
    assert udp_checksum(octets, source, destination) is ChecksumState.GOOD


@given(st.binary(max_size=30))
def test_any_octets_give_a_datagram_or_a_decode_error(data):
    assert reason(parse_udp, data) in {None, "short", "bad-length"}
    assert udp_checksum(data, A, B) in ChecksumState


def test_scapy_agrees_on_the_datagram_and_its_checksum():
    scapys = bytes(IP(src="10.0.0.1", dst="10.0.0.2") / UDP(sport=34964, dport=49152) / b"odd")
    assert emit_udp(UdpDatagram(34964, 49152, b"odd"), A, B) == scapys[20:]


def test_a_checksum_that_a_network_card_was_to_finish_is_distinguished_from_a_damaged_one():
    octets = bytearray(emit_udp(UdpDatagram(1, 2, b"data"), A, B))
    pseudo_header = A.packed + B.packed + bytes([0, PROTOCOL_UDP, 0, 12])
    octets[6:8] = (0xFFFF - internet_checksum(pseudo_header)).to_bytes(2, "big")
    assert udp_checksum(octets, A, B) is ChecksumState.UNFINISHED
    assert parse_udp(octets).data == b"data"
    octets[6:8] = b"\x12\x34"
    assert udp_checksum(octets, A, B) is ChecksumState.BAD
    octets[6:8] = b"\0\0"
    assert udp_checksum(octets, A, B) is ChecksumState.ABSENT


# -- ICMP --------------------------------------------------------------------------------------------------------------


@given(octet, octet, word, word, st.binary(max_size=100))
def test_a_message_survives_the_wire(message_type, code, identifier, sequence, data):
    message = IcmpMessage(message_type, code, identifier, sequence, data)
    assert parse_icmp(emit_icmp(message), verify_checksum=True) == message


@given(st.binary(max_size=30))
def test_any_octets_give_a_message_or_a_decode_error(data):
    assert reason(partial(parse_icmp, verify_checksum=True), data) in {None, "short", "bad-checksum"}


def test_scapy_agrees_on_an_echo_request():
    assert emit_icmp(IcmpMessage(TYPE_ECHO_REQUEST, 0, 7, 9, b"ping")) == bytes(ICMP(type=8, id=7, seq=9) / b"ping")
