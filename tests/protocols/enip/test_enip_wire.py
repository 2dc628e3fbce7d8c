"""The codecs of EtherNet/IP and CIP: known octets, round trips, and any octets."""

from ipaddress import IPv4Address

import enip_strategies as anything
import pytest
from decode_reason import reason
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import DecodeError
from pnfarm.protocols.enip.status import status_text
from pnfarm.protocols.enip.wire import class1, cpf, data_types, encapsulation, epath, message
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire.epath import Logical, LogicalSegment
from pnfarm.protocols.enip.wire.identity import IdentityItem, ServiceItem

PAIRS = {
    "encapsulation": (
        encapsulation.parse_encapsulation,
        encapsulation.emit_encapsulation,
        st.builds(
            encapsulation.EncapsulationPdu, anything.u16, anything.octets, anything.u32, anything.u32,
            st.binary(min_size=8, max_size=8), anything.u32,
        ),
    ),
    "register": (
        encapsulation.RegisterSession.parse,
        encapsulation.RegisterSession.emit,
        st.builds(encapsulation.RegisterSession, anything.u16, anything.u16),
    ),
    "items": (cpf.parse_items, cpf.emit_items, st.lists(anything.items, max_size=5).map(tuple)),
    "packet": (cpf.CommonPacket.parse, cpf.CommonPacket.emit, anything.packets),
    "epath": (epath.parse_epath, epath.emit_epath, anything.paths),
    "request": (message.parse_request, message.MessageRequest.emit, anything.requests),
    "reply": (message.parse_reply, message.MessageReply.emit, anything.replies),
    "several": (
        message.parse_multiple_service,
        message.emit_multiple_service,
        st.lists(st.binary(min_size=1, max_size=30), max_size=8).map(tuple),
    ),
    "open-reply": (fo.ForwardOpenReply.parse, fo.ForwardOpenReply.emit, anything.forward_open_replies),
    "refusal": (fo.ForwardRefusal.parse, fo.ForwardRefusal.emit, anything.forward_refusals),
    "close": (fo.ForwardClose.parse, fo.ForwardClose.emit, anything.forward_closes),
    "close-reply": (fo.ForwardCloseReply.parse, fo.ForwardCloseReply.emit, anything.forward_close_replies),
    "unconnected-send": (fo.UnconnectedSend.parse, fo.UnconnectedSend.emit, anything.unconnected_sends),
}  # fmt: skip


@pytest.mark.parametrize("name", PAIRS)
@given(data=st.data())
def test_what_is_built_can_be_sent_and_read_again(name, data):
    parse, emit, values = PAIRS[name]
    value = data.draw(values)
    assert parse(emit(value)) == value


@given(anything.forward_opens)
def test_a_forward_open_of_either_size_can_be_sent_and_read_again(value):
    assert fo.parse_forward_open(fo.emit_forward_open(value), value.large) == value


PARSERS = {
    **{name: parse for name, (parse, _, _) in PAIRS.items()},
    "open": fo.parse_forward_open,
    "large-open": lambda data: fo.parse_forward_open(data, large=True),
    "header": encapsulation.parse_header,
    "socket": cpf.SocketAddress.parse,
    "class1": class1.parse_class1,
    "class1-header": lambda data: class1.parse_class1(data, header=True),
    **{f"type-{kind.name}": kind.parse for kind in data_types.TYPES.values()},
}


@pytest.mark.parametrize("name", PARSERS)
@given(data=st.binary(max_size=200))
def test_any_octets_give_a_value_or_a_decode_error(name, data):
    assert reason(PARSERS[name], data) != ""


