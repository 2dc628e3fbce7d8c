"""Max T_SDR: an answer that would begin too late is withheld and counted, where the line keeps that."""

import asyncio
import os
import threading
import time

import pytest
from noted_line import NotedLine, Whole

from pnfarm.buses.registry import bus
from pnfarm.config.links import LineWay
from pnfarm.farm.lines import make_line
from pnfarm.links.base import PortSpec
from pnfarm.links.serial.eager_loop import EagerLoop
from pnfarm.links.serial.link import SerialLink

SECOND = 1_000_000_000
#: Longer than any stall of a machine that runs tests.
PATIENT = 600 * SECOND


class Slave:
    """One port of a line that answers each telegram with the same octets, turned round."""

    def __init__(self, latest_ns, *, is_slave=True, has_rate=True, baud=500_000):
        self.line = NotedLine(has_rate=has_rate)
        self.link = SerialLink(self.line, Whole(), baud, latest_ns=lambda _: latest_ns)
        self.told = []
        self.link.set_receiver(lambda index, telegram, now: self.link.send(index, telegram[::-1]))
        if is_slave:
            self.link.set_slaves(lambda _: 0)
        self.link.set_withheld_news(lambda *news: self.told.append(news))

    async def __aenter__(self):
        (self.port,) = await self.link.open([PortSpec("axis", b"")])
        return self

    async def __aexit__(self, *_):
        await self.link.close()

    def hear(self, octets, age_ns=0):
        self.line.came(octets, time.monotonic_ns() - age_ns)

    @property
    def said(self):
        return [octets for _, octets in self.line.left]


@pytest.mark.asyncio
async def test_an_answer_in_time_leaves_and_a_late_one_is_withheld_and_counted():
    async with Slave(PATIENT) as slave:
        slave.hear(b"soon")
        slave.hear(b"late", age_ns=2 * PATIENT)
        slave.hear(b"next")
        assert slave.said == [b"noos", b"txen"]
        assert (slave.link.withheld, slave.link.counters.sent, slave.link.replies.count) == (1, 2, 2)


@pytest.mark.asyncio
async def test_of_requests_that_were_read_together_only_the_last_is_answered():
    async with Slave(PATIENT) as slave:
        slave.hear(b"one;two;three")
        assert (slave.said, slave.link.withheld) == ([b"eerht"], 2)


@pytest.mark.asyncio
async def test_a_request_with_the_beginning_of_the_next_one_behind_it_is_not_answered(monkeypatch):
    async with Slave(PATIENT) as slave:
        monkeypatch.setattr(slave.link.splitter, "is_whole", False)
        slave.hear(b"one")
        assert (slave.said, slave.link.withheld) == ([], 1)


@pytest.mark.asyncio
@pytest.mark.parametrize(("has_rate", "said"), [(False, [b"tseuqer"]), (True, [])])
async def test_the_time_counts_from_when_the_lines_rate_would_have_the_requests_end(has_rate, said):
    # seven octets of eleven bits at one bit in eight seconds: 616 s on the wire, and that is their age as well
    async with Slave(PATIENT, has_rate=has_rate, baud=1 / 8) as slave:
        slave.hear(b"request", age_ns=616 * SECOND)
        assert slave.said == said
        slave.hear(b"older", age_ns=616 * SECOND + 2 * PATIENT)
        assert slave.said == said


@pytest.mark.asyncio
async def test_a_line_without_a_limit_answers_whatever_came_whenever():
    async with Slave(None) as slave:
        slave.hear(b"one;two", age_ns=PATIENT)
        assert (slave.said, slave.link.withheld) == ([b"eno", b"owt"], 0)


@pytest.mark.asyncio
async def test_a_master_on_the_line_sends_whenever_it_likes():
    async with Slave(1, is_slave=False) as master:
        master.hear(b"answer", age_ns=PATIENT)
        assert (master.said, master.link.withheld) == ([b"rewsna"], 0)


@pytest.mark.asyncio
async def test_what_a_fault_delays_is_sent_when_it_is_due():
    async with Slave(1) as slave:
        slave.link.set_receiver(lambda *_: None)
        slave.hear(b"request", age_ns=PATIENT)
        slave.link.send(slave.port.index, b"late on purpose")
        assert (slave.said, slave.link.withheld) == ([b"late on purpose"], 0)


@pytest.mark.asyncio
async def test_an_answer_that_waited_for_min_tsdr_and_left_too_late_is_withheld():
    async with Slave(1) as slave:
        slave.link.set_slaves(lambda _: 255)
        slave.hear(b"request")
        # 255 bits at 500 kbit/s: 0.51 ms, then the event loop's timer
        told = asyncio.Event()
        slave.link.set_withheld_news(lambda *_: told.set())
        async with asyncio.timeout(10):
            await told.wait()
        assert slave.said == []


