"""Through which interface a drive's cyclic frames leave: the kernel's own answers, in a namespace of the test's own."""

import asyncio
import os
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from opened_link import opened

from pnfarm.errors import EnvironmentError_
from pnfarm.links import egress as exits_module
from pnfarm.links.base import MULTICAST_DCP_IDENTIFY, PortSpec
from pnfarm.links.egress import addresses_taken, egress_of
from pnfarm.links.kernel.netlink import attributes, messages
from pnfarm.links.macvlan import MacvlanLink
from pnfarm.links.veth import VethLink

FAR = bytes.fromhex("0a0000000001")
PLC = bytes.fromhex("02cc00000001")
SIBLING = bytes.fromhex("02cc000000aa")


def specs(count):
    return [PortSpec(f"axis-{n:02}", b"\x02\x00\x00\x00" + struct.pack(">H", n)) for n in range(1, count + 1)]


def parent_index(ip, name):
    return int(ip("-o", "link", "show", name).split(":")[0])


class Told:
    """The ports whose exit changed."""

    def __init__(self, link):
        self.ports = []
        self._came = asyncio.Event()
        egress_of(link).set_listener(self._take)

    def _take(self, port):
        self.ports.append(port)
        self._came.set()

    async def next(self):
        async with asyncio.timeout(5.0):
            while not self.ports:
                self._came.clear()
                await self._came.wait()
        return self.ports.pop(0)


@pytest.mark.asyncio
async def test_frames_to_a_far_peer_leave_through_the_parent_and_to_a_sibling_through_the_drive(cable, ip):
    nic, _ = cable
    ip("link", "add", "link", nic, "name", "other", "address", SIBLING.hex(":"), "type", "macvlan", "mode", "bridge")
    ip("link", "set", "other", "up")
    link = MacvlanLink("line-1", nic, send="auto")
    async with opened(link, specs(2)) as (first, second):
        egress = egress_of(link)
        assert egress.egress_for(first.index, FAR) == parent_index(ip, nic)
        assert egress.egress_for(first.index, SIBLING) == 0
        assert egress.egress_for(first.index, second.mac) == 0
        assert egress.egress_for(first.index, MULTICAST_DCP_IDENTIFY) == 0
        assert egress.egress_for(first.index + 1000, FAR) == 0
    assert egress.egress_for(first.index, FAR) == 0


@pytest.mark.asyncio
async def test_a_sibling_in_another_network_namespace_is_known(cable, ip):
    nic, _ = cable
    space = f"pnexit{os.getpid()}"
    ip("netns", "add", space)
    try:
        ip("link", "add", "link", nic, "name", "other", "address", SIBLING.hex(":"), "type", "macvlan")
        ip("link", "set", "other", "netns", space)
        ip("-n", space, "link", "set", "other", "up")
        link = MacvlanLink("line-1", nic, send="auto")
        async with opened(link, specs(1)) as (port,):
            assert egress_of(link).egress_for(port.index, SIBLING) == 0
    finally:
        ip("netns", "del", space)


@pytest.mark.asyncio
@pytest.mark.parametrize(("choice", "through_parent"), [("own", False), ("parent", True)])
async def test_the_farm_file_decides_for_every_peer(cable, ip, choice, through_parent):
    nic, _ = cable
    link, other = MacvlanLink("line-1", nic, send=choice), MacvlanLink("line-1", nic)
    async with opened(link, specs(1)) as (port,), opened(other, [PortSpec("plc", PLC)]):
        expected = parent_index(ip, nic) if through_parent else 0
        assert [egress_of(link).egress_for(port.index, peer) for peer in (FAR, PLC)] == [expected, expected]


@pytest.mark.asyncio
async def test_a_drive_whose_cable_is_pulled_has_no_way_through_the_parent(cable, ip):
    nic, _ = cable
    link = MacvlanLink("line-1", nic, send="auto")
    told = Told(link)
    async with opened(link, specs(2)) as (first, second):
        await link.set_carrier(first.index, False)
        assert await told.next() == first.index
        assert egress_of(link).egress_for(first.index, FAR) == 0
        assert egress_of(link).egress_for(second.index, FAR) == parent_index(ip, nic)
        await link.set_carrier(first.index, True)
        assert await told.next() == first.index
        assert egress_of(link).egress_for(first.index, FAR) == parent_index(ip, nic)


