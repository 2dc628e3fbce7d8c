"""The endpoint mapper: its octets, and what clients find out with it."""

from __future__ import annotations

from contextlib import suppress
from ipaddress import IPv4Address
from uuid import UUID

import pytest
from hypothesis import given
from hypothesis import strategies as st
from wireshark import tshark

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.rpc.endpoints import Endpoint
from pnfarm.protocols.profinet.rpc.server import Peer, RpcServer, RpcServerConfig
from pnfarm.protocols.profinet.wire.rpc.epm import (
    NIL_HANDLE,
    NOT_REGISTERED,
    EntryHandle,
    EpmOpnum,
    EptEntry,
    HandleFreed,
    Inquiry,
    LookupRequest,
    LookupResponse,
    Tower,
    VersionOption,
    annotation,
    emit_lookup_request,
    emit_lookup_response,
    emit_tower,
    parse_lookup_request,
    parse_lookup_response,
    parse_tower,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    DREP_LITTLE,
    NIL_UUID,
    UUID_EPM,
    UUID_PNIO_CONTROLLER,
    UUID_PNIO_DEVICE,
    NcaStatus,
    PacketType,
    RpcPdu,
    drep,
    emit_rpc,
    object_uuid,
    parse_rpc,
    parse_status,
)

ADDRESS = IPv4Address("10.77.0.11")
PEER = Peer(IPv4Address("10.77.0.1"), 50000)
OBJECT = object_uuid(1, 0x0001, 0x0105)
TEXT = annotation("AKD", "AKD-P00306-NBPN-0000", 1, "V", (1, 20, 3))
ACTIVITY = UUID("3a6f1f00-0000-1010-8000-0a0000000001")


def mapper() -> RpcServer:
    return RpcServer(RpcServerConfig(endpoints=(Endpoint(OBJECT, TEXT),)), ADDRESS)


class Tool:
    """Asks a server as an engineering tool does; its sequence numbers start anywhere."""

    def __init__(self, server, *, little_endian=True, sequence=370):
        self.server = server
        self.little = little_endian
        self.sequence = sequence

    def ask(self, opnum: int, stub: bytes) -> RpcPdu:
        self.sequence += 1
        request = RpcPdu(
            PacketType.REQUEST,
            UUID_EPM,
            ACTIVITY,
            sequence=self.sequence,
            opnum=opnum,
            body=stub,
            flags1=0x20,
            interface_version=3,
            drep=drep(little_endian=self.little),
        )
        self.server.receive(PEER, 34964, emit_rpc(request), now=0)
        [datagram] = self.server.to_send(0)
        assert datagram.peer == PEER
        return parse_rpc(datagram.data)

    def lookup(self, request: LookupRequest) -> LookupResponse:
        answer = self.ask(EpmOpnum.LOOKUP, emit_lookup_request(request, little_endian=self.little))
        assert answer.kind == PacketType.RESPONSE
        return parse_lookup_response(answer.body, little_endian=answer.little_endian)

    def list(self, **inquiry) -> list[EptEntry]:
        entries, handle = [], NIL_HANDLE
        while True:
            answer = self.lookup(LookupRequest(handle=handle, **inquiry))
            if answer.status == NOT_REGISTERED:
                assert answer.handle == NIL_HANDLE
                return entries
            assert answer.status == 0
            entries += answer.entries
            handle = answer.handle


@pytest.mark.parametrize("little", [False, True])
def test_a_tool_lists_the_mapper_and_then_the_device(little):
    first, second = Tool(mapper(), little_endian=little).list()
    assert first.tower == Tower(UUID_EPM, 3, 34964, ADDRESS)
    assert first.object_uuid == NIL_UUID
    assert second == EptEntry(OBJECT, Tower(UUID_PNIO_DEVICE, 1, 34964, ADDRESS), TEXT.rstrip("\0"))


