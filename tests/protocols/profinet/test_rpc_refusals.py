"""What a server refuses or drops: exact kinds, codes and reasons."""

from dataclasses import replace
from uuid import UUID

import pytest
from rpc_support import ENDPOINTS, OBJECT, PEER, about, put, received, request, sent, server

from pnfarm.protocols.profinet.rpc.server import Peer
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    OK,
    RPC_PORT,
    UUID_EPM,
    Flags1,
    NcaStatus,
    Opnum,
    PacketType,
    PnioStatus,
    emit_rpc,
    object_uuid,
    parse_response_args,
    parse_status,
)
from tests.support.ndr_counts import counted

CALL = request(5)


@pytest.mark.parametrize(
    "wrong",
    [object_uuid(1, 2, 0x0105), object_uuid(1, 1, 0x0106), object_uuid(2, 1, 0x0105), UUID(int=0), UUID(int=77)],
    ids=["device", "vendor", "instance", "nil", "other"],
)
@pytest.mark.parametrize("opnum", list(Opnum))
def test_a_call_for_another_device_is_rejected_as_for_an_unknown_interface(wrong, opnum):
    device = server(endpoints=ENDPOINTS)
    [answer] = put(device, request(object_uuid=wrong, opnum=opnum))
    assert answer.kind == PacketType.REJECT
    assert answer.object_uuid == wrong
    assert parse_status(answer.body, little_endian=True) == NcaStatus.UNK_IF
    (told,) = device.events()
    assert (told.object_uuid, told.opnum, device.activities) == (wrong, opnum, {})
    assert put(device, request(object_uuid=OBJECT, opnum=opnum)) == []
    assert received(device).object_uuid == OBJECT


def test_the_endpoint_mapper_and_a_server_without_endpoints_take_any_object():
    assert put(server(), request(object_uuid=UUID(int=77))) == []
    device = server(endpoints=ENDPOINTS)
    ask = request(interface=UUID_EPM, interface_version=3, opnum=2, object_uuid=UUID(int=77), body=b"")
    [answer] = put(device, ask)
    assert parse_status(answer.body, little_endian=True) == NcaStatus.PROTO_ERROR


@pytest.mark.parametrize("kind", [PacketType.PING, PacketType.CL_CANCEL, PacketType.ACK, PacketType.FACK])
def test_what_is_meant_for_an_earlier_boot_is_rejected_under_the_boot_time_that_its_client_knows(kind):
    device = server(boot_time=100)
    put(device, CALL)
    assert received(device).call.sequence == 5
    [answer] = put(device, about(CALL, kind, server_boot_time=99))
    assert (answer.kind, answer.server_boot_time) == (PacketType.REJECT, 99)
    assert parse_status(answer.body, little_endian=True) == NcaStatus.WRONG_BOOT_TIME
    assert device.events() == []
    [answer] = put(device, request(6, server_boot_time=99))
    assert (answer.kind, answer.server_boot_time) == (PacketType.REJECT, 99)
    # 0 is a client that does not know the server yet
    [answer] = put(device, about(CALL, PacketType.PING))
    assert (answer.kind, answer.server_boot_time) == (PacketType.WORKING, 100)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda data: data[:79], "short"),
        (lambda data: data[:-1], "short"),
        (lambda _: b"", "short"),
        (lambda data: b"\5" + data[1:], "bad-version"),
        (lambda data: data[:4] + b"\x20" + data[5:], "bad-drep"),
        (lambda data: data[:1] + b"\x0b" + data[2:], "unexpected-type"),
        (lambda data: data[:1] + b"\x02" + data[2:], "unexpected-type"),
        (lambda data: data[:2] + b"\x10" + data[3:], "maybe-or-broadcast"),
    ],
)
def test_what_cannot_be_a_call_is_dropped_with_its_reason(change, reason):
    device = server()
    device.receive(PEER, RPC_PORT, change(emit_rpc(request())), 0)
    assert device.to_send(0) == []
    assert device.dropped == {reason: 1}


def test_the_three_upper_bits_of_the_packet_type_do_not_count():
    device = server()
    put(device, replace(request(), packet_type=0xE0))
    assert received(device).opnum == Opnum.READ


def test_a_client_that_cannot_be_answered_is_dropped():
    device = server()
    assert put(device, request(), peer=Peer(PEER.ip, 0)) == []
    assert (device.dropped, device.activities) == ({"source-port-0": 1}, {})


def test_an_absurd_fragment_number_is_dropped():
    device = server()
    part = replace(CALL, fragment_number=0xFFFE, flags1=int(Flags1.FRAGMENT | Flags1.NO_FACK))
    assert put(device, part) == []
    assert device.dropped["fragment-number"] == 1
    assert device.held_octets == 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"maximum_count": 99},
        {"maximum_count": 101},
        {"offset": 1},
        {"args_length": 3},
        {"args_length": 5},
        {"actual_count": 3},
        {"actual_count": 5},
        {"args_length": 0xFFFFFFFF},
        {"args_maximum": 3, "maximum_count": 3},
    ],
    ids=str,
)
@pytest.mark.parametrize("opnum", list(Opnum))
@pytest.mark.parametrize("little", [False, True])
def test_each_rule_of_the_ndr_arguments_is_answered_by_the_status_of_its_service(wrong, opnum, little):
    device = server()
    stub = counted(100, b"abcd", little_endian=little, **wrong)
    [answer] = put(device, request(body=stub, opnum=opnum, little=little))
    assert answer.kind == PacketType.RESPONSE
    args = parse_response_args(answer.body, little_endian=little)
    service = {0: 0xDB, 1: 0xDC, 2: 0xDE, 3: 0xDF, 4: 0xDD, 5: 0xDE}[opnum]
    assert args.status == PnioStatus(service, 0x81, 0x40, 0)
    # the count that a client compares with what it said
    assert (args.payload, args.maximum_count) == (b"", wrong.get("args_maximum", 100))
    assert device.events() == []


@pytest.mark.parametrize("length", [0, 4, 19])
def test_a_stub_without_all_counts_is_rejected(length):
    device = server()
    [answer] = put(device, request(body=bytes(length)))
    assert answer.kind == PacketType.REJECT
    assert parse_status(answer.body, little_endian=True) == NcaStatus.PROTO_ERROR
    assert device.events() == []


@pytest.mark.parametrize("size", [99, 100])
def test_an_answer_fills_the_clients_room_and_never_more(size):
    device = server()
    put(device, request(maximum=100))
    device.respond(received(device).call, OK, bytes(size), 0)
    [answer] = sent(device)
    args = parse_response_args(answer.body, little_endian=True)
    assert (len(args.payload), args.maximum_count) == (size, 100)
