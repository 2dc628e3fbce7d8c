"""macvlan, veth and plain interfaces of a real kernel, in a namespace of the test's own."""

import asyncio
import contextlib
import errno
import re
import resource
import socket
import struct
import time
from pathlib import Path

import pytest
from opened_link import opened

from pnfarm.errors import ConfigError, EnvironmentError_, InternalError
from pnfarm.farm.process.open_files import open_files
from pnfarm.links.base import MULTICAST_DCP_IDENTIFY, MULTICAST_LLDP, EngineLink, Link, PortSpec
from pnfarm.links.interface import InterfaceLink
from pnfarm.links.kernel.interfaces import remove_leftovers
from pnfarm.links.kernel.ownership import group_of, interface_prefix
from pnfarm.links.macvlan import MacvlanLink
from pnfarm.links.veth import VethLink
from pnfarm.wire.mac import BROADCAST

pytestmark = pytest.mark.asyncio

PLC = bytes.fromhex("02cc00000001")


def specs(count):
    return [PortSpec(f"axis-{n:02}", b"\x02\x00\x00\x00" + struct.pack(">H", n)) for n in range(1, count + 1)]


def frame(destination, frame_id=0xFEFE, ethertype=0x8892, source=PLC, tail=b""):
    return destination + source + struct.pack(">HH", ethertype, frame_id) + tail.ljust(44, b"\0")


class Inbox:
    def __init__(self, link):
        self.frames = []
        self.arrived = asyncio.Event()
        link.set_receiver(self)

    def __call__(self, port_index, data, now):
        self.frames.append((port_index, data, now))
        self.arrived.set()

    async def wait_for(self, count, seconds=10.0):
        async with asyncio.timeout(seconds):
            while len(self.frames) < count:
                self.arrived.clear()
                await self.arrived.wait()
        return self.frames

    async def nothing_more(self):
        before = len(self.frames)
        await asyncio.sleep(0.05)
        return len(self.frames) == before


def sysctl(name):
    return Path("/proc/sys/net", name).read_text()


def set_sysctl(name, value):
    Path("/proc/sys/net", name).write_text(value)


def names(ip):
    return {line.split(": ")[1].split("@")[0] for line in ip("-o", "link").splitlines()}


@pytest.fixture(params=["macvlan", "veth"])
def link_on_wire(request, ip, raw):
    """A link of either kind, and the name of an interface that is on the same wire."""
    if request.param == "macvlan":
        ip("link", "add", "nic0", "type", "veth", "peer", "name", "plc0")
        for end in ("nic0", "plc0"):
            ip("link", "set", end, "addrgenmode", "none", "up")
        return MacvlanLink("line-1", "nic0"), "plc0"
    ip("link", "add", "br0", "type", "bridge", "group_fwd_mask", "0x4000", "mcast_snooping", "0", "forward_delay", "0")
    ip("link", "add", "plc0", "type", "veth", "peer", "name", "plc0br")
    ip("link", "set", "plc0br", "master", "br0")
    for end in ("br0", "plc0", "plc0br"):
        ip("link", "set", end, "addrgenmode", "none", "up")
    return VethLink("line-1", bridge="br0"), "plc0"


async def test_a_link_of_the_kernel_has_the_whole_interface(namespace):
    for link in (MacvlanLink("f", "p"), VethLink("f"), InterfaceLink("eth1")):
        assert isinstance(link, Link)
        assert isinstance(link, EngineLink)


async def test_drives_are_interfaces_with_the_wanted_addresses_and_go_with_the_link(link_on_wire, ip):
    link, _ = link_on_wire
    before = names(ip)
    async with opened(link, specs(3)) as ports:
        assert [port.mac for port in ports] == [spec.mac for spec in specs(3)]
        assert [port.index for port in ports] == [socket.if_nametoindex(port.name) for port in ports]
        for port in ports:
            assert len(port.name) <= 15
            assert re.fullmatch(r"pf[0-9a-f]{4}-\d+", port.name)
            shown = ip("-d", "link", "show", port.name)
            assert re.search(r"<[^>]*\bUP\b", shown)
            assert "alias pnfarm:line-1:axis-" in shown
    assert names(ip) == before
    await link.close()  # twice does nothing


def take_every_file(held):
    """Open files until there is none left; how that was told."""
    while True:
        try:
            held.enter_context(socket.socket())
        except OSError as exc:
            return exc


