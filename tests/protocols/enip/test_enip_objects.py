"""The Message Router and the standard objects, asked over a session."""

import pytest
from enip_bench import Bench
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.enip.wire import message
from pnfarm.protocols.enip.wire.epath import Logical, LogicalSegment, PortSegment, emit_epath, logical_path
from pnfarm.protocols.enip.wire.forward_open import UnconnectedSend


@pytest.fixture
def bench():
    return Bench()


@pytest.fixture
def ask(bench):
    session = bench.register()
    return lambda service, path, data=b"": bench.request(session, service, path, data)


def test_a_value_is_read_and_written_by_number(bench, ask):
    assert ask(0x0E, logical_path(0x0F, 1, 1)).data == (77).to_bytes(4, "little")
    assert ask(0x10, logical_path(0x0F, 1, 1), (500).to_bytes(4, "little")).status == 0
    assert bench.numbers[1] == 500


@pytest.mark.parametrize(
    ("service", "path", "data", "status"),
    [
        (0x0E, logical_path(0x77, 1, 1), b"", 0x16),
        (0x0E, logical_path(0x0F, 99, 1), b"", 0x05),
        (0x0E, logical_path(0x0F, 1, 9), b"", 0x14),
        (0x10, logical_path(0x0F, 1, 9), b"\0", 0x14),
        (0x10, logical_path(0x01, 1, 1), b"\0\0", 0x0E),
        (0x10, logical_path(0x0F, 1, 1), b"\x10\x27\0\0", 0x09),
        (0x10, logical_path(0x0F, 1, 1), b"\0\0", 0x13),
        (0x10, logical_path(0x0F, 1, 1), bytes(5), 0x15),
        (0x0E, logical_path(0x0F, 1, 1), b"\0", 0x15),
        (0x4B, logical_path(0x0F, 1), b"", 0x08),
        (0x05, logical_path(0x0F, 1), b"", 0x08),
        (0x0E, logical_path(0x0F, 1), b"", 0x04),
        (0x0E, (LogicalSegment(Logical.INSTANCE, 1),), b"", 0x04),
        (0x0E, (PortSegment(1, b"\0"),), b"", 0x04),
        (0x03, logical_path(0x01, 1), b"\2\0\1\0", 0x13),
        (0x03, logical_path(0x01, 1), b"\1\0\1\0\0", 0x15),
        (0x0A, logical_path(0x02, 1), b"\1\0\x09\0", 0x13),
    ],
)
def test_each_error_has_its_general_status(ask, service, path, data, status):
    reply = ask(service, path, data)
    assert (reply.service, reply.status, reply.data) == (service, status, b"")


def test_a_path_longer_than_the_message_and_one_that_cannot_be_read_are_told(bench):
    session = bench.register()
    assert bench.unconnected(session, b"\x0e\x09\x20\x01")[0].status == 0x26
    assert bench.unconnected(session, b"\x0e\x01\xff\x01")[0].status == 0x04


def test_a_connection_point_is_an_instance_of_assemblies_alone(bench):
    session = bench.register()
    assembly, identity = (bytes.fromhex(text) for text in ("0e03 2004 2c66 3003", "0e03 2001 2c01 3001"))
    assert bench.unconnected(session, assembly)[0].data == bytes(range(64))
    assert bench.unconnected(session, identity)[0].status == 0x04


def test_the_identity_is_read_as_a_whole_and_as_a_list(ask):
    whole = ask(0x01, logical_path(1, 1)).data
    assert whole == bytes.fromhex("c401 2b00 0700 010d 0000 eeffc000 03") + b"AKD"
    listed = ask(0x03, logical_path(1, 1), b"\2\0\1\0\7\0")
    assert (listed.status, listed.data) == (0, bytes.fromhex("0200 0100 0000 c401 0700 0000 03") + b"AKD")
    partly = ask(0x03, logical_path(1, 1), b"\2\0\x63\0\1\0")
    assert (partly.status, partly.data) == (0x0A, bytes.fromhex("0200 6300 1400 0100 0000 c401"))


def test_reset_reaches_the_drive_with_its_type(bench, ask):
    assert [ask(0x05, logical_path(1, 1), data).status for data in (b"", b"\1", b"\7", b"\0\0")] == [0, 0, 0x20, 0x15]
    assert bench.resets == [0, 1]


def test_the_router_lists_the_classes(ask):
    data = ask(0x0E, logical_path(2, 1, 1)).data
    classes = [int.from_bytes(data[place : place + 2], "little") for place in range(2, len(data), 2)]
    assert classes == [0x01, 0x02, 0x04, 0x06, 0x0F, 0x48, 0xF5, 0xF6]
    assert int.from_bytes(data[:2], "little") == 8


def test_assemblies_have_data_and_size(ask):
    assert ask(0x0E, logical_path(4, 102, 3)).data == bytes(range(64))
    assert [ask(0x0E, logical_path(4, n, 4)).data for n in (100, 101, 102)] == [b"\0\0", b"\x40\0", b"\x40\0"]
    assert ask(0x10, logical_path(4, 101, 3), bytes(64)).status == 0x0E


def test_the_tcp_ip_object_tells_address_link_name_and_multicast(ask):
    assert ask(0x0E, logical_path(0xF5, 1, 5)).data == bytes.fromhex(
        "0b004d0a 00ffffff 00000000 00000000 00000000 0000"
    )
    assert ask(0x0E, logical_path(0xF5, 1, 4)).data == bytes.fromhex("0200 20f6 2401")
    assert ask(0x0E, logical_path(0xF5, 1, 6)).data == b"\x07\0axis-01\0"
    # host 11 of a /24: 32 * 10 above 239.192.1.0
    assert ask(0x0E, logical_path(0xF5, 1, 9)).data == bytes.fromhex("0000 0100 4002c0ef")
    assert ask(0x01, logical_path(0xF5, 1)).status == 0


