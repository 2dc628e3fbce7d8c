"""Several controllers and devices on a network that loses, repeats, delays and reorders.

Whatever happens, a call ends once at its client, runs at most once at its server, and what it returns is its own.
"""

from __future__ import annotations

import time
from dataclasses import replace
from ipaddress import IPv4Address, IPv4Interface

import pytest
from cm_support import UUID_1, Bench
from hypothesis import given, settings
from hypothesis import strategies as st
from rpc_support import ENDPOINTS, MS, PERFECT, Network, Station

from pnfarm.protocols.ip.host import DatagramReceived, IpHost
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.rpc.client import CallFailed, CallReturned, RpcClient, RpcClientConfig
from pnfarm.protocols.profinet.rpc.events import RpcServerConfig
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.wire.records.iod import (
    IodReadReqHeader,
    IodWriteReqHeader,
    emit_write_request,
    parse_read_response,
    parse_write_response,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT, Opnum, PacketType, parse_rpc
from pnfarm.wire.ethernet import parse_ethernet
from pnfarm.wire.ipv4 import emit_ipv4, parse_ipv4

fates = st.lists(
    st.sampled_from([PERFECT, PERFECT, (), (1, 1), (40,), (1, 700), (900,), (3, 2, 1), (1, 2_500)]), max_size=120
)


def station(last: int, **options) -> Station:
    return Station(Peer(IPv4Address(f"10.77.0.{last}"), RPC_PORT), **options)


def payload(size: int, seed: int) -> bytes:
    return bytes((index * 7 + seed * 31) & 0xFF for index in range(size))


@settings(max_examples=80)
@given(
    fates,
    st.lists(st.tuples(st.integers(0, 1), st.integers(0, 1), st.sampled_from([10, 1_400, 9_000])), max_size=6),
    st.sampled_from([0, 300, 4_000]),
    st.data(),
)
def test_calls_of_several_clients_end_once_run_at_most_once_and_do_not_mix(fate, calls, think_ms, data):
    stations = [station(11, think_ns=think_ms * MS), station(12, think_ns=think_ms * MS)]
    net = Network(stations, fate)
    clients = [net.client("10.77.0.1"), net.client("10.77.0.2")]
    asked, cancelled = {}, set()
    for number, (who, whom, size) in enumerate(calls):
        # now and then a client's ports change, or it gives a call up
        port = data.draw(st.sampled_from([49152, 50001]))
        sent = payload(size, number)
        call = net.call(clients[who], stations[whom], sent, port=port, timeout_ns=30_000 * MS)
        asked[who, call] = sent
        if data.draw(st.integers(0, 9)) == 0:
            net.run(net.now + 20 * MS)
            if not any(end.call_id == call for end in net.ends[IPv4Address(f"10.77.0.{who + 1}")]):
                clients[who].cancel(call, net.now)
                net.flush()
                cancelled.add((who, call))
        net.run(net.now + data.draw(st.sampled_from([0, 0, 5, 200])) * MS)
    net.run(net.now + 40_000 * MS)
    ended = [(who, end.call_id) for who in (0, 1) for end in net.ends[IPv4Address(f"10.77.0.{who + 1}")]]
    assert sorted(ended) == sorted(set(asked) - cancelled)
    for who in (0, 1):
        for end in net.ends[IPv4Address(f"10.77.0.{who + 1}")]:
            if isinstance(end, CallReturned):
                assert end.payload == asked[who, end.call_id][::-1]
    for one in stations:
        assert set(one.runs.values()) <= {1}, one.runs
    assert all(client.open_calls == 0 for client in clients)


@pytest.mark.parametrize("little", [False, True])
def test_every_datagram_lost_in_turn_costs_no_call_and_no_second_run(little):
    """A long request and a long answer: each datagram of the exchange is the one that is lost, once."""
    whole = Network([station(11)])
    whole.call(whole.client("10.77.0.1"), whole.stations[IPv4Address("10.77.0.11")], payload(5_000, 1))
    whole.run(1_000 * MS)
    count = len(whole.seen)
    assert count > 8
    for lost in range(count):
        net = Network([one := station(11)], [() if index == lost else PERFECT for index in range(count)])
        net.call(net.client("10.77.0.1"), one, payload(5_000, 1), little_endian=little)
        net.run(10_000 * MS)
        [end] = net.outcomes
        assert isinstance(end, CallReturned), (lost, end)
        assert end.payload == payload(5_000, 1)[::-1]
        assert list(one.runs.values()) == [1]


@pytest.mark.parametrize("swap", range(12))
def test_every_datagram_late_and_twice_in_turn(swap):
    net = Network([one := station(11)], [(9, 20) if index == swap else PERFECT for index in range(40)])
    net.call(net.client("10.77.0.1"), one, payload(9_000, 2))
    net.run(10_000 * MS)
    [end] = net.outcomes
    assert end.payload == payload(9_000, 2)[::-1]
    assert list(one.runs.values()) == [1]


def test_a_client_reads_while_it_writes_and_short_calls_do_not_wait_for_long_ones():
    net = Network([one := station(11)])
    client, other = net.client("10.77.0.1"), net.client("10.77.0.2")
    long_write = net.call(client, one, payload(30_000, 1), opnum=Opnum.WRITE)
    reads = [net.call(client, one, payload(40, index)) for index in range(5)]
    others = [net.call(other, one, payload(40, index)) for index in range(5)]
    net.run(1_000 * MS)
    mine = [end.call_id for end in net.ends[IPv4Address("10.77.0.1")]]
    assert sorted(mine) == sorted([long_write, *reads])
    assert mine[-1] == long_write
    assert [end.call_id for end in net.ends[IPv4Address("10.77.0.2")]] == others
    # each answer went to the port and address that asked
    for source, destination, data in net.seen:
        if parse_rpc(data).kind == PacketType.RESPONSE:
            assert source == one.address
            assert destination.port == 49152


def test_an_application_slower_than_its_time_ends_the_call_at_both_ends():
    config = RpcServerConfig(endpoints=ENDPOINTS, execution_ns=5_000 * MS)
    net = Network([one := station(11, think_ns=60_000 * MS, config=config)])
    net.call(net.client("10.77.0.1"), one, b"slow", timeout_ns=30_000 * MS)
    net.run(100_000 * MS)
    [end] = net.outcomes
    assert isinstance(end, CallFailed)
    assert end.reason == "fault nca_fault_unspec (no reason is given)"
    assert list(one.runs.values()) == [1]


def test_a_busy_server_serves_the_rest_later():
    config = RpcServerConfig(endpoints=ENDPOINTS, calls_max=4)
    net = Network([one := station(11, think_ns=300 * MS, config=config)])
    client = net.client("10.77.0.1")
    numbers = [net.call(client, one, payload(10, index)) for index in range(8)]
    net.run(10_000 * MS)
    assert sorted(end.call_id for end in net.outcomes if isinstance(end, CallReturned)) == numbers
    assert set(one.runs.values()) == {1}
    assert one.server.dropped["reject-server-too-busy"] == 4


# -- records through everything --------------------------------------------------------------------------------------


class LongRecords:
    """An application with a record of 60 kB, and one of 4 kB that can be written."""

    def __init__(self):
        self.written = []

    def read(self, ar, api, slot, subslot, index, max_length, now):
        return payload(60_000, 3)[:max_length] if index == 1 else RecordError(AccessError.INVALID_INDEX)

    def write(self, ar, api, slot, subslot, index, data, now):
        self.written.append(data)


@pytest.mark.parametrize("lost", [None, 3, 10])
def test_a_60_kb_record_is_read_and_a_4_kb_record_written_through_cm(lost):
    records = LongRecords()
    bench = Bench(application=records)
    bench.establish()

    def serve(event):
        return bench.call(event.opnum, event.payload, event.args_maximum)

    net = Network([one := station(11, answer=serve)], [() if index == lost else PERFECT for index in range(200)])
    client = net.client("10.77.0.1")
    read = IodReadReqHeader(1, UUID_1, 0, 0, 1, 1, 60_000).emit()
    write = emit_write_request(IodWriteReqHeader(2, UUID_1, 0, 0, 1, 2), payload(4_096, 4))
    numbers = [net.call(client, one, read), net.call(client, one, write, opnum=Opnum.WRITE)]
    net.run(10_000 * MS)
    ends = {end.call_id: end for end in net.outcomes}
    assert sorted(ends) == numbers
    assert parse_read_response(ends[numbers[0]].payload).data == payload(60_000, 3)
    assert parse_write_response(ends[numbers[1]].payload)[0].status.ok
    assert records.written == [payload(4_096, 4)]
    # 60 kB are 45 fragments; the window saves most of the acknowledgements
    assert len(net.seen) < 80


# -- many ------------------------------------------------------------------------------------------------------------


def test_512_devices_at_once_end_and_leave_nothing_behind():
    stations = [Station(Peer(IPv4Address(f"10.78.{n // 250}.{n % 250 + 1}"), RPC_PORT)) for n in range(512)]
    net = Network(stations)
    client = net.client("10.77.0.1")
    for one in stations:
        client.call(one.address, 49152, ENDPOINTS[0].interface, ENDPOINTS[0].object_uuid, 2, 4_096, b"x", net.now)
    assert client.open_calls == 512
    net.flush()
    net.run(200 * MS)
    assert [type(end) for end in net.outcomes] == [CallReturned] * 512
    assert client.open_calls == 0
    client.handle_timeout(120_000 * MS)
    assert (len(client._activities), len(client._deadlines)) == (0, 0)


def test_a_frame_holds_every_datagram_and_a_peers_fragmented_one_arrives_whole():
    """No end relies on IP fragments, both take them."""
    ends = [IpHost(bytes.fromhex(f"0200000000{n:02x}")) for n in (1, 2)]
    for number, host in enumerate(ends, 1):
        host.set_address(IPv4Interface(f"10.77.0.{number}/24"))
        host.open_ports = {RPC_PORT}
    sender, receiver = ends
    sender.learn(IPv4Address("10.77.0.2"), receiver.mac, 0)
    sender.to_send(0)
    net = Network([one := station(11, answer=lambda _: payload(60_000, 1))])
    net.call(net.client("10.77.0.1"), one, payload(20_000, 2))
    net.run(1_000 * MS)
    for _, _, data in net.seen:
        sender.send(49152, IPv4Address("10.77.0.2"), RPC_PORT, data, 0)
        [frame] = sender.to_send(0)
        assert len(frame) <= 1514
    # the longest datagram, cut by a router on the way
    longest = max((data for _, _, data in net.seen), key=len)
    assert len(longest) == 1464
    sender.send(49152, IPv4Address("10.77.0.2"), RPC_PORT, longest, 0)
    [frame] = sender.to_send(0)
    ether = parse_ethernet(frame)
    packet = parse_ipv4(ether.payload)
    for offset in range(0, len(packet.payload), 552):
        part = packet.payload[offset : offset + 552]
        piece = replace(packet, payload=part, fragment_offset=offset, more_fragments=offset + 552 < len(packet.payload))
        receiver.receive(replace(ether, payload=emit_ipv4(piece)), 0)
    [event] = [event for event in receiver.events() if isinstance(event, DatagramReceived)]
    assert event.data == longest


def seconds_of(calls: int, polls: int) -> float:
    """How long a client with this many open calls takes for questions about its next deadline, and for retries."""
    net = Network([])
    client: RpcClient = net.client("10.77.0.1", RpcClientConfig(tries=10))
    for number in range(calls):
        peer = Peer(IPv4Address(0x0A4E0000 + number), RPC_PORT)
        client.call(peer, 49152, ENDPOINTS[0].interface, ENDPOINTS[0].object_uuid, 2, 4_096, b"x", number * 1_000)
    client.to_send(0)
    started = time.perf_counter()
    for _ in range(polls):
        client.next_deadline()
        client.handle_timeout(400 * MS)
    return time.perf_counter() - started


def test_many_open_calls_make_a_poll_no_slower():
    few, many = (min(seconds_of(calls, 2_000) for _ in range(5)) for calls in (4, 512))
    # a scan would take a hundred times as long
    assert many < 10 * few