async def test_a_process_without_files_does_not_take_its_interfaces_for_removed(link_on_wire, ip):
    link, _ = link_on_wire
    async with opened(link, specs(2)) as ports:
        link.check()
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        with contextlib.ExitStack() as held:
            resource.setrlimit(resource.RLIMIT_NOFILE, (open_files() + 8, hard))
            try:
                taken = take_every_file(held)
                assert taken.errno == errno.EMFILE
                link.check()
            finally:
                resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        ip("link", "del", ports[0].name)
        with pytest.raises(EnvironmentError_, match=f"interface {ports[0].name} was removed"):
            link.check()


async def test_the_kernel_has_no_voice_at_a_drives_interface(link_on_wire, ip, raw):
    link, plc = link_on_wire
    for what in ("default", "all"):  # a host that routes, as every container host does
        set_sysctl(f"ipv4/conf/{what}/forwarding", "1")
    ip("address", "add", "10.9.9.1/24", "dev", "lo")
    ip("link", "set", "lo", "up")
    with raw(plc) as wire:
        async with opened(link, specs(2)) as ports:
            (port, _) = ports
            assert sysctl(f"ipv4/conf/{port.name}/forwarding") == "0\n"
            assert sysctl(f"ipv6/conf/{port.name}/disable_ipv6") == "1\n"
            shown = ip("-d", "link", "show", port.name)
            assert "NOARP" in shown
            assert "addrgenmode none" in shown
            assert "inet" not in ip("address", "show", port.name)
            # an ARP request for an address of this host, an echo request to it, a datagram to be routed
            arp = struct.pack(
                ">HHBBH6s4s6s4s", 1, 0x0800, 6, 4, 1, PLC, bytes([10, 9, 9, 2]), bytes(6), bytes([10, 9, 9, 1])
            )
            wire.send(BROADCAST + PLC + b"\x08\x06" + arp)
            for target in ([10, 9, 9, 1], [10, 9, 9, 5]):
                wire.send(port.mac + PLC + b"\x08\x00" + ip_udp(bytes([10, 9, 9, 2]), bytes(target)))
            await asyncio.sleep(0.3)
        wire.settimeout(0.05)
        heard = []
        with contextlib.suppress(TimeoutError):
            while True:
                data, (_name, _proto, kind, *_rest) = wire.recvfrom(2048)
                # (the parent's own kernel may answer with the parent's address: that is not ours to forbid)
                if kind != socket.PACKET_OUTGOING and data[6:12] in {spec.mac for spec in specs(2)}:
                    heard.append(data.hex())
        assert heard == []


def ip_udp(source, destination):
    header = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 32, 1, 0, 64, 17, 0, source, destination)
    total = sum(struct.unpack(">10H", header))
    total = (total & 0xFFFF) + (total >> 16)
    header = header[:10] + struct.pack(">H", 0xFFFF - total) + header[12:]
    return header + struct.pack(">HHHH", 5000, 34964, 12, 0) + b"data"


async def test_frames_reach_the_drive_they_are_for(link_on_wire, raw):
    link, plc = link_on_wire
    inbox = Inbox(link)
    async with opened(link, specs(3)) as ports:
        with raw(plc) as wire:
            earliest = time.monotonic_ns()
            sent = [
                frame(ports[1].mac),
                ports[2].mac + PLC + b"\x08\x00" + ip_udp(bytes([10, 9, 9, 2]), bytes([10, 9, 9, 3])),
                frame(ports[0].mac, ethertype=0x0806),
            ]
            for data in sent:
                wire.send(data)
            await inbox.wait_for(3)
        assert {(port, data) for port, data, _ in inbox.frames} == {
            (ports[1].index, sent[0]),
            (ports[2].index, sent[1]),
            (ports[0].index, sent[2]),
        }
        assert all(earliest <= now <= time.monotonic_ns() for _, _, now in inbox.frames)
        assert link.counters.received == 3


@pytest.mark.parametrize("group", [MULTICAST_DCP_IDENTIFY, MULTICAST_LLDP, BROADCAST], ids=["dcp", "lldp", "broadcast"])
async def test_every_drive_hears_a_multicast_once(link_on_wire, raw, group):
    link, plc = link_on_wire
    inbox = Inbox(link)
    async with opened(link, specs(3)) as ports:
        with raw(plc) as wire:
            wire.send(frame(group, ethertype=0x88CC if group == MULTICAST_LLDP else 0x8892))
            await inbox.wait_for(3)
        assert await inbox.nothing_more()
        assert sorted(port for port, *_ in inbox.frames) == sorted(port.index for port in ports)


