"""What a client sees of the called end."""

from __future__ import annotations

from dataclasses import replace
from ipaddress import IPv4Address
from uuid import UUID

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rpc_support import (
    ACTIVITY,
    MAC,
    MS,
    OBJECT,
    PEER,
    about,
    big_answer,
    fragments,
    put,
    received,
    request,
    sent,
    server,
)

from pnfarm.protocols.profinet.rpc.server import (
    CallReceived,
    Interface,
    Peer,
    RpcServer,
    ServerState,
)
from pnfarm.protocols.profinet.wire.rpc.bodies import CancelAckBody, CancelBody, parse_cancel_ack
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    BODY_MAX,
    NIL_UUID,
    OK,
    RPC_PORT,
    UUID_PNIO_CONTROLLER,
    UUID_PNIO_DEVICE,
    Flags1,
    NcaStatus,
    Opnum,
    PacketType,
    PnioStatus,
    emit_rpc,
    parse_response_args,
    parse_status,
)
from tests.support.ndr_counts import counted


@pytest.mark.parametrize("little", [False, True])
def test_a_call_reaches_the_application_and_its_answer_the_client(little):
    device = server()
    asked = request(little=little, opnum=Opnum.CONNECT)
    assert put(device, asked) == []
    call = received(device)
    assert (call.interface, call.object_uuid, call.opnum) == (UUID_PNIO_DEVICE, OBJECT, Opnum.CONNECT)
    assert (call.args_maximum, call.payload, call.peer, call.source_mac) == (65536, b"blocks", PEER, MAC)

    assert device.respond(call.call, PnioStatus(0xDB, 0x81, 1, 2), b"answer", 0)
    [answer] = sent(device)
    assert answer.little_endian is little
    assert answer.flags1 == Flags1.NO_FACK | Flags1.LAST_FRAGMENT
    assert (answer.activity, answer.sequence, answer.opnum) == (ACTIVITY, 0, Opnum.CONNECT)
    args = parse_response_args(answer.body, little_endian=little)
    assert (args.status, args.payload, args.maximum_count) == (PnioStatus(0xDB, 0x81, 1, 2), b"answer", 65536)


def test_a_repeated_request_gets_the_same_answer_without_a_second_call():
    device = server()
    put(device, request())
    device.respond(received(device).call, OK, b"answer", 0)
    [first] = sent(device)
    [second] = put(device, request(), 10 * MS)
    assert second.body == first.body
    assert device.events() == []


def test_a_request_repeated_while_the_call_is_open_is_working():
    device = server()
    put(device, request())
    assert [pdu.kind for pdu in put(device, request())] == [PacketType.WORKING]
    assert [pdu.kind for pdu in put(device, about(request(), PacketType.PING))] == [PacketType.WORKING]
    assert len(device.events()) == 1


class Late:
    """Keeps answers to Read back."""

    def __init__(self, wait_ns: int) -> None:
        self.wait, self.told = wait_ns, []

    def wait_ns(self, call, opnum, now) -> int:
        del call, now
        return self.wait if opnum == Opnum.READ else 0

    def left(self, call, *, sent) -> None:
        self.told.append((call.sequence, sent))


def late_server(wait_ns: int = 50 * MS, **settings_) -> RpcServer:
    device = server(**settings_)
    device.late = Late(wait_ns)
    return device


def test_an_answer_that_is_kept_back_leaves_at_its_time_and_the_call_is_working_until_then():
    device = late_server()
    put(device, request())
    assert device.respond(received(device).call, OK, b"answer", 0)
    assert [pdu.kind for pdu in put(device, request(), 10 * MS)] == [PacketType.WORKING]
    assert device.next_deadline() == 50 * MS
    device.handle_timeout(49 * MS)
    assert sent(device) == []
    device.handle_timeout(50 * MS)
    [answer] = sent(device)
    assert parse_response_args(answer.body, little_endian=True).payload == b"answer"
    assert device.late.told == [(0, True)]


