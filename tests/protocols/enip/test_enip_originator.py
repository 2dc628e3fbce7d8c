"""An originator and a target, joined in memory."""

import pytest
from enip_bench import PEER, SECOND, Bench, io_request
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.enip.encapsulation import SendDatagram, SendStream, StreamEnd
from pnfarm.protocols.enip.identity_search import IdentitySearch
from pnfarm.protocols.enip.originator import Originator, OriginatorSettings
from pnfarm.protocols.enip.originator_events import (
    CloseTcp,
    ConnectionEnded,
    ConnectionMade,
    ConnectionNotMade,
    SendTcp,
    SessionEnded,
    SessionRegistered,
)
from pnfarm.protocols.enip.wire.encapsulation import Command, EncapsulationPdu, emit_encapsulation
from pnfarm.protocols.enip.wire.epath import logical_path
from pnfarm.protocols.enip.wire.message import message_request

READ = message_request(0x0E, logical_path(0x0F, 1, 1))


class Pair:
    """Both ends of one TCP connection; ``deaf`` drops what the target answers."""

    def __init__(self, piece=10_000, **settings):
        self.bench = Bench()
        self.originator = Originator(OriginatorSettings(**settings))
        self.piece = piece
        self.deaf = False
        self.bench.drive.opened(1, PEER, self.now)
        self.originator.opened(self.now)

    @property
    def now(self):
        return self.bench.now

    def exchange(self):
        """Carry octets until none are left; the originator's events."""
        while True:
            out = self.originator.take_outputs()
            for output in out:
                if isinstance(output, CloseTcp):
                    self.bench.drive.closed(1, self.now)
                else:
                    for at in range(0, len(output.data), self.piece):
                        self.bench.drive.received(1, output.data[at : at + self.piece], self.now)
            back = self.bench.collect()
            for output in back:
                if isinstance(output, SendStream) and not self.deaf:
                    for at in range(0, len(output.data), self.piece):
                        self.originator.received(output.data[at : at + self.piece], self.now)
                elif isinstance(output, StreamEnd):
                    self.originator.closed(self.now)
            if not out and not back:
                return self.originator.take_events()

    def later(self, seconds):
        self.bench.later(seconds)
        if (due := self.originator.next_deadline()) is not None and due <= self.now:
            self.originator.handle_timeout(self.now)
        return self.exchange()


@pytest.fixture
def pair():
    pair = Pair()
    (event,) = pair.exchange()
    assert isinstance(event, SessionRegistered)
    return pair


@pytest.mark.parametrize("piece", [1, 7, 24, 10_000])
def test_requests_are_answered_by_number_however_octets_are_cut(piece):
    pair = Pair(piece)
    pair.exchange()
    numbers = [pair.originator.request(READ, pair.now) for _ in range(3)]
    events = pair.exchange()
    assert [event.number for event in events] == numbers
    assert all(event.reply.data == (77).to_bytes(4, "little") for event in events)


def test_a_connection_is_made_and_ended(pair):
    pair.originator.forward_open(io_request(), pair.now)
    (made,) = pair.exchange()
    assert isinstance(made, ConnectionMade)
    assert made.reply.o_to_t_id in {one.o_to_t_id for one in pair.bench.drive.manager.connections.values()}
    assert str(made.items[1].address) == "239.192.2.64"
    pair.originator.forward_close(io_request().triad, b"", pair.now)
    (ended,) = pair.exchange()
    assert isinstance(ended, ConnectionEnded)
    assert pair.bench.drive.manager.connections == {}
    pair.originator.forward_close(io_request().triad, b"", pair.now)
    assert isinstance(pair.exchange()[0], ConnectionEnded), "a connection that is not there is closed as well"


def test_a_refusal_is_told_with_its_status_and_in_words(pair):
    pair.originator.forward_open(io_request(o_to_t=64), pair.now)
    (event,) = pair.exchange()
    assert isinstance(event, ConnectionNotMade)
    assert event.reply.extended == (0x0127, 70)
    assert event.reason == "connection failure: o to t size (0x0127)"


def test_a_silent_target_fails_requests_and_the_registration():
    pair = Pair()
    pair.deaf = True
    pair.exchange()
    (event,) = pair.later(5.1)
    assert isinstance(event, SessionEnded)
    assert "RegisterSession" in event.reason
    other = Pair()
    other.exchange()
    other.deaf = True
    number = other.originator.request(READ, other.now)
    other.exchange()
    (failed,) = other.later(5.1)
    assert (failed.number, failed.reason) == (number, "no reply in time")
    assert other.later(60.0) == [], "nothing else is waited for"


def test_a_session_without_requests_is_kept_alive():
    settings = OriginatorSettings()
    pair = Pair()
    pair.exchange()
    registered = pair.now
    assert pair.originator.next_deadline() == registered + settings.alive_ns
    pair.originator.handle_timeout(registered + settings.alive_ns)
    (output,) = pair.originator.take_outputs()
    assert output.data == emit_encapsulation(EncapsulationPdu(Command.NOP, b"", pair.originator.session))
    assert pair.originator.next_deadline() == registered + 2 * settings.alive_ns
    pair.originator.unregister(pair.now)
    assert pair.originator.next_deadline() is None


def test_requests_are_bounded_and_need_a_session():
    originator = Originator(OriginatorSettings(pending=2))
    originator.request(READ, 0)
    assert originator.take_events()[0].reason == "there is no session"
    pair = Pair(pending=2)
    pair.exchange()
    for _ in range(3):
        pair.originator.request(READ, pair.now)
    assert [event.reason for event in pair.originator.take_events()] == ["too many requests are waiting"]


def test_a_session_ends_in_order_when_it_is_unregistered_and_may_be_registered_again(pair):
    pair.originator.unregister(pair.now)
    out = pair.originator.take_outputs()
    assert [type(output) for output in out] == [SendTcp, CloseTcp]
    pair.bench.drive.received(1, out[0].data, pair.now)
    assert StreamEnd(1) in pair.bench.collect()
    assert isinstance(pair.originator.take_events()[0], SessionEnded)
    pair.bench.drive.opened(1, PEER, pair.now)
    pair.originator.opened(pair.now)
    assert isinstance(pair.exchange()[0], SessionRegistered)


@given(st.lists(st.binary(max_size=60), max_size=10))
def test_any_octets_from_a_target_do_no_harm(pieces):
    originator = Originator()
    originator.opened(0)
    for piece in pieces:
        originator.received(piece, 0)
        originator.received(emit_encapsulation(EncapsulationPdu(0x6F, piece)), 0)
        originator.received(emit_encapsulation(EncapsulationPdu(0x70, piece)), 0)
    originator.closed(0)
    assert isinstance(originator.take_events()[-1], SessionEnded)


def test_a_search_finds_each_drive_once_in_the_time_granted():
    search = IdentitySearch(500)
    bench = Bench()
    bench.drive.datagram(search.question(), PEER, bench.now, broadcast=True)
    assert bench.drive.next_deadline() - bench.now < search.duration_ns <= SECOND
    (answer,) = bench.later(0.5)
    assert isinstance(answer, SendDatagram)
    found = search.datagram(answer.data, PEER)
    assert found.identity.serial == 0xC0FFEE
    assert search.datagram(answer.data, PEER) is None
    assert search.datagram(b"rubbish", PEER) is None
    assert (len(search.found), search.discards) == (1, 1)