@pytest.mark.parametrize("little", [False, True])
def test_an_answer_holds_as_many_entries_as_were_asked_for(little):
    tool = Tool(mapper(), little_endian=little)
    answer = tool.lookup(LookupRequest(max_entries=100))
    assert [entry.tower.interface for entry in answer.entries] == [UUID_EPM, UUID_PNIO_DEVICE]
    assert (answer.max_entries, answer.status) == (100, 0)
    # the listing goes on where it was, and so ends
    end = tool.lookup(LookupRequest(handle=answer.handle, max_entries=100))
    assert (end.entries, end.handle, end.status) == ((), NIL_HANDLE, NOT_REGISTERED)
    for asked, held in ((1, 1), (2, 2), (0xFFFFFFFF, 2)):
        assert len(tool.lookup(LookupRequest(max_entries=asked)).entries) == held


def test_a_listing_may_change_its_step():
    tool = Tool(mapper())
    first = tool.lookup(LookupRequest(max_entries=1))
    rest = tool.lookup(LookupRequest(handle=first.handle, max_entries=9))
    assert [entry.tower.interface for entry in rest.entries] == [UUID_PNIO_DEVICE]


def test_asking_for_no_entries_finds_none():
    answer = Tool(mapper()).lookup(LookupRequest(max_entries=0))
    assert (answer.entries, answer.status) == ((), NOT_REGISTERED)


def test_an_inquiry_by_interface_finds_that_interface():
    found = Tool(mapper()).list(inquiry=Inquiry.BY_INTERFACE, interface=UUID_PNIO_DEVICE, version_major=1)
    assert [entry.tower.interface for entry in found] == [UUID_PNIO_DEVICE]
    assert Tool(mapper()).list(inquiry=Inquiry.BY_INTERFACE, interface=UUID_PNIO_CONTROLLER) == []


@pytest.mark.parametrize(
    ("option", "version", "found"),
    [
        (VersionOption.ALL, 7, 1),
        (VersionOption.COMPATIBLE, 1, 1),
        (VersionOption.EXACT, 2, 0),
        (VersionOption.MAJOR_ONLY, 1, 1),
        (VersionOption.UP_TO, 2, 1),
        (VersionOption.UP_TO, 0, 0),
    ],
)
def test_an_inquiry_heeds_the_version_option(option, version, found):
    inquiry = {"inquiry": Inquiry.BY_INTERFACE, "interface": UUID_PNIO_DEVICE}
    assert len(Tool(mapper()).list(version_option=option, version_major=version, **inquiry)) == found


def test_an_inquiry_by_object_finds_the_device():
    assert len(Tool(mapper()).list(inquiry=Inquiry.BY_OBJECT, object_uuid=OBJECT)) == 1
    both = {"inquiry": Inquiry.BY_BOTH, "object_uuid": OBJECT}
    assert len(Tool(mapper()).list(interface=UUID_PNIO_DEVICE, **both)) == 1
    assert Tool(mapper()).list(interface=UUID_EPM, **both) == []


def test_an_unknown_kind_of_inquiry_finds_nothing():
    assert Tool(mapper()).list(inquiry=9) == []


def test_the_mapper_gives_a_new_address_at_once():
    server = mapper()
    server.set_address(IPv4Address("192.168.0.9"))
    assert {entry.tower.address for entry in Tool(server).list()} == {IPv4Address("192.168.0.9")}


def test_a_handle_is_freed():
    tool = Tool(mapper())
    handle = tool.lookup(LookupRequest()).handle
    answer = tool.ask(EpmOpnum.LOOKUP_HANDLE_FREE, handle.emit(little_endian=True))
    assert HandleFreed.parse(answer.body, little_endian=True) == HandleFreed(NIL_HANDLE, 0)


