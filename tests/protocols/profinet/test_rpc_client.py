"""What a server sees of the calling end, and what the caller gets."""

from __future__ import annotations

from dataclasses import replace
from ipaddress import IPv4Address
from itertools import count
from uuid import UUID

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.protocols.profinet.rpc.calls import TRANSITIONS, ClientEventKind, ClientState
from pnfarm.protocols.profinet.rpc.client import CallFailed, CallReturned, Peer, RpcClient, RpcClientConfig
from pnfarm.protocols.profinet.wire.rpc.bodies import FackBody, parse_fack
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    BODY_MAX,
    FRAGMENT_NONE,
    OK,
    RPC_PORT,
    UUID_EPM,
    UUID_PNIO_DEVICE,
    Flags1,
    NcaStatus,
    Opnum,
    PacketType,
    PnioStatus,
    ResponseArgs,
    RpcPdu,
    emit_response_args,
    emit_rpc,
    emit_status,
    object_uuid,
    parse_request_args,
    parse_rpc,
)
from tests.support.ndr_counts import with_counts

MS = 1_000_000
PEER = Peer(IPv4Address("10.77.0.11"), RPC_PORT)
OTHER = Peer(IPv4Address("10.77.0.12"), RPC_PORT)
OBJECT = object_uuid(1, 1, 0x0105)
PORT = 49152


def client(**settings_) -> RpcClient:
    numbers = count(1)
    return RpcClient(lambda: UUID(int=next(numbers)), RpcClientConfig(**settings_))


def call(caller: RpcClient, payload=b"blocks", now=0, *, peer=PEER, maximum=65536, **options) -> int:
    return caller.call(peer, PORT, UUID_PNIO_DEVICE, OBJECT, Opnum.READ, maximum, payload, now, **options)


def sent(caller: RpcClient, now=0) -> list[RpcPdu]:
    datagrams = caller.to_send(now)
    assert all(datagram.local_port == PORT for datagram in datagrams)
    return [parse_rpc(datagram.data) for datagram in datagrams]


def put(caller: RpcClient, pdu: RpcPdu, now=0, peer=PEER) -> list[RpcPdu]:
    caller.receive(peer, PORT, emit_rpc(pdu), now)
    return sent(caller, now)


def reply(asked: RpcPdu, payload=b"answer", status=OK, **fields) -> RpcPdu:
    stub = emit_response_args(ResponseArgs(status, payload, 65536), little_endian=asked.little_endian)
    answer = replace(
        asked,
        packet_type=int(PacketType.RESPONSE),
        body=stub,
        flags1=int(Flags1.NO_FACK | Flags1.LAST_FRAGMENT),
        fragment_number=0,
    )
    return replace(answer, **fields)


def about(asked: RpcPdu, kind: PacketType, **fields) -> RpcPdu:
    return replace(replace(asked, packet_type=int(kind), flags1=0, body=b"", fragment_number=0), **fields)


def wait(caller: RpcClient) -> tuple[int, list[RpcPdu]]:
    """Let time pass until the client acts."""
    now = caller.next_deadline()
    caller.handle_timeout(now)
    return now // MS, sent(caller, now)


@pytest.mark.parametrize("little", [False, True])
def test_a_call_returns_status_and_blocks(little):
    caller = client()
    number = call(caller, little_endian=little)
    [asked] = sent(caller)
    assert (asked.kind, asked.sequence, asked.opnum, asked.interface_version) == (PacketType.REQUEST, 0, Opnum.READ, 1)
    assert asked.flags1 == Flags1.IDEMPOTENT
    assert asked.little_endian is little
    args = parse_request_args(asked.body, little_endian=little)
    assert (args.args_maximum, args.payload) == (65536, b"blocks")
    assert put(caller, reply(asked, status=PnioStatus(0xDE, 0x80, 0xB0, 0))) == []
    assert caller.events() == [CallReturned(number, PnioStatus(0xDE, 0x80, 0xB0, 0), b"answer", PEER, little)]
    assert caller.open_calls == 0


def test_calls_to_one_peer_share_an_activity_with_rising_numbers():
    caller = client()
    numbers = []
    for _ in range(3):
        call(caller)
        [asked] = sent(caller)
        numbers.append((asked.activity.int, asked.sequence))
        put(caller, reply(asked))
    assert numbers == [(1, 0), (1, 1), (1, 2)]


