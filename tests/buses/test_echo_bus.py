"""A bus with streams and datagrams in memory and virtual time, beside drives that have none."""

from __future__ import annotations

import asyncio
from ipaddress import IPv4Address, IPv4Interface

import pytest
from echobus.bus import ECHOBUS, make_model
from echobus.device import ECHO, SESSIONS

from pnfarm.buses import registry
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.catalogue import MODELS_VARIABLE
from pnfarm.farm.file.reading import parse_farm
from pnfarm.links.base import PortSpec
from pnfarm.links.sockets import MOST_OCTETS
from pnfarm.wire.endpoint import (
    Datagram,
    DatagramReceived,
    Services,
    StreamClosed,
    StreamData,
    StreamEnd,
    StreamOpened,
    StreamReceived,
)

DRIVES = """
farm: echoes
link: {kind: memory}
drives:
  - {name: 'echo-{n}', count: 2, model: echo-servo, node: 11}
"""
MIXED = """
farm: mixed
link: {kind: memory}
drives:
  - {name: axis-01, model: akd-profinet, ip: 10.77.0.21/23, cycle: 16ms}
  - {name: echo-1, model: echo-servo, node: 11}
controller: {name: plc, ip: 10.77.1.250/23, program: {kind: constant, speed_rpm: 60}}
"""
ONE, OTHER = IPv4Address("10.77.0.11"), IPv4Address("10.77.0.12")
OWN = IPv4Interface("10.77.1.100/23")
MS = 0.001


class Client:
    """A farm of echo servos, and a client's port on the same switch."""

    def __init__(self, text: str = DRIVES) -> None:
        self.line = asyncio.run(VirtualLine.create(parse_farm(text)))
        self.world, self.farm = self.line.world, self.line.farm
        self.station = self.farm.axis("echo-1")
        self.link = self.world.link()
        (self.port,) = asyncio.run(self.link.open([PortSpec("client", bytes.fromhex("020000000077"))]))
        self.heard: list[tuple[int, object]] = []
        self.link.sockets.set_user(lambda event, now: self.heard.append((now, event)))
        self.link.sockets.serve(self.port.index, Services(OWN, datagrams=(5000,)))

    def run(self, seconds: float = 10 * MS) -> None:
        self.world.run(seconds)

    def connect(self, to: IPv4Address = ONE, service: int = ECHO) -> int:
        stream = self.link.sockets.connect(self.port.index, (to, service))
        self.run()
        return stream

    def send(self, stream: int, data: bytes) -> None:
        self.link.sockets.act(self.port.index, StreamData(stream, data))
        self.run()

    def read(self, stream: int) -> bytes:
        return b"".join(
            event.data for _, event in self.heard if isinstance(event, StreamReceived) and event.stream == stream
        )

    def closed(self, stream: int) -> bool:
        return any(event == StreamClosed(self.port.index, stream) for _, event in self.heard)

    def cable(self, up: bool) -> None:
        self.world.switch.set_carrier(self.station.port.index, up, self.world.now)


@pytest.fixture
def echobus(monkeypatch, tmp_path):
    monkeypatch.setenv(MODELS_VARIABLE, str(make_model(tmp_path)))
    with registry.registered(ECHOBUS):
        yield


def test_a_bus_says_whether_it_has_sockets(echobus):
    assert ECHOBUS.uses_sockets
    assert not registry.bus("profinet").uses_sockets


def test_streams_carry_octets_in_order_both_ways_until_one_side_ends_them(echobus):
    client = Client()
    stream, other = client.connect(), client.connect(OTHER)
    assert [event for _, event in client.heard] == [
        StreamOpened(client.port.index, stream, 0, (ONE, ECHO)),
        StreamOpened(client.port.index, other, 0, (OTHER, ECHO)),
    ]
    client.send(stream, b"one ")
    client.send(stream, b"two")
    client.send(other, b"three")
    assert (client.read(stream), client.read(other)) == (b"ONE TWO", b"THREE")
    client.send(stream, b"bye")
    assert client.read(stream) == b"ONE TWOBYE"
    assert client.closed(stream)
    client.link.sockets.act(client.port.index, StreamEnd(other))
    client.run()
    assert not client.farm.axis("echo-2").device.streams
    assert not client.world.switch.network.ends


