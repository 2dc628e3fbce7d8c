"""A DCP device and what its clients send."""

from ipaddress import IPv4Address, IPv4Interface

from pnfarm.protocols.profinet.dcp.device import DcpDevice
from pnfarm.protocols.profinet.dcp.rules import DcpIdentity, HelloSettings
from pnfarm.protocols.profinet.wire.dcp.blocks import Block
from pnfarm.protocols.profinet.wire.dcp.pdu import (
    IDENTIFY_MULTICAST,
    SERVICE_IDENTIFY,
    SERVICE_SET,
    TYPE_REQUEST,
    TYPE_SUCCESS,
    DcpPdu,
    emit_dcp,
    frame_id_of,
    parse_dcp,
)
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, VlanTag, emit_ethernet, parse_ethernet

MS = 10**6
MAC = bytes.fromhex("020000001234")
PLC = bytes.fromhex("020000000099")
TOOL = bytes.fromhex("020000000098")
ZERO = IPv4Address(0)
ADDRESS = IPv4Address("10.0.0.1")
PLC_NET = IPv4Address("10.0.0.0")
MASK = IPv4Address("255.255.255.0")
GATEWAY = IPv4Address("10.0.0.254")
IDENTITY = DcpIdentity("AKD", 0x0105, 0x0203)
OEM = DcpIdentity("AKD", 0x0105, 0x0203, instance=(2, 3), oem=(0x1111, 0x2222))


def device(identity: DcpIdentity = IDENTITY, *, named: bool = True, hello: HelloSettings | None = None) -> DcpDevice:
    if not named:
        return DcpDevice(MAC, identity)
    machine = DcpDevice(MAC, identity, name="axis-01", address=IPv4Interface("10.0.0.1/24"), gateway=GATEWAY)
    if hello is not None:
        machine.hello_settings = hello
    return machine


def request(service_id: int, *blocks: Block, requested=(), factor: int = 0, xid: int = 77) -> DcpPdu:
    frame_id = frame_id_of(service_id, TYPE_REQUEST)
    return DcpPdu(frame_id, service_id, TYPE_REQUEST, xid, tuple(blocks), tuple(requested), factor)


def frame(pdu: DcpPdu, destination: bytes = MAC, source: bytes = PLC, vlan: VlanTag | None = None) -> EthernetFrame:
    return parse_ethernet(emit_ethernet(EthernetFrame(destination, source, ETHERTYPE_PROFINET, emit_dcp(pdu), vlan)))


def answers(machine: DcpDevice, now: int = 0) -> list[DcpPdu]:
    frames = [parse_ethernet(octets) for octets in machine.to_send(now)]
    assert all(item.source == MAC and item.vlan is None for item in frames)
    return [parse_dcp(item.payload) for item in frames]


def identify(machine: DcpDevice, *filters: Block) -> bool:
    machine.receive(frame(request(SERVICE_IDENTIFY, *filters), IDENTIFY_MULTICAST), 0)
    return bool(answers(machine))


def setting(machine: DcpDevice, *blocks: Block) -> list[int]:
    """Errors of a Set, block by block."""
    machine.receive(frame(request(SERVICE_SET, *blocks)), 0)
    (answer,) = answers(machine)
    assert answer.service_type == TYPE_SUCCESS
    assert [block.subject for block in answer.blocks] == [block.option_id for block in blocks]
    return [block.error for block in answer.blocks]
