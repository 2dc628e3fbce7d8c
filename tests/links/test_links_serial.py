import asyncio
import contextlib
import os
import socket
import statistics
import termios
import time

import pytest
import serial
from waiting import reached

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.links.serial.descriptor import MOST_WAITING, PortLine, PtyLine
from pnfarm.links.serial.tcp import ConnectLine, ListenLine

pytestmark = pytest.mark.asyncio
WAIT = 5.0


class Ear(list):
    """What a line brought, and what it told."""

    def __init__(self, line, answer=None):
        super().__init__()
        self.line, self.news, self.answer = line, [], answer
        line.set_receiver(self.hear)
        line.set_news(lambda up, text: self.news.append((up, text)))

    def hear(self, octets, now):
        assert isinstance(now, int)
        self.append(octets)
        if self.answer is not None:
            self.line.send(self.answer(octets))

    @property
    def octets(self):
        return b"".join(self)


@contextlib.asynccontextmanager
async def opened(line):
    await line.open()
    try:
        yield line
    finally:
        await line.close()


def opened_far(path):
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    return contextlib.closing(os.fdopen(fd, "r+b", buffering=0))


async def read(far, count):
    got = b""
    async with asyncio.timeout(WAIT):
        while len(got) < count:
            got += far.read(count - len(got)) or b""
            await asyncio.sleep(0.001)
    return got


async def test_octets_pass_a_pty_both_ways_and_none_is_changed():
    every = bytes(range(256))
    line = PtyLine()
    ear = Ear(line)
    async with opened(line):
        with opened_far(line.path) as far:
            far.write(every)
            await reached(lambda: ear.octets == every)
            line.send(every)
            assert await read(far, 256) == every
    assert (line.counters.received, line.counters.sent) == (256, 256)


async def test_a_far_end_that_sets_nothing_and_one_of_pyserial_both_read_raw_octets():
    line = PtyLine()
    Ear(line, answer=bytes.upper)
    async with opened(line):
        far = serial.Serial(line.path, 1_500_000, timeout=0)
        far.write(b"a\r\n\x03\x11b")
        got = b""
        async with asyncio.timeout(WAIT):
            while len(got) < 6:
                got += far.read(64)
                await asyncio.sleep(0.001)
        far.close()
        assert got == b"A\r\n\x03\x11B"


async def test_a_pty_may_be_closed_and_opened_again_and_the_next_one_reads_nothing_old():
    line = PtyLine()
    ear = Ear(line, answer=bytes.upper)
    async with opened(line):
        assert not line.is_up
        line.send(b"nobody")
        with opened_far(line.path) as far:
            far.write(b"one")
            await reached(lambda: ear.octets == b"one")
        await reached(lambda: not line.is_up)
        for _ in range(3):
            with opened_far(line.path) as far:
                far.write(b"two")
                assert await read(far, 3) == b"TWO"
            await reached(lambda: not line.is_up)
    assert line.counters.lost == {"not-open": 6}
    assert line.counters.interruptions == {"far-end-closed": 4}
    assert [up for up, _ in ear.news] == [False, True, False, True, False, True, False, True, False]


async def test_a_far_end_that_does_not_read_loses_octets_and_the_farm_is_not_held_up():
    line = PtyLine()
    Ear(line)
    async with opened(line):
        with opened_far(line.path) as far:
            far.write(b"x")
            await reached(lambda: line.is_up)
            begun = time.monotonic()
            for _ in range(2000):
                line.send(bytes(256))
            assert time.monotonic() - begun < 1.0
            counters = line.counters
            assert counters.lost["queue-full"] > 0
            assert counters.sent + counters.lost["queue-full"] <= 2000 * 256
            waiting = 2000 * 256 - counters.sent - counters.lost["queue-full"]
            assert 0 <= waiting <= MOST_WAITING
            await read(far, counters.sent + waiting)
            line.send(b"again")
            assert await read(far, 5) == b"again"


async def test_a_link_names_the_pty_and_is_gone_afterwards(tmp_path):
    link = tmp_path / "line"
    link.symlink_to("/dev/null")
    line = PtyLine(link)
    ear = Ear(line)
    async with opened(line):
        with opened_far(link) as far:
            far.write(b"by name")
            await reached(lambda: ear.octets == b"by name")
        assert line.where == f"{link} -> {line.path}"
    assert not link.is_symlink()


async def test_a_link_does_not_replace_a_file(tmp_path):
    link = tmp_path / "line"
    link.write_text("precious")
    with pytest.raises(EnvironmentError_, match=f"link {link} to /dev/pts/"):
        await PtyLine(link).open()
    assert link.read_text() == "precious"


async def test_a_link_of_another_farm_that_runs_is_not_taken(tmp_path):
    link = tmp_path / "line"
    async with opened(PtyLine(link)) as first:
        with pytest.raises(EnvironmentError_, match=r"another farm's line is at .*: give this one another path"):
            await PtyLine(tmp_path / "." / "line").open()
        assert str(link.readlink()) == first.path
    async with opened(PtyLine(link)) as again:
        assert str(link.readlink()) == again.path


async def test_the_round_trip_over_a_pty_is_short():
    line = PtyLine()
    Ear(line, answer=bytes.upper)
    async with opened(line):

        def trips(path):
            fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
            times = []
            try:
                for _ in range(2000):
                    begun = time.perf_counter_ns()
                    os.write(fd, b"question")
                    got = b""
                    while len(got) < 8:
                        got += os.read(fd, 8)
                    times.append(time.perf_counter_ns() - begun)
            finally:
                os.close(fd)
            return times

        times = await asyncio.to_thread(trips, line.path)
    assert statistics.median(times) < 1_000_000


