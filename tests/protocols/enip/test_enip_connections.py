"""Forward_Open and Forward_Close: what is opened, each refusal, ownership, time-outs, class 3."""

from dataclasses import replace
from ipaddress import IPv4Address

import pytest
from enip_bench import MANAGER, PEER, Bench, explicit_request, io_request

from pnfarm.protocols.enip.connection import (
    CloseReason,
    ConnectionClosed,
    ConnectionKind,
    ConnectionOpened,
    ConnectionRefused,
    ProductionMoved,
    RpiBelowMinimum,
)
from pnfarm.protocols.enip.connection_check import Refusal, check_io, read_path
from pnfarm.protocols.enip.connection_states import CONNECTION, ConnectionState
from pnfarm.protocols.enip.wire import cpf, encapsulation, message
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire.encapsulation import Command, EncapsulationPdu
from pnfarm.protocols.enip.wire.epath import ElectronicKey, NetworkSegment, logical_path

MULTICAST, P2P, NULL = fo.ConnectionType.MULTICAST, fo.ConnectionType.POINT_TO_POINT, fo.ConnectionType.NULL
INPUT_ONLY = {"points": (100, 193, 102), "o_to_t": 2}
LISTEN_ONLY = {"points": (100, 194, 102), "o_to_t": 2}


@pytest.fixture
def bench():
    return Bench()


@pytest.fixture
def session(bench):
    return bench.register()


# Opening


def test_the_manuals_connection_opens_as_multicast(bench, session):
    reply, items = bench.opened(session, io_request())
    (event,) = bench.take(ConnectionOpened)
    connection = event.connection
    assert (connection.kind, connection.produces) == (ConnectionKind.EXCLUSIVE_OWNER, True)
    assert connection.destination == (IPv4Address("239.192.2.64"), 2222)
    assert (reply.o_to_t_id, reply.t_to_o_id) == (connection.o_to_t_id, connection.t_to_o_id)
    assert reply.t_to_o_id != io_request().t_to_o_id, "who produces a multicast chooses its id"
    assert (reply.o_to_t_api_us, reply.t_to_o_api_us) == (10_000, 10_000)
    assert connection.timeout_ns == 160_000_000
    assert items == [
        cpf.SocketAddress(o_to_t=True, port=2222),
        cpf.SocketAddress(o_to_t=False, port=2222, address=IPv4Address("239.192.2.64")),
    ]


def test_a_point_to_point_connection_goes_to_the_originators_address_and_the_port_of_its_item(bench, session):
    reply, items = bench.opened(session, io_request(kind=P2P), cpf.SocketAddress(o_to_t=False, port=40_000))
    (event,) = bench.take(ConnectionOpened)
    assert event.connection.destination == (PEER[0], 40_000)
    assert reply.t_to_o_id == io_request().t_to_o_id, "who consumes point to point chooses its id"
    assert items == [cpf.SocketAddress(o_to_t=True, port=2222)]
    for items in ((), (cpf.SocketAddress(o_to_t=False, port=0),), (cpf.SocketAddress(o_to_t=True, port=40_000),)):
        bench.close(session, io_request().triad)
        bench.opened(session, io_request(kind=P2P), *items)
        assert bench.take(ConnectionOpened)[-1].connection.destination == (PEER[0], 2222)


def test_a_large_forward_open_opens_the_same(bench, session):
    reply, _ = bench.opened(session, io_request(large=True))
    assert reply.triad == io_request().triad


@pytest.mark.parametrize(
    "key",
    [
        ElectronicKey(),
        ElectronicKey(452, 43, 7, 1, 13),
        ElectronicKey(452, 0, 7),
        ElectronicKey(452, 43, 7, 1, 5, compatible=True),
        ElectronicKey(452, 43, 7, 0, 99),
    ],
)
def test_a_key_that_fits_and_zeros_in_it_are_accepted(bench, session, key):
    bench.opened(session, io_request(key=key))


# Refusals