async def test_a_drive_speaks_with_its_own_address(link_on_wire, raw):
    link, plc = link_on_wire
    async with opened(link, specs(2)) as ports:
        with raw(plc) as wire:
            answer = frame(PLC, 0xFEFF, source=ports[1].mac)
            link.send(ports[1].index, answer)
            assert await asyncio.to_thread(wire.recv, 2048) == answer
        assert link.counters.as_dict() == {"received": 0, "sent": 1}


async def test_a_bridge_forwards_the_frames_of_every_drive_as_soon_as_the_link_is_open(ip):
    link = VethLink("line-1", own_bridge=True)
    async with opened(link, specs(8)) as ports:
        for port in ports:
            assert " state forwarding " in ip("-d", "link", "show", link.peer(port.index).name)
        await link.set_carrier(ports[0].index, False)
        await link.set_carrier(ports[0].index, True)
        assert " state forwarding " in ip("-d", "link", "show", link.peer(ports[0].index).name)


async def test_drives_hear_each_other(link_on_wire):
    link, _ = link_on_wire
    inbox = Inbox(link)
    async with opened(link, specs(2)) as (first, second):
        link.send(first.index, frame(second.mac, source=first.mac))
        await inbox.wait_for(1)
        assert inbox.frames[0][0] == second.index
        link.send(first.index, frame(MULTICAST_DCP_IDENTIFY, source=first.mac))
        await inbox.wait_for(2)
        assert await inbox.nothing_more()
        assert inbox.frames[1][0] == second.index


async def test_cyclic_frames_go_to_the_engines_socket_alone(link_on_wire, raw):
    link, plc = link_on_wire
    inbox = Inbox(link)
    async with opened(link, specs(2)) as ports:
        with contextlib.closing(link.engine_socket()) as engine, raw(plc) as wire:
            assert engine.getblocking() is False
            wire.send(frame(ports[1].mac, 0x8001))
            wire.send(frame(ports[1].mac, 0xFC01))
            while ports[1].index not in {port for port, _, _ in inbox.frames}:
                await inbox.wait_for(len(inbox.frames) + 1)
            taken = []
            with contextlib.suppress(BlockingIOError):
                while len(taken) < 9:
                    taken.append(engine.recvfrom(2048))
            # a bridge that does not know the address yet floods the frame, and the engine sees that it is not for there
            assert {data for data, _ in taken} == {frame(ports[1].mac, 0x8001)}
            names = [address[0] for _, address in taken]
            assert names.count(ports[1].name) == 1
            assert names.count(ports[0].name) <= (link.kind == "veth")
            assert {data for _, data, _ in inbox.frames} == {frame(ports[1].mac, 0xFC01)}
            heard = [port for port, _, _ in inbox.frames]
            assert heard.count(ports[1].index) == 1
            assert heard.count(ports[0].index) <= (link.kind == "veth")
            # and the engine sends through it with the index in the address
            engine.sendto(frame(PLC, 0x8002, source=ports[0].mac), (ports[0].name, 0))
            assert b"\x88\x92\x80\x02" in await asyncio.to_thread(wire_recv, wire, b"\x80\x02")


def wire_recv(wire, wanted):
    while True:
        data = wire.recv(2048)
        if data[14:16] == wanted:
            return data


async def test_a_pulled_cable_is_silent_both_ways_and_everything_works_again_when_plugged(link_on_wire, raw):
    link, plc = link_on_wire
    inbox = Inbox(link)
    async with opened(link, specs(2)) as (first, second):
        await link.set_carrier(first.index, False)
        with raw(plc) as wire:
            link.send(first.index, frame(PLC, source=first.mac))
            wire.send(frame(first.mac))
            wire.send(frame(MULTICAST_DCP_IDENTIFY))
            await inbox.wait_for(1)
            assert await inbox.nothing_more()
            assert [port for port, *_ in inbox.frames] == [second.index]
            inbox.frames.clear()

            await link.set_carrier(first.index, True)
            assert sysctl(f"ipv6/conf/{first.name}/disable_ipv6") == "1\n"
            wire.send(frame(first.mac))
            wire.send(frame(MULTICAST_DCP_IDENTIFY))
            wire.send(frame(MULTICAST_LLDP, ethertype=0x88CC))
            await inbox.wait_for(5)
            assert sorted(port for port, *_ in inbox.frames) == sorted([first.index] * 3 + [second.index] * 2)
            link.send(first.index, frame(PLC, 0xFEFF, source=first.mac))
            assert (await asyncio.to_thread(wire_recv, wire, b"\xfe\xff"))[6:12] == first.mac