async def test_opening_twice_is_an_error_and_closing_twice_is_not():
    line = PtyLine()
    async with opened(line):
        with pytest.raises(InternalError):
            await line.open()
    await line.close()


async def test_a_client_over_tcp_is_heard_and_answered_and_a_newer_one_takes_its_place():
    line = ListenLine("127.0.0.1", 0)
    ear = Ear(line, answer=bytes.upper)
    async with opened(line):
        assert line.where == f"127.0.0.1:{line.port}"
        reader, writer = await asyncio.open_connection("127.0.0.1", line.port)
        writer.write(b"first")
        assert await asyncio.wait_for(reader.readexactly(5), WAIT) == b"FIRST"
        other, second = await asyncio.open_connection("127.0.0.1", line.port)
        second.write(b"second")
        assert await asyncio.wait_for(other.readexactly(6), WAIT) == b"SECOND"
        assert await asyncio.wait_for(reader.read(), WAIT) == b""
        second.close()
        await reached(lambda: not line.is_up)
        line.send(b"nobody")
        writer.close()
    assert line.counters.interruptions == {"replaced": 1, "far-end-closed": 1}
    assert line.counters.lost == {"not-open": 6}
    assert ear.octets == b"firstsecond"


async def test_a_port_that_is_taken_is_told_in_one_sentence():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(EnvironmentError_, match=f"cannot listen on 127.0.0.1:{port}: Address already in use"):
            await ListenLine("127.0.0.1", port).open()


async def test_a_server_over_tcp_may_come_later_and_go_and_come_back():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    line = ConnectLine("127.0.0.1", port)
    ear = Ear(line, answer=bytes.upper)
    async with opened(line):
        await reached(lambda: line.counters.interruptions["no-connection"] > 1)
        for word in (b"one", b"two"):
            with socket.create_server(("127.0.0.1", port)) as server:
                server.settimeout(WAIT)
                client, _ = await asyncio.to_thread(server.accept)
                with client:
                    client.settimeout(WAIT)
                    await asyncio.to_thread(client.sendall, word)
                    assert await asyncio.to_thread(client.recv, 16) == word.upper()
            await reached(lambda: not line.is_up)
    assert ear.octets == b"onetwo"
    assert line.counters.opened == 2
    # told once for each time, however often it was tried
    assert [up for up, _ in ear.news].count(True) == 2
    assert len(ear.news) <= 6


async def test_a_server_that_hangs_up_at_once_is_tried_with_growing_pauses(monkeypatch):
    """As ser2net does where its port is in use."""
    loop, pauses, served = asyncio.get_running_loop(), [], []
    later = loop.call_later

    def noted(delay, call, *args):
        if getattr(call, "__self__", None) is line:
            pauses.append(delay)
        return later(delay, call, *args)

    async def serve(reader, writer):
        served.append(writer)
        if len(served) > 4:
            await reader.read()
        writer.close()

    monkeypatch.setattr(loop, "call_later", noted)
    async with await asyncio.start_server(serve, "127.0.0.1", 0) as server:
        line = ConnectLine(*server.sockets[0].getsockname())
        async with opened(line):
            await reached(lambda: len(served) == 5 and line.is_up)
            assert pauses == [0.005, 0.01, 0.02, 0.04]
            # one that lasted, however short, is tried again soon
            line.last_pause = 0.0
            served[-1].close()
            await reached(lambda: len(pauses) == 5)
            assert pauses[-1] == 0.005


async def test_a_line_that_is_closed_while_it_tries_leaves_nothing_behind():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    before = set(asyncio.all_tasks())
    line = ConnectLine("127.0.0.1", port)
    await line.open()
    await line.close()
    await asyncio.sleep(0)
    assert set(asyncio.all_tasks()) == before


@pytest.mark.parametrize(
    ("port", "said"),
    [
        ("/dev/ttyNone7", "does not exist"),
        ("/dev/null", "is not a serial port"),
        ("/proc/version", "is not a serial port"),
    ],
)
async def test_a_wrong_port_is_told_in_one_sentence(port, said):
    with pytest.raises(EnvironmentError_, match=said) as told:
        await PortLine(port, 9600).open()
    assert "\n" not in str(told.value)


async def test_a_port_that_is_pulled_out_is_taken_again_when_it_is_back(tmp_path):
    """A pty stands for the device: a port without parity, which no pty has."""
    near, far = os.openpty()
    device = tmp_path / "ttyUSB0"
    device.symlink_to(os.ttyname(far))
    os.close(far)
    line = PortLine(str(device), 19200)
    ear = Ear(line, answer=bytes.upper)
    async with opened(line):
        assert termios.tcgetattr(near)[4] == termios.B19200
        os.write(near, b"in")
        await reached(lambda: ear.octets == b"in")
        line.set_baud(38400)
        assert termios.tcgetattr(near)[4] == termios.B38400
        device.unlink()
        os.close(near)
        await reached(lambda: not line.is_up)
        line.send(b"lost")
        near, far = os.openpty()
        device.symlink_to(os.ttyname(far))
        os.close(far)
        await reached(lambda: line.is_up)
        os.write(near, b"back")
        await reached(lambda: ear.octets == b"inback")
    os.close(near)
    assert line.counters.lost["not-open"] == 4
    assert line.counters.opened == 2
