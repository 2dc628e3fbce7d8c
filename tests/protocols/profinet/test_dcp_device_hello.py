"""A DCP device that announces itself."""

import pytest
from dcp_bench import ADDRESS, GATEWAY, MASK, MS, OEM, answers, device, frame, request

from pnfarm.protocols.profinet.dcp.device import DcpDevice
from pnfarm.protocols.profinet.dcp.rules import HelloMode, HelloSettings
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    DeviceIdBlock,
    DeviceInitiativeBlock,
    DeviceOptionsBlock,
    DeviceRoleBlock,
    IpParameterBlock,
    NameBlock,
    OemDeviceIdBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import HELLO_MULTICAST, SERVICE_HELLO, SERVICE_SET, TYPE_REQUEST, parse_dcp
from pnfarm.wire.ethernet import parse_ethernet


def hellos(machine: DcpDevice, until: int, step: int = 10 * MS) -> list[int]:
    """When Hello was sent."""
    return [now for now in range(0, until, step) for _ in machine.to_send(now)]


def test_hello_announces_name_and_address_to_all():
    machine = device(OEM, hello=HelloSettings())
    machine.link_up(0)
    (octets,) = machine.to_send(0)
    sent = parse_ethernet(octets)
    assert sent.destination == HELLO_MULTICAST
    pdu = parse_dcp(sent.payload)
    assert (pdu.frame_id, pdu.service_id, pdu.service_type) == (0xFEFC, SERVICE_HELLO, TYPE_REQUEST)
    assert [block.option_id for block in pdu.blocks] == [
        NameBlock.ID, IpParameterBlock.ID, DeviceIdBlock.ID, OemDeviceIdBlock.ID, DeviceOptionsBlock.ID,
        DeviceRoleBlock.ID, DeviceInitiativeBlock.ID,
    ]  # fmt: skip
    assert pdu.blocks[0] == NameBlock("axis-01")
    assert pdu.blocks[1] == IpParameterBlock(ADDRESS, MASK, GATEWAY, info=1)
    assert pdu.blocks[-1] == DeviceInitiativeBlock(1)


@pytest.mark.parametrize(
    ("settings", "times"),
    [
        (HelloSettings(), [0, 30, 60]),
        (HelloSettings(HelloMode.ON_LINK_UP, 100 * MS, 2), [0, 100]),
        (HelloSettings(HelloMode.ON_LINK_UP, delay_ns=500 * MS), [0, 30, 60]),
        (HelloSettings(HelloMode.ON_LINK_UP_DELAYED, 50 * MS, 3, 500 * MS), [500, 550, 600]),
        (HelloSettings(HelloMode.ON_LINK_UP, count=0), []),
        (HelloSettings(HelloMode.OFF), []),
    ],
    ids=repr,
)
def test_hello_is_repeated_as_it_is_set(settings, times):
    machine = device(hello=settings)
    machine.link_up(0)
    assert hellos(machine, 1000 * MS) == [time * MS for time in times]
    assert machine.next_deadline() is None


@pytest.mark.parametrize("missing", ["name", "address"])
def test_a_device_without_name_or_address_sends_no_hello(missing):
    machine = device(hello=HelloSettings())
    setattr(machine, missing, "" if missing == "name" else None)
    machine.link_up(0)
    assert hellos(machine, 1000 * MS) == []


def test_hello_ends_with_the_first_set():
    machine = device(hello=HelloSettings())
    machine.link_up(0)
    assert len(answers(machine, 0)) == 1
    machine.receive(frame(request(SERVICE_SET, NameBlock("axis-01", 1))), 10 * MS)
    assert [answer.service_id for answer in answers(machine, 1000 * MS)] == [SERVICE_SET]


def test_hellos_are_counted_by_their_xid():
    machine = device(hello=HelloSettings())
    machine.link_up(0)
    assert [answer.xid for now in range(0, 90, 30) for answer in answers(machine, now * MS)] == [1, 2, 3]