REFUSALS = [
    ({"transport": fo.TransportClass(0)}, (0x0103,)),
    ({"transport": fo.TransportClass(2)}, (0x0103,)),
    ({"transport": fo.TransportClass(1, 2)}, (0x0103,)),
    ({"transport": fo.TransportClass(1, 0, server=True)}, (0x011E,)),
    ({"o_to_t_rpi_us": 0}, (0x0111,)),
    ({"t_to_o_rpi_us": 0}, (0x0111,)),
    ({"t_to_o_rpi_us": 60_000_000}, (0x0111,)),
    ({"key": ElectronicKey(453)}, (0x0114,)),
    ({"key": ElectronicKey(452, 43, 8)}, (0x0114,)),
    ({"key": ElectronicKey(452, 44)}, (0x0115,)),
    ({"key": ElectronicKey(452, 43, 7, 2)}, (0x0116,)),
    ({"key": ElectronicKey(452, 43, 7, 1, 12)}, (0x0116,)),
    ({"key": ElectronicKey(452, 43, 7, 1, 14, compatible=True)}, (0x0116,)),
    ({"class_id": 0x25}, (0x012F,)),
    ({"points": (100,)}, (0x0315,)),
    ({"points": (100, 101, 102, 103)}, (0x0315,)),
    (LISTEN_ONLY, (0x0119,)),
    ({"o_to_t": fo.NetworkParameters(70, MULTICAST)}, (0x0123,)),
    ({"t_to_o": fo.NetworkParameters(66, NULL)}, (0x0124,)),
    ({"o_to_t": fo.NetworkParameters(70, redundant_owner=True)}, (0x0125,)),
    ({"configuration": b"\1\2"}, (0x0126, 0)),
    ({"o_to_t": fo.NetworkParameters(66)}, (0x0127, 70)),
    ({"t_to_o": fo.NetworkParameters(64, MULTICAST)}, (0x0128, 66)),
    ({"points": (99, 101, 102)}, (0x012F,)),
    ({"points": (100, 102, 101)}, (0x012F,)),
    ({"points": (100, 101, 103)}, (0x012F,)),
    ({"o_to_t": fo.NetworkParameters(0, NULL), "t_to_o": fo.NetworkParameters(0, NULL)}, (0x0132,)),
    ({"timeout_multiplier": 8}, (0x0133,)),
    ({"more": [NetworkSegment(3, b"\x0b")]}, (0x011B,)),
    ({"path": b"\xe0\x00"}, (0x0315,)),
    ({"path": b""}, (0x0315,)),
]


@pytest.mark.parametrize(("change", "extended"), REFUSALS)
def test_each_refusal_has_its_extended_status(bench, session, change, extended):
    reply, items = bench.open(session, replace_request(change))
    assert (reply.status, reply.extended) == (0x01, extended)
    assert fo.ForwardRefusal.parse(reply.data).triad == io_request().triad
    assert items == []
    (event,) = bench.take(ConnectionRefused)
    assert event.extended == extended
    assert bench.drive.manager.connections == {}


def replace_request(change):
    """``io_request`` makes sizes from numbers; whole parameters replace them."""
    whole = {name: part for name, part in change.items() if isinstance(part, fo.NetworkParameters)}
    return replace(io_request(**{name: part for name, part in change.items() if name not in whole}), **whole)


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"points": (99, 101, 102)}, 0x0129),
        ({"points": (100, 99, 102)}, 0x012A),
        ({"points": (100, 101, 99)}, 0x012B),
        ({"points": (100, 102, 102)}, 0x012A),
        ({"points": (100,)}, 0x0117),
        ({"class_id": 0x25}, 0x0117),
    ],
)
def test_a_target_may_tell_wrong_paths_apart(change, status):
    bench = Bench(paths_told_apart=True)
    reply, _ = bench.open(bench.register(), io_request(**change))
    assert reply.extended == (status,)


NOTHING = {"o_to_t": fo.NetworkParameters(0, NULL), "t_to_o": fo.NetworkParameters(0, NULL)}


def test_a_forward_open_of_nothing_for_an_open_connection_is_refused_as_in_use_and_leaves_it_alone(bench, session):
    """A reconfiguration: the drive has no configuration data."""
    bench.opened(session, io_request())
    assert bench.open(session, replace(io_request(), **NOTHING))[0].extended == (0x0100,)
    assert len(bench.drive.manager.connections) == 1


def test_a_target_may_refuse_a_forward_open_of_nothing_as_an_unknown_path():
    bench = Bench(null_open_status=0x012F)
    assert bench.open(bench.register(), replace(io_request(), **NOTHING))[0].extended == (0x012F,)