def test_calls_that_overlap_have_activities_of_their_own():
    caller = client()
    first, second, third = call(caller), call(caller), call(caller, peer=OTHER)
    asked = sent(caller)
    assert [pdu.activity.int for pdu in asked] == [1, 2, 3]
    put(caller, reply(asked[2]), peer=OTHER)
    put(caller, reply(asked[1]))
    put(caller, reply(asked[0]))
    assert [event.call_id for event in caller.events()] == [third, second, first]


def test_a_silent_server_is_asked_three_times():
    caller = client()
    number = call(caller)
    sent(caller)
    assert [wait(caller)[0] for _ in range(2)] == [500, 1500]
    now, again = wait(caller)
    assert (now, again) == (3500, [])
    assert caller.events() == [CallFailed(number, "no-answer", PEER)]


def test_each_sending_has_a_serial_number_of_its_own():
    caller = client()
    call(caller)
    serials = [sent(caller)[0].serial, *(wait(caller)[1][0].serial for _ in range(2))]
    assert serials == [0, 1, 2]


def test_a_call_ends_when_its_time_is_up():
    caller = client()
    number = call(caller, timeout_ns=700 * MS)
    assert wait(caller)[0] == 500
    assert wait(caller)[0] == 700
    assert caller.events() == [CallFailed(number, "timeout", PEER)]


def test_a_working_server_is_pinged_with_patience():
    caller = client(working_ping_ns=2_000 * MS, timeout_ns=30_000 * MS)
    number = call(caller)
    [asked] = sent(caller)
    now = 400 * MS
    for _ in range(5):
        put(caller, about(asked, PacketType.WORKING), now)
        at, [ping] = wait(caller)
        assert at * MS == now + 2_000 * MS
        assert (ping.kind, ping.sequence, ping.body) == (PacketType.PING, 0, b"")
        now = at * MS
    put(caller, reply(asked), now)
    assert [event.call_id for event in caller.events()] == [number]


def test_a_server_that_stops_working_is_given_up():
    caller = client(timeout_ns=60_000 * MS)
    number = call(caller)
    [asked] = sent(caller)
    put(caller, about(asked, PacketType.WORKING))
    while not (events := caller.events()):
        wait(caller)
    assert events == [CallFailed(number, "no-answer", PEER)]


def test_no_call_means_the_request_is_sent_again():
    caller = client()
    call(caller)
    [asked] = sent(caller)
    [again] = put(caller, about(asked, PacketType.NOCALL, fragment_number=FRAGMENT_NONE))
    assert (again.kind, again.body) == (PacketType.REQUEST, asked.body)


def test_a_server_that_keeps_losing_the_call_is_given_up():
    caller = client()
    number = call(caller)
    [asked] = sent(caller)
    for _ in range(4):
        put(caller, about(asked, PacketType.NOCALL, fragment_number=FRAGMENT_NONE))
    assert caller.events() == [CallFailed(number, "nocall", PEER)]


@pytest.mark.parametrize(
    ("kind", "status", "reason"),
    [
        (PacketType.REJECT, NcaStatus.UNK_IF, "reject nca_unk_if (no such interface, version or object)"),
        (PacketType.FAULT, NcaStatus.FAULT_UNSPEC, "fault nca_fault_unspec (no reason is given)"),
        (PacketType.FAULT, 0x12345678, "fault 0x12345678"),
    ],
)
@pytest.mark.parametrize("little", [False, True])
def test_a_refusal_fails_the_call_with_its_reason(kind, status, reason, little):
    caller = client()
    number = call(caller, little_endian=little)
    [asked] = sent(caller)
    put(caller, about(asked, kind, body=emit_status(status, little_endian=little)))
    assert caller.events() == [CallFailed(number, reason, PEER, int(status))]


def test_a_refusal_without_a_reason_is_a_bad_response():
    caller = client()
    number = call(caller)
    put(caller, about(sent(caller)[0], PacketType.REJECT))
    assert caller.events() == [CallFailed(number, "bad-response", PEER)]


def test_contradicting_lengths_are_a_bad_response():
    caller = client()
    number = call(caller)
    [asked] = sent(caller)
    stub = with_counts(emit_response_args(ResponseArgs(OK, b"abc", 9), little_endian=True), actual_count=7)
    put(caller, reply(asked, body=stub))
    assert caller.events() == [CallFailed(number, "bad-response", PEER)]