def test_two_runs_are_the_same_to_the_nanosecond(echobus):
    def story() -> list[tuple[int, object]]:
        client = Client()
        for n in range(5):
            stream = client.connect(ONE if n % 2 else OTHER)
            client.send(stream, b"x" * n * 1000 + b"y")
        return client.heard

    assert story() == story()


def test_a_port_that_nobody_listens_to_refuses_and_an_address_that_nobody_has_is_silent(echobus):
    client = Client()
    assert client.closed(client.connect(ONE, ECHO + 1))
    client.heard.clear()
    client.connect(IPv4Address("10.77.0.99"))
    client.run(1.0)
    assert client.heard == []


def test_a_drive_has_no_more_sessions_than_its_device_allows(echobus):
    client = Client()
    streams = [client.connect() for _ in range(SESSIONS + 1)]
    assert [client.closed(stream) for stream in streams] == [False] * SESSIONS + [True]
    client.link.sockets.act(client.port.index, StreamEnd(streams[0]))
    client.run()
    assert not client.closed(client.connect())


def test_a_datagram_comes_to_one_drive_or_to_all(echobus):
    client = Client()
    for to in (str(OTHER), "255.255.255.255", "10.77.1.255"):
        peer = (IPv4Address(to), ECHO)
        client.link.sockets.act(client.port.index, Datagram(5000, peer, b"who"))
        client.run()
    assert [(event.peer, event.data) for _, event in client.heard if isinstance(event, DatagramReceived)] == [
        ((address, ECHO), b"WHO") for address in (OTHER, ONE, OTHER, ONE, OTHER)
    ]


def test_power_off_is_silence_and_after_the_next_boot_an_old_stream_is_reset(echobus):
    client = Client()
    stream = client.connect()
    client.send(stream, b"a")
    client.station.station.power_off(client.world.now)
    client.farm.settle(client.station.station, client.world.now)
    client.heard.clear()
    client.send(stream, b"b")
    client.connect()
    client.run(2.0)
    assert client.heard == []
    client.station.station.power_on(client.world.now)
    client.farm.settle(client.station.station, client.world.now)
    client.run(1.0)
    assert not client.station.device.streams
    client.send(stream, b"c")
    assert client.closed(stream)
    again = client.connect()
    client.send(again, b"d")
    assert client.read(again) == b"D"


def test_a_power_cycle_between_two_inputs_forgets_the_streams(echobus):
    client = Client()
    stream = client.connect()
    client.station.station.power_cycle(client.world.now)
    client.farm.settle(client.station.station, client.world.now)
    client.send(stream, b"x")
    assert client.closed(stream)


def test_octets_wait_for_a_pulled_cable_and_datagrams_do_not(echobus):
    client = Client()
    stream = client.connect()
    client.cable(False)
    client.send(stream, b"early ")
    client.link.sockets.act(client.port.index, Datagram(5000, (ONE, ECHO), b"lost"))
    client.send(stream, b"late")
    assert client.read(stream) == b""
    client.cable(True)
    client.run()
    assert client.read(stream) == b"EARLY LATE"
    assert not [event for _, event in client.heard if isinstance(event, DatagramReceived)]


def test_what_waits_is_bounded(echobus):
    client = Client()
    stream = client.connect()
    client.cable(False)
    for _ in range(5):
        client.send(stream, bytes(MOST_OCTETS // 4))
    assert client.closed(stream)
    assert client.link.counters.dropped["slow-reader"] == 1


def test_the_next_hop_is_the_station_s_own_address(echobus):
    client = Client()
    assert client.link.sockets.next_hop(client.port.index, ONE) == client.station.port.mac
    assert client.link.sockets.next_hop(client.port.index, IPv4Address("10.77.0.99")) is None


def test_a_profinet_drive_and_one_with_sockets_run_side_by_side(echobus):
    client = Client(MIXED)
    stream = client.connect()
    client.run(1.0)
    client.send(stream, b"beside")
    assert client.read(stream) == b"BESIDE"
    assert client.farm.axis("axis-01").device.connected
    client.station.station.power_off(client.world.now)
    client.farm.settle(client.station.station, client.world.now)
    client.run(0.5)
    assert client.farm.axis("axis-01").device.connected
