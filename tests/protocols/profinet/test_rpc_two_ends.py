"""Client and server joined by a network that loses, repeats, delays and reorders; in virtual time."""

from __future__ import annotations

import heapq
from ipaddress import IPv4Address
from itertools import count
from uuid import UUID

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.protocols.profinet.rpc.client import CallFailed, CallReturned, Peer, RpcClient
from pnfarm.protocols.profinet.rpc.endpoints import Endpoint
from pnfarm.protocols.profinet.rpc.server import CallReceived, RpcServer, RpcServerConfig
from pnfarm.protocols.profinet.wire.rpc.epm import LookupRequest, emit_lookup_request, parse_lookup_response
from pnfarm.protocols.profinet.wire.rpc.pdu import OK, RPC_PORT, UUID_EPM, UUID_PNIO_DEVICE, Opnum, object_uuid

MS = 1_000_000
CONTROLLER = Peer(IPv4Address("10.77.0.1"), 49152)
DEVICE = Peer(IPv4Address("10.77.0.11"), RPC_PORT)
OBJECT = object_uuid(1, 1, 0x0105)

# what the network does with one datagram: delays in ms of each copy that arrives; none is a loss
PERFECT = (1,)
fates = st.lists(st.sampled_from([PERFECT, PERFECT, (), (1, 1), (40,), (1, 700), (900,)]), max_size=60)


class Net:
    """Both ends and what is on the way between them."""

    def __init__(self, fate=(), *, think_ms=0, answer=lambda payload: payload[::-1]):
        numbers = count(1)
        self.client = RpcClient(lambda: UUID(int=next(numbers)))
        self.server = RpcServer(RpcServerConfig(endpoints=(Endpoint(OBJECT, "AKD"),)), DEVICE.ip)
        self.now = 0
        self.calls: list[CallReceived] = []
        self.ends: list[CallReturned | CallFailed] = []
        self.datagrams = 0
        self._fate = iter(fate)
        self._order = count()
        self._way: list[tuple[int, int, bool, bytes]] = []
        self._thinking: list[tuple[int, int, CallReceived]] = []
        self._think_ns = think_ms * MS
        self._answer = answer

    def call(self, payload: bytes, **options) -> int:
        number = self.client.call(
            DEVICE, CONTROLLER.port, UUID_PNIO_DEVICE, OBJECT, Opnum.READ, 65536, payload, self.now, **options
        )
        self._flush()
        return number

    def _flush(self) -> None:
        for to_server, end in ((True, self.client), (False, self.server)):
            for datagram in end.to_send(self.now):
                assert len(datagram.data) <= 1464
                self.datagrams += 1
                for delay in next(self._fate, PERFECT):
                    heapq.heappush(self._way, (self.now + delay * MS, next(self._order), to_server, datagram.data))
        for event in self.server.events():
            assert isinstance(event, CallReceived)
            self.calls.append(event)
            heapq.heappush(self._thinking, (self.now + self._think_ns, next(self._order), event))
        self.ends += self.client.events()

    def run(self, until: int) -> None:
        """Let everything happen that happens up to ``until``."""
        for _ in range(20_000):
            queues = [queue[0][0] for queue in (self._way, self._thinking) if queue]
            deadlines = [at for at in (self.client.next_deadline(), self.server.next_deadline()) if at is not None]
            due = min(queues + deadlines, default=None)
            if due is None or due > until:
                self.now = until
                return
            self.now = max(self.now, due)
            if self._way and self._way[0][0] <= self.now:
                _, _, to_server, data = heapq.heappop(self._way)
                if to_server:
                    self.server.receive(CONTROLLER, RPC_PORT, data, self.now)
                else:
                    self.client.receive(DEVICE, CONTROLLER.port, data, self.now)
            elif self._thinking and self._thinking[0][0] <= self.now:
                _, _, event = heapq.heappop(self._thinking)
                self.server.respond(event.call, OK, self._answer(event.payload), self.now)
            else:
                self.client.handle_timeout(self.now)
                self.server.handle_timeout(self.now)
            self._flush()
        pytest.fail("the two ends do not come to rest")


