"""``pnfarm record``'s client and a farm in memory: reads with and without an AR, writes, and what can go wrong."""

from __future__ import annotations

import asyncio
from ipaddress import IPv4Address, IPv4Interface
from itertools import count

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller.record_client import RecordClient, RecordTask
from pnfarm.errors import RemoteError
from pnfarm.links.base import PortSpec

TEXT = bytes.fromhex("0021 0038 0100") + b"feed".ljust(32) + b"hall 3".ljust(22)
OWN = IPv4Interface("10.77.1.200/23")
IM0, IM1 = (0, 0, 1, 0xAFF0), (0, 0, 1, 0xAFF1)
#: Each tool is a process of its own: no two share their UUIDs.
SEEDS = count(1)
MAC = bytes.fromhex("0200000000aa")


def run(line: VirtualLine, task: RecordTask, seconds: float = 5.0) -> RecordClient:
    """The client at its end."""
    link = line.world.link()
    (port,) = asyncio.run(link.open([PortSpec("record", MAC)]))
    client = RecordClient(task, MAC, OWN, next(SEEDS).to_bytes(4, "big"))

    def send() -> None:
        for frame in client.to_send(line.world.now):
            link.send(port.index, frame)

    def receive(_: int, frame: bytes, now: int) -> None:
        client.receive(frame, now)
        send()

    link.set_receiver(receive)
    client.start(line.world.now)
    send()
    for _ in range(int(seconds * 1000)):
        if client.done:
            break
        line.run(0.001)
        client.handle_timeout(line.world.now)
        send()
    assert client.done
    asyncio.run(link.close())
    return client


@pytest.mark.parametrize("implicit", [True, False])
@pytest.mark.parametrize("target", ["axis-02", IPv4Address("10.77.0.12")])
def test_a_record_is_read_by_name_or_address_with_or_without_a_connection(
    target: str | IPv4Address, implicit: bool
) -> None:
    line = VirtualLine(drives=3)
    line.connect()
    client = run(line, RecordTask(target, IM0, implicit=implicit))
    client.check()
    assert client.data is not None
    assert client.data[8:28].decode().strip() == line.farm.axes[1].device.description.im0.order_id
    assert client.station is not None
    assert client.station.info.name == "axis-02"
    assert [len(station.device.cm.ars) for station in line.farm.axes] == [1, 1, 1]
    assert line.plc.all_connected


def test_a_record_is_written_beside_the_controllers_connection() -> None:
    line = VirtualLine(controller=False)
    write = run(line, RecordTask("axis-01", IM1, TEXT))
    write.check()
    assert write.data is None
    assert run(line, RecordTask("axis-01", IM1)).data == TEXT
    assert line.farm.axes[0].device.cm.ars == ()


def test_a_submodule_that_a_controller_owns_is_not_written_by_hand() -> None:
    line = VirtualLine()
    line.connect()
    client = run(line, RecordTask("axis-01", IM1, TEXT))
    with pytest.raises(RemoteError, match="access denied"):
        client.check()
    assert len(line.farm.axes[0].device.cm.ars) == 1


@pytest.mark.parametrize("implicit", [True, False])
def test_an_unknown_record_is_refused_with_a_reason(implicit: bool) -> None:
    line = VirtualLine(controller=False)
    client = run(line, RecordTask("axis-01", (0, 0, 1, 0x1234), implicit=implicit))
    assert client.data is None
    with pytest.raises(RemoteError, match="invalid index"):
        client.check()
    assert line.farm.axes[0].device.cm.ars == ()


@pytest.mark.parametrize("target", ["nobody", IPv4Address("10.77.0.99")])
def test_a_device_that_is_not_there_is_reported(target: str | IPv4Address) -> None:
    line = VirtualLine(controller=False)
    with pytest.raises(RemoteError, match=r"no station .* answers"):
        run(line, RecordTask(target, IM0)).check()


def test_a_device_without_an_address_is_reported() -> None:
    line = VirtualLine(controller=False)
    station = line.farm.axes[0]
    station.device.dcp.address = None
    with pytest.raises(RemoteError, match="axis-01 has no IP address"):
        run(line, RecordTask("axis-01", IM0)).check()


def test_a_device_that_falls_silent_is_given_up() -> None:
    line = VirtualLine(controller=False)
    station = line.farm.axes[0]
    original = station.device.rpc.receive
    station.device.rpc.receive = lambda *_args: None
    with pytest.raises(RemoteError, match=r"^connect: no answer$"):
        run(line, RecordTask("axis-01", IM0), 60.0).check()
    station.device.rpc.receive = original


def test_one_read_after_the_other_finds_room_for_its_connection() -> None:
    line = VirtualLine(controller=False)
    assert line.farm.axes[0].device.cm.description.limits.max_device_access_ars == 1
    first = run(line, RecordTask("axis-01", IM0))
    assert first.data
    assert run(line, RecordTask("axis-01", IM0)).data == first.data
