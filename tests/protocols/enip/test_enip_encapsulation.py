"""Sessions, commands and datagrams of one drive, as a peer sees them."""

import pytest
from enip_bench import PEER, SECOND, Bench
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.enip.encapsulation import EncapsulationSettings, SendStream, StreamEnd
from pnfarm.protocols.enip.wire import cpf, epath
from pnfarm.protocols.enip.wire.encapsulation import (
    Command,
    EncapsulationPdu,
    EncapsulationStatus,
    emit_encapsulation,
    parse_encapsulation,
)
from pnfarm.protocols.enip.wire.identity import IdentityItem, ServiceItem

READ_VENDOR = bytes.fromhex("0e03 2001 2401 3001")
REGISTER = EncapsulationPdu(Command.REGISTER_SESSION, b"\1\0\0\0")


def rr(session, message=READ_VENDOR, **more):
    packet = cpf.CommonPacket((cpf.NullAddress(), cpf.UnconnectedData(message)))
    return EncapsulationPdu(Command.SEND_RR_DATA, packet.emit(), session, **more)


@pytest.fixture
def bench():
    bench = Bench()
    bench.drive.opened(1, PEER, bench.now)
    return bench


def test_a_session_is_registered_used_and_unregistered(bench):
    (reply,) = bench.ask(REGISTER)
    assert (reply.status, reply.data) == (0, b"\1\0\0\0")
    assert reply.session != 0
    (answer,) = bench.ask(rr(reply.session))
    assert answer.data.endswith(bytes.fromhex("8e000000 c401"))
    assert bench.ask(EncapsulationPdu(Command.UNREGISTER_SESSION, session=reply.session)) == []
    assert bench.ended()
    assert bench.drive.encapsulation.sessions == 0


def test_lists_need_no_session(bench):
    (services,) = bench.ask(EncapsulationPdu(Command.LIST_SERVICES))
    (identity,) = bench.ask(EncapsulationPdu(Command.LIST_IDENTITY))
    (interfaces,) = bench.ask(EncapsulationPdu(Command.LIST_INTERFACES))
    assert cpf.parse_items(services.data) == (ServiceItem(0x0120),)
    (item,) = cpf.parse_items(identity.data)
    assert isinstance(item, IdentityItem)
    assert (item.vendor_id, item.name, str(item.address)) == (452, b"AKD", "10.77.0.11")
    assert interfaces.data == b"\0\0"


@pytest.mark.parametrize(
    ("pdu", "status"),
    [
        (EncapsulationPdu(0x1234), 0x01),
        (EncapsulationPdu(Command.REGISTER_SESSION, b"\1\0"), 0x65),
        (EncapsulationPdu(Command.REGISTER_SESSION, b"\1\0\0\0\0"), 0x65),
        (EncapsulationPdu(Command.REGISTER_SESSION, b"\2\0\0\0"), 0x69),
        (EncapsulationPdu(Command.REGISTER_SESSION, b"\1\0\1\0"), 0x69),
        (EncapsulationPdu(Command.LIST_IDENTITY, b"x"), 0x65),
        (rr(0), 0x64),
        (rr(77), 0x64),
        (EncapsulationPdu(Command.UNREGISTER_SESSION, session=5), 0x64),
        (EncapsulationPdu(Command.SEND_UNIT_DATA, session=5), 0x64),
    ],
)
def test_a_wrong_command_before_the_session_has_its_status_and_the_stream_stays(bench, pdu, status):
    (reply,) = bench.ask(pdu)
    assert (reply.command, reply.status) == (pdu.command, status)
    assert not bench.ended()
    (reply,) = bench.ask(REGISTER)
    assert reply.status == 0


def test_the_refusal_of_a_version_tells_the_one_that_is_spoken(bench):
    (reply,) = bench.ask(EncapsulationPdu(Command.REGISTER_SESSION, b"\7\0\0\0"))
    assert (reply.status, reply.data) == (0x69, b"\1\0\0\0")


def test_a_second_session_on_a_stream_is_refused_and_a_session_of_another_stream_is_not_known(bench):
    (first,) = bench.ask(REGISTER)
    (second,) = bench.ask(REGISTER)
    assert (second.status, second.session) == (0x01, first.session)
    other = bench.register(stream=2)
    assert other != first.session
    (reply,) = bench.ask(rr(other), stream=1)
    assert reply.status == EncapsulationStatus.INVALID_SESSION_HANDLE


