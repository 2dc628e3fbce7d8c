"""Each kind of PDU in each state of a call, and what a server refuses: exact kinds, codes and side effects."""

from __future__ import annotations

from dataclasses import replace
from ipaddress import IPv4Address
from uuid import UUID

import pytest
from rpc_support import ENDPOINTS, MS, PEER, about, fragments, put, received, request, sent, server

from pnfarm.protocols.profinet.rpc.activities import TRANSITIONS, ServerEventKind
from pnfarm.protocols.profinet.rpc.events import (
    TIMEOUT_FRAG_NS,
    TIMEOUT_IDLE_NS,
    TIMEOUT_PING_NS,
    TIMEOUT_RESEND_NS,
    RpcClientConfig,
    RpcServerConfig,
)
from pnfarm.protocols.profinet.rpc.server import CallReceived, Peer, RpcServer, ServerState
from pnfarm.protocols.profinet.wire.rpc.bodies import CancelAckBody, CancelBody, parse_cancel_ack, parse_fack
from pnfarm.protocols.profinet.wire.rpc.epm import LookupRequest, emit_lookup_request
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    FRAGMENT_NONE,
    NIL_UUID,
    OK,
    RPC_PORT,
    UUID_EPM,
    Flags1,
    NcaStatus,
    Opnum,
    PacketType,
    emit_rpc,
    parse_response_args,
    parse_status,
)

CALL = request(5, bytes(3_000))
PARTS = fragments(CALL)
CANCEL = CancelBody(7).emit(little_endian=True)
ATMO = {"flags1": 0}  # at most once: the idempotent flag is not set


def in_state(state: ServerState | None, **settings) -> RpcServer:
    """A server whose call 5 is in this state; None: it knows nothing of the client."""
    device = server(**settings)
    if state is None:
        return device
    put(device, PARTS[0])
    if state is not ServerState.RECEIVING:
        for part in PARTS[1:]:
            put(device, part)
        call = received(device).call
        if state in {ServerState.REPLYING, ServerState.REPLIED, ServerState.IDLE}:
            device.respond(call, OK, bytes(3_000 if state is ServerState.REPLYING else 30), 0)
        if state is ServerState.IDLE:
            put(device, about(CALL, PacketType.ACK))
        if state is ServerState.ORPHANED:
            put(device, about(CALL, PacketType.CL_CANCEL))
    device.events()
    sent(device)
    assert list(device.activities.values()) == [state]
    return device


def kinds(answers) -> list[str]:
    return [PacketType(pdu.kind).name for pdu in answers]


