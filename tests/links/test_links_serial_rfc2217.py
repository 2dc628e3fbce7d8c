"""A line behind RFC 2217; the server is pyserial's own, over its loop-back port."""

import socket
import threading

import pytest
import serial
import serial.rfc2217
from waiting import reached

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.links.serial import descriptor as serial_module
from pnfarm.links.serial.rfc2217 import Rfc2217Line

# pyserial's own threads use an old spelling
pytestmark = [pytest.mark.asyncio, pytest.mark.filterwarnings("ignore:set.* is deprecated:DeprecationWarning")]


class Server:
    """Serves one client after the other: what it writes comes back from the port."""

    def __init__(self):
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.settimeout(0.05)
        self.number = self.listener.getsockname()[1]
        self.port = serial.serial_for_url("loop://", timeout=0.01)
        self.client = None
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    def write(self, octets):
        self.client.sendall(octets)

    def serve(self):
        while not self.ended.is_set():
            try:
                self.client, _ = self.listener.accept()
            except TimeoutError:
                continue
            self.client.settimeout(0.01)
            manager = serial.rfc2217.PortManager(self.port, self)
            with self.client:
                self.pass_on(manager)

    def pass_on(self, manager):
        while not self.ended.is_set():
            try:
                got = self.client.recv(1024)
                if not got:
                    return
                self.port.write(b"".join(manager.filter(got)))
            except TimeoutError:
                pass
            except OSError:
                return
            if back := self.port.read(self.port.in_waiting):
                self.client.sendall(b"".join(manager.escape(back)))

    def drop(self):
        self.client.shutdown(socket.SHUT_RDWR)

    def close(self):
        self.ended.set()
        self.thread.join()
        self.listener.close()
        self.port.close()


@pytest.fixture
def server():
    made = Server()
    yield made
    made.close()


async def test_octets_pass_with_the_line_s_rate_and_parity_and_it_comes_back_after_a_break(server):
    line = Rfc2217Line("127.0.0.1", server.number, 19200)
    heard, news = [], []
    line.set_receiver(lambda octets, _: heard.append(octets))
    line.set_news(lambda up, text: news.append(up))
    await line.open()
    try:
        with pytest.raises(InternalError):
            await line.open()
        await reached(lambda: line.is_up)
        assert (server.port.baudrate, server.port.parity) == (19200, "E")
        line.send(bytes(range(256)))
        await reached(lambda: b"".join(heard) == bytes(range(256)))
        server.drop()
        await reached(lambda: line.counters.interruptions)
        await reached(lambda: line.counters.opened == 2)
        heard.clear()
        line.send(b"again")
        await reached(lambda: b"".join(heard) == b"again")
        line.set_baud(500_000)
        await reached(lambda: line.counters.opened == 3)
        assert server.port.baudrate == 500_000
    finally:
        await line.close()
    assert news[0] is True
    assert line.counters.sent == 261
    assert threading.active_count() < 6


async def test_a_server_that_is_not_there_is_tried_again_and_nothing_waits_for_it():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        number = probe.getsockname()[1]
    line = Rfc2217Line("127.0.0.1", number, 19200)
    await line.open()
    try:
        line.send(b"lost")
        await reached(lambda: line.counters.interruptions["no-connection"] >= 2)
    finally:
        await line.close()
    assert line.counters.lost == {"not-open": 4}


async def test_without_pyserial_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "serial", None)
    with pytest.raises(EnvironmentError_, match="needs pyserial, which is not installed"):
        serial_module.import_serial("the line")