@pytest.mark.asyncio
async def test_an_answer_that_waits_for_min_tsdr_leaves_whatever_comes_meanwhile():
    async with Slave(PATIENT) as slave:
        slave.link.set_slaves(lambda _: 255)
        slave.hear(b"request")
        slave.link.set_receiver(lambda *_: None)
        # requests to other stations: only the last of them is the present one
        slave.hear(b"two;three")
        async with asyncio.timeout(10):
            await slave.line.sent.wait()
        assert (slave.said, slave.link.withheld) == ([b"tseuqer"], 0)


@pytest.mark.asyncio
async def test_a_line_that_is_always_late_is_told_at_each_doubling():
    async with Slave(1) as slave:
        for _ in range(100):
            slave.hear(b"late", age_ns=SECOND)
        # they are told in the event loop's next turn
        await asyncio.sleep(0)
        assert slave.told == [("/dev/ttyS7", count, 1) for count in (1, 2, 4, 8, 16, 32, 64)]


def latest(text_of_baud, **way):
    way = LineWay(baud=text_of_baud, **way)
    return make_line(way, bus("profibus")).latest_ns


@pytest.mark.parametrize(
    ("baud", "way", "expected"),
    [
        (1_500_000, {"port": "/dev/ttyUSB0"}, 100_000),
        (500_000, {"port": "/dev/ttyUSB0"}, 200_000),
        (9_600, {"port": "/dev/ttyUSB0"}, 6_250_000),
        # a slave of this machine cannot keep that
        (3_000_000, {"port": "/dev/ttyUSB0"}, None),
        (3_000_000, {"port": "/dev/ttyUSB0", "latest_answer": "tsdr"}, 83_333),
        (1_500_000, {"port": "/dev/ttyUSB0", "latest_answer": "any"}, None),
        (1_500_000, {"port": "/dev/ttyUSB0", "latest_answer": "2ms"}, 2_000_000),
        (500_000, {"pty": "auto"}, 200_000),
        (19_200, {"pty": "auto"}, 3_125_000),
        (500_000, {"pty": "auto", "latest_answer": "any"}, None),
        # one in a hundred would be missing
        (1_500_000, {"pty": "auto"}, None),
        (1_500_000, {"pty": "auto", "latest_answer": "tsdr"}, 100_000),
        # what a network takes is not the slave's time
        (1_500_000, {"listen": "127.0.0.1:7000"}, None),
        (1_500_000, {"connect": "127.0.0.1:7000"}, None),
        (1_500_000, {"rfc2217": "127.0.0.1:7000"}, None),
        (1_500_000, {"listen": "127.0.0.1:7000", "latest_answer": "tsdr"}, 100_000),
    ],
)
def test_how_late_an_answer_may_begin_by_the_file(baud, way, expected):
    assert latest(baud, **way) == expected


def test_a_pty_given_as_a_port_has_the_same_limit_and_no_rate():
    near, far = os.openpty()
    try:
        link = make_line(LineWay(baud=500_000, port=os.ttyname(far)), bus("profibus"))
        assert (link.latest_ns, link.line.has_rate) == (200_000, False)
    finally:
        os.close(near)
        os.close(far)


# -- what an event loop knows of the time that octets waited


def on_looking_loop(task):
    with asyncio.Runner(loop_factory=EagerLoop) as runner:
        return runner.run(task())


def watched():
    """A pipe's ends, and a future: what the loop knows of the octets' age when they are read, and the time then."""
    loop, (reading, writing) = asyncio.get_running_loop(), os.pipe()
    loop.ask_for_age()
    loop.set_eager(reading, lambda: False)
    found = loop.create_future()
    loop.add_reader(reading, lambda: found.done() or found.set_result((loop.earliest_ns, time.monotonic_ns())))
    return reading, writing, found


def test_octets_that_a_loop_waited_for_came_just_now():
    async def task():
        reading, writing, found = watched()
        written = []

        def write():
            written.append(time.monotonic_ns())
            os.write(writing, b"x")

        threading.Timer(0.05, write).start()
        earliest, _ = await found
        os.close(reading)
        os.close(writing)
        return written[0], earliest

    # the loop was waiting when they came
    written, earliest = on_looking_loop(task)
    assert earliest >= written


def test_octets_that_came_while_a_loop_was_busy_are_as_old_as_its_last_look():
    async def task():
        reading, writing, found = watched()
        # the loop looks once before anything comes
        await asyncio.sleep(0)
        os.write(writing, b"x")
        # a callback that takes long
        written, end = time.monotonic_ns(), time.monotonic_ns() + 20_000_000
        while time.monotonic_ns() < end:
            pass
        earliest, now = await found
        os.close(reading)
        os.close(writing)
        return written, earliest, now

    written, earliest, now = on_looking_loop(task)
    assert earliest <= written
    assert now - earliest >= 20_000_000
