"""Streams and datagrams of stations with addresses of the kernel's: each on its own interface, and gone at once."""

from __future__ import annotations

import asyncio
import contextlib
import resource
import socket
import struct
from ipaddress import IPv4Address, IPv4Interface
from pathlib import Path
from typing import Self

import pytest
from waiting import reached

from pnfarm.errors import EnvironmentError_
from pnfarm.links.base import LinkCounters, Port, PortSpec
from pnfarm.links.kernel import sockets as kernel_sockets
from pnfarm.links.kernel.interfaces import remove_leftovers_now
from pnfarm.links.macvlan import MacvlanLink
from pnfarm.links.sockets import MOST_OCTETS
from pnfarm.links.veth import VethLink
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

DRIVES = 64
TCP = UDP = 44818
#: A machine that is busy with other things, seconds.
PATIENCE = 60
CONTROLLER = "10.77.1.250"


def mac_of(number: int) -> bytes:
    return bytes.fromhex("0200000000") + bytes([number + 1])


def address_of(number: int) -> IPv4Interface:
    return IPv4Interface(f"10.77.0.{11 + number}/23")


class Echo:
    """Stations that send back what comes, on a link of ``kind``."""

    def __init__(self, kind: str, count: int, *, silenced: int = 0) -> None:
        self.link = MacvlanLink("sockets", "nic0") if kind == "macvlan" else VethLink("sockets", bridge="br0")
        self.specs = [PortSpec(f"d{n}", mac_of(n), kernel=n < count) for n in range(count + silenced)]
        self.count = count
        self.heard: list[object] = []
        self.reply = True

    async def __aenter__(self) -> Self:
        self.ports = await self.link.open(self.specs)
        self.link.sockets.set_user(self._heard)
        for n in range(self.count):
            self.serve(n)
        return self

    def serve(self, n: int) -> None:
        services = Services(address_of(n), streams=(TCP,), datagrams=(UDP,), silent=(2222,), sessions=3)
        self.link.sockets.serve(self.ports[n].index, services)

    async def __aexit__(self, *_: object) -> None:
        await self.link.close()

    def _heard(self, event: object, now: int) -> None:
        self.heard.append(event)
        if isinstance(event, StreamReceived) and self.reply:
            self.link.sockets.act(event.port, StreamData(event.stream, event.data.upper()))
        if isinstance(event, DatagramReceived):
            self.link.sockets.act(event.port, Datagram(event.service, event.peer, event.data.upper()))

    def of(self, kind: type) -> list:
        return [event for event in self.heard if isinstance(event, kind)]


@pytest.fixture(params=["macvlan", "veth"])
def wire(request, ip):
    """A controller's interface ``plc0`` in the same namespace, at the other end of the drives' wire."""
    ip("link", "add", "nic0", "type", "veth", "peer", "name", "plc0")
    if request.param == "veth":
        ip("link", "add", "br0", "type", "bridge", "mcast_snooping", "0")
        ip("link", "set", "nic0", "master", "br0")
        ip("link", "set", "br0", "addrgenmode", "none", "up")
        # as on a farm's own bridge: it does not answer for the controller's address, which plc0 has
        Path("/proc/sys/net/ipv4/conf/br0/arp_ignore").write_text("1", encoding="ascii")
    for end in ("nic0", "plc0"):
        ip("link", "set", end, "addrgenmode", "none", "up")
    ip("link", "set", "lo", "up")
    ip("addr", "add", f"{CONTROLLER}/23", "dev", "plc0")
    return request.param


async def ask(number: int, data: bytes = b"hello") -> bytes:
    """What a drive answers on a new stream, to a client that knows nothing of interfaces."""
    async with asyncio.timeout(PATIENCE):
        reader, writer = await asyncio.open_connection(str(address_of(number).ip), TCP)
        writer.write(data)
        answer = await reader.readexactly(len(data))
        writer.close()
        await writer.wait_closed()
        return answer


def heard_frames(raw) -> list[bytes]:
    raw.setblocking(False)
    frames = []
    with contextlib.suppress(BlockingIOError):
        while True:
            frames.append(raw.recv(2048))
    return frames


def test_each_of_64_drives_in_one_subnet_answers_from_its_own_address_and_no_other(wire, raw):
    async def run() -> list[bytes]:
        async with Echo(wire, DRIVES) as echo:
            with raw("plc0") as tap:
                tap.setsockopt(socket.SOL_SOCKET, 33, 1 << 24)
                for n in range(DRIVES):
                    assert await ask(n, b"drive %d" % n) == b"DRIVE %d" % n
                await reached(lambda: len(echo.of(StreamClosed)) == DRIVES, PATIENCE)
                return heard_frames(tap)

    frames = [frame for frame in asyncio.run(run()) if frame[6:10] == mac_of(0)[:4]]
    spoke = set()
    for frame in frames:
        kind = int.from_bytes(frame[12:14], "big")
        address = frame[28:32] if kind == 0x0806 else frame[26:30]
        assert kind in {0x0800, 0x0806}
        assert frame[6:12] == mac_of(address[3] - 11), "an address speaks from the MAC of another drive"
        spoke.add((kind, address[3] - 11))
    assert spoke == {(kind, n) for kind in (0x0800, 0x0806) for n in range(DRIVES)}