@pytest.mark.asyncio
async def test_an_interface_that_somebody_sets_down_sends_nothing_through_the_parent(cable, ip):
    nic, _ = cable
    link = MacvlanLink("line-1", nic, send="auto")
    told = Told(link)
    async with opened(link, specs(1)) as (port,):
        ip("link", "set", port.name, "down")
        assert await told.next() == port.index
        assert egress_of(link).egress_for(port.index, FAR) == 0
        ip("link", "set", port.name, "up")
        assert await told.next() == port.index
        assert egress_of(link).egress_for(port.index, FAR) == parent_index(ip, nic)


@pytest.mark.asyncio
async def test_reports_that_the_kernel_had_no_room_for_are_asked_for(cable, ip, monkeypatch):
    monkeypatch.setattr(exits_module, "_REPORTS", 4096)
    nic, _ = cable
    link = MacvlanLink("line-1", nic, send="auto")
    told = Told(link)
    async with opened(link, specs(4)) as ports:
        # nobody reads while these are reported
        for _ in range(10):
            ip("link", "set", ports[0].name, "down")
            ip("link", "set", ports[0].name, "up")
        ip("link", "set", ports[1].name, "down")
        while await told.next() != ports[1].index:
            pass
        parent = parent_index(ip, nic)
        assert [egress_of(link).egress_for(port.index, FAR) for port in ports] == [parent, 0, parent, parent]


@pytest.mark.asyncio
async def test_reports_lost_where_the_kernel_lists_nothing_leave_each_drive_its_own_interface(cable, ip, monkeypatch):
    def refused():
        raise OSError("no answer")

    monkeypatch.setattr(exits_module, "_REPORTS", 4096)
    monkeypatch.setattr(exits_module, "_interfaces_up", refused)
    nic, _ = cable
    link = MacvlanLink("line-1", nic, send="auto")
    told = Told(link)
    async with opened(link, specs(2)) as ports:
        for _ in range(20):
            ip("link", "set", ports[0].name, "down")
            ip("link", "set", ports[0].name, "up")
        assert {await told.next(), await told.next()} == {port.index for port in ports}
        assert [egress_of(link).egress_for(port.index, FAR) for port in ports] == [0, 0]


@pytest.mark.asyncio
async def test_where_the_kernel_does_not_tell_addresses_a_drive_sends_by_its_own_interface(cable, ip, monkeypatch):
    def refused(index):
        raise EnvironmentError_(f"the kernel does not report the addresses of interface {index}")

    nic, _ = cable
    link = MacvlanLink("line-1", nic, send="auto")
    async with opened(link, specs(1)) as (port,):
        with monkeypatch.context() as patched:
            patched.setattr(exits_module, "addresses_taken", refused)
            assert egress_of(link).egress_for(port.index, FAR) == 0
        assert egress_of(link).egress_for(port.index, FAR) == parent_index(ip, nic)


@pytest.mark.asyncio
async def test_a_link_without_a_shared_parent_has_no_choice(namespace):
    assert egress_of(VethLink("line-1")) is None


def test_an_interface_that_is_not_there_takes_no_addresses(namespace):
    assert addresses_taken(987_654) == frozenset()


@given(st.binary(max_size=300))
def test_any_octets_are_read_as_messages_without_an_error(data):
    for _kind, content in messages(data):
        attributes(content)


@given(st.lists(st.tuples(st.integers(0, 60), st.binary(max_size=40)), max_size=5))
def test_messages_are_taken_apart_as_they_were_put_together(parts):
    data = b""
    for kind, content in parts:
        data += struct.pack("=IHHII", 16 + len(content), kind, 0, 0, 0) + content + bytes(-len(content) % 4)
    assert [(kind, bytes(content)) for kind, content in messages(data)] == parts