@pytest.mark.parametrize("name", [name for name in PAIRS if name not in {"request", "reply", "epath"}])
@given(data=st.data())
def test_a_cut_message_is_a_decode_error(name, data):
    parse, emit, values = PAIRS[name]
    octets = emit(data.draw(values))
    cut = octets[: data.draw(st.integers(0, len(octets) - 1))]
    if name == "several":  # offsets fit, the last message may be any length: count and offsets may not be cut
        cut = cut[: 2 * int.from_bytes(octets[:2], "little") + 1]
        if octets == b"\0\0":
            cut = b"\0"
    with pytest.raises(DecodeError):
        parse(cut)


# Known octets


def test_register_session_is_the_standards_28_octets():
    pdu = encapsulation.EncapsulationPdu(encapsulation.Command.REGISTER_SESSION, encapsulation.RegisterSession().emit())
    expected = "65 00 04 00 00000000 00000000 0000000000000000 00000000 01 00 00 00"
    assert encapsulation.emit_encapsulation(pdu) == bytes.fromhex(expected)


def test_a_length_other_than_the_datas_is_told():
    octets = bytes.fromhex("6300 0100 00000000 00000000 0000000000000000 00000000")
    assert reason(encapsulation.parse_encapsulation, octets) == "bad-length"
    assert encapsulation.parse_header(octets).length == 1


def test_the_path_of_a_parameter_has_8_bit_and_16_bit_segments():
    path = epath.logical_path(0x0F, 470, 1)
    assert epath.emit_epath(path) == bytes.fromhex("200f 2500d601 3001")
    widths = [segment.width for segment in epath.parse_epath(bytes.fromhex("200f 2500d601 3001"))]
    assert widths == [1, 2, 1]


def test_the_connection_path_of_the_manuals_assemblies():
    key = epath.ElectronicKey()
    octets = bytes.fromhex("3404 0000 0000 0000 00 00 2004 2464 2c65 2c66 8001 1234")
    path = (
        key,
        LogicalSegment(Logical.CLASS, 4, 1),
        LogicalSegment(Logical.INSTANCE, 100, 1),
        LogicalSegment(Logical.CONNECTION_POINT, 101, 1),
        LogicalSegment(Logical.CONNECTION_POINT, 102, 1),
        epath.DataSegment(b"\x12\x34"),
    )
    assert epath.parse_epath(octets) == path
    assert epath.emit_epath(path) == octets


@pytest.mark.parametrize("octets", ["3405" + 8 * "00", "2300", "3900", "e000", "a200", "6000", "0001"])
def test_a_segment_of_unknown_form_ends_the_path(octets):
    assert reason(epath.parse_epath, bytes.fromhex(octets)) == "bad-segment"


def test_a_long_link_address_is_padded_and_counted():
    segment = epath.PortSegment(2, b"10.0.0.1x")
    assert epath.emit_epath([segment]) == b"\x12\x0910.0.0.1x\0"
    assert epath.emit_epath([epath.PortSegment(20, b"\x05")]) == bytes.fromhex("0f 1400 05")


def test_network_parameters_are_the_standards_bits():
    assert fo.NetworkParameters.from_int(0x4846, large=False) == fo.NetworkParameters(70, 2, 2)
    assert fo.NetworkParameters(66, fo.ConnectionType.MULTICAST, 2).to_int(large=False) == 0x2842
    assert fo.NetworkParameters(1400, 2, 0, variable=True).to_int(large=True) == 0x42000578
    with pytest.raises(ValueError, match="Large_Forward_Open"):
        fo.NetworkParameters(512).to_int(large=False)


def test_a_forward_open_of_class_1_is_these_octets():
    value = fo.ForwardOpen(
        fo.Triad(0x1234, 0x004D, 0xDEADBEEF), 0, 0x80FE0001, 10_000, fo.NetworkParameters(70), 10_000,
        fo.NetworkParameters(66, fo.ConnectionType.MULTICAST), fo.TransportClass(1),
        bytes.fromhex("200424642c652c66"), timeout_multiplier=2,
    )  # fmt: skip
    assert fo.emit_forward_open(value) == bytes.fromhex(
        "0a 0e 00000000 0100fe80 3412 4d00 efbeadde 02 000000 10270000 4648 10270000 4228 01 04 200424642c652c66"
    )