def test_the_inactivity_timeout_is_written_within_its_range(bench, ask):
    path = logical_path(0xF5, 1, 13)
    assert ask(0x0E, path).data == b"\x78\0"
    assert ask(0x10, path, b"\x0a\0").status == 0
    assert ask(0x10, path, b"\xff\xff").status == 0x09
    assert bench.drive.data.tcp_ip.inactivity_timeout_s == 10


def test_every_write_that_a_device_keeps_is_told(bench, ask):
    told = []
    data = bench.drive.data
    data.tcp_ip.changed = data.qos.changed = lambda: told.append(1) is None
    assert ask(0x10, logical_path(0xF5, 1, 13), b"\x0a\0").status == 0
    assert ask(0x10, logical_path(0xF5, 1, 10), b"\0").status == 0
    assert ask(0x10, logical_path(0x48, 1, 5), b"\x21").status == 0
    assert len(told) == 3
    assert ask(0x10, logical_path(0x48, 1, 5), b"\x40").status == 0x09
    assert len(told) == 3
    assert (data.tcp_ip.conflict_detection, data.qos.dscp[5]) == (False, 0x21)


def test_a_list_of_attributes_is_written_and_answered_one_by_one(ask):
    data = bytes.fromhex("0300 0400 0100 0500 ff 0900 00")
    reply = ask(0x04, logical_path(0x48, 1), data[:-3].replace(b"\3\0\4\0", b"\2\0\4\0", 1)[:5] + b"\5\0\xff")
    assert (reply.status, reply.data) == (0x0A, bytes.fromhex("0200 0400 0000 0500 0900"))
    assert ask(0x0E, logical_path(0x48, 1, 4)).data == b"\1"
    unknown = ask(0x04, logical_path(0x48, 1), bytes.fromhex("0200 6300 00 0400 05"))
    assert (unknown.status, unknown.data) == (0x0A, bytes.fromhex("0100 6300 1400"))


def test_ethernet_link_and_qos_and_connection_manager_are_read(ask):
    assert ask(0x0E, logical_path(0xF6, 1, 3)).data == bytes.fromhex("020000000011")
    assert len(ask(0x0E, logical_path(0xF6, 1, 4)).data) == 44
    assert len(ask(0x0E, logical_path(0xF6, 1, 5)).data) == 48
    assert ask(0x01, logical_path(0xF6, 1)).status == 0
    assert ask(0x0E, logical_path(0x48, 1, 8)).data == b"\x1b"
    assert ask(0x0E, logical_path(6, 1, 1)).data == b"\0\0"
    assert ask(0x0E, logical_path(1, 0, 1)).data == b"\1\0"


def test_several_services_in_one_packet_are_answered_one_by_one(ask):
    requests = [
        message.message_request(0x0E, logical_path(1, 1, 1)).emit(),
        message.message_request(0x0E, logical_path(1, 1, 99)).emit(),
        message.message_request(0x0A, logical_path(2, 1), b"\0\0").emit(),
    ]
    reply = ask(0x0A, logical_path(2, 1), message.emit_multiple_service(requests))
    assert reply.status == 0x1E
    inner = [message.parse_reply(octets) for octets in message.parse_multiple_service(reply.data)]
    assert [(one.service, one.status) for one in inner] == [(0x0E, 0), (0x0E, 0x14), (0x0A, 0x08)]
    assert inner[0].data == b"\xc4\1"
    good = ask(0x0A, logical_path(2, 1), message.emit_multiple_service(requests[:1] * 3))
    assert (good.status, len(message.parse_multiple_service(good.data))) == (0, 3)


def test_replies_never_grow_beyond_what_a_message_holds(ask):
    read = message.message_request(0x0E, logical_path(4, 102, 3)).emit()
    reply = ask(0x0A, logical_path(2, 1), message.emit_multiple_service([read] * 30))
    assert len(reply.emit()) <= 504
    inner = [message.parse_reply(octets).status for octets in message.parse_multiple_service(reply.data)]
    assert inner[0] == 0
    assert inner[-1] == 0x11
    assert ask(0x03, logical_path(4, 102), b"\x14\0" + b"\3\0" * 20).status == 0x11
    assert ask(0x0A, logical_path(2, 1), message.emit_multiple_service([b"\x0e"] * 200)).status == 0x11


def test_a_message_for_the_drive_itself_in_an_unconnected_send_is_carried_out_and_a_route_is_refused(ask):
    inner = message.message_request(0x0E, logical_path(1, 1, 1)).emit()
    reply = ask(0x52, logical_path(6, 1), UnconnectedSend(inner).emit())
    assert (reply.service, reply.status, reply.data) == (0x0E, 0, b"\xc4\1")
    route = emit_epath([PortSegment(1, b"\0")])
    refused = ask(0x52, logical_path(6, 1), UnconnectedSend(inner, route).emit())
    assert (refused.service, refused.status, refused.extended) == (0x52, 1, (0x0311,))
    assert ask(0x52, logical_path(6, 1), b"\0").extended == (0x0205,)


@given(st.binary(max_size=120))
def test_any_request_has_a_reply_of_the_same_service_or_none(octets):
    bench = Bench()
    reply = bench.drive.unconnected(1, 1, (bench.settings.multicast_address, 1), octets, (), bench.now)
    if octets and octets[0] < 0x80 and octets[0] != 0x52:
        assert reply is not None
        assert reply[0][0] == octets[0] | 0x80
