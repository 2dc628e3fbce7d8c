import random
from ipaddress import IPv4Address
from pathlib import Path

import pytest
import scapy.contrib.pnio_dcp as oracle
from hypothesis import given
from hypothesis import strategies as st
from scapy.utils import PcapReader

from pnfarm.errors import DecodeError
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    AliasBlock,
    AllSelectorBlock,
    Block,
    DeviceIdBlock,
    DeviceInitiativeBlock,
    DeviceInstanceBlock,
    DeviceOptionsBlock,
    DeviceRoleBlock,
    DhcpBlock,
    FactoryResetBlock,
    FullIpSuiteBlock,
    IpParameterBlock,
    MacBlock,
    NameBlock,
    OemDeviceIdBlock,
    OptionId,
    ResetMode,
    ResetToFactoryBlock,
    ResponseBlock,
    RsiPropertiesBlock,
    SignalBlock,
    StandardGatewayBlock,
    StartBlock,
    StationTypeBlock,
    StopBlock,
    UnknownBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import (
    SERVICE_GET,
    SERVICE_HELLO,
    SERVICE_IDENTIFY,
    SERVICE_SET,
    TYPE_NOT_SUPPORTED,
    TYPE_REQUEST,
    TYPE_SUCCESS,
    DcpPdu,
    emit_dcp,
    frame_id_of,
    parse_dcp,
)
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, parse_ethernet

CAPTURES = Path(__file__).resolve().parents[3].parent / "shared" / "captures"

octet = st.integers(0, 0xFF)
word = st.integers(0, 0xFFFF)
ip = st.ip_addresses(v=4)
text = st.text(st.characters(min_codepoint=0, max_codepoint=255), max_size=30)
option_ids = st.builds(OptionId, octet, octet)


def blocks_with(info):
    return st.one_of(
        st.builds(MacBlock, st.binary(min_size=6, max_size=6), info),
        st.builds(IpParameterBlock, ip, ip, ip, info),
        st.builds(FullIpSuiteBlock, ip, ip, ip, st.tuples(ip, ip, ip, ip), info),
        st.builds(StationTypeBlock, text, info),
        st.builds(NameBlock, text, info),
        st.builds(DeviceIdBlock, word, word, info),
        st.builds(DeviceRoleBlock, octet, info, octet),
        st.builds(DeviceOptionsBlock, st.lists(option_ids, max_size=5).map(tuple), info),
        st.builds(AliasBlock, text, info),
        st.builds(DeviceInstanceBlock, octet, octet, info),
        st.builds(OemDeviceIdBlock, word, word, info),
        st.builds(DhcpBlock, octet, st.binary(max_size=9), info),
        st.builds(StandardGatewayBlock, word, info),
        st.builds(RsiPropertiesBlock, word, info),
        st.builds(StartBlock, info),
        st.builds(StopBlock, info),
        st.builds(SignalBlock, word, info),
        st.builds(FactoryResetBlock, info),
        st.builds(ResetToFactoryBlock, info),
        st.builds(DeviceInitiativeBlock, word, info),
        st.builds(AllSelectorBlock, st.binary(max_size=3), info),
        st.builds(UnknownBlock, st.integers(0x80, 0xFE), octet, st.binary(max_size=9), info),
    )


def pdu(service_id: int, service_type: int, *blocks: Block, requested=(), xid: int = 7) -> DcpPdu:
    frame_id = frame_id_of(service_id, service_type)
    return DcpPdu(frame_id, service_id, service_type, xid, tuple(blocks), tuple(requested))


# -- round trips --------------------------------------------------------------------------------------------


@given(st.lists(blocks_with(word), max_size=6))
@pytest.mark.parametrize(
    ("service_id", "service_type"),
    [(SERVICE_SET, TYPE_REQUEST), (SERVICE_HELLO, TYPE_REQUEST), (SERVICE_IDENTIFY, 1), (SERVICE_GET, 1)],
)
def test_blocks_with_info_or_qualifier_survive_the_wire(service_id, service_type, blocks):
    sent = pdu(service_id, service_type, *blocks)
    assert parse_dcp(emit_dcp(sent)) == sent


@given(st.lists(blocks_with(st.just(0)).filter(lambda block: not isinstance(block, UnknownBlock)), max_size=6))
def test_filters_survive_the_wire(filters):
    sent = pdu(SERVICE_IDENTIFY, TYPE_REQUEST, *filters)
    assert parse_dcp(emit_dcp(sent)) == sent


@given(st.lists(option_ids, max_size=10))
def test_a_get_request_is_a_row_of_options(requested):
    sent = pdu(SERVICE_GET, TYPE_REQUEST, requested=requested)
    assert parse_dcp(emit_dcp(sent)) == sent


