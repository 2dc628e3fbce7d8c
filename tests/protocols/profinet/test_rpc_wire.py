"""The codec of connectionless RPC against captures, an independent implementation and arbitrary octets."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from uuid import UUID

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.rpc.bodies import FackBody, parse_fack
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    DREP_BIG,
    DREP_LITTLE,
    FRAGMENT_NONE,
    NIL_UUID,
    OK,
    UUID_PNIO_CONTROLLER,
    UUID_PNIO_DEVICE,
    Flags1,
    PacketType,
    PnioStatus,
    RequestArgs,
    ResponseArgs,
    RpcPdu,
    args_length_invalid,
    emit_request_args,
    emit_response_args,
    emit_rpc,
    emit_status,
    object_uuid,
    parse_request_args,
    parse_response_args,
    parse_rpc,
    parse_status,
    status_name,
)
from tests.support.ndr_counts import counted

CAPTURES = Path(__file__).resolve().parents[3].parent / "shared" / "captures"
ACTIVITY = UUID("00000008-0000-1010-808e-000e8cb06c7e")


def captured(name: str) -> list[bytes]:
    """UDP payloads of context management in a capture, in order."""
    path = CAPTURES / name
    if not path.exists():
        pytest.skip(f"{name} is not here")
    from scapy.layers.inet import UDP
    from scapy.utils import rdpcap

    ports = {34964}
    payloads = []
    for packet in rdpcap(str(path)):
        if UDP in packet and (packet[UDP].sport in ports or packet[UDP].dport in ports):
            # a peer may go on from another port than it was called at
            ports |= {packet[UDP].sport, packet[UDP].dport}
            payloads.append(bytes(packet[UDP].payload))
    return payloads


@pytest.mark.parametrize(
    ("name", "count"),
    [("drive_connect_api3a00.pcap", 8), ("dacookie_connectrequest.pcap", 8), ("pnio-rs_s7-1515_golden.pcap", 10)],
)
def test_every_captured_pdu_is_emitted_as_it_was_read(name, count):
    payloads = captured(name)
    assert len(payloads) == count
    for payload in payloads:
        pdu = parse_rpc(payload)
        assert emit_rpc(pdu) == payload
        little = pdu.little_endian
        if pdu.kind == PacketType.REQUEST:
            request = parse_request_args(pdu.body, little_endian=little)
            assert request.payload
            assert emit_request_args(request, little_endian=little) == pdu.body
        elif pdu.kind == PacketType.RESPONSE:
            response = parse_response_args(pdu.body, little_endian=little)
            assert response.status.ok
            assert emit_response_args(response, little_endian=little) == pdu.body


def test_captured_ping_and_nocall_say_what_the_drive_said():
    ping, nocall = (parse_rpc(data) for data in captured("drive_connect_api3a00.pcap")[:2])
    assert (ping.kind, ping.serial, ping.fragment_number) == (PacketType.PING, 1, 0)
    assert (nocall.kind, nocall.fragment_number, nocall.body) == (PacketType.NOCALL, FRAGMENT_NONE, b"")
    assert ping.activity == nocall.activity == ACTIVITY
    assert ping.object_uuid == object_uuid(1, 1, 0x80)
    assert ping.interface == UUID_PNIO_DEVICE


def test_captured_application_ready_comes_big_endian_from_one_device():
    pdus = [parse_rpc(data) for data in captured("pnio-rs_s7-1515_golden.pcap")]
    ready = [pdu for pdu in pdus if pdu.interface == UUID_PNIO_CONTROLLER]
    assert [(pdu.kind, pdu.little_endian) for pdu in ready] == [
        (PacketType.REQUEST, False),
        (PacketType.RESPONSE, True),
    ]


@pytest.mark.parametrize("little", [False, True])
def test_another_implementation_reads_the_same_header(little):
    from scapy.layers.dcerpc import DceRpc4

    pdu = RpcPdu(
        PacketType.RESPONSE,
        UUID_PNIO_DEVICE,
        ACTIVITY,
        object_uuid(1, 0x0293, 0x002A),
        sequence=0x01020304,
        opnum=3,
        body=b"\x01\x02\x03",
        flags1=int(Flags1.NO_FACK | Flags1.LAST_FRAGMENT),
        drep=DREP_LITTLE if little else DREP_BIG,
        server_boot_time=95,
        fragment_number=7,
        serial=0x1234,
    )
    other = DceRpc4(emit_rpc(pdu))
    assert (other.object, other.if_id, other.act_id) == (pdu.object_uuid, pdu.interface, pdu.activity)
    assert (other.ptype, other.seqnum, other.opnum, other.len, other.fragnum) == (2, 0x01020304, 3, 3, 7)
    assert (other.server_boot, other.if_vers, other.ihint, other.ahint) == (95, 1, 0xFFFF, 0xFFFF)
    assert (other.serial_hi, other.serial_lo) == (0x12, 0x34)
    assert bytes(other) == emit_rpc(pdu)


u8, u16, u32 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32))
uuids = st.uuids()
pdus = st.builds(
    RpcPdu,
    packet_type=u8,
    interface=uuids,
    activity=uuids,
    object_uuid=uuids,
    sequence=u32,
    opnum=u16,
    body=st.binary(max_size=40),
    flags1=u8,
    flags2=u8,
    drep=st.tuples(st.integers(0, 0x1F), u8, u8).map(bytes),
    server_boot_time=u32,
    interface_version=u32,
    interface_hint=u16,
    activity_hint=u16,
    fragment_number=u16,
    serial=u16,
    auth_protocol=u8,
    trailer=st.binary(max_size=8),
)
facks = st.builds(
    FackBody,
    window_size=u16,
    max_tsdu=u32,
    max_fragment_size=u32,
    serial=u16,
    selective=st.lists(u32, max_size=4).map(tuple),
    version=st.integers(0, 1),
)
stati = st.builds(PnioStatus, u8, u8, u8, u8)


@given(pdus)
def test_what_is_emitted_is_read_back(pdu):
    assert parse_rpc(emit_rpc(pdu)) == pdu


@given(pdus, st.data())
def test_a_mutated_pdu_gives_a_value_or_a_decode_error(pdu, data):
    octets = bytearray(emit_rpc(pdu))
    octets[data.draw(st.integers(0, len(octets) - 1))] = data.draw(u8)
    cut = bytes(octets[: data.draw(st.integers(0, len(octets)))])
    with suppress(DecodeError):
        assert emit_rpc(parse_rpc(cut)) == cut


@given(st.binary(max_size=200), st.booleans())
def test_any_octets_give_a_value_or_a_decode_error(octets, little):
    for parse in (parse_request_args, parse_response_args, parse_fack, parse_status):
        with suppress(DecodeError):
            parse(octets, little_endian=little)


@given(facks, st.booleans())
def test_fack_bodies_are_read_back(fack, little):
    assert parse_fack(fack.emit(little_endian=little), little_endian=little) == fack


def test_an_empty_fack_body_is_allowed():
    assert parse_fack(b"", little_endian=True) is None


def test_a_fack_body_may_carry_one_word_that_it_does_not_count():
    fack = FackBody(8, 4096, 1464, 3)
    assert parse_fack(fack.emit(little_endian=True) + bytes(4), little_endian=True) == fack


@given(u32, st.binary(max_size=64), st.booleans())
def test_request_arguments_are_read_back(maximum, payload, little):
    args = RequestArgs(max(maximum, len(payload)), payload)
    assert parse_request_args(emit_request_args(args, little_endian=little), little_endian=little) == args


@given(stati, st.binary(max_size=64), st.booleans())
def test_response_arguments_are_read_back(status, payload, little):
    args = ResponseArgs(status, payload, 4096)
    assert parse_response_args(emit_response_args(args, little_endian=little), little_endian=little) == args


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"offset": 1}, "bad-offset"),
        ({"actual_count": 5}, "bad-length"),
        ({"actual_count": 0xFFFFFFFF}, "bad-length"),
        ({"args_length": 3}, "bad-length"),
        ({"maximum_count": 3}, "bad-length"),
    ],
)
def test_contradicting_lengths_are_refused(wrong, reason):
    stub = counted(100, b"abcd", **wrong)
    with pytest.raises(DecodeError) as caught:
        parse_request_args(stub, little_endian=True)
    assert caught.value.reason == reason


def test_the_status_is_the_most_significant_octet_first():
    status = PnioStatus(0xDB, 0x81, 0x40, 0x04)
    assert int(status) == 0xDB814004
    assert PnioStatus.from_int(0xDB814004) == status
    assert not status.ok
    assert OK.ok
    stub = emit_response_args(ResponseArgs(status, b"", 0), little_endian=True)
    assert stub[:4] == bytes.fromhex("044081db")


def test_bad_lengths_are_named_after_the_operation():
    assert args_length_invalid(2) == PnioStatus(0xDE, 0x81, 0x40, 0)
    assert args_length_invalid(99) == PnioStatus(0xDB, 0x81, 0x40, 0)


def test_a_reject_is_named_as_the_standard_names_it():
    assert parse_status(emit_status(0x1C010003, little_endian=False), little_endian=False) == 0x1C010003
    assert status_name(0x1C010003) == "nca_unk_if"
    assert status_name(0x1C0100FF) == "0x1c0100ff"


def test_other_rpc_versions_are_refused():
    octets = bytearray(emit_rpc(RpcPdu(PacketType.PING, UUID_PNIO_DEVICE, NIL_UUID)))
    octets[0] = 5
    with pytest.raises(DecodeError, match="bad-version"):
        parse_rpc(bytes(octets))


def test_the_object_uuid_names_instance_device_and_vendor():
    assert object_uuid(1, 0x0293, 0x002A) == UUID("dea00000-6c97-11d1-8271-00010293002a")
