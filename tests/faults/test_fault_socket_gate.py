"""The gate of streams and datagrams: order, repetition, bounds, and nothing left behind."""

from __future__ import annotations

from ipaddress import IPv4Address
from random import Random

import pytest

from pnfarm.faults.gate.gate import EVERY_FRAME, DelayRule, GateRule
from pnfarm.faults.gate.shaping import Shape
from pnfarm.faults.gate.socket_gate import DATAGRAM, MOST_WAITING, REPEAT_NS, STREAM, SocketGate
from pnfarm.wire.endpoint import (
    Datagram,
    DatagramReceived,
    StreamClosed,
    StreamData,
    StreamEnd,
    StreamOpened,
    StreamReceived,
)

PEER = (IPv4Address("10.0.0.1"), 5000)
PORT = 3


class Bench:
    def __init__(self) -> None:
        self.delivered: list[object] = []
        self.acted: list[object] = []
        self.refused: list[bool] = []
        self.gate = SocketGate(
            lambda _, event, __: self.delivered.append(event),
            lambda _, action: self.acted.append(action),
            lambda _, on: self.refused.append(on),
        )
        self.gate.received(StreamOpened(PORT, 1, 9, PEER), 0)
        self.delivered.clear()

    def comes(self, data: bytes, now: int) -> None:
        self.gate.received(StreamReceived(PORT, 1, data), now)

    def goes(self, data: bytes, now: int) -> None:
        self.gate.sent(PORT, StreamData(1, data), now)


@pytest.fixture
def bench() -> Bench:
    return Bench()


class Late:
    def __init__(self, wait: int) -> None:
        self.wait = wait
        self.sent: list[bool] = []

    def asked(self, now: int) -> int:
        return self.wait

    def left(self, *, sent: bool) -> None:
        self.sent.append(sent)


def test_without_rules_everything_passes_at_once(bench):
    bench.comes(b"one", 5)
    bench.goes(b"two", 6)
    assert bench.delivered == [StreamReceived(PORT, 1, b"one")]
    assert bench.acted == [StreamData(1, b"two")]
    assert bench.gate.next_deadline() is None
    assert bench.gate.sessions(PORT) == [1]


def test_what_is_lost_of_a_stream_is_repeated_in_order_until_the_rule_is_gone(bench):
    rule = GateRule(("in", "out"))
    bench.gate.add(PORT, rule)
    for number in range(3):
        bench.comes(bytes([number]), number)
    bench.gate.handle_timeout(REPEAT_NS + 10)
    assert bench.delivered == []
    assert rule.waiting == 3
    bench.gate.remove(PORT, rule)
    assert rule.waiting == 0
    bench.gate.handle_timeout(REPEAT_NS + 11)
    assert [event.data for event in bench.delivered] == [b"\0", b"\1", b"\2"]
    assert bench.gate.in_force(PORT) == []
    assert bench.gate.next_deadline() is None


def test_a_rule_of_messages_takes_them_away_for_good(bench):
    rule = GateRule(("in",), frozenset({STREAM}), of_messages=True)
    bench.gate.add(PORT, rule)
    bench.comes(b"gone", 1)
    bench.gate.remove(PORT, rule)
    bench.comes(b"next", 2)
    bench.gate.handle_timeout(10 * REPEAT_NS)
    assert [event.data for event in bench.delivered] == [b"next"]
    assert rule.evidence().activations == 1


def test_a_datagram_that_is_lost_never_comes(bench):
    rule = GateRule(("in", "out"), frozenset({DATAGRAM}))
    bench.gate.add(PORT, rule)
    bench.gate.received(DatagramReceived(PORT, 9, PEER, b"x"), 1)
    bench.gate.sent(PORT, Datagram(9, PEER, b"y"), 1)
    bench.comes(b"stream", 2)
    bench.gate.remove(PORT, rule)
    bench.gate.handle_timeout(10 * REPEAT_NS)
    assert bench.delivered == [StreamReceived(PORT, 1, b"stream")]
    assert bench.acted == []


def test_delays_add_up_keep_the_order_and_are_told(bench):
    slow, slower = Late(100), Late(1000)
    for late in (slow, slower):
        bench.gate.delay(PORT, DelayRule(EVERY_FRAME, late))
    bench.goes(b"one", 0)
    slow.wait = slower.wait = 0
    bench.goes(b"two", 1)
    bench.gate.handle_timeout(1099)
    assert bench.acted == []
    bench.gate.handle_timeout(1100)
    assert [action.data for action in bench.acted] == [b"one", b"two"]
    assert (slow.sent, slower.sent) == ([True], [True])