def test_datagrams_are_answered_whether_they_come_to_one_or_to_all(wire):
    async def run() -> None:
        async with Echo(wire, 8) as echo:
            loop = asyncio.get_running_loop()
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
                sock.setblocking(False)
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"plc0")
                for to, who in ((str(address_of(3).ip), {3}), ("10.77.1.255", set(range(8))),
                                ("255.255.255.255", set(range(8)))):  # fmt: skip
                    await loop.sock_sendto(sock, b"list", (to, UDP))
                    answers = set()
                    async with asyncio.timeout(PATIENCE):
                        while len(answers) < len(who):
                            data, (source, _) = await loop.sock_recvfrom(sock, 99)
                            assert data == b"LIST"
                            answers.add(source)
                    assert answers == {str(address_of(n).ip) for n in who}
            peers = {event.peer[0] for event in echo.of(DatagramReceived)}
            assert peers == {IPv4Address(CONTROLLER)}

    asyncio.run(run())


def test_a_datagram_for_the_engine_is_not_called_unreachable_and_reaches_its_socket(wire, raw):
    async def run() -> list[bytes]:
        async with Echo(wire, 2, silenced=1) as echo:
            engine = echo.link.engine_datagrams(2222)
            assert engine is not None
            # an answer of the kernel's to an address that it has itself takes this way
            with engine, raw("lo", 0x0800) as tap, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
                for n in range(3):
                    sock.sendto(b"cyclic", (str(address_of(n % 2).ip), 2222))
                engine.settimeout(10)
                got = [engine.recvfrom(2048) for _ in range(3)]
                assert [data[-6:] for data, _ in got] == [b"cyclic"] * 3
                # those of two interfaces may overtake each other
                assert sorted(at[0] for _, at in got) == sorted(echo.ports[n % 2].name for n in range(3))
                # a socket that is connected is told of an unreachable port
                sock.connect((str(address_of(0).ip), 2223))
                sock.settimeout(PATIENCE)
                sock.send(b"other")
                with pytest.raises(ConnectionRefusedError):
                    sock.recv(9)
                return [f for f in heard_frames(tap) if f[23] == 1]

    unreachable = asyncio.run(run())
    # only the port that nobody has
    assert [struct.unpack_from(">H", frame, 14 + 20 + 8 + 22)[0] for frame in unreachable] == [2223]


def test_power_off_is_silence_at_once_and_not_a_reset(wire, raw):
    async def run() -> None:
        async with Echo(wire, 2) as echo:
            with socket.socket() as sock, socket.socket() as beside, raw("plc0") as tap:
                for number, one in enumerate((sock, beside)):
                    one.settimeout(10)
                    await asyncio.to_thread(one.connect, (str(address_of(number).ip), TCP))
                await reached(lambda: len(echo.of(StreamOpened)) == 2, PATIENCE)
                heard_frames(tap)
                echo.link.sockets.withdraw(echo.ports[0].index)
                sock.sendall(b"anyone?")
                await asyncio.sleep(0.3)
                spoke = [frame for frame in heard_frames(tap) if frame[6:12] == mac_of(0)]
                assert spoke == [], "a drive without power sent something"
                beside.sendall(b"and you")
                assert await asyncio.to_thread(beside.recv, 99) == b"AND YOU"
                # it boots: the peer's old stream means nothing to it
                echo.serve(0)
                sock.sendall(b"still there?")
                with pytest.raises(ConnectionResetError):
                    await asyncio.to_thread(sock.recv, 99)
            assert await ask(0) == b"HELLO"

    asyncio.run(run())


def test_a_cable_that_was_pulled_and_plugged_leaves_the_address_usable(wire):
    async def run() -> None:
        async with Echo(wire, 2) as echo:
            assert await ask(0) == b"HELLO"
            await echo.link.set_carrier(echo.ports[0].index, False)
            await echo.link.set_carrier(echo.ports[0].index, True)
            assert await ask(0) == b"HELLO"
            assert await ask(1) == b"HELLO"

    asyncio.run(run())