def test_only_the_answers_that_are_asked_for_are_kept_back():
    device = late_server()
    put(device, request(opnum=Opnum.WRITE))
    device.respond(received(device).call, OK, b"answer", 0)
    assert len(sent(device)) == 1
    assert device.late.told == []


def test_an_answer_to_a_call_that_was_replaced_meanwhile_never_leaves():
    device = late_server()
    put(device, request(1))
    device.respond(received(device).call, OK, b"old", 0)
    put(device, request(2, opnum=Opnum.WRITE), 10 * MS)
    (new,) = [event for event in device.events() if isinstance(event, CallReceived)]
    device.respond(new.call, OK, b"new", 10 * MS)
    device.handle_timeout(60 * MS)
    answers = [parse_response_args(pdu.body, little_endian=True).payload for pdu in sent(device)]
    assert answers == [b"new"]
    assert device.late.told == [(1, False)]
    assert device.dropped["late-answer"] == 1


def test_answers_that_are_kept_back_can_be_let_go():
    device = late_server(3600_000 * MS)
    put(device, request())
    device.respond(received(device).call, OK, b"answer", 0)
    device.release_answers(5 * MS)
    assert len(sent(device)) == 1
    assert device.late.told == [(0, True)]
    device.release_answers(6 * MS)
    assert sent(device) == []


def test_an_answer_later_than_a_call_is_kept_never_leaves():
    device = late_server(10_000 * MS, execution_ns=5_000 * MS)
    put(device, request())
    device.respond(received(device).call, OK, b"answer", 0)
    device.handle_timeout(5_000 * MS)
    assert device.next_deadline() == 10_000 * MS
    assert [pdu.kind for pdu in sent(device)] == [PacketType.FAULT]
    device.handle_timeout(10_000 * MS)
    assert sent(device) == []
    assert device.late.told == [(0, False)]


def test_a_ping_before_any_call_is_no_call():
    device = server()
    [answer] = put(device, about(request(), PacketType.PING, serial=1))
    assert (answer.kind, answer.fragment_number, answer.body, answer.serial) == (PacketType.NOCALL, 0xFFFF, b"", 0)
    assert device.next_deadline() is None


def test_a_ping_after_the_answer_gets_the_answer_again():
    device = server()
    put(device, request())
    device.respond(received(device).call, OK, b"answer", 0)
    sent(device)
    [answer] = put(device, about(request(), PacketType.PING))
    assert answer.kind == PacketType.RESPONSE


def test_an_acknowledged_answer_is_not_kept():
    device = server()
    put(device, request())
    device.respond(received(device).call, OK, b"x" * 1000, 0)
    put(device, about(request(), PacketType.ACK))
    assert device.held_octets == 0
    assert [pdu.kind for pdu in put(device, about(request(), PacketType.PING))][-1] == PacketType.NOCALL


def test_the_answer_goes_to_the_port_that_asked_last():
    device = server()
    put(device, request())
    call = received(device)
    moved = Peer(PEER.ip, 50001)
    put(device, request(), peer=moved)
    device.respond(call.call, OK, b"", 0)
    assert [datagram.peer for datagram in device.to_send(0)] == [moved]


def test_an_older_sequence_number_is_a_late_duplicate():
    device = server()
    put(device, request(5))
    device.events()
    assert put(device, request(4), 100 * MS) == []
    assert device.events() == []
    assert device.dropped["old-sequence"] == 1


def test_an_older_sequence_number_after_a_pause_is_a_restarted_client():
    device = server()
    put(device, request(5))
    device.respond(received(device).call, OK, b"", 0)
    put(device, request(0), 4_000 * MS)
    assert received(device).call.sequence == 0


def test_sequence_numbers_wrap():
    device = server()
    put(device, request(0xFFFFFFFF))
    device.respond(received(device).call, OK, b"", 0)
    put(device, request(0))
    assert received(device).call.sequence == 0