@pytest.mark.parametrize("opnum", [EpmOpnum.LOOKUP, EpmOpnum.LOOKUP_HANDLE_FREE])
def test_a_freed_handle_is_a_context_mismatch_and_others_go_on(opnum):
    tool = Tool(mapper())
    handles = [tool.lookup(LookupRequest()).handle for _ in range(2)]
    tool.ask(EpmOpnum.LOOKUP_HANDLE_FREE, handles[0].emit(little_endian=True))
    argument = handles[0].emit(little_endian=True)
    if opnum == EpmOpnum.LOOKUP:
        argument = emit_lookup_request(LookupRequest(handle=handles[0]), little_endian=True)
    answer = tool.ask(opnum, argument)
    assert answer.kind == PacketType.FAULT
    assert parse_status(answer.body, little_endian=True) == NcaStatus.FAULT_CONTEXT_MISMATCH
    [rest] = tool.lookup(LookupRequest(handle=handles[1])).entries
    assert rest.tower.interface == UUID_PNIO_DEVICE
    assert len(tool.list()) == 2


@pytest.mark.parametrize("opnum", [EpmOpnum.LOOKUP, EpmOpnum.LOOKUP_HANDLE_FREE])
def test_a_foreign_handle_is_a_context_mismatch(opnum):
    handle = EntryHandle(0, UUID("11111111-2222-3333-4444-555555555555"))
    emit = EntryHandle.emit if opnum == EpmOpnum.LOOKUP_HANDLE_FREE else emit_lookup_request
    argument = handle if opnum == EpmOpnum.LOOKUP_HANDLE_FREE else LookupRequest(handle=handle)
    answer = Tool(mapper()).ask(opnum, emit(argument, little_endian=True))
    assert answer.kind == PacketType.FAULT
    assert parse_status(answer.body, little_endian=True) == NcaStatus.FAULT_CONTEXT_MISMATCH


def test_operations_that_a_device_need_not_have_are_out_of_range():
    answer = Tool(mapper()).ask(EpmOpnum.MAP, b"")
    assert answer.kind == PacketType.REJECT
    assert parse_status(answer.body, little_endian=True) == NcaStatus.OP_RNG_ERROR


def test_a_server_without_endpoints_has_no_mapper():
    answer = Tool(RpcServer(RpcServerConfig(), ADDRESS)).ask(EpmOpnum.LOOKUP, b"")
    assert parse_status(answer.body, little_endian=True) == NcaStatus.UNK_IF


def test_the_library_profinet_py_gets_an_answer_it_survives(monkeypatch):
    """Its lookup omits the pointers of the NDR and reads answers the same way, so no device can serve it entries."""
    import profinet.rpc

    server = mapper()
    replies = []

    class Socket:
        def __init__(self, *_): ...
        def settimeout(self, _): ...
        def close(self): ...
        def sendto(self, data, _):
            server.receive(PEER, 34964, data, now=0)
            replies.extend(server.to_send(0))

        def recvfrom(self, _):
            return replies[0].data, ("10.77.0.11", 34964)

    monkeypatch.setattr(profinet.rpc, "socket", Socket)
    assert profinet.rpc.epm_lookup("10.77.0.11") == []
    assert parse_rpc(replies[0].data).kind == PacketType.REJECT


def test_the_annotation_has_the_fields_of_the_standard():
    assert len(TEXT) == 63
    assert TEXT[:25].rstrip() == "AKD"
    assert TEXT[26:46].rstrip() == "AKD-P00306-NBPN-0000"
    assert TEXT[47:52] == "    1"
    assert TEXT[53:] == "V  1 20  3"
    assert len(annotation("x" * 99, "y" * 99, 99999, "VV", (1, 2, 3))) == 63


def test_a_tower_has_five_floors_in_75_octets():
    octets = emit_tower(Tower(UUID_PNIO_DEVICE, 1, 34964, ADDRESS))
    assert len(octets) == 75
    assert octets[:2] == b"\x05\x00"
    assert octets[-4:] == ADDRESS.packed
    assert b"\x88\x94" in octets
    from scapy.layers.dcerpc import DceRpc4  # noqa: F401  # registers what the next import needs
    from scapy.layers.msrpce.ept import protocol_tower_t

    floors = protocol_tower_t(octets).floors
    assert [floor.protocol_identifier for floor in floors] == [0x0D, 0x0D, 0x0A, 0x08, 0x09]
    assert floors[0].uuid == UUID_PNIO_DEVICE