async def test_another_address_is_heard_and_the_old_one_no_more(link_on_wire, raw):
    link, plc = link_on_wire
    inbox = Inbox(link)
    new = bytes.fromhex("0200000000ee")
    async with opened(link, specs(1)) as (port,):
        await link.set_mac(port.index, new)
        with raw(plc) as wire:
            wire.send(frame(port.mac))
            wire.send(frame(new))
            await inbox.wait_for(1)
            assert await inbox.nothing_more()
        assert [data[:6] for _, data, _ in inbox.frames] == [new]


async def test_what_cannot_be_sent_is_counted(link_on_wire):
    link, _ = link_on_wire
    async with opened(link, specs(1)) as (port,):
        link.send(port.index + 1000, frame(PLC))
        link.send(port.index, frame(PLC) + bytes(3000))
        assert link.counters.dropped == {"unknown-port": 1, "too-long": 1}
    link.send(port.index, frame(PLC))
    assert link.counters.dropped["unknown-port"] == 2


async def test_a_storm_does_not_starve_the_loop(link_on_wire, raw):
    link, plc = link_on_wire
    inbox = Inbox(link)
    async with opened(link, specs(1)) as (port,):
        with raw(plc) as wire:
            for _ in range(2000):
                wire.send(frame(port.mac))
            turns = 0
            async with asyncio.timeout(5):
                while len(inbox.frames) < 2000:
                    turns += 1
                    await asyncio.sleep(0)
        assert turns >= 2000 // 64


async def test_a_link_opens_once_and_wants_known_ports(link_on_wire):
    link, _ = link_on_wire
    with pytest.raises(InternalError, match="after the link's ports are up"):
        link.engine_socket()
    async with opened(link, specs(1)):
        with pytest.raises(InternalError, match="already open"):
            await link.open(specs(1))
        with pytest.raises(InternalError, match="no port 99999"):
            await link.set_carrier(99999, False)


async def test_a_failure_half_way_leaves_nothing(link_on_wire, ip):
    link, _ = link_on_wire
    before = names(ip)
    wanted = [*specs(5), PortSpec("axis-bad", bytes.fromhex("010000000001"))]
    with pytest.raises((ConfigError, EnvironmentError_), match="axis-bad"):
        await link.open(wanted)
    assert names(ip) == before
    async with opened(link, specs(2)):
        pass


async def test_cancelling_a_start_leaves_nothing(link_on_wire, ip):
    link, _ = link_on_wire
    before = names(ip)
    cancelled = 0
    for delay in (0, 0.002, 0.005, 0.01, 0.03):
        task = asyncio.create_task(link.open(specs(60)))
        await asyncio.sleep(delay)
        task.cancel()
        try:
            await task
        except asyncio.CancelledError:
            cancelled += 1
        else:
            await link.close()  # it was faster
        assert names(ip) == before
    assert cancelled >= 2


async def test_two_links_of_one_farm_remove_each_its_own(cable, ip):
    nic, _ = cable
    drives, plc = MacvlanLink("line-1", nic), MacvlanLink("line-1", nic)
    async with opened(drives, specs(3)) as ports:
        async with opened(plc, [PortSpec("plc", PLC)]):
            assert len(names(ip)) == 3 + 4
        assert {port.name for port in ports} <= names(ip)
    assert names(ip) == {"lo", "nic0", "plc0"}


# -- macvlan


async def test_256_macvlans_are_up_in_time(cable, ip, capsys):
    nic, _ = cable
    link = MacvlanLink("big", nic)
    started = time.perf_counter()
    ports = await link.open([PortSpec(f"axis-{n}", b"\x02\x00\x00\x01" + struct.pack(">H", n)) for n in range(256)])
    up = time.perf_counter()
    assert len({port.index for port in ports}) == 256
    await link.close()
    down = time.perf_counter()
    with capsys.disabled():
        print(f"\n256 macvlans: up in {up - started:.2f} s, gone in {down - up:.2f} s")  # noqa: T201 - a measurement to read, not to judge by
    assert names(ip) == {"lo", "nic0", "plc0"}


