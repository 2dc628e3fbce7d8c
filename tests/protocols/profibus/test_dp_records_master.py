"""A master of class 2 alone on a line: it listens first, repeats, asks for records, and leaves with an Abort."""

from itertools import pairwise

import pytest
from dp_line import IDENT, MS, Drive

from pnfarm.protocols.profibus.record_request import RecordRequest
from pnfarm.protocols.profibus.records_master import RecordsMaster, RecordsSettings
from pnfarm.protocols.profibus.slave import Slave
from pnfarm.protocols.profibus.slave_user import SlaveOptions
from pnfarm.protocols.profibus.wire.telegram import Request, ShortAck, Telegram, Token, emit_telegram, parse_telegram


class Pair:
    """The master and one slave; ``lose`` decides which octets arrive, by who sent them."""

    def __init__(self, **options):
        self.now = 0
        self.drive = Drive()
        self.slave = Slave(5, self.drive, SlaveOptions(IDENT, **options))
        self.master = RecordsMaster(RecordsSettings(5, latency_ns=0))
        self.master.start(self.now)
        self.lose = lambda who: False
        self.sent = []

    def run(self, until, seconds=10.0):
        end = self.now + round(seconds * 1e9)
        while not until():
            due = self.master.next_deadline()
            if due is None or due > end:
                return False
            self.now = max(self.now, due)
            self.master.handle_timeout(self.now)
            self._send()
        return True

    def _send(self):
        while (octets := self.master.to_send()) is not None:
            self.master.sent(self.now)
            self.sent.append((self.now, parse_telegram(octets)))
            self.now += MS // 10
            if self.lose("master"):
                continue
            answer = self.slave.receive(self.sent[-1][1], self.now)
            if answer is not None and not self.lose("slave"):
                self.master.receive(parse_telegram(emit_telegram(answer)), self.now)

    def ask(self, request):
        self.master.ask(request, self.now)
        assert self.run(lambda: request.done)
        return request


def test_it_listens_then_asks_and_leaves_with_an_abort():
    pair = Pair()
    pair.drive.records[0, 47] = b"hello"
    assert pair.ask(RecordRequest.read(0, 47, 240)).data == b"hello"
    assert pair.sent[0][0] >= 300 * MS
    assert pair.slave.class_two.open == [(0, 0)]
    pair.master.end()
    assert pair.run(lambda: pair.master.over)
    assert pair.slave.class_two.open == []
    assert pair.master.next_deadline() is None


def test_a_record_that_takes_its_time_is_polled_for_with_pauses():
    pair = Pair()
    pair.drive.records[0, 47] = b"x"
    pair.drive.ready_ns = 500 * MS
    assert pair.ask(RecordRequest.read(0, 47, 240)).ok
    polls = [when for when, telegram in pair.sent if not telegram.data]
    assert len(polls) < 250
    assert min(after - before for before, after in pairwise(polls[3:])) >= MS


@pytest.mark.parametrize("who", ["master", "slave"])
def test_what_was_lost_is_repeated_with_the_same_fcb_and_carried_out_once(who):
    pair = Pair()
    lost = iter([False, False, True, False] * 100)
    pair.lose = lambda sender: sender == who and next(lost)
    written = []
    write = pair.drive.write_record
    pair.drive.write_record = lambda *given: written.append(given) or write(*given)
    assert pair.ask(RecordRequest.write(0, 47, b"abc")).ok
    assert len(written) == 1
    assert pair.master.counts["retries"] >= 1


def test_a_slave_that_is_not_there_is_told_after_the_repetitions():
    pair = Pair()
    pair.lose = lambda who: who == "master"
    asked = pair.ask(RecordRequest.read(0, 47, 240))
    assert asked.error == "station 5 does not answer"
    assert len(pair.sent) == 3
    assert pair.master.over
    late = RecordRequest.read(0, 47, 240)
    pair.master.ask(late, pair.now)
    assert late.error == "station 5 does not answer"


def test_a_slave_without_connections_of_class_2_refuses():
    assert "answered with RR" in Pair(connections=0).ask(RecordRequest.read(0, 47, 240)).error
    assert "answered with RS" in Pair(v1=False).ask(RecordRequest.read(0, 47, 240)).error


@pytest.mark.parametrize(
    "heard", [Token(2, 1), Telegram(5, 1, 0x6D, data=b"12"), Telegram(9, 1, 0x49), Telegram(5, 0, 0x6D, data=b"1")]
)
def test_another_master_on_the_line_ends_it_before_its_first_request(heard):
    pair = Pair()
    asked = RecordRequest.read(0, 47, 240)
    pair.master.ask(asked, pair.now)
    pair.master.receive(heard, 10 * MS)
    assert asked.error == f"master {heard.source} is active on this line"
    assert pair.run(lambda: False) is False
    assert pair.sent == []


def test_a_token_ends_it_at_work_too_and_answers_of_others_do_not():
    pair = Pair()
    assert pair.ask(RecordRequest.write(0, 47, b"a")).ok
    pair.master.receive(Telegram(1, 5, 0x08, data=b"an answer"), pair.now)
    pair.master.receive(ShortAck(), pair.now)
    assert pair.ask(RecordRequest.write(0, 47, b"b")).ok
    pair.master.receive(Token(1, 1), pair.now)
    assert pair.master.failure == "master 1 is active on this line"


def test_an_adapter_that_hears_itself_does_no_harm():
    pair = Pair()
    receive = pair.slave.receive

    def echoed(telegram, now):
        pair.master.receive(telegram, now)
        return receive(telegram, now)

    pair.slave.receive = echoed
    assert pair.ask(RecordRequest.write(0, 47, b"a")).ok
    assert all(telegram.code == Request.SRD_LOW for _, telegram in pair.sent)