def test_transport_class_3_with_the_server_bit_is_a3():
    assert int(fo.TransportClass(3, 2, server=True)) == 0xA3
    assert fo.TransportClass.from_int(0xA3) == fo.TransportClass(3, 2, server=True)


def test_a_socket_address_is_in_network_order():
    item = cpf.SocketAddress(o_to_t=False, port=2222, address=IPv4Address("239.192.1.32"))
    assert cpf.emit_items((item,)) == bytes.fromhex("0100 0180 1000 0002 08ae efc00120 0000000000000000")


def test_an_identity_item_is_these_octets():
    item = IdentityItem(IPv4Address("10.0.0.2"), 452, 43, 7, (1, 13), 0x30, 0xC0FFEE, b"AKD", 3)
    assert cpf.emit_items((item,)) == bytes.fromhex(
        "0100 0c00 2500 0100 0002 af12 0a000002 0000000000000000 c401 2b00 0700 010d 3000 eeffc000 03414b44 03"
    )
    assert cpf.emit_items((ServiceItem(),))[6:] == bytes.fromhex("0100 2001") + b"Communications\0\0"


def test_items_of_known_types_with_wrong_lengths_are_refused_and_unknown_ones_kept():
    assert reason(cpf.parse_items, bytes.fromhex("0100 0000 0100 00")) == "trailing"
    assert reason(cpf.parse_items, bytes.fromhex("0100 a100 0300 000000")) == "short"
    assert reason(cpf.parse_items, bytes.fromhex("0100 0180 0f00") + bytes(15)) == "bad-length"
    assert cpf.parse_items(bytes.fromhex("0100 8600 0100 aa")) == (cpf.UnknownItem(0x86, b"\xaa"),)


def test_a_multiple_service_packet_with_falling_or_outside_offsets_is_refused():
    for octets in ("0200 0700 0600 0101", "0200 0600 0900 0101", "0100 0200 01", "0100 0400"):
        assert reason(message.parse_multiple_service, bytes.fromhex(octets)) == "bad-length"


def test_requests_and_replies_are_told_apart():
    assert reason(message.parse_request, b"\x8e\0") == "bad-type"
    assert reason(message.parse_reply, b"\x0e\0\0\0") == "bad-type"
    refusal = message.MessageReply(0x54, 1, (0x127, 70), b"")
    assert refusal.emit() == bytes.fromhex("d4 00 01 02 2701 4600")


def test_a_class_1_datagram_has_sequence_count_and_run_idle_header():
    pdu = class1.Class1Pdu(0x80FE0001, 7, 3, b"\xaa\xbb", header=1)
    octets = bytes.fromhex("0200 0280 0800 0100fe80 07000000 b100 0800 0300 01000000 aabb")
    assert class1.emit_class1(pdu) == octets
    assert class1.parse_class1(octets, header=True) == pdu
    assert pdu.run
    assert not class1.Class1Pdu(1, 1, 1, b"", header=0).run
    assert class1.parse_class1(octets).data == bytes.fromhex("01000000aabb")


@pytest.mark.parametrize("kind", data_types.TYPES.values(), ids=lambda kind: kind.name)
def test_a_value_of_each_type_is_read_as_it_was_written(kind):
    values = {None: b"abcd", 1: 1, 2: 0x1234 >> 1, 4: 77, 8: 78}
    value = True if kind.name == "BOOL" else values[kind.size]
    assert kind.parse(kind.emit(value)) == value
    with pytest.raises(ValueError, match=kind.name):
        kind.emit(b"text" if kind.size else 5)


def test_a_status_is_told_in_words():
    assert status_text(0x14) == "attribute not supported"
    assert status_text(0x01, (0x0127, 70)) == "connection failure: o to t size (0x0127)"
    assert status_text(0xF0, (3,)) == "status 0xF0 (0x0003)"