def test_an_answer_to_a_call_that_was_replaced_goes_nowhere():
    device = server()
    put(device, request(1))
    old = received(device).call
    put(device, request(2))
    assert not device.respond(old, OK, b"", 0)
    assert sent(device) == []
    [new] = device.events()
    assert device.respond(new.call, OK, b"", 0)
    assert not device.fault(old, NcaStatus.FAULT_UNSPEC, 0)


@pytest.mark.parametrize(
    ("fields", "status"),
    [
        ({"interface": UUID_PNIO_CONTROLLER}, NcaStatus.UNK_IF),
        ({"interface_version": 2}, NcaStatus.UNK_IF),
        ({"interface_version": 0x00010001}, NcaStatus.UNK_IF),
        ({"opnum": 6}, NcaStatus.OP_RNG_ERROR),
        ({"activity": NIL_UUID}, NcaStatus.BAD_ACTID),
        ({"auth_protocol": 1}, NcaStatus.UNSUPPORTED_AUTHN_LEVEL),
        ({"trailer": b"more"}, NcaStatus.PROTO_ERROR),
        ({"body": bytes(BODY_MAX + 1)}, NcaStatus.PROTO_ERROR),
        ({"server_boot_time": 8}, NcaStatus.WRONG_BOOT_TIME),
    ],
)
@pytest.mark.parametrize("little", [False, True])
def test_what_cannot_be_served_is_rejected_with_its_reason(fields, status, little):
    device = server(boot_time=7)
    [answer] = put(device, request(little=little, **fields))
    assert answer.kind == PacketType.REJECT
    assert parse_status(answer.body, little_endian=little) == status
    assert device.events() == []
    assert device.activities == {}


def test_a_server_that_knows_its_boot_time_sends_it():
    device = server(boot_time=7)
    put(device, request(server_boot_time=0))
    device.respond(received(device).call, OK, b"", 0)
    assert sent(device)[0].server_boot_time == 7


def test_a_server_that_keeps_no_boot_time_repeats_the_clients():
    device = server()
    put(device, request(server_boot_time=95))
    device.respond(received(device).call, OK, b"", 0)
    assert sent(device)[0].server_boot_time == 95


@pytest.mark.parametrize("flag", [Flags1.MAYBE, Flags1.BROADCAST])
def test_maybe_and_broadcast_calls_are_not_answered(flag):
    device = server()
    assert put(device, request(flags1=int(flag))) == []
    assert device.dropped["maybe-or-broadcast"] == 1


def test_a_server_may_offer_the_controllers_interface():
    controller = server(interfaces=(Interface(UUID_PNIO_CONTROLLER, frozenset({Opnum.CONTROL})),))
    put(controller, request(interface=UUID_PNIO_CONTROLLER, opnum=Opnum.CONTROL))
    assert received(controller).interface == UUID_PNIO_CONTROLLER
    assert put(controller, request(1, opnum=Opnum.CONTROL))[0].kind == PacketType.REJECT


def test_contradicting_lengths_are_answered_with_a_status():
    device = server()
    stub = counted(100, b"abcd", actual_count=9)
    [answer] = put(device, request(body=stub, opnum=Opnum.WRITE))
    assert parse_response_args(answer.body, little_endian=True).status == PnioStatus(0xDF, 0x81, 0x40, 0)
    assert device.events() == []


def test_an_answer_above_the_clients_room_is_a_fault():
    device = server()
    put(device, request(maximum=10))
    device.respond(received(device).call, OK, bytes(11), 0)
    [answer] = sent(device)
    assert answer.kind == PacketType.FAULT
    assert parse_status(answer.body, little_endian=True) == NcaStatus.OUT_ARGS_TOO_BIG


