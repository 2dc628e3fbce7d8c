"""A cable pulled, and a MAC address changed, on real interfaces, in a network namespace of the test's own."""

import asyncio
import contextlib
import ctypes
import os
import socket
import subprocess

import pytest

from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import parse_farm
from pnfarm.faults.effects.adapter import ADAPTER
from pnfarm.station.event_log import EventLog
from pnfarm.wire.mac import parse_mac

CLONE_NEWNET = 0x40000000
MACVLAN = "{kind: macvlan, parent: nic0}"
OTHER = "02:aa:00:00:00:07"
FILE = """
farm: cut
link: LINK
drives:
  - {name: axis-01, model: akd-profinet, ip: 10.77.0.11/24}
  - {name: axis-02, model: akd-profinet, ip: 10.77.0.12/24}
"""
#: Who has 10.77.0.11?
ARP_REQUEST = bytes.fromhex(
    "ffffffffffff02cc000000010806000108000604000102cc000000010a4d00fa0000000000000a4d000b"
) + bytes(18)


def address_of(interface: str) -> bytes:
    shown = subprocess.run(["ip", "-o", "link", "show", interface], check=True, capture_output=True, text=True).stdout
    return parse_mac(shown.split("link/ether ")[1].split()[0])


def occupy(mac: str) -> None:
    """Make another macvlan of the same parent that is not the farm's."""
    for words in (f"add link nic0 name other address {mac} type macvlan mode bridge", "set other up"):
        subprocess.run(["ip", "link", *words.split()], check=True, capture_output=True)


@pytest.fixture
def cable():
    """``nic0`` with ``plc0`` at its other end, in a namespace that this thread enters and leaves."""
    libc = ctypes.CDLL(None, use_errno=True)
    outside = os.open("/proc/thread-self/ns/net", os.O_RDONLY | os.O_CLOEXEC)
    try:
        if libc.unshare(CLONE_NEWNET) != 0:
            pytest.skip(f"needs a private network namespace, so root: {os.strerror(ctypes.get_errno())}")
        try:
            try:
                for words in ("add nic0 type veth peer name plc0", "set nic0 up", "set plc0 up"):
                    subprocess.run(["ip", "link", *words.split()], check=True, capture_output=True)
            except FileNotFoundError:
                pytest.skip("needs the tool `ip` (iproute2)")
            yield
        finally:
            assert libc.setns(outside, CLONE_NEWNET) == 0
    finally:
        os.close(outside)


async def answers(wire: socket.socket) -> bool:
    """Whether the drive still answers for its address."""
    loop = asyncio.get_running_loop()
    wire.send(ARP_REQUEST)
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(0.3):
            while True:
                frame = await loop.sock_recv(wire, 2048)
                if (
                    frame[12:14] == b"\x08\x06"
                    and frame[20:22] == b"\x00\x02"
                    and frame[28:32] == bytes([10, 77, 0, 11])
                ):
                    return True
    return False


def carrier(name: str) -> bool:
    shown = subprocess.run(["ip", "-o", "link", "show", name], check=True, capture_output=True, text=True).stdout
    return "UP" in shown.split("<")[1].split(">")[0].split(",")


@pytest.mark.asyncio
async def test_a_pulled_cable_takes_the_interface_down_and_a_plugged_one_brings_it_back(cable, tmp_path):
    async with Farm(parse_farm(FILE.replace("LINK", MACVLAN)), log=EventLog(quiet=True)) as farm:
        port, other = (station.port.name for station in farm.core.axes)
        with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3)) as wire:
            wire.bind(("plc0", 3))
            wire.setblocking(False)
            assert await answers(wire)
            fault = farm.inject({"kind": "link-down", "on": "axis-01"})
            await asyncio.sleep(0.15)
            assert fault.evidence().confirmed
            assert not carrier(port)
            assert carrier(other)
            assert not await answers(wire)
            farm.injections.clear(fault.id, farm.now())
            farm.poke()
            await asyncio.sleep(0.15)
            assert carrier(port)
            assert await answers(wire)

            fault = farm.inject({"kind": "silence", "on": "axis-01", "for": "400ms"})
            assert not await answers(wire)
            await asyncio.sleep(0.3)
            assert await answers(wire)
            assert fault.state == "ended"
            assert fault.evidence().confirmed


@pytest.mark.asyncio
@pytest.mark.parametrize("link", [MACVLAN, "{kind: veth}", "{kind: tap}"])
async def test_an_interface_of_the_kernel_gets_the_address_and_its_own_one_back(cable, link):
    async with Farm(parse_farm(FILE.replace("LINK", link)), log=EventLog(quiet=True)) as farm:
        station, kind = farm.core.axes[0], farm.link.kind
        own, name = station.port.mac, station.port.name

        async def has(mac: bytes) -> bool:
            """Whether the interface and a frame of the drive have this address, within half a second."""
            for _ in range(50):
                await asyncio.sleep(0.01)
                sent = {frame[6:12] for frame in heard}
                # a TAP's interface is the far end of the drive's cable
                if sent == {mac} and station.port.mac == mac and (kind == "tap" or address_of(name) == mac):
                    return True
            return False

        heard: list[bytes] = []
        farm.core.link.listen(station.port.index, lambda way, frame, now: way == "out" and heard.append(frame))
        fault = farm.inject({"kind": "mac-change", "on": "axis-01", "params": {"mac": OTHER}})
        heard.clear()
        assert await has(parse_mac(OTHER))
        assert fault.evidence().confirmed
        assert farm.core.axes[1].port.mac != parse_mac(OTHER)
        farm.injections.clear(fault.id, farm.now())
        farm.poke()
        heard.clear()
        assert await has(own)
        assert farm.core.injections.drive("axis-01").part(ADAPTER).in_force() == []


@pytest.mark.asyncio
async def test_an_address_that_the_kernel_refuses_ends_the_fault_with_its_reason_and_the_drive_boots_as_it_was(cable):
    async with Farm(parse_farm(FILE.replace("LINK", MACVLAN)), log=EventLog(quiet=True)) as farm:
        station = farm.core.axes[0]
        own = station.port.mac
        occupy(OTHER)
        fault = farm.inject({"kind": "mac-change", "on": "axis-01", "params": {"mac": OTHER}})
        for _ in range(50):
            await asyncio.sleep(0.01)
            if fault.state == "ended" and station.powered:
                break
        assert fault.runs["axis-01"].reason.endswith(f"{OTHER}: another interface of the same parent has it")
        assert (station.port.mac, address_of(station.port.name)) == (own, own)