def test_more_sessions_than_allowed_are_closed_and_one_that_ends_makes_room(wire):
    async def run() -> None:
        async with Echo(wire, 1) as echo:
            async with asyncio.timeout(PATIENCE):
                streams = [await asyncio.open_connection(str(address_of(0).ip), TCP) for _ in range(3)]
                await reached(lambda: len(echo.of(StreamOpened)) == 3, PATIENCE)
                reader, writer = await asyncio.open_connection(str(address_of(0).ip), TCP)
                assert await reader.read() == b""
                writer.close()
                streams[0][1].close()
                await reached(lambda: len(echo.of(StreamClosed)) == 1, PATIENCE)
                assert await ask(0) == b"HELLO"
                assert echo.link.counters.dropped["stream-refused"] == 1
                for _, other in streams:
                    other.close()

    asyncio.run(run())


def test_a_listener_that_cannot_be_opened_again_is_an_error_and_the_next_try_opens_it(wire):
    async def run() -> None:
        async with Echo(wire, 1) as echo:
            sockets, port = echo.link.sockets, echo.ports[0].index
            sockets.refuse(port, refused=True)
            soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
            resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
            try:
                with pytest.raises(EnvironmentError_, match=rf"a port of {address_of(0).ip} .* cannot be opened"):
                    sockets.refuse(port, refused=False)
            finally:
                resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
            sockets.refuse(port, refused=False)
            assert await ask(0) == b"HELLO"

    asyncio.run(run())