@pytest.mark.parametrize("little", [False, True])
@pytest.mark.parametrize("size", [0, 1, 1364, 1365, 4096, 61_440])
def test_a_call_and_its_answer_of_any_size(size, little):
    net = Net()
    payload = bytes(index * 7 & 0xFF for index in range(size))
    number = net.call(payload, little_endian=little)
    net.run(2_000 * MS)
    assert net.ends == [CallReturned(number, OK, payload[::-1], DEVICE, little)]
    assert [call.payload for call in net.calls] == [payload]


def test_a_short_request_may_have_a_long_answer():
    net = Net(answer=lambda payload: payload * 15_000)
    net.call(b"abcd")
    net.run(2_000 * MS)
    assert net.ends[0].payload == b"abcd" * 15_000
    # 44 fragments; the window saves most of the acknowledgements
    assert net.datagrams < 70


def test_a_slow_application_is_waited_for():
    net = Net(think_ms=9_000)
    net.call(b"slow", timeout_ns=20_000 * MS)
    net.run(20_000 * MS)
    assert [type(end) for end in net.ends] == [CallReturned]
    assert len(net.calls) == 1


def test_an_application_slower_than_the_calls_time_ends_in_a_timeout():
    net = Net(think_ms=15_000)
    number = net.call(b"slow")
    net.run(30_000 * MS)
    assert net.ends == [CallFailed(number, "timeout", DEVICE)]


@settings(max_examples=150)
@given(fates, st.sampled_from([10, 4_096, 20_000]), st.sampled_from([10, 4_096, 61_440]), st.sampled_from([0, 300]))
def test_whatever_the_network_does_a_call_ends_once_and_runs_once(fate, size, answer_size, think_ms):
    payload = bytes(index * 13 & 0xFF for index in range(size))
    answer = bytes(index * 11 & 0xFF for index in range(answer_size))
    net = Net(fate, think_ms=think_ms, answer=lambda _: answer)
    number = net.call(payload, timeout_ns=30_000 * MS)
    net.run(32_000 * MS)
    [end] = net.ends
    assert end.call_id == number
    assert len(net.calls) <= 1
    if isinstance(end, CallReturned):
        assert end.payload == answer
        assert net.calls[0].payload == payload
    else:
        assert sum(one != PERFECT for one in fate) >= 3
        assert end.reason in {"no-answer", "nocall", "timeout"}
    # the next call finds both ends in order
    net._fate = iter(())
    net.call(b"next")
    net.run(net.now + 20_000 * MS)
    assert isinstance(net.ends[-1], CallReturned)


@settings(max_examples=100)
@given(st.sets(st.integers(0, 40), max_size=2), st.sampled_from([10, 4_096]), st.sampled_from([10, 20_000]))
def test_two_lost_datagrams_never_cost_a_call(lost, size, answer_size):
    fate = [() if index in lost else PERFECT for index in range(41)]
    net = Net(fate, answer=lambda _: bytes(answer_size))
    net.call(bytes(size))
    net.run(15_000 * MS)
    assert [type(end) for end in net.ends] == [CallReturned]
    assert len(net.calls) == 1


@settings(max_examples=40)
@given(fates)
def test_calls_in_parallel_do_not_mix(fate):
    net = Net(fate)
    payloads = {net.call(bytes([index]) * 2_000, timeout_ns=30_000 * MS): bytes([index]) * 2_000 for index in range(4)}
    net.run(35_000 * MS)
    assert sorted(end.call_id for end in net.ends) == sorted(payloads)
    for end in net.ends:
        if isinstance(end, CallReturned):
            assert end.payload == payloads[end.call_id][::-1]


def test_an_hour_of_calls_leaves_nothing_behind():
    net = Net()
    for _ in range(3_600):
        net.call(b"cycle")
        net.run(net.now + 1_000 * MS)
    assert len(net.ends) == len(net.calls) == 3_600
    assert len(net.server.activities) == 1
    net.run(net.now + 400_000 * MS)
    assert net.server.activities == {}
    assert net.client.next_deadline() is None


def test_the_endpoint_mapper_answers_the_client():
    net = Net()
    stub = emit_lookup_request(LookupRequest(), little_endian=True)
    net.client.call(DEVICE, CONTROLLER.port, UUID_EPM, UUID(int=0), 2, 0, stub, 0)
    net._flush()
    net.run(1_000 * MS)
    assert net.calls == []
    answer = parse_lookup_response(net.ends[0].payload, little_endian=net.ends[0].little_endian)
    assert answer.entries[0].tower.address == DEVICE.ip