@given(st.lists(st.builds(ResponseBlock, option_ids, octet), max_size=6))
def test_results_survive_the_wire(results):
    sent = pdu(SERVICE_SET, TYPE_SUCCESS, *results)
    assert parse_dcp(emit_dcp(sent)) == sent


@given(octet.filter(lambda value: value not in {3, 4, 5, 6}), octet, st.binary(max_size=20))
def test_an_unknown_service_keeps_its_octets(service_id, service_type, data):
    sent = DcpPdu(0xFEFD, service_id, service_type, 1, undecoded=data)
    assert parse_dcp(emit_dcp(sent)) == sent


def test_the_padding_of_the_frame_is_cut_off():
    octets = emit_dcp(pdu(SERVICE_IDENTIFY, TYPE_REQUEST, AllSelectorBlock()))
    assert parse_dcp(octets + bytes(30)) == parse_dcp(octets)


def test_an_odd_block_is_padded_and_the_padding_counted():
    octets = emit_dcp(pdu(SERVICE_SET, TYPE_SUCCESS, ResponseBlock(OptionId(1, 2), 0)))
    assert octets[8:12] == b"\0\0\0\x08"
    assert octets[12:] == b"\x05\x04\0\x03\x01\x02\0\0"


def test_a_block_without_the_shape_of_its_option_keeps_its_octets():
    wrong = UnknownBlock(1, 2, b"short", info=1)
    sent = pdu(SERVICE_SET, TYPE_REQUEST, wrong, NameBlock("axis", info=1))
    assert parse_dcp(emit_dcp(sent)) == sent


def test_the_mode_of_a_reset_is_beside_bit_0():
    assert ResetToFactoryBlock(0x0004).mode == ResetMode.COMMUNICATION
    assert ResetToFactoryBlock(0x0005).mode == ResetMode.COMMUNICATION
    assert ResetToFactoryBlock().info == 0x0004


# -- refusals -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("octets", "reason"),
    [
        ("", "short"),
        ("8000 0500 00000001 0000 0000", "bad-type"),
        ("fefe 0500 00000001 0001 0001", "short"),  # data length beyond the end
        ("fefe 0500 00000001 0001 0003 ffff00", "short"),  # a block header cut off
        ("fefe 0500 00000001 0001 0004 0202 0008", "short"),  # a block longer than the data
        ("fefd 0300 00000001 0000 0003 010201", "short"),  # half an option
    ],
)
def test_a_broken_frame_is_refused_with_the_reason(octets, reason):
    with pytest.raises(DecodeError) as caught:
        parse_dcp(bytes.fromhex(octets))
    assert caught.value.reason == reason


def test_a_hundred_thousand_broken_frames_do_no_harm():
    source = random.Random(61158)
    valid = [
        emit_dcp(pdu(SERVICE_SET, TYPE_REQUEST, StartBlock(), NameBlock("axis-01", 1), StopBlock())),
        emit_dcp(pdu(SERVICE_IDENTIFY, TYPE_REQUEST, NameBlock("axis-01"), DeviceRoleBlock(1))),
        emit_dcp(pdu(SERVICE_IDENTIFY, TYPE_SUCCESS, DeviceOptionsBlock((OptionId(2, 7),)), DeviceIdBlock(1, 2))),
        emit_dcp(pdu(SERVICE_GET, TYPE_REQUEST, requested=[OptionId(1, 2), OptionId(2, 2)])),
        emit_dcp(pdu(SERVICE_SET, TYPE_SUCCESS, ResponseBlock(OptionId(1, 2), 3))),
    ]
    parsed = 0
    for round_ in range(100_000):
        if round_ % 4 == 0:
            data = bytearray(b"\xfe" + bytes([source.choice(range(0xFC, 0x100)), source.choice((3, 4, 5, 6, 9))]))
            data += source.randbytes(source.randrange(30))
        else:
            data = bytearray(source.choice(valid))
            for _ in range(source.randrange(1, 4)):
                data[source.randrange(len(data))] = source.choice((0, 1, 2, 4, 0xFF, source.randrange(256)))
            if round_ % 4 == 1:
                del data[source.randrange(len(data)) :]
        try:
            value = parse_dcp(data)
        except DecodeError:
            continue
        parsed += 1
        if round_ % 16 == 2:
            assert parse_dcp(emit_dcp(value)) == value
    assert parsed > 10_000