def test_a_production_inhibit_time_up_to_the_interval_is_taken(bench, session):
    bench.opened(session, io_request(more=[NetworkSegment(3, b"\x0a")]))


def test_a_target_produces_at_multiples_of_its_step(bench):
    bench = Bench(interval_step_us=10_000)
    session = bench.register()
    asked = {"o_to_t_rpi_us": 12_000, "t_to_o_rpi_us": 12_000}
    reply, _ = bench.opened(session, io_request(**asked))
    assert (reply.o_to_t_api_us, reply.t_to_o_api_us) == (12_000, 20_000)
    bench.close(session, io_request().triad)
    reply, _ = bench.opened(session, io_request(t_to_o_rpi_us=30_000))
    assert reply.t_to_o_api_us == 30_000


def test_a_socket_address_of_another_family_is_a_parameter_error(bench, session):
    reply, _ = bench.open(session, io_request(), cpf.SocketAddress(o_to_t=False, port=1, family=10))
    assert reply.extended == (0x0205,)


def test_a_forward_open_that_is_cut_has_not_enough_data_and_counts(bench, session):
    body = fo.emit_forward_open(io_request())
    assert bench.request(session, 0x54, MANAGER, body[:-2]).status == 0x13
    assert bench.request(session, 0x54, MANAGER, body + b"\0").status == 0x15
    assert bench.request(session, 0x4E, MANAGER, b"\0").status == 0x13
    assert bench.request(session, 0x0E, logical_path(6, 1, 2)).data == b"\2\0"


def test_a_second_owner_a_second_open_and_too_many_are_refused():
    bench = Bench(io_connections=2)
    session = bench.register()
    bench.opened(session, io_request(1))
    assert bench.open(session, io_request(1))[0].extended == (0x0100,)
    assert bench.open(session, io_request(2))[0].extended == (0x0106,)
    bench.opened(session, io_request(3, **INPUT_ONLY))
    assert bench.open(session, io_request(4, **INPUT_ONLY))[0].extended == (0x011A,)
    bench.close(session, io_request(1).triad)
    bench.opened(session, io_request(4, **INPUT_ONLY))
    assert bench.open(session, io_request(5))[0].extended == (0x0113,)


@pytest.mark.parametrize("service", [0x56, 0x57, 0x5A])
def test_data_and_owner_of_connections_are_not_told(bench, session, service):
    """Get_Connection_Data, Search_Connection_Data and Get_Connection_Owner are optional."""
    bench.opened(session, io_request())
    reply = bench.request(session, service, MANAGER, (1).to_bytes(2, "little"))
    assert (reply.service, reply.status, reply.data) == (service, 0x08, b"")


def test_a_refusal_on_demand_has_the_status_that_was_asked_for(bench, session):
    bench.drive.manager.admit = lambda _: Refusal(0x031C)
    assert bench.open(session, io_request())[0].extended == (0x031C,)


@pytest.mark.parametrize(
    ("below", "answer"),
    [(RpiBelowMinimum.ROUND_UP, 10_000), (RpiBelowMinimum.ACCEPT, 2_000), (RpiBelowMinimum.REFUSE, None)],
)
def test_an_interval_below_the_minimum_is_rounded_up_taken_or_refused(below, answer):
    bench = Bench(below_minimum=below)
    session = bench.register()
    request = io_request(o_to_t_rpi_us=2_000, t_to_o_rpi_us=2_000, timeout_multiplier=0)
    if answer is None:
        assert bench.open(session, request)[0].extended == (0x0111,)
        return
    reply, _ = bench.opened(session, request)
    assert (reply.o_to_t_api_us, reply.t_to_o_api_us) == (2_000, answer)
    assert bench.take(ConnectionOpened)[0].connection.timeout_ns == 8_000_000


def test_nobody_gets_more_packets_than_one_in_100_us_whatever_the_target_accepts():
    bench = Bench(below_minimum=RpiBelowMinimum.ACCEPT)
    request = io_request(o_to_t_rpi_us=1, t_to_o_rpi_us=1)
    reply, _ = bench.opened(bench.register(), request)
    assert (reply.o_to_t_api_us, reply.t_to_o_api_us) == (1, 100)


# Closing


