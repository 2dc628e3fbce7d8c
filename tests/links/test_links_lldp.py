"""LLDP on links: it is between the two ends of a cable, and drives of one farm do not hear each other."""

import asyncio
import contextlib
import json
import struct

import pytest
from opened_link import opened

from pnfarm.links.base import MULTICAST_LLDP, PortSpec
from pnfarm.links.macvlan import MacvlanLink
from pnfarm.links.memory import MemoryLink, MemorySwitch
from pnfarm.links.veth import VethLink

PLC = bytes.fromhex("02cc00000001")
GROUP = "01:80:c2:00:00:0e"


def specs(count):
    return [PortSpec(f"axis-{n:02}", b"\x02\x00\x00\x00" + struct.pack(">H", n)) for n in range(1, count + 1)]


def lldp(source=PLC, tail=b"\x02\x07\x04"):
    return MULTICAST_LLDP + source + b"\x88\xcc" + tail.ljust(46, b"\0")


class Inbox:
    def __init__(self, link):
        self.frames = []
        self.arrived = asyncio.Event()
        link.set_receiver(self)

    def __call__(self, port_index, data, now):
        self.frames.append((port_index, data))
        self.arrived.set()

    async def wait_for(self, count, seconds=2.0):
        async with asyncio.timeout(seconds):
            while len(self.frames) < count:
                self.arrived.clear()
                await self.arrived.wait()

    async def hears_only(self, raw, wire, ports):
        """A frame of the peer comes to ``ports`` once, and nothing came before it or comes with it."""
        with raw(wire) as peer:
            peer.send(lldp(tail=b"last"))
            await self.wait_for(len(ports))
        await asyncio.sleep(0.05)
        heard, self.frames = self.frames, []
        return sorted(heard) == sorted((port.index, lldp(tail=b"last")) for port in ports)


@pytest.fixture
def nic(ip):
    """A cable whose far end is the peer's."""
    ip("link", "add", "nic0", "type", "veth", "peer", "name", "plc0")
    for end in ("nic0", "plc0"):
        ip("link", "set", end, "addrgenmode", "none", "up")
    return "nic0"


def bridge(ip, mask):
    ip("link", "add", "br0", "type", "bridge", "group_fwd_mask", mask, "mcast_snooping", "0", "forward_delay", "0")
    ip("link", "add", "plc0", "type", "veth", "peer", "name", "plc0br")
    ip("link", "set", "plc0br", "master", "br0")
    for end in ("br0", "plc0", "plc0br"):
        ip("link", "set", end, "addrgenmode", "none", "up")
    return "br0"


def received(raw_socket):
    """Sources of the LLDP frames that wait."""
    sources = []
    raw_socket.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            data = raw_socket.recv(2048)
            if data[12:14] == b"\x88\xcc":
                sources.append(data[6:12])
    return sources


@pytest.mark.asyncio
async def test_macvlans_hear_their_one_cable_and_not_each_other(nic, ip, raw):
    link = MacvlanLink("line-1", nic)
    inbox = Inbox(link)
    async with opened(link, specs(20)) as ports:
        with raw("plc0") as peer:
            for port in ports:
                link.send(port.index, lldp(port.mac))
            await asyncio.sleep(0.05)
            assert sorted(s for s in received(peer) if s != PLC) == sorted(port.mac for port in ports)
        assert await inbox.hears_only(raw, "plc0", ports)
        # heard on the parent, once: no macvlan asked the kernel for a copy
        assert GROUP in ip("maddress", "show", "dev", nic)
        assert all(GROUP not in ip("maddress", "show", "dev", port.name) for port in ports)
    assert GROUP not in ip("maddress", "show", "dev", nic)


async def arrive(raw_socket, count):
    """Sources of the next LLDP frames of others, as soon as there are so many, and of what came behind."""
    raw_socket.setblocking(False)
    sources = []
    async with asyncio.timeout(2.0):
        while len(sources) < count:
            data = await asyncio.get_running_loop().sock_recv(raw_socket, 2048)
            if data[12:14] == b"\x88\xcc" and data[6:12] != PLC:
                sources.append(data[6:12])
    return sorted(sources + [source for source in received(raw_socket) if source != PLC])


def left_by_itself(ip, port):
    """How many frames the drive's own interface sent."""
    (link,) = json.loads(ip("-s", "-j", "link", "show", "dev", port.name))
    return link["stats64"]["tx"]["packets"]


@pytest.mark.asyncio
async def test_lldp_of_macvlans_without_others_leaves_through_the_parent_and_reaches_the_peer_once(nic, ip, raw):
    link = MacvlanLink("line-1", nic, send="auto")
    async with opened(link, specs(3)) as ports:
        new = bytes.fromhex("0200000000ee")
        await link.set_mac(ports[2].index, new)
        before = [left_by_itself(ip, port) for port in ports]
        with raw("plc0") as peer:
            for port in ports:
                link.send(port.index, lldp(port.mac))
            assert await arrive(peer, len(ports)) == sorted(port.mac for port in ports)
            assert [left_by_itself(ip, port) for port in ports] == before
            # a cable that is pulled has no other way
            await link.set_carrier(ports[0].index, False)
            link.send(ports[0].index, lldp(ports[0].mac))
            link.send(ports[1].index, lldp(ports[1].mac))
            assert await arrive(peer, 1) == [ports[1].mac]


