import asyncio
import contextlib
import os
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from waiting import reached

from pnfarm.errors import EnvironmentError_, InternalError
from pnfarm.links import tap as tap_module
from pnfarm.links.base import EngineLink, Link, PortSpec
from pnfarm.links.tap import TapLink, is_cyclic, without_priority_tag
from pnfarm.wire.mac import BROADCAST

PLC = bytes.fromhex("02cc00000001")
DRIVES = [PortSpec("axis-01", bytes.fromhex("020000000001")), PortSpec("axis-02", bytes.fromhex("020000000002"))]


def frame(destination, frame_id, *, tag=None):
    ethernet = destination + PLC + (b"" if tag is None else struct.pack(">HH", 0x8100, tag))
    return ethernet + struct.pack(">HH", 0x8892, frame_id) + bytes(44)


@pytest.fixture
def tun(namespace):
    if not os.access("/dev/net/tun", os.R_OK | os.W_OK):
        pytest.skip("needs /dev/net/tun")


@contextlib.asynccontextmanager
async def opened(link):
    ports = await link.open(DRIVES)
    try:
        yield ports
    finally:
        await link.close()


class Inbox(list):
    def __call__(self, port_index, data, now):
        self.append((port_index, data))


@pytest.mark.asyncio
async def test_frames_pass_both_ways_and_cyclic_ones_go_to_their_own_receiver(tun, raw):
    link = TapLink("line-1")
    acyclic, cyclic = Inbox(), Inbox()
    link.set_receiver(acyclic)
    link.set_cyclic_receiver(cyclic)
    assert isinstance(link, Link)
    assert not isinstance(link, EngineLink)
    async with opened(link) as (first, second):
        assert [first.mac, second.mac] == [spec.mac for spec in DRIVES]
        with raw(second.name) as far_end:
            far_end.send(frame(second.mac, 0xFEFD))
            far_end.send(frame(second.mac, 0x8001))
            far_end.send(frame(BROADCAST, 0xFEFE))
            await reached(lambda: len(acyclic) == 2 and cyclic)
            assert acyclic == [(second.index, frame(second.mac, 0xFEFD)), (second.index, frame(BROADCAST, 0xFEFE))]
            assert cyclic == [(second.index, frame(second.mac, 0x8001))]
            link.send(second.index, frame(PLC, 0x8002))
            assert await asyncio.to_thread(far_end.recv, 2048)
        assert link.counters.as_dict() == {"received": 3, "sent": 1}


@pytest.mark.asyncio
async def test_tags_and_strangers_are_treated_as_at_a_packet_socket(tun, raw):
    link = TapLink("line-1")
    inbox = Inbox()
    link.set_receiver(inbox)
    async with opened(link) as (first, _):
        with raw(first.name) as far_end:
            far_end.send(frame(first.mac, 0xFEFD, tag=6 << 13))
            far_end.send(frame(first.mac, 0xFEFD, tag=5))
            far_end.send(frame(first.mac, 0xFE01, tag=5 << 13 | 4))
            far_end.send(frame(DRIVES[1].mac, 0xFEFD))
            await reached(lambda: link.counters.dropped.total() == 2 and len(inbox) == 2)
        assert inbox == [(first.index, frame(first.mac, 0xFEFD)), (first.index, frame(first.mac, 0xFE01))]
        assert link.counters.dropped == {"other-vlan": 1, "other-address": 1}


@pytest.mark.asyncio
async def test_a_pulled_cable_shows_at_the_far_end_and_nothing_passes(tun, ip, raw):
    link = TapLink("line-1")
    inbox = Inbox()
    link.set_receiver(inbox)
    async with opened(link) as (first, _):
        await link.set_carrier(first.index, False)
        assert "NO-CARRIER" in ip("link", "show", first.name)
        link.send(first.index, frame(PLC, 0xFEFF))
        assert link.counters.dropped["cable-pulled"] == 1
        await link.set_carrier(first.index, True)
        assert "NO-CARRIER" not in ip("link", "show", first.name)
        with raw(first.name) as far_end:
            far_end.send(frame(first.mac, 0xFEFD))
            await reached(lambda: inbox)


@pytest.mark.asyncio
async def test_the_address_of_a_drive_can_change(tun, raw):
    link = TapLink("line-1")
    inbox = Inbox()
    link.set_receiver(inbox)
    new = bytes.fromhex("0200000000ee")
    async with opened(link) as (first, _):
        await link.set_mac(first.index, new)
        with raw(first.name) as far_end:
            far_end.send(frame(new, 0xFEFD))
            await reached(lambda: inbox)
            far_end.send(frame(first.mac, 0xFEFD))
            await reached(lambda: link.counters.dropped["other-address"])


@pytest.mark.asyncio
async def test_taps_are_tagged_silent_in_the_bridge_and_go_with_the_link(tun, ip):
    ip("link", "add", "br0", "type", "bridge")
    ip("link", "set", "br0", "up")
    link = TapLink("line-1", bridge="br0")
    async with opened(link) as (first, _):
        shown = ip("-d", "link", "show", first.name)
        assert "alias pnfarm:line-1:axis-01" in shown
        assert "master br0" in shown
        assert "addrgenmode none" in shown
    assert "pf" not in ip("-o", "link")


@pytest.mark.asyncio
async def test_the_taps_of_a_dead_run_are_gone(tun, ip):
    link = TapLink("line-1")
    await link.open(DRIVES)
    for fd in link._fds.values():  # what the kernel does to the descriptors of a killed process
        asyncio.get_running_loop().remove_reader(fd)
        os.close(fd)
    assert "pf" not in ip("-o", "link")


@pytest.mark.asyncio
async def test_an_interface_removed_under_the_link_is_counted_and_the_loop_goes_on(tun, ip):
    link = TapLink("line-1")
    async with opened(link) as (first, _):
        ip("link", "del", first.name)
        await reached(lambda: link.counters.dropped["interface-down"])
        link.send(first.index, frame(PLC, 0xFEFF))
        assert link.counters.dropped["interface-down"] == 2


@pytest.mark.asyncio
async def test_misuse_and_missing_things_are_named(tun, monkeypatch):
    link = TapLink("line-1", bridge="br7")
    with pytest.raises(EnvironmentError_, match="bridge br7 does not exist"):
        await link.open(DRIVES)
    link = TapLink("line-1")
    link.send(7, b"")
    assert link.counters.dropped == {"unknown-port": 1}
    for change in (link.set_carrier(7, False), link.set_mac(7, PLC)):
        with pytest.raises(InternalError, match="no port 7"):
            await change
    monkeypatch.setattr(tap_module, "_TUN_DEVICE", "/dev/net/no-tun")
    with pytest.raises(EnvironmentError_, match="modprobe tun"):
        await link.open(DRIVES)


@given(st.binary(max_size=80))
def test_any_bytes_can_be_looked_at(data):
    untagged = without_priority_tag(data)
    assert untagged is None or untagged == data or len(untagged) == max(len(data) - 4, 12)
    assert is_cyclic(data) in {True, False}


def test_frames_are_told_apart_by_frame_id():
    assert is_cyclic(frame(PLC, 0xFBFF))
    assert not is_cyclic(frame(PLC, 0xFC00))
    assert not is_cyclic(frame(PLC, 0x8001)[:15])
    assert not is_cyclic(BROADCAST + PLC + b"\x08\x00" + bytes(40))