def test_an_application_may_answer_with_a_fault():
    device = server()
    put(device, request())
    assert device.fault(received(device).call, NcaStatus.FAULT_UNSPEC, 0)
    [answer] = sent(device)
    assert answer.kind == PacketType.FAULT
    assert [pdu.kind for pdu in put(device, request())] == [PacketType.FAULT]


def test_a_cancel_is_acknowledged():
    device = server()
    put(device, request())
    call = received(device).call
    cancel = replace(about(request(), PacketType.CL_CANCEL), body=CancelBody(1).emit(little_endian=True))
    for _ in range(2):
        [answer] = put(device, cancel)
        assert answer.kind == PacketType.CANCEL_ACK
        assert parse_cancel_ack(answer.body, little_endian=True) == CancelAckBody(1, accepting=True)
    assert device.events() == []
    assert put(device, replace(cancel, sequence=9)) == []
    assert device.fault(call, NcaStatus.FAULT_CANCEL, 0)
    assert [pdu.kind for pdu in sent(device)] == [PacketType.FAULT]


def test_idle_activities_are_forgotten():
    device = server(reply_ns=10_000 * MS, idle_ns=20_000 * MS)
    put(device, request())
    device.respond(received(device).call, OK, b"x", 0)
    assert device.next_deadline() == 10_000 * MS
    device.handle_timeout(10_000 * MS)
    assert (device.held_octets, len(device.activities)) == (0, 1)
    assert device.next_deadline() == 30_000 * MS
    device.handle_timeout(30_000 * MS)
    assert device.next_deadline() is None
    assert device.activities == {}
    assert device.held_octets == 0
    [answer] = put(device, about(request(), PacketType.PING))[-1:]
    assert answer.kind == PacketType.NOCALL


def test_half_a_request_is_forgotten():
    device = server(reassembly_ns=5_000 * MS)
    put(device, fragments(request(payload=bytes(3000)))[0])
    assert device.held_octets > 0
    device.handle_timeout(5_000 * MS)
    assert device.held_octets == 0


def to_the_end(device: RpcServer) -> None:
    """Until nothing waits any more."""
    while (due := device.next_deadline()) is not None:
        device.handle_timeout(due)
        sent(device)


@pytest.mark.parametrize("flags", [int(Flags1.IDEMPOTENT), 0])
@pytest.mark.parametrize("end", ["acknowledged", "kept silent", "evicted"])
def test_the_end_of_an_answered_call_is_no_discard(end, flags):
    device = server(activities_max=2)
    for number in range(1, 8 if end == "evicted" else 2):
        call = request(flags1=flags, activity=UUID(int=number))
        put(device, call)
        device.respond(received(device).call, OK, b"x", 0)
        sent(device)
        if end == "acknowledged":
            put(device, about(call, PacketType.ACK))
    to_the_end(device)
    assert device.activities == {}
    assert device.dropped == {}


def test_a_call_given_up_in_the_middle_is_a_discard():
    half = fragments(request(payload=bytes(3000)))[0]
    device = server()
    put(device, half)
    to_the_end(device)
    assert device.dropped == {"expired-receiving": 1}
    device = server()
    put(device, request())
    to_the_end(device)
    assert device.dropped == {"expired-executing": 1}
    device = server()
    big_answer(device)
    to_the_end(device)
    assert device.dropped == {"expired-replying": 1}
    device = server(activities_max=1)
    put(device, half)
    put(device, request(activity=UUID(int=1)))
    assert device.dropped == {"evicted": 1}


def test_a_call_that_is_never_answered_is_a_fault():
    device = server(execution_ns=60_000 * MS)
    put(device, request())
    call = received(device).call
    put(device, request(), 59_000 * MS)
    device.handle_timeout(60_000 * MS)
    [answer] = sent(device)
    assert parse_status(answer.body, little_endian=True) == NcaStatus.FAULT_UNSPEC
    assert not device.respond(call, OK, b"", 60_000 * MS)
    # it may have run, so that a repetition gets what the client got already
    assert [pdu.kind for pdu in put(device, request(), 61_000 * MS)] == [PacketType.FAULT]