@pytest.mark.parametrize("first", ["delay", "rule"])
def test_what_a_delay_and_a_rule_hold_goes_on_when_both_are_gone(bench, first):
    delay = DelayRule(EVERY_FRAME, Late(3_600_000_000_000))
    rule = GateRule(["out"], EVERY_FRAME, probability=1.0, shape=Shape(1, delay_ns=100_000_000))
    bench.gate.add(PORT, rule)
    bench.gate.delay(PORT, delay)
    bench.goes(b"one", 0)
    ends = [lambda: bench.gate.undelay(PORT, delay), lambda: bench.gate.remove(PORT, rule)]
    for end in ends if first == "delay" else reversed(ends):
        end()
    bench.gate.handle_timeout(1)
    assert bench.acted == [StreamData(1, b"one")]
    assert bench.gate.in_force(PORT) == []


def test_what_a_delay_holds_goes_on_when_it_ends_beside_another(bench):
    long, short = DelayRule(EVERY_FRAME, Late(3_600_000_000_000)), DelayRule(EVERY_FRAME, Late(0))
    bench.gate.delay(PORT, long)
    bench.gate.delay(PORT, short)
    bench.goes(b"one", 0)
    bench.gate.undelay(PORT, long)
    bench.gate.handle_timeout(1)
    assert bench.acted == [StreamData(1, b"one")]


def test_a_close_waits_behind_what_was_sent_before_it(bench):
    rule = DelayRule(EVERY_FRAME, Late(50))
    bench.gate.delay(PORT, rule)
    bench.goes(b"last", 0)
    bench.gate.sent(PORT, StreamEnd(1), 1)
    assert bench.acted == []
    bench.gate.handle_timeout(50)
    assert bench.acted == [StreamData(1, b"last"), StreamEnd(1)]
    bench.gate.undelay(PORT, rule)
    assert bench.gate.in_force(PORT) == []


def test_the_peers_close_takes_along_what_waits_for_it(bench):
    late = Late(50)
    rule = DelayRule(EVERY_FRAME, late)
    bench.gate.delay(PORT, rule)
    bench.goes(b"never", 0)
    bench.gate.received(StreamClosed(PORT, 1), 1)
    assert bench.delivered == [StreamClosed(PORT, 1)]
    assert late.sent == [False]
    bench.gate.undelay(PORT, rule)
    assert bench.gate.in_force(PORT) == []


def test_what_exceeds_the_bound_closes_the_stream(bench):
    bench.gate.add(PORT, GateRule(("in",)))
    for number in range(MOST_WAITING + 1):
        bench.comes(b"x", number)
    assert bench.acted == [StreamEnd(1)]
    assert bench.delivered == [StreamClosed(PORT, 1)]
    assert bench.gate.next_deadline() is None


def test_a_lost_supply_forgets_what_waits(bench):
    late = Late(50)
    rule = GateRule(("in", "out"))
    bench.gate.add(PORT, rule)
    bench.gate.delay(PORT, DelayRule(EVERY_FRAME, late))
    bench.comes(b"x", 0)
    bench.goes(b"y", 0)
    bench.gate.restart(PORT)
    assert (rule.waiting, late.sent) == (0, [False])
    assert bench.gate.next_deadline() is None
    assert bench.gate.sessions(PORT) == []


def test_new_streams_are_refused_until_the_last_caller_takes_them_again(bench):
    for on in (True, True, False, False):
        bench.gate.refuse(PORT, on=on)
    assert bench.refused == [True, False]


@pytest.mark.parametrize("seed", range(20))
def test_whatever_rules_come_and_go_a_streams_octets_arrive_whole_and_in_order(seed):
    rng = Random(seed)
    bench = Bench()
    rules: list[GateRule] = []
    now, number = 0, 0
    for _ in range(300):
        now += rng.randrange(50_000_000)
        bench.gate.handle_timeout(now)
        match rng.randrange(4):
            case 0 if len(rules) < 4:
                shape = Shape(
                    rng.randrange(99), delay_ns=rng.randrange(1, 10**9), jitter_ns=5, overtakes=rng.random() < 0.5
                )
                fields = {"shape": shape} if rng.random() < 0.5 else {}
                rules.append(GateRule(("in", "out"), probability=rng.random(), seed=rng.randrange(99), **fields))
                bench.gate.add(PORT, rules[-1])
            case 1 if rules:
                rule = rules.pop(rng.randrange(len(rules)))
                bench.gate.remove(PORT, rule)
                assert rule.waiting == 0
            case _:
                bench.comes(number.to_bytes(2, "big"), now)
                bench.goes(number.to_bytes(2, "big"), now)
                number += 1
    for rule in rules:
        bench.gate.remove(PORT, rule)
    bench.gate.handle_timeout(now + 1)
    expected = [n.to_bytes(2, "big") for n in range(number)]
    assert [event.data for event in bench.delivered] == expected
    assert [action.data for action in bench.acted] == expected
    assert bench.gate.in_force(PORT) == []