def test_a_forward_close_frees_the_connection_for_the_next(bench, session):
    bench.opened(session, io_request())
    reply = bench.close(session, io_request().triad)
    assert fo.ForwardCloseReply.parse(reply.data).triad == io_request().triad
    (event,) = bench.take(ConnectionClosed)
    assert event.reason is CloseReason.FORWARD_CLOSE
    assert event.connection.state is ConnectionState.NON_EXISTENT
    bench.opened(session, io_request(2))
    assert bench.close(session, io_request().triad).extended == (0x0107,)


def test_data_that_never_come_end_a_connection_after_ten_seconds(bench, session):
    bench.opened(session, io_request())
    bench.later(9.9)
    assert len(bench.drive.manager.connections) == 1
    bench.later(0.2)
    (event,) = bench.take(ConnectionClosed)
    assert (event.reason, event.before_data) == (CloseReason.TIMED_OUT, True)


def test_a_long_timeout_is_longer_than_ten_seconds_for_the_first_data_too(bench, session):
    bench.opened(session, io_request(o_to_t_rpi_us=1_000_000, timeout_multiplier=3))
    bench.later(31)
    assert len(bench.drive.manager.connections) == 1
    bench.later(2)
    assert bench.drive.manager.connections == {}


def test_with_data_only_the_engine_says_that_a_connection_expired_and_its_stream_goes_with_it(bench, session):
    bench.opened(session, io_request())
    number = bench.take(ConnectionOpened)[0].connection.number
    bench.drive.data_received(number, bench.now)
    bench.later(100)
    assert len(bench.drive.manager.connections) == 1
    bench.drive.expired(number, bench.now)
    bench.collect()
    (event,) = bench.take(ConnectionClosed)
    assert (event.reason, event.before_data) == (CloseReason.TIMED_OUT, False)
    assert bench.ended()
    bench.drive.expired(number, bench.now)
    assert bench.drive.take_events() == []


def test_a_stream_with_another_connection_stays_when_one_times_out(bench, session):
    bench.opened(session, io_request(1))
    bench.opened(session, io_request(2, **INPUT_ONLY))
    bench.drive.expired(1, bench.now)
    bench.collect()
    assert not bench.ended()


def test_cyclic_connections_survive_their_tcp_connection_and_explicit_ones_do_not(bench, session):
    bench.opened(session, io_request())
    bench.opened(session, explicit_request())
    bench.drive.closed(1, bench.now)
    bench.collect()
    (event,) = bench.take(ConnectionClosed)
    assert (event.connection.kind, event.reason) == (ConnectionKind.EXPLICIT, CloseReason.STREAM_CLOSED)
    assert [one.kind for one in bench.drive.manager.connections.values()] == [ConnectionKind.EXCLUSIVE_OWNER]
    other = bench.register(stream=2)
    assert bench.close(other, io_request().triad, stream=2).status == 0


def test_the_drive_may_end_a_connection_itself(bench, session):
    bench.opened(session, io_request())
    bench.drive.close(1, bench.now)
    bench.collect()
    assert bench.take(ConnectionClosed)[0].reason is CloseReason.ENDED


# Several listeners


def test_connections_of_one_multicast_share_its_id_and_one_of_them_drives_it(bench, session):
    owner, _ = bench.opened(session, io_request(1))
    listener, items = bench.opened(session, io_request(2, **LISTEN_ONLY))
    inputs, _ = bench.opened(session, io_request(3, **INPUT_ONLY))
    assert owner.t_to_o_id == listener.t_to_o_id == inputs.t_to_o_id
    assert len({owner.o_to_t_id, listener.o_to_t_id, inputs.o_to_t_id}) == 3
    assert items[1].address == IPv4Address("239.192.2.64")
    assert [event.connection.produces for event in bench.take(ConnectionOpened)] == [True, False, False]


def test_all_connections_of_one_multicast_have_its_size_and_others_their_own(bench, session):
    manager = bench.drive.manager
    ranged = tuple(replace(offer, produced_least=4) for offer in manager.settings.offers)
    manager.settings = replace(manager.settings, offers=ranged)
    bench.opened(session, io_request(1))
    assert bench.open(session, io_request(2, t_to_o=34, **INPUT_ONLY))[0].extended == (0x0134,)
    bench.opened(session, io_request(2, kind=P2P, t_to_o=34, **INPUT_ONLY))
    bench.opened(session, io_request(3, **INPUT_ONLY))