def test_an_answer_from_another_port_counts_and_draws_what_follows_there():
    """Real devices answer from a port of their own (1208, 49155 in captures)."""
    caller = client()
    number = call(caller)
    [asked] = sent(caller)
    moved = Peer(PEER.ip, 49155)
    caller.receive(moved, PORT, emit_rpc(about(asked, PacketType.WORKING)), 0)
    now = caller.next_deadline()
    caller.handle_timeout(now)
    assert [datagram.peer for datagram in caller.to_send(now)] == [moved]
    put(caller, reply(asked), now, peer=moved)
    assert caller.events() == [CallReturned(number, OK, b"answer", moved, True)]


def test_answers_of_strangers_and_to_older_calls_are_dropped():
    caller = client()
    call(caller)
    [asked] = sent(caller)
    put(caller, reply(asked), peer=OTHER)
    put(caller, reply(asked, activity=UUID(int=99)))
    put(caller, reply(asked, sequence=7))
    put(caller, about(asked, PacketType.REQUEST))
    caller.receive(PEER, PORT, b"noise", 0)
    assert caller.events() == []
    assert caller.dropped == {"unknown-activity": 2, "stale-sequence": 1, "unexpected-type": 1, "bad-version": 1}
    put(caller, reply(asked))
    put(caller, reply(asked))
    assert len(caller.events()) == 1
    assert caller.dropped["call-is-over"] == 1


def test_a_learned_boot_time_is_sent_and_forgotten_when_refused():
    caller = client()
    call(caller)
    put(caller, reply(sent(caller)[0], server_boot_time=6))
    call(caller)
    [asked] = sent(caller)
    assert asked.server_boot_time == 6
    refusal = emit_status(NcaStatus.WRONG_BOOT_TIME, little_endian=True)
    put(caller, about(asked, PacketType.REJECT, body=refusal, server_boot_time=0))
    call(caller)
    assert sent(caller)[0].server_boot_time == 0


def test_a_long_request_waits_for_each_fragment_to_be_acknowledged():
    caller = client()
    payload = bytes(range(256)) * 16
    call(caller, payload)
    parts = sent(caller)
    for number in range(2):
        assert parts[-1].wants_fack
        parts += put(caller, about(parts[0], PacketType.FACK, fragment_number=number))
    assert [part.fragment_number for part in parts] == [0, 1, 2]
    assert parts[-1].is_last
    assert parse_request_args(b"".join(part.body for part in parts), little_endian=True).payload == payload


def test_a_fragment_without_acknowledgement_is_sent_again():
    caller = client()
    call(caller, bytes(4096))
    [first] = sent(caller)
    now, [again] = wait(caller)
    assert (now, again.body, again.fragment_number) == (500, first.body, 0)


def test_after_a_long_request_the_server_is_pinged_and_may_say_what_is_missing():
    caller = client()
    call(caller, bytes(4096))
    [first] = sent(caller)
    put(caller, about(first, PacketType.FACK, fragment_number=0))
    put(caller, about(first, PacketType.FACK, fragment_number=1))
    _, [ping] = wait(caller)
    assert ping.kind == PacketType.PING
    arrived = FackBody(5, 65536, 1464, ping.serial).emit(little_endian=True)
    [again] = put(caller, about(first, PacketType.NOCALL, fragment_number=1, body=arrived))
    assert again.fragment_number == 2
    [again] = put(caller, about(first, PacketType.NOCALL, fragment_number=FRAGMENT_NONE))
    assert again.fragment_number == 0


def answer_parts(asked: RpcPdu, size: int) -> list[RpcPdu]:
    whole = reply(asked, bytes(size))
    bodies = [whole.body[at : at + BODY_MAX] for at in range(0, len(whole.body), BODY_MAX)]
    last = len(bodies) - 1
    return [
        replace(
            whole,
            body=body,
            fragment_number=number,
            flags1=int(Flags1.FRAGMENT | (Flags1.LAST_FRAGMENT if number == last else 0)),
            serial=number,
        )
        for number, body in enumerate(bodies)
    ]


def test_a_long_answer_is_acknowledged_and_joined():
    caller = client()
    number = call(caller)
    [asked] = sent(caller)
    for part in answer_parts(asked, 5_000):
        [fack] = put(caller, part)
        assert (fack.kind, fack.fragment_number) == (PacketType.FACK, part.fragment_number)
        body = parse_fack(fack.body, little_endian=True)
        assert body is not None
        assert body.serial == part.serial
    assert caller.events() == [CallReturned(number, OK, bytes(5_000), PEER, True)]