u16, u32 = st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)
texts = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=63)
towers = st.builds(Tower, st.uuids(), u16, u16, st.ip_addresses(v=4), u16)
handles = st.builds(EntryHandle, u32, st.uuids())
requests = st.builds(LookupRequest, u32, st.uuids(), st.uuids(), u16, u16, u32, handles, u32)
entries = st.lists(st.builds(EptEntry, st.uuids(), towers, texts), max_size=3).map(tuple)
responses = st.builds(LookupResponse, handles, entries, st.integers(3, 500), u32)


@given(requests, st.booleans())
def test_lookup_requests_are_read_back(request_, little):
    stub = emit_lookup_request(request_, little_endian=little)
    assert len(stub) == 76
    assert parse_lookup_request(stub, little_endian=little) == request_


def test_null_pointers_leave_their_uuids_out():
    request = LookupRequest(object_uuid=None, interface=None)
    stub = emit_lookup_request(request, little_endian=True)
    assert len(stub) == 40
    assert parse_lookup_request(stub, little_endian=True) == request


@given(responses, st.booleans())
def test_lookup_responses_are_read_back(response, little):
    assert parse_lookup_response(emit_lookup_response(response, little_endian=little), little_endian=little) == response


@given(towers)
def test_towers_are_read_back(tower):
    assert parse_tower(emit_tower(tower)) == tower


@given(responses, st.data())
def test_mutated_lookup_responses_give_a_value_or_a_decode_error(response, data):
    octets = bytearray(emit_lookup_response(response, little_endian=True))
    octets[data.draw(st.integers(0, len(octets) - 1))] = data.draw(st.integers(0, 255))
    for end in (len(octets), data.draw(st.integers(0, len(octets)))):
        with suppress(DecodeError):
            parse_lookup_response(bytes(octets[:end]), little_endian=True)


@given(st.binary(max_size=120), st.booleans())
def test_any_octets_are_answered_or_refused(octets, little):
    for parse in (parse_lookup_request, parse_lookup_response, EntryHandle.parse, HandleFreed.parse):
        with suppress(DecodeError):
            parse(octets, little_endian=little)
    with suppress(DecodeError):
        parse_tower(octets)
    answer = Tool(mapper(), little_endian=little).ask(EpmOpnum.LOOKUP, octets)
    assert answer.kind in {PacketType.RESPONSE, PacketType.REJECT, PacketType.FAULT}


def test_the_answer_is_what_a_dissector_reads(tmp_path):
    from scapy.layers.inet import IP, UDP
    from scapy.layers.l2 import Ether
    from scapy.utils import wrpcap

    server = mapper()
    tool = Tool(server)
    packets = []
    handle = NIL_HANDLE
    for _ in range(2):
        stub = emit_lookup_request(LookupRequest(handle=handle), little_endian=True)
        answer = tool.ask(EpmOpnum.LOOKUP, stub)
        handle = parse_lookup_response(answer.body, little_endian=True).handle
        request = RpcPdu(
            PacketType.REQUEST,
            UUID_EPM,
            ACTIVITY,
            sequence=answer.sequence,
            opnum=2,
            body=stub,
            interface_version=3,
            drep=DREP_LITTLE,
        )
        one, two = str(PEER.ip), str(ADDRESS)
        packets.append(Ether() / IP(src=one, dst=two) / UDP(sport=PEER.port, dport=34964) / emit_rpc(request))
        packets.append(Ether() / IP(src=two, dst=one) / UDP(sport=34964, dport=PEER.port) / emit_rpc(answer))
    path = tmp_path / "epm.pcap"
    wrpcap(str(path), packets)
    text = tshark(path, "-V")
    assert "Malformed" not in text
    assert "UDP Port: 34964" in text
    assert f"IP: {ADDRESS}" in text
    assert "AKD-P00306-NBPN-0000" in text
    assert str(UUID_PNIO_DEVICE) in text