@pytest.mark.parametrize(
    ("parent", "sentence"),
    [
        ("eth77", r"parent interface eth77 does not exist on this machine: Ethernet interfaces here are nic0, plc0"),
        ("lo", r"lo is not an Ethernet interface"),
        ("nic0", r"nic0 is down: bring it up with `ip link set nic0 up`"),
    ],
)
async def test_an_unusable_parent_is_named_with_what_would_be_right(cable, ip, parent, sentence):
    ip("link", "set", "nic0", "down")
    with pytest.raises(EnvironmentError_, match=sentence):
        await MacvlanLink("line-1", parent).open(specs(1))
    assert "state DOWN" in ip("link", "show", "nic0")


async def test_a_parent_that_is_a_bridges_port_is_refused_in_words(cable, ip):
    ip("link", "add", "br0", "type", "bridge")
    ip("link", "set", "nic0", "master", "br0")
    with pytest.raises(EnvironmentError_, match="parent is in use"):
        await MacvlanLink("line-1", "nic0").open(specs(1))


async def test_an_address_in_use_on_the_parent_is_refused_in_words(cable, ip):
    nic, _ = cable
    async with opened(MacvlanLink("line-1", nic), specs(2)):
        with pytest.raises(EnvironmentError_, match="MAC address is in use on nic0"):
            await MacvlanLink("line-2", nic).open(specs(1))
        assert not any(name.startswith(interface_prefix("line-2")) for name in names(ip))


# -- veth


async def test_an_own_bridge_comes_and_goes_with_the_farm(ip):
    link = VethLink("line-1", own_bridge=True)
    async with opened(link, specs(2)) as ports:
        assert link.bridge in names(ip)
        shown = ip("-d", "link", "show", link.bridge)
        assert "group_fwd_mask 0x4000" in shown
        assert "stp_state 0" in shown
        assert f"master {link.bridge}" in ip("link", "show", link.peer(ports[0].index).name)
    assert names(ip) == {"lo"}


async def test_without_a_bridge_the_far_end_is_free(ip, raw):
    link = VethLink("line-1")
    inbox = Inbox(link)
    async with opened(link, specs(1)) as (port,):
        peer = link.peer(port.index)
        assert peer.name == f"{port.name}p"
        assert "NOARP" not in ip("link", "show", peer.name)
        with raw(peer.name) as wire:
            wire.send(frame(port.mac))
            await inbox.wait_for(1)


async def test_wrong_bridges_are_refused_in_words(cable):
    with pytest.raises(EnvironmentError_, match=r"bridge br7 does not exist"):
        await VethLink("line-1", bridge="br7").open(specs(1))
    with pytest.raises(EnvironmentError_, match=r"bridge nic0 is a veth: name a bridge"):
        await VethLink("line-1", bridge="nic0").open(specs(1))
    with pytest.raises(ConfigError, match="not both"):
        VethLink("line-1", bridge="br0", own_bridge=True)


# -- an interface as it is


async def test_an_existing_interface_is_used_and_not_changed(cable, ip, raw):
    nic, plc = cable
    before = ip("-d", "address", "show", nic)
    link = InterfaceLink(nic)
    inbox = Inbox(link)
    async with opened(link, [PortSpec("plc", bytes(6))]) as (port,):
        assert port.mac.hex(":") in before
        with raw(plc) as wire:
            wire.send(frame(port.mac))
            wire.send(frame(MULTICAST_LLDP, ethertype=0x88CC))
            await inbox.wait_for(2)
        for change in (link.set_carrier(port.index, False), link.set_mac(port.index, PLC)):
            with pytest.raises(EnvironmentError_, match="is not the farm's"):
                await change
    assert re.sub(r"promiscuity \d+ ", "", ip("-d", "address", "show", nic)) == re.sub(r"promiscuity \d+ ", "", before)


async def test_one_interface_takes_one_station(cable):
    with pytest.raises(ConfigError, match="one address, so one station: 2 were given"):
        await InterfaceLink("nic0").open(specs(2))


# -- what earlier runs left