@pytest.mark.parametrize(
    "data",
    [
        b"",
        bytes(6),
        cpf.CommonPacket((cpf.NullAddress(),)).emit(),
        cpf.CommonPacket((cpf.UnconnectedData(READ_VENDOR), cpf.NullAddress())).emit(),
        cpf.CommonPacket((cpf.NullAddress(), cpf.UnconnectedData(READ_VENDOR)), interface=1).emit(),
        cpf.CommonPacket((cpf.NullAddress(), cpf.UnconnectedData(b""))).emit(),
    ],
)
def test_items_that_are_no_unconnected_request_are_incorrect_data(bench, data):
    (registered,) = bench.ask(REGISTER)
    (reply,) = bench.ask(EncapsulationPdu(Command.SEND_RR_DATA, data, registered.session))
    assert reply.status == EncapsulationStatus.INCORRECT_DATA


@pytest.mark.parametrize("change", [{"options": 1}, {"status": 3}])
def test_a_request_with_options_or_a_status_is_dropped(bench, change):
    assert bench.ask(EncapsulationPdu(Command.LIST_IDENTITY, **change)) == []
    assert sum(bench.drive.encapsulation.discards.values()) == 1


def test_nop_has_no_reply_with_and_without_data(bench):
    assert bench.ask(EncapsulationPdu(Command.NOP, b"anything")) == []
    assert bench.datagram(emit_encapsulation(EncapsulationPdu(Command.NOP))) == []


@given(st.data())
def test_octets_in_any_pieces_give_the_same_replies(data):
    stream = b"".join(
        emit_encapsulation(pdu)
        for pdu in (
            REGISTER,
            rr(1),
            EncapsulationPdu(Command.NOP, b"abc"),
            EncapsulationPdu(0x99),
            rr(1, context=b"8" * 8),
        )
    )
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12)))
    replies = []
    for pieces in ([stream], [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]):
        bench = Bench()
        bench.drive.opened(1, PEER, bench.now)
        for piece in pieces:
            bench.drive.received(1, piece, bench.now)
        replies.append(b"".join(output.data for output in bench.drive.take_outputs()))
    assert replies[0] == replies[1]
    assert len(replies[0]) > 100


def test_a_message_longer_than_is_held_is_refused_and_skipped_in_bounded_memory():
    bench = Bench(EncapsulationSettings(message_octets=100))
    session = bench.register()
    header = emit_encapsulation(EncapsulationPdu(Command.SEND_RR_DATA, bytes(60_000), session))
    bench.drive.received(1, header[:1000], bench.now)
    (reply,) = bench.replies(1)
    assert reply.status == EncapsulationStatus.INVALID_LENGTH
    for start in range(1000, len(header), 1000):
        bench.drive.received(1, header[start : start + 1000], bench.now)
        assert len(bench.drive.encapsulation._streams[1].held) == 0
    (reply,) = bench.ask(rr(session))
    assert reply.status == 0


def test_another_timeout_counts_from_the_last_message_of_each_stream_and_0_is_none(bench):
    """Attribute 13 of the TCP/IP object."""
    path = epath.logical_path(0xF5, 1, 13)
    session = bench.register(1)
    bench.register(2)
    bench.later(30)
    assert bench.request(session, 0x10, path, b"\x28\0").status == 0
    bench.later(9.9)
    assert not bench.ended(2)
    bench.later(0.2)
    assert bench.ended(2)
    bench.register(3)
    assert bench.request(session, 0x10, path, b"\0\0").status == 0
    bench.later(10_000)
    assert not bench.ended(1)
    assert not bench.ended(3)
    assert bench.request(session, 0x10, path, b"\x01\0").status == 0
    bench.later(0.1)
    assert (bench.ended(1), bench.ended(3)) == (False, True), "it was silent for longer already"


def test_a_silent_stream_is_closed_after_the_inactivity_timeout_with_and_without_a_session(bench):
    bench.register(stream=2)
    bench.later(119.9)
    assert not bench.ended(1)
    bench.later(0.2)
    assert bench.ended(1)
    assert bench.ended(2)
    assert bench.drive.encapsulation.streams == 0


