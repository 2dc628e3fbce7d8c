"""Min T_SDR: on a port with a rate no answer begins sooner behind its request than the master asked for."""

import asyncio
import time

import pytest
from noted_line import NotedLine, Whole

from pnfarm.links.base import PortSpec
from pnfarm.links.serial.link import SerialLink

pytestmark = pytest.mark.asyncio


async def heard(baud, bits, *, has_rate=True, answers=(b"one", b"two")):
    """When the answers left after their request came, ns, and what."""
    line = NotedLine(has_rate=has_rate)
    link = SerialLink(line, Whole(), baud)
    (port,) = await link.open([PortSpec("axis", b"")])

    def answer(index, telegram, now):
        for octets in answers:
            link.send(index, octets)

    link.set_receiver(answer)
    link.set_slaves(lambda index: bits if index == port.index else 0)
    came = time.monotonic_ns()
    line.came(b"request", came)
    async with asyncio.timeout(10):
        while len(line.left) < len(answers):
            line.sent.clear()
            await line.sent.wait()
    await link.close()
    return [when - came for when, _ in line.left], [octets for _, octets in line.left], link


@pytest.mark.parametrize(("baud", "bits"), [(9_600, 11), (9_600, 255), (19_200, 60), (93_750, 11), (187_500, 11)])
async def test_an_answer_waits_for_min_tsdr_and_the_next_one_stays_behind_it(baud, bits):
    after, octets, link = await heard(baud, bits)
    assert after[0] >= bits * 1_000_000_000 // baud
    assert octets == [b"one", b"two"]
    assert link.counters.sent == 2


async def test_a_line_without_a_rate_of_its_own_answers_at_once():
    after, octets, _ = await heard(9_600, 255, has_rate=False)
    assert octets == [b"one", b"two"]
    assert after[0] < 255 * 1_000_000_000 // 9_600


async def test_what_no_request_asked_for_leaves_at_once():
    line = NotedLine(has_rate=True)
    link = SerialLink(line, Whole(), 9_600)
    (port,) = await link.open([PortSpec("axis", b"")])
    link.set_slaves(lambda _: 255)
    link.send(port.index, b"noise")
    assert [octets for _, octets in line.left] == [b"noise"]
    await link.close()


async def test_an_answer_that_waits_when_the_line_closes_never_leaves():
    line = NotedLine(has_rate=True)
    link = SerialLink(line, Whole(), 9_600)
    (port,) = await link.open([PortSpec("axis", b"")])
    link.set_receiver(lambda index, telegram, now: link.send(index, telegram))
    link.set_slaves(lambda _: 255)
    line.came(b"request", time.monotonic_ns())
    await link.close()
    await asyncio.sleep(0.03)
    assert (line.left, port.baud) == ([], 9_600)