def test_the_last_fragment_is_acknowledged_again_after_the_call_is_over():
    caller = client()
    call(caller)
    parts = answer_parts(sent(caller)[0], 3_000)
    for part in parts:
        put(caller, part)
    [fack] = put(caller, parts[-1])
    assert (fack.kind, fack.fragment_number) == (PacketType.FACK, len(parts) - 1)


def test_an_answer_that_stalls_is_asked_for_with_a_ping():
    caller = client()
    call(caller)
    [asked] = sent(caller)
    put(caller, answer_parts(asked, 3_000)[0])
    assert [pdu.kind for pdu in wait(caller)[1]] == [PacketType.PING]


def test_fragments_of_an_answer_in_another_byte_order_do_not_belong():
    caller = client()
    call(caller)
    first, second, *_ = answer_parts(sent(caller)[0], 3_000)
    put(caller, first)
    assert put(caller, replace(second, drep=bytes(3))) == []
    assert caller.dropped["fragments-differ"] == 1


def test_an_endless_answer_is_a_bad_response():
    caller = client()
    number = call(caller)
    [asked] = sent(caller)
    for part in range(60):
        put(caller, reply(asked, body=bytes(BODY_MAX), fragment_number=part, flags1=int(Flags1.FRAGMENT)))
    assert caller.events() == [CallFailed(number, "bad-response", PEER)]


def test_a_cancelled_call_ends_without_an_event_and_is_orphaned_once():
    caller = client()
    number = call(caller)
    [asked] = sent(caller)
    caller.cancel(number, 0)
    caller.cancel(number, 0)
    [orphan] = sent(caller)
    assert (orphan.kind, orphan.activity, orphan.sequence, orphan.body) == (
        PacketType.CL_CANCEL,
        asked.activity,
        asked.sequence,
        b"",
    )
    put(caller, about(asked, PacketType.CANCEL_ACK))
    put(caller, reply(asked))
    assert caller.events() == []
    assert caller.open_calls == 0
    assert caller.dropped == {"call-is-over": 2}


def test_silence_is_met_with_the_request_and_a_ping_in_turns():
    """Some servers ignore a request that they work on already, others know no pings."""
    caller = client(tries=5)
    call(caller)
    kinds = [sent(caller)[0].kind]
    while True:
        _, again = wait(caller)
        if not again:
            break
        kinds += [pdu.kind for pdu in again]
    assert kinds == [PacketType.REQUEST, PacketType.REQUEST, PacketType.PING, PacketType.REQUEST, PacketType.PING]


def test_a_server_that_ignores_repetitions_while_it_works_is_waited_for():
    caller = client(timeout_ns=60_000 * MS)
    number = call(caller)
    [asked] = sent(caller)
    now = 0
    while now < 20_000:
        now, [pdu] = wait(caller)
        if pdu.kind == PacketType.PING:
            put(caller, about(asked, PacketType.WORKING), now * MS)
    put(caller, reply(asked), now * MS)
    assert [event.call_id for event in caller.events()] == [number]


def test_a_busy_server_is_asked_again_after_a_longer_and_longer_pause():
    caller = client()
    number = call(caller)
    [asked] = sent(caller)
    busy = about(asked, PacketType.REJECT, body=emit_status(NcaStatus.SERVER_TOO_BUSY, little_endian=True))
    assert put(caller, busy) == []
    at, [again] = wait(caller)
    assert (at, again.kind, again.body) == (500, PacketType.REQUEST, asked.body)
    assert put(caller, busy, at * MS) == []
    at, [again] = wait(caller)
    assert (at, again.kind) == (1_500, PacketType.REQUEST)
    put(caller, busy, at * MS)
    reason = "reject nca_server_too_busy (the server is busy)"
    assert caller.events() == [CallFailed(number, reason, PEER, int(NcaStatus.SERVER_TOO_BUSY))]


def test_a_long_request_to_a_busy_server_starts_over():
    caller = client()
    call(caller, bytes(4096))
    [first] = sent(caller)
    put(caller, about(first, PacketType.FACK, fragment_number=0))
    put(caller, about(first, PacketType.FACK, fragment_number=1))
    busy = about(first, PacketType.REJECT, body=emit_status(NcaStatus.SERVER_TOO_BUSY, little_endian=True))
    put(caller, busy, 100 * MS)
    at, [again] = wait(caller)
    assert (at, again.fragment_number, again.body) == (600, 0, first.body)
    assert [pdu.fragment_number for pdu in put(caller, about(first, PacketType.FACK, fragment_number=0))] == [1]