def test_the_production_moves_when_its_driver_closes_and_listeners_end_with_the_last_owner(bench, session):
    for request in (io_request(1), io_request(2, **LISTEN_ONLY), io_request(3, **INPUT_ONLY)):
        bench.opened(session, request)
    bench.close(session, io_request(1).triad)
    assert [event.connection.triad.serial for event in bench.take(ProductionMoved)] == [3]
    bench.close(session, io_request(3).triad)
    closed = [(event.connection.triad.serial, event.reason) for event in bench.take(ConnectionClosed)]
    assert closed == [(3, CloseReason.FORWARD_CLOSE), (2, CloseReason.OWNER_GONE)]
    assert bench.drive.manager.connections == {}


def test_a_point_to_point_owner_is_nothing_to_listen_to(bench, session):
    bench.opened(session, io_request(1, kind=P2P))
    assert bench.open(session, io_request(2, **LISTEN_ONLY))[0].extended == (0x0119,)
    assert bench.open(session, io_request(2, kind=P2P, **LISTEN_ONLY))[0].extended == (0x0124,)


# Unconnected_Send


@pytest.mark.parametrize(
    ("body", "status", "extended"),
    [
        (lambda: fo.UnconnectedSend(READ).emit(), 0, ()),
        (lambda: fo.UnconnectedSend(READ, b"\1\0").emit(), 1, (0x0311,)),
        (lambda: fo.UnconnectedSend(READ).emit()[:5], 1, (0x0205,)),
    ],
    ids=["to itself", "to another port", "cut"],
)
def test_a_message_in_an_unconnected_send_is_for_the_device_itself_or_refused(bench, session, body, status, extended):
    reply = bench.request(session, 0x52, MANAGER, body())
    assert (reply.status, reply.extended) == (status, extended)
    assert reply.data == (b"" if status else (77).to_bytes(4, "little"))


# Class 3


def unit(bench, session, connection_id, count, octets, stream=1):
    """The replies to a message of a class 3 connection: connection id, count, message."""
    data = count.to_bytes(2, "little") + octets
    packet = cpf.CommonPacket((cpf.ConnectedAddress(connection_id), cpf.ConnectedData(data)))
    replies = bench.ask(EncapsulationPdu(Command.SEND_UNIT_DATA, packet.emit(), session), stream)
    found = []
    for reply in replies:
        address, payload = cpf.CommonPacket.parse(reply.data).items
        found.append((address.connection_id, int.from_bytes(payload.data[:2], "little"), payload.data[2:]))
    return found


WRITE = message.message_request(0x10, logical_path(0x0F, 1, 1), (9).to_bytes(4, "little")).emit()
READ = message.message_request(0x0E, logical_path(0x0F, 1, 1)).emit()


def test_explicit_messages_of_a_connection_are_answered_with_their_count_and_the_originators_id(bench, session):
    reply, items = bench.opened(session, explicit_request())
    assert items == []
    ((connection_id, count, octets),) = unit(bench, session, reply.o_to_t_id, 1, READ)
    assert (connection_id, count) == (explicit_request().t_to_o_id, 1)
    assert message.parse_reply(octets).data == (77).to_bytes(4, "little")


def test_a_repeated_count_repeats_the_reply_and_does_nothing_again(bench, session):
    reply, _ = bench.opened(session, explicit_request())
    first = unit(bench, session, reply.o_to_t_id, 1, WRITE)
    bench.numbers[1] = 5
    assert unit(bench, session, reply.o_to_t_id, 1, WRITE) == first
    assert bench.numbers[1] == 5
    unit(bench, session, reply.o_to_t_id, 2, WRITE)
    assert bench.numbers[1] == 9


def test_messages_of_unknown_connections_other_streams_and_too_long_ones_have_no_reply(bench, session):
    reply, _ = bench.opened(session, explicit_request(size=100))
    assert unit(bench, session, 0x12345, 1, READ) == []
    assert unit(bench, session, reply.o_to_t_id, 1, READ + bytes(100)) == []
    other = bench.register(stream=2)
    assert unit(bench, other, reply.o_to_t_id, 1, READ, stream=2) == []
    cyclic, _ = bench.opened(session, io_request(7))
    assert unit(bench, session, cyclic.o_to_t_id, 1, READ) == []
    assert bench.drive.encapsulation.discards["connection"] == 4
    wrong = EncapsulationPdu(Command.SEND_UNIT_DATA, bytes(6), session)
    (refusal,) = bench.ask(wrong)
    assert refusal.status == encapsulation.EncapsulationStatus.INCORRECT_DATA