STATES = [None, *ServerState]
#: What is answered to a PDU about call 5, and the state after it; same: unchanged.
MATRIX = {
    ("PING", None): (["NOCALL"], "same"),
    ("PING", "IDLE"): (["NOCALL"], "same"),
    ("PING", "RECEIVING"): (["NOCALL"], "same"),
    ("PING", "EXECUTING"): (["WORKING"], "same"),
    ("PING", "ORPHANED"): (["NOCALL"], "same"),
    ("PING", "REPLYING"): (["RESPONSE"], "same"),
    ("PING", "REPLIED"): (["RESPONSE"], "same"),
    ("ACK", None): ([], "same"),
    ("ACK", "IDLE"): ([], "same"),
    ("ACK", "RECEIVING"): ([], "same"),
    ("ACK", "EXECUTING"): ([], "same"),
    ("ACK", "ORPHANED"): ([], "same"),
    ("ACK", "REPLYING"): ([], "IDLE"),
    ("ACK", "REPLIED"): ([], "IDLE"),
    ("FACK", None): ([], "same"),
    ("FACK", "IDLE"): ([], "same"),
    ("FACK", "RECEIVING"): ([], "same"),
    ("FACK", "EXECUTING"): ([], "same"),
    ("FACK", "ORPHANED"): ([], "same"),
    ("FACK", "REPLYING"): (["RESPONSE"], "same"),
    ("FACK", "REPLIED"): ([], "same"),
    ("CANCEL", None): ([], "same"),
    ("CANCEL", "IDLE"): (["CANCEL_ACK"], "same"),
    ("CANCEL", "RECEIVING"): (["CANCEL_ACK", "FAULT"], "REPLIED"),
    ("CANCEL", "EXECUTING"): (["CANCEL_ACK"], "same"),
    ("CANCEL", "ORPHANED"): (["CANCEL_ACK"], "same"),
    ("CANCEL", "REPLYING"): (["CANCEL_ACK"], "same"),
    ("CANCEL", "REPLIED"): (["CANCEL_ACK"], "same"),
    ("ORPHAN", None): ([], "same"),
    ("ORPHAN", "IDLE"): (["CANCEL_ACK"], "same"),
    ("ORPHAN", "RECEIVING"): (["CANCEL_ACK"], "ORPHANED"),
    ("ORPHAN", "EXECUTING"): (["CANCEL_ACK"], "ORPHANED"),
    ("ORPHAN", "ORPHANED"): (["CANCEL_ACK"], "same"),
    ("ORPHAN", "REPLYING"): (["CANCEL_ACK"], "ORPHANED"),
    ("ORPHAN", "REPLIED"): (["CANCEL_ACK"], "ORPHANED"),
    ("REQUEST", None): (["FACK"], "RECEIVING"),
    ("REQUEST", "IDLE"): (["FACK"], "RECEIVING"),
    ("REQUEST", "RECEIVING"): (["FACK"], "same"),
    ("REQUEST", "EXECUTING"): (["WORKING"], "same"),
    ("REQUEST", "ORPHANED"): ([], "same"),
    ("REQUEST", "REPLYING"): (["RESPONSE"], "same"),
    ("REQUEST", "REPLIED"): (["RESPONSE"], "same"),
    ("NEXT REQUEST", None): (["FACK"], "RECEIVING"),
    **{("NEXT REQUEST", state.name): (["FACK"], "RECEIVING") for state in ServerState},
    ("OLD REQUEST", None): (["FACK"], "RECEIVING"),
    **{("OLD REQUEST", state.name): ([], "same") for state in ServerState},
}
PDUS = {
    "PING": about(CALL, PacketType.PING),
    "ACK": about(CALL, PacketType.ACK),
    "FACK": about(CALL, PacketType.FACK, fragment_number=0),
    "CANCEL": about(CALL, PacketType.CL_CANCEL, body=CANCEL),
    "ORPHAN": about(CALL, PacketType.CL_CANCEL),
    "REQUEST": PARTS[0],
    "NEXT REQUEST": replace(PARTS[0], sequence=6),
    "OLD REQUEST": replace(PARTS[0], sequence=4),
}


@pytest.mark.parametrize("state", STATES, ids=str)
@pytest.mark.parametrize("pdu", PDUS)
def test_each_pdu_in_each_state(pdu, state):
    wanted, after = MATRIX[pdu, state.name if state else None]
    device = in_state(state)
    executed = 0
    assert kinds(put(device, PDUS[pdu], 10 * MS)) == wanted
    executed += sum(isinstance(event, CallReceived) for event in device.events())
    states = [row.name for row in device.activities.values()]
    assert states == ([state.name] if state else []) if after == "same" else states == [after]
    assert executed == 0
    if not wanted:
        assert sum(device.dropped.values()) or after != "same"


def test_every_row_of_the_table_names_an_action_that_exists():
    for state, action in TRANSITIONS.values():
        assert isinstance(state, ServerState)
        assert action is None or callable(getattr(RpcServer, f"_do_{action}"))
    assert {state for state, _ in TRANSITIONS} == set(ServerState)
    assert {event for _, event in TRANSITIONS} == set(ServerEventKind)


