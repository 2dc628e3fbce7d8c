"""Requests and answers in fragments, as a client sees the called end."""

from dataclasses import replace

from rpc_support import MS, about, big_answer, fragments, put, received, request, sent, server

from pnfarm.protocols.profinet.rpc.server import (
    ServerState,
)
from pnfarm.protocols.profinet.wire.rpc.bodies import FackBody, parse_fack
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    BODY_MAX,
    FRAGMENT_NONE,
    Flags1,
    PacketType,
    drep,
    parse_response_args,
)


def test_fragments_are_acknowledged_and_joined():
    device = server()
    payload = bytes(range(256)) * 16
    parts = fragments(request(payload=payload))
    for number, part in enumerate(parts[:-1]):
        [fack] = put(device, replace(part, serial=number + 10))
        assert (fack.kind, fack.fragment_number) == (PacketType.FACK, number)
        body = parse_fack(fack.body, little_endian=True)
        assert body is not None
        assert body.serial == number + 10
    [fack] = put(device, parts[-1])
    assert (fack.kind, fack.fragment_number) == (PacketType.FACK, len(parts) - 1)
    assert received(device).payload == payload


def test_fragments_may_come_in_any_order_and_twice():
    device = server()
    payload = bytes(range(256)) * 16
    parts = fragments(request(payload=payload))
    [fack] = put(device, parts[1])
    assert fack.fragment_number == FRAGMENT_NONE
    for part in (parts[1], parts[2], parts[0]):
        put(device, part)
    assert received(device).payload == payload


def test_fragments_that_forbid_it_are_not_acknowledged():
    device = server()
    parts = fragments(request(payload=bytes(3000)), flags=Flags1.NO_FACK)
    assert [put(device, part) for part in parts] == [[], [], []]
    assert received(device).payload == bytes(3000)


def test_a_ping_during_reassembly_is_answered_with_how_much_arrived():
    device = server()
    parts = fragments(request(payload=bytes(3000)))
    put(device, parts[0])
    [answer] = put(device, about(parts[0], PacketType.PING))
    assert (answer.kind, answer.fragment_number) == (PacketType.NOCALL, 0)
    assert parse_fack(answer.body, little_endian=True) is not None


def test_fragments_in_another_byte_order_do_not_belong():
    device = server()
    parts = fragments(request(payload=bytes(3000)))
    put(device, parts[0])
    put(device, replace(parts[1], drep=drep(little_endian=False)))
    assert device.dropped["fragments-differ"] == 1


def test_a_request_that_never_ends_is_rejected():
    device = server()
    whole = request(payload=b"")
    kinds = []
    for number in range(60):
        part = replace(whole, body=bytes(BODY_MAX), fragment_number=number, flags1=int(Flags1.FRAGMENT))
        kinds += [pdu.kind for pdu in put(device, part)]
        if kinds[-1] == PacketType.REJECT:
            break
    assert kinds[-1] == PacketType.REJECT
    assert device.held_octets == 0
    assert device.activities == {}


def test_a_request_that_does_not_fit_into_memory_is_dropped():
    device = server(held_octets_max=2_000)
    parts = fragments(request(payload=bytes(3000)))
    put(device, parts[0])
    assert put(device, parts[1]) == []
    assert device.dropped["held-octets"] == 1
    assert device.held_octets == 0


def test_a_long_answer_waits_for_each_fragment_to_be_acknowledged():
    device = server()
    parts = big_answer(device)
    while len(parts) < 8:
        assert parts[-1].wants_fack
        parts += put(device, about(request(), PacketType.FACK, fragment_number=parts[-1].fragment_number))
    assert [part.fragment_number for part in parts] == list(range(8))
    assert parts[-1].is_last
    assert put(device, about(request(), PacketType.FACK, fragment_number=7)) == []
    stub = b"".join(part.body for part in parts)
    assert parse_response_args(stub, little_endian=True).payload == bytes(10_000)
    assert set(device.activities.values()) == {ServerState.REPLIED}


def test_an_advertised_window_lets_several_fragments_out():
    device = server()
    big_answer(device)
    body = FackBody(8, 65536, 1464, 0).emit(little_endian=True)
    burst = put(device, replace(about(request(), PacketType.FACK, fragment_number=0), body=body))
    assert [(part.fragment_number, part.wants_fack) for part in burst] == [(1, False), (2, True)]
    burst = put(device, replace(about(request(), PacketType.FACK, fragment_number=2), body=body))
    assert [(part.fragment_number, part.wants_fack) for part in burst] == [(3, False), (4, False), (5, True)]


def test_a_fack_that_shows_a_gap_makes_the_server_go_back():
    device = server()
    big_answer(device)
    body = FackBody(8, 65536, 1464, 0).emit(little_endian=True)
    put(device, replace(about(request(), PacketType.FACK, fragment_number=0), body=body))
    burst = put(device, replace(about(request(), PacketType.FACK, fragment_number=1), body=body))
    assert burst[0].fragment_number == 2


def test_a_fragment_without_acknowledgement_is_sent_again_and_then_given_up():
    device = server(fragment_retry_ns=500 * MS, fragment_tries=3)
    big_answer(device)
    times = []
    while set(device.activities.values()) == {ServerState.REPLYING}:
        now = device.next_deadline()
        device.handle_timeout(now)
        again = sent(device)
        times += [now // MS] * len(again)
        assert all(part.fragment_number == 0 for part in again)
    assert times == [500, 1000]
    # the answer is still there for a client that asks again
    assert put(device, request(), 9_000 * MS)[0].fragment_number == 0


def test_an_absurd_fack_changes_nothing():
    device = server()
    big_answer(device)
    for number in (5, 0xFFFE, FRAGMENT_NONE):
        assert put(device, about(request(), PacketType.FACK, fragment_number=number)) == []
    broken = replace(about(request(), PacketType.FACK), body=b"\x09")
    assert put(device, broken) == []
    assert device.dropped["fack-bad-version"] == 1
