"""Frames that real controllers and devices exchanged, put to our two ends."""

from ipaddress import IPv4Address, IPv4Interface
from pathlib import Path

import pytest
from scapy.utils import PcapReader

from pnfarm.protocols.profinet.dcp.client import DcpClient, IdentifyAnswered, station_info
from pnfarm.protocols.profinet.dcp.device import DcpDevice
from pnfarm.protocols.profinet.dcp.rules import DcpIdentity, IpSet
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    DeviceIdBlock,
    DeviceInstanceBlock,
    DeviceOptionsBlock,
    DeviceRoleBlock,
    IpParameterBlock,
    NameBlock,
    StationTypeBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import SERVICE_IDENTIFY, SERVICE_SET, TYPE_REQUEST, DcpPdu, parse_dcp
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, emit_ethernet, parse_ethernet

CAPTURES = Path(__file__).resolve().parents[3].parent / "shared" / "captures"
pytestmark = pytest.mark.skipif(not CAPTURES.is_dir(), reason="the captures of real controllers are not here")


def captured() -> list[tuple[EthernetFrame, DcpPdu]]:
    found = []
    for path in sorted(CAPTURES.glob("*.pcap")):
        with PcapReader(str(path)) as reader:
            for packet in reader:
                frame = parse_ethernet(bytes(packet.original))
                if frame.ethertype == ETHERTYPE_PROFINET and int.from_bytes(frame.payload[:2], "big") >= 0xFEFC:
                    found.append((frame, parse_dcp(frame.payload)))
    return found


def one(service_id: int, *, request: bool, name: str | None = None) -> tuple[EthernetFrame, DcpPdu]:
    return next(
        (frame, pdu)
        for frame, pdu in captured()
        if pdu.service_id == service_id
        and (pdu.service_type == TYPE_REQUEST) == request
        and (name is None or NameBlock(name) in pdu.blocks)
    )


def test_a_real_controllers_search_is_answered_like_the_real_device_did():
    question, asked = next(
        (f, p) for f, p in captured() if p.service_id == SERVICE_IDENTIFY and p.service_type == TYPE_REQUEST
    )
    (wanted,) = asked.blocks
    answer, said = one(SERVICE_IDENTIFY, request=False, name=wanted.name)
    info = station_info(said.blocks)
    identity = DcpIdentity(info.station_type, info.vendor_id, info.device_id, instance=info.instance, role=info.role)
    address = IPv4Interface(f"{info.ip}/{info.mask}") if int(info.ip) else None
    machine = DcpDevice(answer.source, identity, name=wanted.name, address=address, gateway=info.gateway)
    machine.receive(question, 0)
    (octets,) = machine.to_send(machine.next_deadline())
    ours = parse_dcp(parse_ethernet(octets).payload)
    assert (parse_ethernet(octets).destination, ours.xid) == (question.source, asked.xid)
    kinds = (NameBlock, StationTypeBlock, DeviceIdBlock, DeviceRoleBlock, DeviceInstanceBlock, IpParameterBlock)
    for kind in kinds:
        theirs, mine = ([block for block in pdu.blocks if isinstance(block, kind)] for pdu in (said, ours))
        assert mine == theirs, kind
    assert any(isinstance(block, DeviceOptionsBlock) for block in ours.blocks)


def test_a_real_controllers_set_of_an_address_is_answered_octet_for_octet_like_the_real_device_did():
    request, asked = one(SERVICE_SET, request=True)
    answer, _ = one(SERVICE_SET, request=False)
    machine = DcpDevice(request.destination, DcpIdentity("x", 1, 2), name="rt-labs-dev")
    machine.receive(request, 0)
    (octets,) = machine.to_send(0)
    # untagged, and padded to the shortest frame
    theirs = emit_ethernet(EthernetFrame(answer.destination, answer.source, ETHERTYPE_PROFINET, answer.payload))
    assert octets == theirs
    (block,) = asked.blocks
    router = None if block.gateway == block.address or not int(block.gateway) else block.gateway
    interface = IPv4Interface((block.address, int(block.mask).bit_count()))
    assert machine.events() == [IpSet(interface, router, bool(block.info & 1))]


def test_a_real_devices_answer_is_understood():
    for frame, pdu in captured():
        if pdu.service_id != SERVICE_IDENTIFY or pdu.service_type == TYPE_REQUEST:
            continue
        client = DcpClient(frame.destination, first_xid=pdu.xid)
        client.identify(now=0, expected=1)
        client.receive(frame, 0)
        found = client.events()[0]
        assert isinstance(found, IdentifyAnswered)
        assert None not in {found.info.name, found.info.station_type, found.info.vendor_id, found.info.role}
        assert isinstance(found.info.ip, IPv4Address)
        assert not found.info.ip_conflict
