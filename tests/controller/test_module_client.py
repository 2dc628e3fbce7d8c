"""``pnfarm module list`` on the wire: what a device says of its slots, read without a connection."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv4Interface
from itertools import count

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller.module_client import DeviceModule, DeviceSubmodule, read_modules
from pnfarm.buses.profinet.controller.record_client import RecordClient, RecordTask
from pnfarm.errors import RemoteError
from pnfarm.links.base import PortSpec
from pnfarm.protocols.profinet.wire.records.identification import (
    ApiData,
    IdentificationApi,
    IdentificationData,
    IdentificationSlot,
)

SEEDS = count(1)
MAC = bytes.fromhex("0200000000aa")


def listed(line, target):
    """What the device tells, and the client that asked."""
    asking = read_modules()
    task = RecordTask(target, next(asking), length=32_768, implicit=True)
    link = line.world.link()
    (port,) = asyncio.run(link.open([PortSpec("tool", MAC)]))
    client = RecordClient(task, MAC, IPv4Interface("10.77.1.200/23"), next(SEEDS).to_bytes(4, "big"))

    def send():
        for frame in client.to_send(line.world.now):
            link.send(port.index, frame)

    def receive(_index, frame, now):
        client.receive(frame, now)
        send()

    link.set_receiver(receive)
    client.start(line.world.now)
    send()
    try:
        for _ in range(20_000):
            if client.done:
                client.read_next(asking.send(client), line.world.now)
            line.run(0.001)
            client.handle_timeout(line.world.now)
            send()
        raise AssertionError("the client does not come to an end")
    except StopIteration as end:
        return end.value, client
    finally:
        asyncio.run(link.close())


def real(station):
    """The modules in a station's slots, as it reports them."""
    return tuple(
        DeviceModule(
            module.slot,
            module.module_ident,
            sorted(
                (DeviceSubmodule(s.subslot, s.submodule_ident, s.api) for s in module.submodules),
                key=lambda s: (s.subslot, s.api),
            ),
        )
        for module in station.device.cm.plugged.modules()
    )


@pytest.mark.parametrize("target", ["axis-02", IPv4Address("10.77.0.12")])
def test_the_modules_of_a_device_are_read_by_its_name_or_address(target):
    line = VirtualLine(drives=3, controller=False)
    modules, client = listed(line, target)
    assert modules == real(line.farm.axes[1])
    assert {s.api for m in modules for s in m.submodules} == {0, 0x3A00}
    assert client.station.info.name == "axis-02"


def test_a_connected_device_is_asked_beside_its_controller():
    line = VirtualLine()
    line.connect()
    modules, _ = listed(line, "axis-01")
    assert modules == real(line.farm.axes[0])
    line.run(1.0)
    assert line.plc.all_connected
    assert line.plc.sessions[0].measures.losses == 0


def test_a_device_without_an_address_is_reported():
    line = VirtualLine(controller=False)
    line.farm.axes[0].device.dcp.address = None
    with pytest.raises(RemoteError, match="axis-01 has no IP address: give it one first"):
        listed(line, "axis-01")


def test_a_pulled_module_is_not_there_any_more():
    line = VirtualLine(controller=False)
    station = line.farm.axes[0]
    station.device.cm.pull(1, None, line.world.now)
    modules, _ = listed(line, "axis-01")
    assert [module.slot for module in modules] == [0]


@dataclass
class Answer:
    """A client that has read one record, or was refused."""

    data: bytes | None = None
    reason: str = ""

    def check(self):
        if self.reason:
            raise RemoteError(self.reason)


def asked(answers):
    """Drive the reader with what a device answers to (API, index); what it finds, and what it asked for."""
    asking, places = read_modules(), []
    place = next(asking)
    try:
        while True:
            places.append((place[0], place[3]))
            place = asking.send(answers.get(places[-1], Answer(reason="invalid index")))
    except StopIteration as end:
        return end.value, places


def identification(api, *slots, version=0x0101):
    return Answer(IdentificationData(0x0013, (IdentificationApi(api, slots),), version).emit())


DAP = IdentificationSlot(0, 0x10, ((1, 0x11), (0x8000, 0x12)))
AXIS = IdentificationSlot(1, 0x20, ((1, 0xFFFF), (2, 0x68)))
APIS = (0, 0xF821)


def test_a_device_that_lists_no_apis_is_asked_for_the_usual_ones():
    modules, places = asked({(0, 0xF000): identification(0, DAP), (0x3A00, 0xF000): identification(0x3A00, AXIS)})
    assert places == [APIS, (0, 0xF000), (0x3A00, 0xF000)]
    assert [(m.slot, m.ident, [s.api for s in m.submodules]) for m in modules] == [
        (0, 0x10, [0, 0]),
        (1, 0x20, [0x3A00, 0x3A00]),
    ]


def test_a_device_without_the_drives_api_has_its_other_modules():
    modules, _ = asked({(0, 0xF000): identification(0, DAP, AXIS)})
    assert [m.slot for m in modules] == [0, 1]


def test_a_module_in_two_apis_is_listed_once():
    own = IdentificationSlot(1, 0x20, ((9, 0x99),))
    modules, places = asked({
        APIS: Answer(ApiData((0, 0x3A00, 0)).emit()),
        (0, 0xF000): identification(0, DAP, own),
        (0x3A00, 0xF000): identification(0x3A00, AXIS),
    })  # fmt: skip
    assert places == [APIS, (0, 0xF000), (0x3A00, 0xF000)]
    assert [(s.subslot, s.api) for s in modules[1].submodules] == [(1, 0x3A00), (2, 0x3A00), (9, 0)]


def test_an_answer_in_the_older_form_is_of_the_api_that_was_asked_for():
    old = identification(0, AXIS, version=0x0100)
    modules, _ = asked({APIS: Answer(ApiData((0x3A00,)).emit()), (0x3A00, 0xF000): old})
    assert {s.api for s in modules[0].submodules} == {0x3A00}


def test_a_device_that_answers_nothing_ends_with_its_own_reason():
    with pytest.raises(RemoteError, match="no such index there"):
        asked({(0, 0xF000): Answer(reason="no such index there")})


def test_a_malformed_answer_is_reported():
    with pytest.raises(RemoteError, match="RealIdentificationData is malformed"):
        asked({(0, 0xF000): Answer(b"\x00\x13\x00\x40\x01\x01")})
    with pytest.raises(RemoteError, match="APIData is malformed"):
        asked({APIS: Answer(b"\x00")})