def test_a_busy_fault_is_no_promise_that_nothing_ran():
    caller = client()
    number = call(caller)
    [asked] = sent(caller)
    put(caller, about(asked, PacketType.FAULT, body=emit_status(NcaStatus.SERVER_TOO_BUSY, little_endian=True)))
    [event] = caller.events()
    assert (event.call_id, event.code) == (number, NcaStatus.SERVER_TOO_BUSY)


def test_an_answer_longer_than_asked_for_is_a_bad_response():
    for maximum, size, good in ((100, 100, True), (100, 101, False), (4_000, 4_001, False), (4_000, 4_000, True)):
        caller = client()
        call(caller, maximum=maximum)
        for part in answer_parts(sent(caller)[0], size):
            put(caller, part)
        [event] = caller.events()
        assert isinstance(event, CallReturned) is good
        assert good or event.reason == "bad-response"


def test_an_answer_from_port_0_is_ignored():
    caller = client()
    call(caller)
    [asked] = sent(caller)
    put(caller, reply(asked), peer=Peer(PEER.ip, 0))
    assert caller.events() == []


def test_every_row_of_the_table_names_an_action_that_exists():
    for state, action in TRANSITIONS.values():
        assert isinstance(state, ClientState)
        assert action is None or callable(getattr(RpcClient, f"_do_{action}"))
    assert {event for _, event in TRANSITIONS} == set(ClientEventKind) - {ClientEventKind.CANCEL_ACK}


@pytest.mark.parametrize(
    ("kind", "state", "answered"),
    [
        ("FACK", "WAITING", []),
        ("FACK", "RECEIVING", []),
        ("WORKING", "WAITING", []),
        ("WORKING", "RECEIVING", []),
        ("NOCALL", "WAITING", ["REQUEST"]),
        ("NOCALL", "RECEIVING", ["REQUEST"]),
        ("CANCEL_ACK", "WAITING", []),
        ("REQUEST", "WAITING", []),
        ("PING", "WAITING", []),
        ("ACK", "WAITING", []),
        ("CL_CANCEL", "WAITING", []),
    ],
)
def test_each_pdu_that_does_not_end_a_call(kind, state, answered):
    caller = client()
    call(caller)
    [asked] = sent(caller)
    if state == "RECEIVING":
        put(caller, answer_parts(asked, 5_000)[0])
    again = put(caller, about(asked, PacketType[kind], fragment_number=FRAGMENT_NONE))
    assert [PacketType(pdu.kind).name for pdu in again] == answered
    assert (caller.open_calls, caller.events()) == (1, [])


def test_unused_activities_are_forgotten():
    caller = client(idle_ns=60_000 * MS)
    call(caller)
    put(caller, reply(sent(caller)[0]))
    assert caller.next_deadline() == 60_000 * MS
    caller.handle_timeout(60_000 * MS)
    assert caller.next_deadline() is None
    call(caller)
    assert sent(caller)[0].activity.int == 2


def test_the_endpoint_mapper_is_called_without_ndr_arguments_of_profinet():
    caller = client()
    number = caller.call(PEER, PORT, UUID_EPM, UUID(int=0), 2, 0, b"lookup", 0)
    [asked] = sent(caller)
    assert (asked.body, asked.interface_version) == (b"lookup", 3)
    put(caller, reply(asked, body=b"entries"))
    assert caller.events() == [CallReturned(number, OK, b"entries", PEER, True)]


def test_a_payload_beyond_64_kib_is_the_callers_mistake():
    with pytest.raises(ValueError, match="at most 65536 fit"):
        call(client(), bytes(65_537))


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(st.integers(0, 12), st.integers(0, 0x7F), st.integers(0, 4), st.binary(max_size=40), st.booleans()),
        max_size=30,
    )
)
def test_any_answers_end_a_call_once(answers):
    caller = client()
    number = call(caller, bytes(4096))
    [asked] = sent(caller)
    now = 0
    for kind, flags, fragment, body, little in answers:
        drep = b"\x10\0\0" if little else bytes(3)
        pdu = replace(asked, packet_type=kind, flags1=flags, fragment_number=fragment, body=body, drep=drep)
        assert len(put(caller, pdu, now)) <= 5
        now += 50 * MS
        caller.handle_timeout(now)
    caller.handle_timeout(20_000 * MS)
    assert [event.call_id for event in caller.events()] == [number]
    assert caller.open_calls == 0