@given(st.binary(max_size=120) | st.binary(max_size=80).map(lambda data: b"\xfe\xfd\x04\0\0\0\0\1\0\0\0\x20" + data))
def test_any_octets_give_a_frame_or_a_decode_error(data):
    try:
        value = parse_dcp(data)
    except DecodeError:
        return
    assert parse_dcp(emit_dcp(value)) == value


@pytest.mark.parametrize(
    "block", [NameBlock("Ω", 1), DeviceIdBlock(0x10000, 0), UnknownBlock(256, 0), SignalBlock(info=-1)]
)
def test_what_does_not_fit_is_our_own_mistake(block):
    with pytest.raises(ValueError):
        emit_dcp(pdu(SERVICE_SET, TYPE_REQUEST, block))


# -- the same octets, seen by others ------------------------------------------------------------------------


def test_scapy_reads_our_identify_response():
    blocks = (
        NameBlock("axis-01"),
        IpParameterBlock(IPv4Address("10.0.0.1"), IPv4Address("255.255.255.0"), IPv4Address("10.0.0.254"), 1),
        StationTypeBlock("AKD"),
        DeviceIdBlock(0x0105, 0x0203),
        DeviceRoleBlock(1),
        DeviceInstanceBlock(0, 1),
        OemDeviceIdBlock(0x1111, 0x2222),
    )
    seen = oracle.ProfinetDCP(emit_dcp(pdu(SERVICE_IDENTIFY, TYPE_SUCCESS, *blocks))[2:])
    assert (seen.service_id, seen.service_type, seen.xid) == (5, 1, 7)
    name, address, station_type, device_id, role, instance, oem = seen.dcp_blocks
    assert name.name_of_station == b"axis-01"
    assert (address.ip, address.netmask, address.gateway, address.block_info) == (
        "10.0.0.1", "255.255.255.0", "10.0.0.254", 1,
    )  # fmt: skip
    assert station_type.device_vendor_value == b"AKD"
    assert (device_id.vendor_id, device_id.device_id) == (0x0105, 0x0203)
    assert role.device_role_details == 1
    assert (instance.device_instance_high, instance.device_instance_low) == (0, 1)
    assert (oem.vendor_id, oem.device_id) == (0x1111, 0x2222)


def test_scapy_reads_our_result_of_a_set():
    octets = emit_dcp(pdu(SERVICE_SET, TYPE_SUCCESS, ResponseBlock(OptionId(2, 2), 6)))
    (block,) = oracle.ProfinetDCP(octets[2:]).dcp_blocks
    assert (block.response, block.response_sub_option, block.block_error) == (2, 2, 6)


def test_we_read_requests_that_scapy_builds():
    name = oracle.ProfinetDCP(
        service_id=4, option=2, sub_option=2, dcp_data_length=14, dcp_block_length=9, block_qualifier=1,
        name_of_station=b"axis-01", xid=9,
    )  # fmt: skip
    value = parse_dcp(b"\xfe\xfd" + bytes(name))
    assert (value.service_id, value.xid, value.blocks) == (4, 9, (NameBlock("axis-01", 1),))
    everybody = oracle.ProfinetDCP(service_id=5, option=255, sub_option=255, dcp_data_length=4, reserved=1)
    value = parse_dcp(b"\xfe\xfe" + bytes(everybody))
    assert (value.response_delay_factor, value.blocks) == (1, (AllSelectorBlock(),))


@pytest.mark.skipif(not CAPTURES.is_dir(), reason="the captures of real controllers are not here")
def test_captured_frames_are_parsed_into_known_blocks_and_emitted_identically():
    seen = 0
    for path in sorted(CAPTURES.glob("*.pcap")):
        with PcapReader(str(path)) as reader:
            for packet in reader:
                frame = parse_ethernet(bytes(packet.original))
                if frame.ethertype != ETHERTYPE_PROFINET or frame.payload[1] < 0xFC or frame.payload[0] != 0xFE:
                    continue
                value = parse_dcp(frame.payload)
                assert not any(isinstance(block, UnknownBlock) for block in value.blocks)
                octets = emit_dcp(value)
                assert octets.ljust(len(frame.payload), b"\0") == frame.payload
                seen += 1
    assert seen == 12


def test_frame_ids_follow_the_service():
    assert frame_id_of(SERVICE_HELLO, TYPE_REQUEST) == 0xFEFC
    assert frame_id_of(SERVICE_GET, TYPE_REQUEST) == 0xFEFD
    assert frame_id_of(SERVICE_SET, TYPE_NOT_SUPPORTED) == 0xFEFD
    assert frame_id_of(SERVICE_IDENTIFY, TYPE_REQUEST) == 0xFEFE
    assert frame_id_of(SERVICE_IDENTIFY, TYPE_SUCCESS) == 0xFEFF