@pytest.mark.asyncio
async def test_lldp_reaches_the_peer_while_the_parent_has_another_name(nic, ip, raw):
    link = MacvlanLink("line-1", nic, send="auto")
    async with opened(link, specs(1)) as (port,):
        ip("link", "set", nic, "down")
        ip("link", "set", nic, "name", "renamed0")
        ip("link", "set", "renamed0", "up")
        with raw("plc0") as peer:
            link.send(port.index, lldp(port.mac))
            assert await arrive(peer, 1) == [port.mac]


@pytest.mark.asyncio
async def test_a_macvlan_of_somebody_else_on_the_same_parent_hears_the_drives_lldp(nic, ip, raw):
    ip("link", "add", "link", nic, "name", "other", "address", PLC.hex(":"), "type", "macvlan", "mode", "bridge")
    ip("link", "set", "other", "up")
    ip("maddress", "add", GROUP, "dev", "other")
    link = MacvlanLink("line-1", nic, send="auto")
    async with opened(link, specs(2)) as ports:
        with raw("other") as sibling, raw("plc0") as peer:
            for port in ports:
                link.send(port.index, lldp(port.mac))
            for end in (sibling, peer):
                assert await arrive(end, len(ports)) == sorted(port.mac for port in ports)


@pytest.mark.asyncio
async def test_a_pulled_macvlan_hears_nothing_of_the_shared_cable(nic, raw):
    link = MacvlanLink("line-1", nic)
    inbox = Inbox(link)
    async with opened(link, specs(3)) as ports:
        await link.set_carrier(ports[1].index, False)
        assert await inbox.hears_only(raw, "plc0", [ports[0], ports[2]])
        await link.set_carrier(ports[1].index, True)
        assert await inbox.hears_only(raw, "plc0", ports)


@pytest.mark.asyncio
async def test_drives_behind_a_bridge_that_forwards_lldp_do_not_hear_each_other(namespace, ip, raw):
    link = VethLink("line-1", bridge=bridge(ip, "0x4000"))
    inbox = Inbox(link)
    async with opened(link, specs(8)) as ports:
        for port in ports:
            link.send(port.index, lldp(port.mac))
        assert await inbox.hears_only(raw, "plc0", ports)
        # the kernel dropped them: not one of the 56 copies reached this process
        assert link.counters.dropped["own-lldp"] == 0
        # the frame of a sibling that came by a way on which its mark was lost
        with raw("plc0") as peer:
            peer.send(lldp(ports[0].mac))
        await asyncio.sleep(0.05)
        assert inbox.frames == []
        assert link.counters.dropped["own-lldp"] == len(ports)


@pytest.mark.asyncio
async def test_an_address_that_changed_is_still_our_own(namespace, ip, raw):
    link = VethLink("line-1", bridge=bridge(ip, "0x4000"))
    inbox = Inbox(link)
    async with opened(link, specs(2)) as (first, second):
        new = bytes.fromhex("0200000000ee")
        await link.set_mac(first.index, new)
        with raw("plc0") as peer:
            peer.send(lldp(new))
            peer.send(lldp(first.mac))
            await inbox.wait_for(2)
        assert {data[6:12] for _, data in inbox.frames} == {first.mac}
        assert {port for port, _ in inbox.frames} == {first.index, second.index}


@pytest.mark.asyncio
async def test_an_ordinary_bridge_keeps_lldp_to_itself(namespace, ip, raw):
    link = VethLink("line-1", bridge=bridge(ip, "0"))
    inbox = Inbox(link)
    async with opened(link, specs(2)) as ports:
        with raw("plc0") as peer:
            link.send(ports[0].index, lldp(ports[0].mac))
            peer.send(lldp())
            await asyncio.sleep(0.05)
            assert ports[0].mac not in received(peer)
        assert inbox.frames == []


def test_in_memory_lldp_crosses_from_link_to_link_and_not_within_one():
    switch = MemorySwitch()
    farm, plc = MemoryLink(switch, lambda: 0), MemoryLink(switch, lambda: 0)

    async def run():
        drives = await farm.open(specs(3))
        (port,) = await plc.open([PortSpec("plc", PLC)])
        return drives, port

    drives, port = asyncio.run(run())
    heard = []
    farm.set_receiver(lambda index, data, now: heard.append((index, data[6:12])))
    plc.set_receiver(lambda index, data, now: heard.append((index, data[6:12])))
    farm.send(drives[0].index, lldp(drives[0].mac))
    plc.send(port.index, lldp())
    switch.deliver(0)
    assert heard == [(port.index, drives[0].mac), *((drive.index, PLC) for drive in drives)]
    # everything else still reaches the siblings
    heard.clear()
    farm.send(drives[0].index, bytes.fromhex("010ecf000000") + lldp(drives[0].mac)[6:])
    switch.deliver(0)
    assert len(heard) == 3