def test_octets_that_never_make_a_message_do_not_keep_a_stream_open(bench):
    octets = emit_encapsulation(EncapsulationPdu(Command.SEND_RR_DATA, bytes(2000)))
    for place in range(30):
        bench.drive.received(1, octets[place : place + 1], bench.now)
        bench.later(5)
    assert bench.ended(1)


def test_a_stream_in_use_stays_open(bench):
    session = bench.register(stream=2)
    for _ in range(5):
        bench.later(100)
        (reply,) = bench.ask(rr(session), stream=2)
        assert reply.status == 0
    assert not bench.ended(2)


def test_streams_beyond_the_bound_are_closed_and_a_closed_one_makes_room():
    bench = Bench(EncapsulationSettings(streams=3))
    for stream in range(1, 4):
        bench.register(stream)
    bench.drive.opened(4, PEER, bench.now)
    assert bench.collect() == [StreamEnd(4)]
    bench.drive.closed(2, bench.now)
    bench.register(5)
    assert bench.drive.encapsulation.sessions == 3


def test_a_flood_of_requests_in_one_piece_ends_the_stream_before_its_replies_fill_memory():
    bench = Bench(EncapsulationSettings(reply_octets=2000))
    bench.drive.opened(1, PEER, bench.now)
    bench.drive.received(1, emit_encapsulation(EncapsulationPdu(Command.LIST_IDENTITY)) * 1000, bench.now)
    outputs = bench.collect()
    assert outputs[-1] == StreamEnd(1)
    assert sum(len(output.data) for output in outputs[:-1]) <= 2000


def test_unicast_datagrams_are_answered_at_once_and_broadcast_ones_within_the_time_granted():
    bench = Bench()
    ask = emit_encapsulation(EncapsulationPdu(Command.LIST_IDENTITY, context=(700).to_bytes(2, "little") + bytes(6)))
    (now,) = bench.datagram(ask)
    assert now.peer == PEER
    assert bench.datagram(ask, broadcast=True) == []
    due = bench.drive.next_deadline()
    assert bench.now < due <= bench.now + SECOND * 7 // 10
    (later,) = bench.later(0.7)
    assert parse_encapsulation(later.data) == parse_encapsulation(now.data)


def test_drives_with_other_serial_numbers_answer_at_other_times():
    ask = emit_encapsulation(EncapsulationPdu(Command.LIST_IDENTITY))
    times = set()
    for serial in range(64):
        bench = Bench()
        bench.drive.encapsulation._random = serial * 2 + 1
        for _ in range(2):
            bench.datagram(ask, broadcast=True)
        times.add(bench.drive.next_deadline() - bench.now)
    assert len(times) > 48
    assert max(times) - min(times) > SECOND // 2


def test_delayed_answers_are_bounded():
    bench = Bench(EncapsulationSettings(delayed_answers=4))
    ask = emit_encapsulation(EncapsulationPdu(Command.LIST_IDENTITY))
    for _ in range(100):
        bench.datagram(ask, broadcast=True)
    assert len(bench.later(3)) == 4


@pytest.mark.parametrize("command", [Command.REGISTER_SESSION, Command.SEND_RR_DATA, Command.UNREGISTER_SESSION, 0x99])
def test_commands_of_streams_are_refused_as_datagrams_and_unanswered_as_broadcasts(command):
    bench = Bench()
    octets = emit_encapsulation(EncapsulationPdu(command, b"\1\0\0\0"))
    (answer,) = bench.datagram(octets)
    assert parse_encapsulation(answer.data).status == EncapsulationStatus.INVALID_COMMAND
    assert bench.datagram(octets, broadcast=True) == []
    assert bench.datagram(octets[:-1]) == []


def test_a_farm_that_stops_closes_every_stream(bench):
    bench.register(stream=2)
    bench.drive.end(bench.now)
    assert {output for output in bench.collect() if not isinstance(output, SendStream)} == {StreamEnd(1), StreamEnd(2)}
    assert bench.drive.next_deadline() is None


@given(st.lists(st.binary(max_size=80), max_size=20))
def test_any_octets_on_a_stream_do_no_harm(pieces):
    bench = Bench()
    bench.drive.opened(1, PEER, bench.now)
    for piece in pieces:
        bench.drive.received(1, piece, bench.now)
        bench.drive.datagram(piece, PEER, bench.now)
    bench.drive.take_outputs()
    other = bench.register(stream=2)
    (reply,) = bench.ask(rr(other), stream=2)
    assert reply.status == 0