def test_too_many_open_calls_are_rejected_as_busy():
    device = server(calls_max=4, activities_max=8)
    for number in range(4):
        assert put(device, request(activity=UUID(int=number + 1))) == []
    [answer] = put(device, request(activity=UUID(int=99)))
    assert parse_status(answer.body, little_endian=True) == NcaStatus.SERVER_TOO_BUSY
    assert len(device.events()) == 4


def test_a_full_table_of_open_calls_is_busy():
    device = server(calls_max=8, activities_max=2)
    for number in range(2):
        put(device, request(activity=UUID(int=number + 1)))
    [answer] = put(device, request(activity=UUID(int=99)))
    assert parse_status(answer.body, little_endian=True) == NcaStatus.SERVER_TOO_BUSY


def test_activities_of_different_clients_do_not_mix():
    device = server()
    other = Peer(IPv4Address("10.77.0.2"), 49155)
    put(device, request())
    put(device, request(payload=b"other"), peer=other)
    first, second = device.events()
    assert first.call != second.call
    device.respond(second.call, OK, b"2", 0)
    device.respond(first.call, OK, b"1", 0)
    assert [datagram.peer for datagram in device.to_send(0)] == [other, PEER]


def test_memory_stays_flat_under_strangers():
    device = server(activities_max=16, held_octets_max=100_000)
    for number in range(2_000):
        activity = UUID(int=number + 1)
        part = replace(request(activity=activity, body=bytes(BODY_MAX)), flags1=int(Flags1.FRAGMENT))
        put(device, part, number)
        put(device, about(part, PacketType.PING), number)
        put(device, request(activity=UUID(int=number + 10**6)), number)
        for event in device.events():
            device.respond(event.call, OK, bytes(20_000), number)
        device.to_send(number)
        assert len(device.activities) <= 16
        assert device.held_octets <= 100_000


def test_an_answer_that_does_not_fit_into_memory_is_a_fault():
    device = server(held_octets_max=1_000)
    put(device, request())
    device.respond(received(device).call, OK, bytes(2_000), 0)
    [answer] = sent(device)
    assert parse_status(answer.body, little_endian=True) == NcaStatus.FAULT_REMOTE_NO_MEMORY


@settings(max_examples=150)
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=120),
            st.tuples(
                st.integers(0, 12),
                st.integers(0, 3),
                st.integers(0, 3),
                st.integers(0, 0x7F),
                st.integers(0, 4),
                st.binary(max_size=60),
            ),
        ),
        max_size=40,
    )
)
def test_any_datagrams_leave_the_server_able_to_serve(datagrams):
    device = server()
    now = 0
    for datagram in datagrams:
        if isinstance(datagram, bytes):
            device.receive(PEER, RPC_PORT, datagram, now)
        else:
            kind, sequence, opnum, flags, number, body = datagram
            pdu = request(sequence, opnum=opnum, packet_type=kind, flags1=flags, fragment_number=number, body=body)
            device.receive(PEER, RPC_PORT, emit_rpc(pdu), now)
        for event in device.events():
            if isinstance(event, CallReceived) and event.call.sequence % 2:
                device.respond(event.call, OK, bytes(event.call.sequence * 2_000), now)
        # the sums that are kept are those of the rows
        rows = list(device._activities)
        assert device.held_octets == sum(row.held for row in rows)
        assert device.next_deadline() == min((row.deadline for row in rows), default=None)
        for state in ServerState:
            assert device._activities.count(state) == sum(row.state is state for row in rows)
        now += 100 * MS
        device.handle_timeout(now)
        assert len(device.to_send(now)) <= 12
    put(device, request(activity=UUID(int=77)))
    assert any(event.payload == b"blocks" for event in device.events() if isinstance(event, CallReceived))