def test_a_peer_that_does_not_read_loses_its_stream_and_no_memory_is_lost(wire):
    async def run() -> None:
        async with Echo(wire, 1) as echo:
            with socket.socket() as sock:
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                sock.settimeout(20)
                await asyncio.to_thread(sock.connect, (str(address_of(0).ip), TCP))
                await reached(lambda: echo.of(StreamOpened), PATIENCE)
                (opened,) = echo.of(StreamOpened)
                for _ in range(200):
                    echo.link.sockets.act(opened.port, StreamData(opened.stream, bytes(MOST_OCTETS // 8)))
                await reached(lambda: echo.of(StreamClosed), PATIENCE)
                assert echo.link.counters.dropped["slow-reader"] >= 1

    asyncio.run(run())


def test_a_stream_that_ends_behind_octets_that_its_peer_never_reads_is_not_kept(wire, monkeypatch):
    monkeypatch.setattr(kernel_sockets, "_UNANSWERED_MS", 300)

    async def run() -> None:
        async with Echo(wire, 1) as echo, asyncio.timeout(PATIENCE):
            with contextlib.ExitStack() as peers:
                for _ in range(3):
                    peer = peers.enter_context(socket.socket())
                    peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                    await asyncio.to_thread(peer.connect, (str(address_of(0).ip), TCP))
                await reached(lambda: len(echo.of(StreamOpened)) == 3, PATIENCE)
                for opened in echo.of(StreamOpened):
                    # more than the kernel takes for such a peer
                    echo.link.sockets.act(opened.port, StreamData(opened.stream, bytes(MOST_OCTETS)))
                    echo.link.sockets.act(opened.port, StreamEnd(opened.stream))
                reader, writer = await asyncio.open_connection(str(address_of(0).ip), TCP)
                assert await reader.read() == b""
                writer.close()
                await reached(lambda: echo.link.counters.dropped["unanswered"] == 3, PATIENCE)
                assert await ask(0) == b"HELLO"

    asyncio.run(run())


def test_a_station_closes_behind_its_last_octets(wire):
    async def run() -> None:
        async with Echo(wire, 1) as echo:
            async with asyncio.timeout(PATIENCE):
                reader, writer = await asyncio.open_connection(str(address_of(0).ip), TCP)
                await reached(lambda: echo.of(StreamOpened), PATIENCE)
                (opened,) = echo.of(StreamOpened)
                echo.link.sockets.act(opened.port, StreamData(opened.stream, b"x" * 100_000))
                echo.link.sockets.act(opened.port, StreamEnd(opened.stream))
                assert await reader.read() == b"x" * 100_000
                writer.close()

    asyncio.run(run())


def test_a_controller_s_port_opens_streams_to_drives_of_the_same_link(wire):
    async def run() -> None:
        async with Echo(wire, 2) as echo:
            carrier, (near, far) = echo.link.sockets, echo.ports
            echo.reply = False
            stream = carrier.connect(near.index, (address_of(1).ip, TCP))
            await reached(lambda: len(echo.of(StreamOpened)) == 2, PATIENCE)
            there = next(event for event in echo.of(StreamOpened) if event.service == TCP)
            assert (there.port, there.peer[0]) == (far.index, address_of(0).ip)
            carrier.act(near.index, StreamData(stream, b"question"))
            await reached(lambda: echo.of(StreamReceived), PATIENCE)
            assert echo.of(StreamReceived) == [StreamReceived(far.index, there.stream, b"question")]
            assert carrier.next_hop(near.index, address_of(1).ip) == far.mac
            refused = carrier.connect(near.index, (address_of(1).ip, TCP + 1))
            await reached(lambda: StreamClosed(near.index, refused) in echo.heard, PATIENCE)

    asyncio.run(run())


def test_a_drive_without_sockets_beside_one_with_them_stays_silent_to_the_kernel(wire):
    async def run() -> None:
        seen: list[tuple[int, bytes]] = []
        async with Echo(wire, 1, silenced=1) as echo:
            echo.link.set_receiver(lambda port, frame, now: seen.append((port, frame)))
            assert await ask(0) == b"HELLO"
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
                sock.sendto(b"who", (str(address_of(1).ip), 161))
            await reached(lambda: seen, PATIENCE)
            arp = [frame for port, frame in seen if port == echo.ports[1].index and frame[12:14] == b"\x08\x06"]
            assert arp
            # ARP is heard there, for conflicts of addresses
            others = [frame for port, frame in seen if port == echo.ports[0].index and frame[12:14] != b"\x08\x06"]
            assert not others, "the kernel's frames came to the loop"

    asyncio.run(run())


def test_nothing_is_left_of_addresses_rules_and_routes_neither_at_the_end_nor_after_a_kill(wire, ip):
    def state() -> tuple[str, str, str]:
        routes = ip("route", "show", "table", "all", "type", "local")
        return ip("rule"), ip("-4", "addr", "show", "scope", "global"), routes

    before = state()

    async def run() -> None:
        async with Echo(wire, 4):
            assert state() != before

    asyncio.run(run())
    assert state() == before

    async def die() -> None:
        echo = Echo(wire, 4)
        await echo.__aenter__()
        # the end of the process: its sockets go, and what the kernel keeps stays
        echo.link._sockets.close()
        loop = asyncio.get_running_loop()
        for host in echo.link.sockets._hosts.values():
            for sock in (*host.listeners, *host.datagrams.values(), *host.silent):
                loop.remove_reader(sock)
                sock.close()

    asyncio.run(die())
    assert state() != before
    assert len(remove_leftovers_now("sockets")) == (4 if wire == "macvlan" else 8)
    assert state() == before


def test_a_port_that_another_program_has_is_an_error_that_leaves_nothing(wire, ip):
    async def run() -> None:
        async with Echo(wire, 1) as echo:
            port = echo.ports[0].index
            echo.link.sockets.withdraw(port)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
                other.bind(("", UDP))
                with pytest.raises(EnvironmentError_, match="another program's"):
                    echo.serve(0)
                assert "10.77.0.11" not in ip("addr")
            echo.serve(0)
            assert await ask(0) == b"HELLO"

    asyncio.run(run())


def test_a_group_is_joined_on_the_station_s_own_interface_alone_until_it_leaves_or_goes(wire, ip):
    group, other = IPv4Address("239.192.2.64"), IPv4Address("239.192.2.96")

    def joined(name: str) -> set[str]:
        return {line.split()[1] for line in ip("maddr", "show", "dev", name).splitlines() if "239." in line}

    async def run() -> None:
        async with Echo(wire, 2) as echo:
            first, second = (port.name for port in echo.ports[:2])
            sockets = echo.link.sockets
            for _ in range(2):
                sockets.join(echo.ports[0].index, group)
            for n in range(30):
                sockets.join(echo.ports[0].index, IPv4Address(int(other) + n))
            assert len(joined(first)) == 31, "more than a socket may have"
            assert joined(second) == set()
            sockets.leave(echo.ports[0].index, group)
            sockets.leave(echo.ports[0].index, group)
            assert str(group) not in joined(first)
            assert str(other) in joined(first)
            sockets.withdraw(echo.ports[0].index)
            assert joined(first) == set()
            sockets.join(echo.ports[0].index, group)
            assert echo.link.counters.dropped["no-address"] == 1

    asyncio.run(run())


@pytest.mark.asyncio
async def test_without_files_a_group_a_next_hop_and_a_stream_are_refused_and_nothing_raises(cable):
    heard: list[object] = []
    counters = LinkCounters()
    carrier = kernel_sockets.KernelSockets(counters, own=False)
    port = socket.if_nametoindex("lo")
    carrier.open([Port("lo", port, bytes(6))])
    carrier.set_user(lambda event, _now: heard.append(event))
    carrier.serve(port, Services(IPv4Interface("127.0.0.1/8"), datagrams=(UDP,)))
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
        carrier.join(port, IPv4Address("239.192.1.32"))
        assert carrier.next_hop(port, IPv4Address("127.0.0.2")) is None
        stream = carrier.connect(port, (IPv4Address("127.0.0.1"), TCP))
        await asyncio.sleep(0)  # a turn of the loop, in which the user is told
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        carrier.close()
    assert heard == [StreamClosed(port, stream)]
    assert counters.dropped == {"group-emfile": 1, "connect-emfile": 1}