def test_an_explicit_connection_times_out_without_messages_and_lives_with_them(bench, session):
    reply, _ = bench.opened(session, explicit_request())
    for count in range(1, 5):
        bench.later(15)
        assert unit(bench, session, reply.o_to_t_id, count, READ) if count > 1 else True
        if count == 1 and not bench.drive.manager.connections:
            pytest.fail("16 s of timeout, 15 s of silence")
        if count == 1:
            unit(bench, session, reply.o_to_t_id, 1, READ)
    bench.later(16.1)
    assert bench.take(ConnectionClosed)[0].reason is CloseReason.TIMED_OUT


@pytest.mark.parametrize(
    ("change", "extended"),
    [
        ({"transport": fo.TransportClass(3, 2)}, (0x0103,)),
        ({"transport": fo.TransportClass(1, 0, server=True)}, (0x0103,)),
        ({"size": 511}, (0x0109, 504)),
        ({"size": 5000}, (0x0109, 4002)),
        ({"size": 4}, (0x0109, 504)),
        ({"t_to_o": fo.NetworkParameters(100, MULTICAST)}, (0x0124,)),
        ({"o_to_t": fo.NetworkParameters(100, NULL)}, (0x0123,)),
        ({"o_to_t_rpi_us": 0}, (0x0111,)),
        ({"path": b"\x20\x02"}, (0x012F,)),
        ({"path": b"\x20\x02\x24\x05"}, (0x0315,)),
        ({"path": b"\x20\x02\x24\x01\x2c\x66"}, (0x0315,)),
        ({"path": b"\x20\x02\x24\x01\x80\x01\x00\x00"}, (0x0315,)),
    ],
)
def test_each_refusal_of_an_explicit_connection_has_its_extended_status(bench, session, change, extended):
    assert bench.open(session, explicit_request(**change))[0].extended == extended


def test_explicit_connections_are_bounded():
    bench = Bench(explicit_connections=2)
    session = bench.register()
    for serial in (1, 2):
        bench.opened(session, explicit_request(serial))
    assert bench.open(session, explicit_request(3))[0].extended == (0x0113,)


def test_a_reply_of_a_connection_fits_its_size(bench, session):
    reply, _ = bench.opened(session, explicit_request(size=40))
    big = message.message_request(0x0E, logical_path(4, 102, 3)).emit()
    ((_, _, octets),) = unit(bench, session, reply.o_to_t_id, 1, big)
    assert message.parse_reply(octets).status == 0x11


def test_connections_cannot_be_opened_over_a_connection(bench, session):
    reply, _ = bench.opened(session, explicit_request())
    octets = message.message_request(0x54, MANAGER, fo.emit_forward_open(io_request())).emit()
    ((_, _, answer),) = unit(bench, session, reply.o_to_t_id, 1, octets)
    assert message.parse_reply(answer).status == 0x08


def test_every_row_of_the_state_table_ends_in_a_state_that_has_a_way_out():
    ends = {state for state, _ in CONNECTION.values()}
    assert ends <= {state for state, _ in CONNECTION}


def test_of_offers_with_the_same_points_the_one_with_the_size_is_meant():
    bench = Bench()
    wide, narrow = bench.settings.offers[0], replace(bench.settings.offers[0], consumed_octets=8, consumed_header=False)
    ranged = replace(wide, produced_octets=32, produced_least=4, produced_variable=frozenset({True}))
    settings = replace(bench.settings, offers=(wide, narrow, ranged))

    def meant(**changes):
        request = io_request(**changes)
        return check_io(request, read_path(request.path), settings)

    assert [meant(), meant(o_to_t=10)] == [wide, narrow]
    variable = io_request(t_to_o=6)
    variable = replace(variable, t_to_o=replace(variable.t_to_o, variable=True))
    assert check_io(variable, read_path(variable.path), settings) == ranged
    with pytest.raises(Refusal) as refused:
        meant(t_to_o=6)
    assert refused.value.extended == (0x0120,)
    with pytest.raises(Refusal) as refused:
        meant(t_to_o=5)
    assert refused.value.extended == (0x0128, 66)