async def test_only_what_the_farm_made_is_removed(cable, ip):
    prefix = interface_prefix("line-1")
    group = str(group_of("line-1"))
    # ours, tagged; ours, killed before it was tagged; a namesake of somebody else; another farm's
    for name, options in {
        f"{prefix}-0": ("alias", "pnfarm:line-1:axis-01"),
        f"{prefix}-1": ("group", group),
        f"{prefix}-2": ("alias", "my tunnel"),
        f"{prefix}-3": ("group", "7"),
        "pf0000-0": ("alias", "pnfarm:line-1:axis-01"),
        f"{prefix}-4": ("alias", "pnfarm:line-10:axis-01"),
        "tunnel": ("group", group),
    }.items():
        ip("link", "add", name, "type", "veth", "peer", "name", f"{name[:13]}_q")
        ip("link", "set", name, *options)
    assert await remove_leftovers("line-1") == [f"{prefix}-0", f"{prefix}-1"]
    left = names(ip)
    assert {f"{prefix}-2", f"{prefix}-3", f"{prefix}-4", "pf0000-0", "tunnel"} <= left
    assert not {f"{prefix}-0", f"{prefix}-1"} & left
    assert await remove_leftovers("line-1") == []


async def test_a_name_that_is_taken_is_passed_over(cable, ip):
    prefix = interface_prefix("line-1")
    ip("link", "add", f"{prefix}-0", "type", "veth", "peer", "name", "other")
    async with opened(MacvlanLink("line-1", "nic0"), specs(2)) as ports:
        assert [port.name for port in ports] == [f"{prefix}-1", f"{prefix}-2"]
    assert f"{prefix}-0" in names(ip)


async def test_an_interface_removed_by_somebody_else_is_counted_and_closing_still_works(cable, ip):
    link = MacvlanLink("line-1", "nic0")
    async with opened(link, specs(2)) as (first, second):
        ip("link", "del", first.name)
        link.send(first.index, frame(PLC))
        assert link.counters.dropped["interface-down"] == 1
        link.send(second.index, frame(PLC))
        assert link.counters.sent == 1
        with pytest.raises(EnvironmentError_, match="cannot be set down"):
            await link.set_carrier(first.index, False)
    assert names(ip) == {"lo", "nic0", "plc0"}


async def test_macvlans_get_what_one_of_them_sends_to_a_group_and_it_does_not(cable, raw):
    nic, plc = cable
    link = MacvlanLink("line-1", nic)
    inbox = Inbox(link)
    async with opened(link, specs(3)) as ports:
        for port in ports:
            announced = frame(BROADCAST, source=port.mac, ethertype=0x0806)
            with raw(plc, 0x0806) as wire:
                link.send(port.index, announced)
                assert wire.recv(2048)[:14] == announced[:14]
            await inbox.wait_for(2)
            assert await inbox.nothing_more()
            assert sorted((index, data) for index, data, _ in inbox.frames) == sorted(
                (other.index, announced) for other in ports if other is not port
            )
            inbox.frames.clear()


async def test_another_one_hears_for_all_when_the_first_loses_its_carrier(cable, raw):
    nic, plc = cable
    link = MacvlanLink("line-1", nic)
    inbox = Inbox(link)
    async with opened(link, specs(3)) as ports:
        with raw(plc) as wire:
            for pulled in (ports[0], ports[1]):
                await link.set_carrier(pulled.index, False)
                left = [port.index for port in ports if port is not pulled]
                wire.send(frame(MULTICAST_DCP_IDENTIFY))
                await inbox.wait_for(2)
                assert sorted(index for index, *_ in inbox.frames) == left
                await link.set_carrier(pulled.index, True)
                inbox.frames.clear()


async def test_only_the_drives_that_a_broadcast_concerns_get_it(cable, raw):
    nic, plc = cable
    link = MacvlanLink("line-1", nic)
    inbox = Inbox(link)
    async with opened(link, specs(3)) as ports:
        link.set_audience(lambda data: [ports[1].index] if data[12:14] == b"\x08\x06" else None)
        with raw(plc) as wire:
            wire.send(frame(BROADCAST, ethertype=0x0806))
            await inbox.wait_for(1)
            wire.send(frame(MULTICAST_DCP_IDENTIFY))
            await inbox.wait_for(1 + 3)
        assert inbox.frames[0][0] == ports[1].index
        assert await inbox.nothing_more()