def test_the_times_are_those_of_c706_appendix_k():
    times = (TIMEOUT_FRAG_NS, TIMEOUT_IDLE_NS, TIMEOUT_PING_NS, TIMEOUT_RESEND_NS)
    assert [time // (1_000 * MS) for time in times] == [2, 300, 2, 2]
    config = RpcServerConfig()
    assert (config.fragment_retry_ns, config.idle_ns, config.resend_ns) == (
        TIMEOUT_FRAG_NS,
        TIMEOUT_IDLE_NS,
        TIMEOUT_RESEND_NS,
    )


@pytest.mark.parametrize("octets", [0, 12, 1388, 1392])
@pytest.mark.parametrize("config", [RpcServerConfig, RpcClientConfig])
def test_fragments_are_multiples_of_eight_that_everybody_takes(config, octets):
    with pytest.raises(ValueError, match="multiples of 8 up to 1384"):
        config(fragment_octets=octets)


# -- pings, numbers, reruns ------------------------------------------------------------------------------------------


def test_a_ping_with_a_newer_number_is_no_call_and_an_older_one_is_a_late_duplicate():
    device = in_state(ServerState.REPLIED)
    [answer] = put(device, about(CALL, PacketType.PING, sequence=6))
    assert (answer.kind, answer.fragment_number) == (PacketType.NOCALL, FRAGMENT_NONE)
    assert put(device, about(CALL, PacketType.PING, sequence=4)) == []
    assert device.dropped["no-call-for-ping"] == 1


@pytest.mark.parametrize("step", [1, 2, 0x7FFFFFFF])
def test_a_number_ahead_is_a_new_call_however_far(step):
    device = in_state(ServerState.REPLIED)
    assert put(device, request(5 + step & 0xFFFFFFFF)) == []
    assert received(device).call.sequence == 5 + step & 0xFFFFFFFF


@pytest.mark.parametrize("step", [0x80000000, 0xFFFFFFFF])
def test_a_lower_number_is_old(step):
    device = in_state(ServerState.REPLIED)
    assert put(device, request(5 + step & 0xFFFFFFFF)) == []
    assert device.events() == []
    assert device.dropped["old-sequence"] == 1


def test_another_operation_under_the_last_number_is_a_restarted_client():
    device = server()
    put(device, request(0, opnum=Opnum.CONNECT))
    device.respond(received(device).call, OK, b"connected", 0)
    put(device, request(0, opnum=Opnum.READ))
    assert received(device).opnum == Opnum.READ


def test_a_reply_is_sent_again_from_what_is_kept_while_other_clients_call():
    device = server()
    others = [request(0, activity=UUID(int=number)) for number in range(1, 9)]
    put(device, request())
    device.respond(received(device).call, OK, b"first", 0)
    [first] = sent(device)
    ran = 1
    for now, other in enumerate(others):
        put(device, other, now * MS)
        ran += 1
        device.respond(received(device).call, OK, b"other", now * MS)
        sent(device)
        [again] = put(device, request(), now * MS)
        assert again.body == first.body
        assert device.events() == []
    assert ran == 9


@pytest.mark.parametrize(
    ("flags", "answered", "runs"), [(Flags1.IDEMPOTENT, [], 1), (0, ["REJECT"], 0)], ids=["idempotent", "once"]
)
def test_a_call_whose_reply_is_too_old_runs_again_only_if_its_client_allows(flags, answered, runs):
    device = server(reply_ns=10_000 * MS, resend_ns=10_000 * MS, fragment_tries=1)
    put(device, request(flags1=int(flags)))
    device.respond(received(device).call, OK, b"reply", 0)
    sent(device)
    for now in (10_000 * MS, 20_000 * MS):
        device.handle_timeout(now)
    assert list(device.activities.values()) == [ServerState.IDLE]
    assert device.held_octets == 0
    again = put(device, request(flags1=int(flags)), 21_000 * MS)
    assert kinds(again) == answered
    assert len(device.events()) == runs
    if answered:
        assert parse_status(again[0].body, little_endian=True) == NcaStatus.PROTO_ERROR


def test_the_middle_of_a_call_that_must_not_run_again_is_not_rejected_only_its_beginning():
    device = server()
    parts = [replace(part, flags1=part.flags1 & ~int(Flags1.IDEMPOTENT)) for part in PARTS]
    for part in parts:
        put(device, part)
    device.respond(received(device).call, OK, b"", 0)
    put(device, about(CALL, PacketType.ACK))
    assert put(device, parts[1]) == []
    assert device.dropped["rerun-fragment"] == 1
    assert kinds(put(device, parts[0])) == ["REJECT"]


def test_the_reply_to_a_call_that_must_not_run_twice_is_sent_until_it_is_acknowledged():
    device = server()
    put(device, request(**ATMO))
    device.respond(received(device).call, OK, b"reply", 0)
    assert kinds(sent(device)) == ["RESPONSE"]
    for times in (1, 2):
        now = device.next_deadline()
        assert now == times * TIMEOUT_RESEND_NS
        device.handle_timeout(now)
        assert kinds(sent(device)) == ["RESPONSE"]
    put(device, about(request(), PacketType.ACK), 5_000 * MS)
    device.handle_timeout(20_000 * MS)
    assert sent(device) == []
    assert list(device.activities.values()) == [ServerState.IDLE]


def test_a_reply_without_acknowledgement_is_sent_no_more_after_some_times_but_kept():
    device = server(fragment_tries=3)
    put(device, request(**ATMO))
    device.respond(received(device).call, OK, b"reply", 0)
    count = len(sent(device))
    while list(device.activities.values()) == [ServerState.REPLYING]:
        now = device.next_deadline()
        device.handle_timeout(now)
        count += len(sent(device))
    assert count == 3
    assert kinds(put(device, request(**ATMO), now)) == ["RESPONSE"]


# -- cancels ---------------------------------------------------------------------------------------------------------


def test_a_call_that_is_cancelled_before_it_is_complete_never_runs():
    device = in_state(ServerState.RECEIVING)
    ack, fault = put(device, PDUS["CANCEL"])
    assert parse_cancel_ack(ack.body, little_endian=True) == CancelAckBody(7, accepting=True)
    assert parse_status(fault.body, little_endian=True) == NcaStatus.FAULT_CANCEL
    for part in PARTS:
        assert "RESPONSE" not in kinds(put(device, part))
    assert device.events() == []
    assert device.held_octets == len(fault.body)


@pytest.mark.parametrize("little", [False, True])
def test_a_cancel_that_comes_too_late_is_reported_as_late(little):
    device = server()
    call = request(little=little)
    put(device, call)
    device.respond(received(device).call, OK, b"", 0)
    sent(device)
    [ack] = put(device, about(call, PacketType.CL_CANCEL, body=CancelBody(9).emit(little_endian=little)))
    assert parse_cancel_ack(ack.body, little_endian=little) == CancelAckBody(9, accepting=False)
    assert device.events() == []


def test_an_orphaned_calls_answer_goes_nowhere_and_the_next_call_is_served():
    device = server()
    put(device, request(1))
    call = received(device).call
    [ack] = put(device, about(request(1), PacketType.CL_CANCEL))
    assert ack.body == b""
    assert device.events() == []
    assert not device.respond(call, OK, b"late", 0)
    assert sent(device) == []
    # a late duplicate of the request does not bring it back, until it cannot be one any more
    assert put(device, request(1), 10 * MS) == []
    device.handle_timeout(60_000 * MS)
    assert list(device.activities.values()) == [ServerState.IDLE]
    assert device.events() == []
    put(device, request(2))
    assert device.respond(received(device).call, OK, b"", 0)


def test_an_orphan_for_a_call_that_never_came_is_acknowledged():
    device = in_state(ServerState.REPLIED)
    assert kinds(put(device, about(CALL, PacketType.CL_CANCEL, sequence=6))) == ["CANCEL_ACK"]
    assert put(device, about(CALL, PacketType.CL_CANCEL, sequence=4)) == []


@pytest.mark.parametrize("body", [b"\0", bytes(7), b"\1" + bytes(7), bytes(12)])
def test_a_cancel_that_does_not_read_changes_nothing(body):
    device = in_state(ServerState.EXECUTING)
    assert put(device, about(CALL, PacketType.CL_CANCEL, body=body)) == []
    assert device.events() == []
    assert [reason for reason in device.dropped if reason.startswith("cancel-")]
    assert list(device.activities.values()) == [ServerState.EXECUTING]


# -- representation, ports, bounds -----------------------------------------------------------------------------------


@pytest.mark.parametrize("drep", [b"\x10\0\0", b"\0\0\0", b"\x10\1\0", b"\0\2\0", b"\x10\3\0"])
def test_answers_represent_integers_and_floats_as_the_client_does(drep):
    device = server()
    put(device, request(little=drep[0] == 0x10, drep=drep))
    device.respond(received(device).call, OK, b"", 0)
    assert [answer.drep for answer in sent(device)] == [drep]
    [answer] = put(device, request(9, little=drep[0] == 0x10, drep=drep, opnum=77))
    assert answer.drep == drep


def test_answers_are_ascii_whatever_the_client_writes():
    device = server()
    put(device, request(drep=b"\x11\0\0"))
    device.respond(received(device).call, OK, b"", 0)
    assert [answer.drep for answer in sent(device)] == [b"\x10\0\0"]


def test_answers_go_from_the_port_that_was_called_to_the_port_that_called_last():
    device = server()
    for number, port in enumerate((49152, 50001, 1208)):
        device.receive(Peer(PEER.ip, port), RPC_PORT, emit_rpc(request(number)), 0)
        device.respond(received(device).call, OK, b"", 0)
        [datagram] = device.to_send(0)
        assert (datagram.local_port, datagram.peer) == (RPC_PORT, Peer(PEER.ip, port))


def test_two_fragmented_calls_of_one_client_interleave():
    device = server()
    payloads = {UUID(int=1): bytes(range(256)) * 12, UUID(int=2): bytes(range(255, -1, -1)) * 12}
    parts = [fragments(request(payload=payload, activity=uuid)) for uuid, payload in payloads.items()]
    for pair in zip(*parts, strict=True):
        for part in pair:
            put(device, part)
    calls = {event.call.activity: event for event in device.events()}
    assert {uuid: event.payload for uuid, event in calls.items()} == payloads
    for event in calls.values():
        device.respond(event.call, OK, event.payload, 0)
    stubs = dict.fromkeys(payloads, b"")
    out = sent(device)
    while out:
        pdu = out.pop(0)
        stubs[pdu.activity] += pdu.body
        out += put(device, about(pdu, PacketType.FACK, fragment_number=pdu.fragment_number))
    for uuid, stub in stubs.items():
        assert parse_response_args(stub, little_endian=True).payload == payloads[uuid]


def test_a_station_that_floods_does_not_cost_another_the_reply_kept_for_it():
    device = server(activities_max=8)
    put(device, request())
    device.respond(received(device).call, OK, b"kept", 0)
    sent(device)
    stranger = Peer(IPv4Address("10.77.9.9"), 1)
    for number in range(1, 100):
        put(device, request(activity=UUID(int=number)), number * MS, stranger)
        device.respond(received(device).call, OK, bytes(1_000), number * MS)
        sent(device)
    assert len(device.activities) == 8
    assert kinds(put(device, request(), 200 * MS)) == ["RESPONSE"]
    assert device.events() == []


def test_a_whole_64_kib_request_is_taken_and_one_octet_more_rejected():
    for size, kind in ((65_536, None), (65_537, "REJECT")):
        device = server()
        answers = []
        for part in fragments(request(payload=bytes(size), maximum=70_000), flags=Flags1.NO_FACK):
            answers += put(device, part)
        assert kinds(answers) == ([kind] if kind else [])
        assert len(device.events()) == (kind is None)


def test_the_last_fragments_serial_number_is_acknowledged():
    device = server()
    for number, part in enumerate(PARTS):
        [fack] = put(device, replace(part, serial=100 + number))
        body = parse_fack(fack.body, little_endian=True)
        assert body is not None
        assert (fack.fragment_number, body.serial) == (number, 100 + number)
    put(device, PARTS[0])
    assert len(device.events()) == 1


def test_a_lost_fragment_is_reported_by_the_number_before_it():
    device = server()
    numbers = []
    for part in (PARTS[0], PARTS[2], PARTS[2], PARTS[1]):
        [fack] = put(device, part)
        numbers.append(fack.fragment_number)
    assert numbers == [0, 0, 0, 2]
    assert received(device).payload == bytes(3_000)


def test_the_memory_of_a_call_that_ended_is_free():
    device = in_state(ServerState.REPLYING)
    assert device.held_octets == 3_020
    put(device, about(CALL, PacketType.CL_CANCEL))
    assert device.held_octets == 0


# -- lookups before calls --------------------------------------------------------------------------------------------


def after_lookups(number):
    """A server of which the same activity asked its endpoint mapper, the last time under ``number``."""
    device = server(endpoints=ENDPOINTS)
    lookup = request(number, opnum=2, interface=UUID_EPM, object_uuid=NIL_UUID, interface_version=3)
    [answer] = put(device, replace(lookup, body=emit_lookup_request(LookupRequest(), little_endian=True)))
    assert answer.kind == PacketType.RESPONSE
    return device


@pytest.mark.parametrize("number", [0, 1, 3])
def test_a_client_may_count_again_from_0_after_its_lookups(number):
    """py-profinet looks a device up under 1, 2 and 3 and connects under 0, all in one activity."""
    device = after_lookups(3)
    assert put(device, request(number, opnum=Opnum.CONNECT)) == []
    event = received(device)
    assert (event.opnum, event.call.sequence) == (Opnum.CONNECT, number)
    device.respond(event.call, OK, b"connected", 0)
    assert [answer.kind for answer in sent(device)] == [PacketType.RESPONSE]


def test_after_the_first_call_numbers_count_for_lookups_too():
    """So that a Connect that the network delivers twice is not run twice, whatever came between."""
    device = after_lookups(1)
    connect = request(5, opnum=Opnum.CONNECT, flags1=0)
    put(device, connect)
    device.respond(received(device).call, OK, b"connected", 0)
    sent(device)
    lookup = request(6, opnum=2, interface=UUID_EPM, object_uuid=NIL_UUID, interface_version=3)
    put(device, replace(lookup, body=emit_lookup_request(LookupRequest(), little_endian=True)))
    assert put(device, connect) == []
    assert device.events() == []
    assert device.dropped["old-sequence"] == 1
