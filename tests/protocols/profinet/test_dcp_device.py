from ipaddress import IPv4Address, IPv4Interface

import pytest
import scapy.contrib.pnio_dcp as oracle
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.profinet.dcp_device import (
    CLIENT_HOLD_NS,
    MAXIMUM_RESULTS,
    PENDING_LIMIT,
    SIGNAL_NS,
    DcpDevice,
    identify_matches,
)
from pnfarm.protocols.profinet.dcp_rules import (
    NO_DNS,
    RESET_CLEARS,
    AbortRequired,
    DcpIdentity,
    FactoryReset,
    HelloMode,
    HelloSettings,
    IpSet,
    NameSet,
    SignalBegan,
    SignalEnded,
    Stored,
    check_ip_suite,
    response_delay_ns,
)
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.protocols.profinet.wire.dcp import (
    HELLO_MULTICAST,
    IDENTIFY_MULTICAST,
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
from pnfarm.protocols.profinet.wire.dcp_blocks import (
    PERMANENT,
    AliasBlock,
    AllSelectorBlock,
    Block,
    BlockError,
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


# -- Identify -----------------------------------------------------------------------------------------------


def test_everybody_is_asked_and_the_device_tells_all_about_itself():
    machine = device(OEM, hello=HelloSettings())
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock()), IDENTIFY_MULTICAST), 0)
    (octets,) = machine.to_send(0)
    assert parse_ethernet(octets).destination == PLC
    answer = parse_dcp(parse_ethernet(octets).payload)
    assert (answer.frame_id, answer.service_type, answer.xid) == (0xFEFF, TYPE_SUCCESS, 77)
    blocks = {block.option_id: block for block in answer.blocks}
    assert blocks[NameBlock.ID] == NameBlock("axis-01")
    assert blocks[IpParameterBlock.ID] == IpParameterBlock(ADDRESS, MASK, GATEWAY, info=1)
    assert blocks[StationTypeBlock.ID] == StationTypeBlock("AKD")
    assert blocks[DeviceIdBlock.ID] == DeviceIdBlock(0x0105, 0x0203)
    assert blocks[DeviceRoleBlock.ID] == DeviceRoleBlock(1)
    assert blocks[DeviceInstanceBlock.ID] == DeviceInstanceBlock(2, 3)
    assert blocks[OemDeviceIdBlock.ID] == OemDeviceIdBlock(0x1111, 0x2222)
    assert blocks[DeviceInitiativeBlock.ID] == DeviceInitiativeBlock(1)
    assert {NameBlock.ID, IpParameterBlock.ID, SignalBlock.ID, ResetToFactoryBlock.ID} <= set(
        blocks[DeviceOptionsBlock.ID].options
    )


def test_a_new_device_has_an_empty_name_and_no_address():
    machine = device(named=False)
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock()), IDENTIFY_MULTICAST), 0)
    (answer,) = answers(machine)
    assert NameBlock("") in answer.blocks
    assert IpParameterBlock(ZERO, ZERO, ZERO, info=0) in answer.blocks


@pytest.mark.parametrize(
    ("named", "conflict", "in_use", "info"),
    [
        (False, False, True, 0x00),
        (True, False, True, 0x01),
        (True, True, True, 0x81),
        (True, True, False, 0x80),
    ],
)
def test_block_info_tells_whether_the_address_is_in_use_and_disputed(named, conflict, in_use, info):
    machine = device(named=named)
    machine.ip_conflict, machine.ip_in_use = conflict, in_use
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock()), IDENTIFY_MULTICAST), 0)
    machine.receive(frame(request(SERVICE_GET, requested=[IpParameterBlock.ID, FullIpSuiteBlock.ID])), 0)
    got, identified = answers(machine)
    told = [b for b in (*identified.blocks, *got.blocks) if isinstance(b, (IpParameterBlock, FullIpSuiteBlock))]
    assert [block.info for block in told] == [info] * 3
    # the address that it shall have is told either way
    assert {block.address for block in told} == {ADDRESS if named else ZERO}


def test_scapy_reads_every_block_of_an_answer():
    machine = device(OEM, hello=HelloSettings())
    machine.ip_conflict = True
    machine.aliases = frozenset({"port-001.plc"})
    machine.receive(frame(request(SERVICE_IDENTIFY, AliasBlock("port-001.plc")), IDENTIFY_MULTICAST), 0)
    (octets,) = machine.to_send(0)
    seen = oracle.ProfinetDCP(parse_ethernet(octets).payload[2:])
    assert (seen.service_id, seen.service_type, seen.xid) == (5, 1, 77)
    kinds = [type(block).__name__ for block in seen.dcp_blocks]
    assert kinds == [
        "DCPNameOfStationBlock", "DCPIPBlock", "DCPManufacturerSpecificBlock", "DCPDeviceIDBlock",
        "DCPDeviceRoleBlock", "DCPDeviceOptionsBlock", "DCPDeviceInstanceBlock", "DCPOEMIDBlock",
        "DCPDeviceInitiativeBlock", "DCPAliasNameBlock",
    ]  # fmt: skip
    assert seen.dcp_blocks[1].block_info == 0x81
    assert seen.dcp_blocks[-1].alias_name == b"port-001.plc"
    pairs = {(option.option, option.sub_option) for option in seen.dcp_blocks[5].device_options}
    assert {(1, 1), (1, 2), (1, 3), (2, 2), (2, 6), (2, 8), (5, 3), (5, 5), (5, 6), (6, 1), (255, 255)} <= pairs


MATCHING = [
    NameBlock("axis-01"),
    AliasBlock("port-001.neighbour"),
    DeviceIdBlock(0x0105, 0x0203),
    DeviceRoleBlock(1),
    DeviceInstanceBlock(2, 3),
    IpParameterBlock(ADDRESS, MASK, GATEWAY),
    MacBlock(MAC),
    FullIpSuiteBlock(ADDRESS, MASK, GATEWAY, (ZERO,) * 4),
    StandardGatewayBlock(0),
    StationTypeBlock("AKD"),
    OemDeviceIdBlock(0x1111, 0x2222),
    DeviceOptionsBlock((OptionId(2, 2), OptionId(1, 2))),
    AllSelectorBlock(b"\0\0"),
]
OTHER = [
    NameBlock("axis-02"),
    NameBlock("axis-0"),
    NameBlock("axis-011"),
    NameBlock(""),
    AliasBlock("port-002.neighbour"),
    DeviceIdBlock(0x0105, 0x0204),
    DeviceRoleBlock(2),
    DeviceInstanceBlock(2, 4),
    IpParameterBlock(ADDRESS, MASK, ZERO),
    MacBlock(PLC),
    StationTypeBlock("akd"),
    OemDeviceIdBlock(0x1111, 0x2223),
    DeviceOptionsBlock((OptionId(2, 2), OptionId(3, 61))),
    DhcpBlock(61, b"x"),
    RsiPropertiesBlock(0),
    StandardGatewayBlock(1),
    DeviceInitiativeBlock(1),
    SignalBlock(),
    UnknownBlock(0x80, 1),
    UnknownBlock(0xFE, 1, b"maker"),
    UnknownBlock(2, 99),
    UnknownBlock(1, 2, b"odd"),
]


def named_device() -> DcpDevice:
    machine = device(OEM)
    machine.aliases = frozenset({"port-001.neighbour"})
    return machine


@pytest.mark.parametrize("block", MATCHING, ids=repr)
def test_a_filter_that_fits_is_answered(block):
    assert identify(named_device(), block)


@pytest.mark.parametrize("block", OTHER, ids=repr)
def test_a_filter_that_does_not_fit_is_not_answered(block):
    machine = named_device()
    assert not identify(machine, block)
    assert machine.dropped == {"filter": 1}


def test_all_filters_must_fit():
    assert identify(named_device(), *MATCHING)
    for wrong in OTHER:
        assert not identify(named_device(), *MATCHING[:3], wrong, *MATCHING[3:])


def test_a_request_without_any_filter_fits_nobody():
    assert not identify(named_device())
    assert not identify_matches(request(SERVICE_IDENTIFY), named_device())


def test_an_alias_is_unknown_until_lldp_learns_it_and_then_comes_back_in_the_answer():
    machine = device()
    assert not identify(machine, AliasBlock("port-001.neighbour"))
    machine.aliases = frozenset({"port-001.neighbour"})
    machine.receive(frame(request(SERVICE_IDENTIFY, *[AliasBlock("port-001.neighbour")] * 50), IDENTIFY_MULTICAST), 0)
    (answer,) = answers(machine)
    assert answer.blocks.count(AliasBlock("port-001.neighbour")) == 1


def test_identify_by_unicast_is_answered_and_for_another_station_not():
    machine = device()
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock())), 0)
    assert len(answers(machine)) == 1
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock()), PLC), 0)
    assert answers(machine) == []


@pytest.mark.parametrize(
    ("factor", "steps"), [(0, 0), (1, 0), (2, 0), (10, 0), (100, 60), (255, 0x1234 % 255), (6400, 0x1234), (6401, 0)]
)
def test_the_answer_waits_its_turn(factor, steps):
    assert response_delay_ns(MAC, factor) == steps * 10 * MS
    machine = device()
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock(), factor=factor), IDENTIFY_MULTICAST), 5)
    due = 5 + steps * 10 * MS
    assert machine.next_deadline() == due
    if steps:
        assert answers(machine, due - 1) == []
    machine.handle_timeout(due)
    assert machine.next_deadline() is None
    (answer,) = answers(machine, due)
    assert answer.response_delay_factor == 0


def test_several_answers_wait_in_order_and_their_number_is_bounded():
    machine = device()
    slow = request(SERVICE_IDENTIFY, AllSelectorBlock(), factor=6400, xid=1)
    machine.receive(frame(slow, IDENTIFY_MULTICAST), 0)
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock(), xid=2), IDENTIFY_MULTICAST), 0)
    assert [answer.xid for answer in answers(machine, 0)] == [2]
    for _ in range(PENDING_LIMIT + 5):
        machine.receive(frame(slow, IDENTIFY_MULTICAST), 0)
    assert machine.dropped == {"queue-full": 6}
    assert len(answers(machine, 10**12)) == PENDING_LIMIT


def test_one_parsed_request_serves_a_whole_farm():
    pdu = request(SERVICE_IDENTIFY, NameBlock("axis-07"))
    farm = [DcpDevice(bytes([2, 0, 0, 0, 0, n]), IDENTITY, name=f"axis-{n:02}") for n in range(20)]
    assert [machine.name for machine in farm if identify_matches(pdu, machine)] == ["axis-07"]
    for machine in farm:
        machine.receive_pdu(PLC, IDENTIFY_MULTICAST, pdu, 0)
    assert [machine.name for machine in farm if machine.to_send(0)] == ["axis-07"]


# -- Get ----------------------------------------------------------------------------------------------------


def test_get_reads_what_the_device_has_and_says_what_it_has_not():
    machine = device()
    asked = [
        *(MacBlock.ID, NameBlock.ID, IpParameterBlock.ID, FullIpSuiteBlock.ID, DeviceInitiativeBlock.ID),
        StandardGatewayBlock.ID,
    ]
    missing = [
        *(OemDeviceIdBlock.ID, AliasBlock.ID, RsiPropertiesBlock.ID, OptionId(2, 99), OptionId(255, 255)),
        *(OptionId(5, suboption) for suboption in range(7)),
        *(OptionId(3, code) for code in (12, 43, 54, 55, 60, 61, 81, 97, 255)),
    ]
    foreign = [OptionId(0x80, 1), OptionId(0xFE, 0xFF), OptionId(0, 0), OptionId(4, 1), OptionId(0x7F, 1)]
    machine.receive(frame(request(SERVICE_GET, requested=[*asked, *missing, *foreign])), 0)
    (answer,) = answers(machine)
    assert answer.blocks[: len(asked)] == (
        MacBlock(MAC),
        NameBlock("axis-01"),
        IpParameterBlock(ADDRESS, MASK, GATEWAY, info=1),
        FullIpSuiteBlock(ADDRESS, MASK, GATEWAY, (ZERO,) * 4, info=1),
        DeviceInitiativeBlock(0),
        StandardGatewayBlock(0),
    )
    assert [(block.subject, block.error) for block in answer.blocks[len(asked) :]] == [
        *((option_id, BlockError.SUBOPTION_NOT_SUPPORTED) for option_id in missing),
        *((option_id, BlockError.OPTION_NOT_SUPPORTED) for option_id in foreign),
    ]


def test_an_answer_never_outgrows_its_frame():
    machine = device()
    machine.receive(frame(request(SERVICE_GET, requested=[DeviceOptionsBlock.ID] * 700)), 0)
    (octets,) = machine.to_send(0)
    assert len(octets) <= 1514
    assert machine.dropped["response-full"] > 600


def test_an_unknown_service_is_answered_as_not_supported():
    machine = device()
    machine.receive(frame(DcpPdu(0xFEFD, 1, TYPE_REQUEST, 5, undecoded=b"abcd")), 0)
    (answer,) = answers(machine)
    assert (answer.service_id, answer.service_type, answer.xid) == (1, TYPE_NOT_SUPPORTED, 5)


# -- Set: name ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("permanent", [True, False])
def test_a_name_is_taken_over_and_reported(permanent):
    machine = device()
    assert setting(machine, NameBlock("axis-09", PERMANENT * permanent)) == [BlockError.OK]
    assert machine.name == "axis-09"
    assert machine.events() == [NameSet("axis-09", permanent)]


def test_the_same_name_again_is_fine_and_changes_nothing():
    machine = device()
    assert setting(machine, NameBlock("axis-01", PERMANENT)) == [BlockError.OK]
    assert machine.events() == []


def test_a_temporary_name_made_permanent_is_a_change():
    machine = device()
    setting(machine, NameBlock("axis-09", 0))
    setting(machine, NameBlock("axis-09", PERMANENT))
    assert machine.events() == [NameSet("axis-09", permanent=False), NameSet("axis-09", permanent=True)]


def test_an_empty_name_clears():
    machine = device()
    assert setting(machine, NameBlock("", PERMANENT)) == [BlockError.OK]
    assert machine.events() == [NameSet("", permanent=True)]


@pytest.mark.parametrize("name", ["Axis", "axis_1", "-axis", "10.0.0.1", "port-001", "é", "a" * 64])
def test_an_invalid_name_is_refused(name):
    machine = device()
    assert setting(machine, NameBlock(name, PERMANENT)) == [BlockError.SUBOPTION_NOT_SET]
    assert machine.name == "axis-01"
    assert machine.events() == []


# -- Set: address -------------------------------------------------------------------------------------------


def test_an_address_from_a_real_controllers_frame_is_taken_over():
    # A controller sets the address temporarily, VLAN-tagged, with the device's own address as gateway.
    machine = device(named=False)
    block = IpParameterBlock(IPv4Address("172.16.2.10"), MASK, IPv4Address("172.16.2.10"), info=0)
    machine.receive(frame(request(SERVICE_SET, block), vlan=VlanTag()), 0)
    (answer,) = answers(machine)
    assert answer.blocks == (ResponseBlock(OptionId(1, 2), BlockError.OK),)
    assert machine.events() == [IpSet(IPv4Interface("172.16.2.10/24"), None, permanent=False)]
    machine.receive(frame(request(SERVICE_GET, requested=[IpParameterBlock.ID])), 0)
    (answer,) = answers(machine)
    assert answer.blocks == (IpParameterBlock(block.address, MASK, block.gateway, info=1),)


def test_an_address_with_a_gateway():
    machine = device(named=False)
    assert setting(machine, IpParameterBlock(ADDRESS, MASK, GATEWAY, PERMANENT)) == [BlockError.OK]
    assert machine.events() == [IpSet(IPv4Interface("10.0.0.1/24"), GATEWAY, permanent=True)]
    assert setting(machine, IpParameterBlock(ADDRESS, MASK, GATEWAY, PERMANENT)) == [BlockError.OK]
    assert machine.events() == []


def test_three_zeros_clear_the_address():
    machine = device()
    assert setting(machine, IpParameterBlock(ZERO, ZERO, ZERO, PERMANENT)) == [BlockError.OK]
    assert machine.events() == [IpSet(None, None, permanent=True)]
    assert machine.address is None


def test_the_full_suite_brings_name_servers_along():
    machine = device(named=False)
    dns = (GATEWAY, ZERO, ZERO, ZERO)
    assert setting(machine, FullIpSuiteBlock(ADDRESS, MASK, GATEWAY, dns, PERMANENT)) == [BlockError.OK]
    assert machine.events() == [IpSet(IPv4Interface("10.0.0.1/24"), GATEWAY, permanent=True, dns=dns)]
    assert machine.dns == dns
    assert setting(machine, IpParameterBlock(ADDRESS, MASK, GATEWAY, PERMANENT)) == [BlockError.OK]
    assert machine.dns == dns
    assert machine.events() == []
    assert setting(machine, FullIpSuiteBlock(ZERO, MASK, ZERO, (ZERO,) * 4)) == [BlockError.SUBOPTION_NOT_SET]
    assert machine.dns == dns


@pytest.mark.parametrize(
    ("address", "mask", "gateway"),
    [
        ("224.0.0.1", "255.255.255.0", "0.0.0.0"),
        ("239.1.2.3", "255.0.0.0", "0.0.0.0"),
        ("240.0.0.1", "255.0.0.0", "0.0.0.0"),
        ("127.255.255.254", "255.0.0.0", "0.0.0.0"),
        ("10.0.0.1", "0.255.255.0", "0.0.0.0"),
        ("10.0.0.1", "255.255.255.254", "0.0.0.0"),
        ("255.255.255.255", "255.255.255.0", "0.0.0.0"),
        ("127.0.0.1", "255.0.0.0", "0.0.0.0"),
        ("0.1.2.3", "255.0.0.0", "0.0.0.0"),
        ("10.0.0.1", "255.0.255.0", "0.0.0.0"),
        ("10.0.0.0", "255.255.255.0", "0.0.0.0"),
        ("10.0.0.255", "255.255.255.0", "0.0.0.0"),
        ("10.0.0.1", "255.255.255.255", "0.0.0.0"),
        ("10.0.0.1", "255.255.255.0", "10.0.1.1"),
        ("0.0.0.0", "255.255.255.0", "0.0.0.0"),
        ("0.0.0.0", "0.0.0.0", "10.0.0.1"),
    ],
)
def test_an_invalid_address_is_refused(address, mask, gateway):
    machine = device()
    values = IPv4Address(address), IPv4Address(mask), IPv4Address(gateway)
    assert check_ip_suite(*values) is not None
    assert setting(machine, IpParameterBlock(*values, PERMANENT)) == [BlockError.SUBOPTION_NOT_SET]
    assert machine.address == IPv4Interface("10.0.0.1/24")
    assert machine.events() == []


# -- Set: the rest ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gateway", ["0.0.0.0", "10.0.0.1", "10.0.0.254"], ids=["none", "itself", "a neighbour"])
def test_a_gateway_is_none_or_in_the_subnet(gateway):
    assert check_ip_suite(ADDRESS, MASK, IPv4Address(gateway)) is None


# CMINA, state W_CONNECT with an active AR (the rows that p-net's pf_cmina.c names 24 to 30)


def test_another_address_is_refused_while_an_application_relation_is_up():
    machine = device()
    machine.in_operation = True
    wanted = [
        IpParameterBlock(IPv4Address("10.0.0.9"), MASK, GATEWAY, PERMANENT),
        IpParameterBlock(ADDRESS, MASK, ZERO),
        FullIpSuiteBlock(IPv4Address("10.0.0.9"), MASK, GATEWAY, NO_DNS, PERMANENT),
    ]
    assert setting(machine, *wanted) == [BlockError.IN_OPERATION] * 3
    assert machine.events() == []
    assert machine.address == IPv4Interface("10.0.0.1/24")
    # a wrong value is wrong first
    assert setting(machine, IpParameterBlock(PLC_NET, MASK, GATEWAY)) == [BlockError.SUBOPTION_NOT_SET]


def test_what_it_has_anyway_can_be_set_while_an_application_relation_is_up():
    machine = device()
    machine.in_operation = True
    same = [NameBlock("axis-01", PERMANENT), IpParameterBlock(ADDRESS, MASK, GATEWAY, PERMANENT), SignalBlock()]
    assert setting(machine, *same) == [BlockError.OK] * 3
    assert machine.events() == [SignalBegan()]
    assert machine.in_operation
    # also when only its duration is another
    assert setting(machine, NameBlock("axis-01", 0), IpParameterBlock(ADDRESS, MASK, GATEWAY)) == [BlockError.OK] * 2
    assert machine.events() == [
        NameSet("axis-01", permanent=False), IpSet(IPv4Interface("10.0.0.1/24"), GATEWAY, permanent=False),
    ]  # fmt: skip
    assert machine.in_operation


@pytest.mark.parametrize("name", ["axis-09", ""])
def test_another_name_ends_the_application_relation(name):
    machine = device()
    machine.in_operation = True
    assert setting(machine, NameBlock(name, PERMANENT)) == [BlockError.OK]
    assert machine.events() == [AbortRequired(RtaError.STATION_NAME_CHANGED), NameSet(name, permanent=True)]


def test_taking_the_address_away_ends_the_application_relation():
    machine = device()
    machine.in_operation = True
    assert setting(machine, IpParameterBlock(ZERO, ZERO, ZERO)) == [BlockError.OK]
    assert machine.events() == [AbortRequired(RtaError.IP_SUITE_CHANGED), IpSet(None, None, permanent=False)]


def test_a_name_and_then_an_address_in_one_request_are_both_taken():
    machine = device()
    machine.in_operation = True
    block = IpParameterBlock(IPv4Address("10.0.0.9"), MASK, GATEWAY, PERMANENT)
    assert setting(machine, block, NameBlock("axis-09", 1), block) == [BlockError.IN_OPERATION, 0, 0]
    assert [type(event) for event in machine.events()] == [AbortRequired, NameSet, IpSet]


def test_an_invalid_name_ends_nothing():
    machine = device()
    machine.in_operation = True
    assert setting(machine, NameBlock("Wrong", PERMANENT)) == [BlockError.SUBOPTION_NOT_SET]
    assert machine.in_operation
    assert machine.events() == []


def test_what_is_fixed_on_the_device_itself_cannot_be_set():
    machine = device()
    machine.locked = frozenset({NameBlock.ID})
    assert setting(machine, NameBlock("axis-09", 1), IpParameterBlock(ZERO, ZERO, ZERO)) == [
        BlockError.SET_NOT_POSSIBLE,
        BlockError.OK,
    ]
    assert machine.name == "axis-01"


# -- Set: signal --------------------------------------------------------------------------------------------


def test_the_lamp_flashes_for_three_seconds():
    machine = device()
    assert setting(machine, SignalBlock()) == [BlockError.OK]
    assert machine.events() == [SignalBegan()]
    assert machine.signalling
    assert machine.next_deadline() == SIGNAL_NS == 3000 * MS
    machine.handle_timeout(SIGNAL_NS - 1)
    assert machine.events() == []
    machine.handle_timeout(SIGNAL_NS)
    assert machine.events() == [SignalEnded()]
    assert not machine.signalling
    assert machine.next_deadline() is None


def test_a_second_signal_prolongs_the_first():
    machine = device()
    machine.receive(frame(request(SERVICE_SET, SignalBlock())), 0)
    machine.receive(frame(request(SERVICE_SET, SignalBlock())), 2000 * MS)
    machine.handle_timeout(SIGNAL_NS)
    assert machine.events() == [SignalBegan()]
    machine.handle_timeout(5000 * MS)
    assert machine.events() == [SignalEnded()]


@pytest.mark.parametrize("value", [0, 1, 0x0101, 0x0200, 0xFFFF])
def test_another_signal_than_flash_once_is_refused(value):
    machine = device()
    assert setting(machine, SignalBlock(value)) == [BlockError.SUBOPTION_NOT_SET]
    assert not machine.signalling


def test_a_signal_without_a_value_is_refused():
    # a block of nothing but its qualifier, as there are peers that send it
    assert setting(device(), UnknownBlock(5, 3, b"", 0)) == [BlockError.SUBOPTION_NOT_SET]


# -- Set: resets --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [ResetMode.COMMUNICATION, ResetMode.ALL, ResetMode.DEVICE])
def test_a_reset_of_communication_takes_name_and_address_away(mode):
    machine = device()
    machine.dns = (GATEWAY, ZERO, ZERO, ZERO)
    assert setting(machine, ResetToFactoryBlock(mode << 1)) == [BlockError.OK]
    reset, *rest = machine.events()
    assert reset == FactoryReset(mode, RESET_CLEARS[mode])
    assert rest == [NameSet("", permanent=True), IpSet(None, None, permanent=True)]
    assert (machine.name, machine.address, machine.dns) == ("", None, NO_DNS)


def test_a_reset_of_application_data_leaves_name_and_address():
    machine = device()
    assert setting(machine, ResetToFactoryBlock(ResetMode.APPLICATION << 1)) == [BlockError.OK]
    (reset,) = machine.events()
    assert reset.clears == {Stored.APPLICATION, Stored.IDENTIFICATION, Stored.MANAGEMENT}
    assert machine.name == "axis-01"


def test_bit_0_of_the_qualifier_says_nothing_in_a_reset():
    machine = device()
    assert setting(machine, ResetToFactoryBlock(ResetMode.COMMUNICATION << 1 | 1)) == [BlockError.OK]
    assert machine.events()[0].mode is ResetMode.COMMUNICATION


@pytest.mark.parametrize(
    ("mode", "clears"),
    [
        (ResetMode.APPLICATION, {"application", "identification", "management"}),
        (ResetMode.COMMUNICATION, {"communication", "interface", "management"}),
        (ResetMode.ALL, set(Stored)),
        (ResetMode.DEVICE, set(Stored)),
        (ResetMode.DEVICE_AND_RESTORE, set(Stored)),
    ],
)
def test_each_mode_clears_its_kinds_of_data(mode, clears):
    assert RESET_CLEARS[mode] == clears
    assert RESET_CLEARS.keys() == set(ResetMode)
    assert FactoryReset(mode, RESET_CLEARS[mode]).reboots == (mode >= ResetMode.DEVICE)


def test_the_old_factory_reset_resets_all():
    machine = device()
    assert setting(machine, FactoryResetBlock()) == [BlockError.OK]
    assert machine.events()[0] == FactoryReset(ResetMode.ALL, frozenset(Stored))
    assert machine.name == ""


@pytest.mark.parametrize("mode", [0, 5, 6, 7, 10, 0x7FFF])
def test_a_reserved_reset_mode_is_refused(mode):
    machine = device()
    assert setting(machine, ResetToFactoryBlock(mode << 1)) == [BlockError.SUBOPTION_NOT_SET]
    assert machine.events() == []


@pytest.mark.parametrize("mode", [ResetMode.ENGINEERING, ResetMode.DEVICE_AND_RESTORE])
def test_a_reset_mode_that_the_device_has_not_is_refused(mode):
    machine = device()
    machine.in_operation = True
    assert setting(machine, ResetToFactoryBlock(mode << 1)) == [BlockError.SUBOPTION_NOT_SUPPORTED]
    assert machine.events() == []
    assert machine.in_operation


@pytest.mark.parametrize("block", [ResetToFactoryBlock(ResetMode.APPLICATION << 1), FactoryResetBlock()], ids=repr)
def test_a_reset_ends_the_application_relation(block):
    machine = device()
    machine.in_operation = True
    assert setting(machine, block) == [BlockError.OK]
    assert machine.events()[0] == AbortRequired(RtaError.RESET_TO_FACTORY)


def test_a_transaction_ends_with_the_qualifier_it_began_with():
    machine = device()
    assert setting(machine, StartBlock(1), NameBlock("axis-02", 1), StopBlock(1)) == [BlockError.OK] * 3
    assert setting(machine, StartBlock(1), StopBlock(0)) == [BlockError.OK, BlockError.SUBOPTION_NOT_SET]


def test_an_end_of_transaction_without_a_start_is_fine():
    machine = device(named=False)
    assert setting(machine, IpParameterBlock(ADDRESS, MASK, GATEWAY), StopBlock()) == [BlockError.OK] * 2


@pytest.mark.parametrize(
    ("block", "error"),
    [
        (ResetToFactoryBlock(), BlockError.OK),
        (DhcpBlock(255, b"\1\1\2"), BlockError.SUBOPTION_NOT_SUPPORTED),
        (UnknownBlock(5, 4, b"\2\2\0", 0), BlockError.SUBOPTION_NOT_SUPPORTED),
        (UnknownBlock(5, 5, b"x", 0), BlockError.SUBOPTION_NOT_SET),
        (UnknownBlock(1, 3, bytes(27), 0), BlockError.SUBOPTION_NOT_SET),
        (UnknownBlock(4, 1, b"", 0), BlockError.OPTION_NOT_SUPPORTED),
        (UnknownBlock(0x7F, 1, b"", 0), BlockError.OPTION_NOT_SUPPORTED),
        (UnknownBlock(0xFE, 0xFE, b"maker", 0), BlockError.OPTION_NOT_SUPPORTED),
        (AllSelectorBlock(), BlockError.SUBOPTION_NOT_SUPPORTED),
        (DeviceInitiativeBlock(1), BlockError.SUBOPTION_NOT_SUPPORTED),
        (StandardGatewayBlock(1), BlockError.SUBOPTION_NOT_SUPPORTED),
        (DeviceRoleBlock(2), BlockError.SUBOPTION_NOT_SUPPORTED),
        (MacBlock(PLC), BlockError.SUBOPTION_NOT_SUPPORTED),
        (DeviceIdBlock(1, 2), BlockError.SUBOPTION_NOT_SUPPORTED),
        (AliasBlock("x"), BlockError.SUBOPTION_NOT_SUPPORTED),
        (DhcpBlock(61, b"x"), BlockError.SUBOPTION_NOT_SUPPORTED),
        (UnknownBlock(5, 9, b"", 0), BlockError.SUBOPTION_NOT_SUPPORTED),
        (UnknownBlock(0x80, 1, b"xy", 0), BlockError.OPTION_NOT_SUPPORTED),
        (UnknownBlock(1, 2, b"short", 1), BlockError.SUBOPTION_NOT_SET),
        (UnknownBlock(2, 2, b"x"), BlockError.SUBOPTION_NOT_SET),
    ],
    ids=repr,
)
def test_what_cannot_be_set_is_refused_block_by_block(block, error):
    machine = device()
    assert setting(machine, block, NameBlock("axis-02", 1)) == [error, BlockError.OK]


# -- who is listened to -------------------------------------------------------------------------------------


def test_after_a_request_only_this_client_is_heard_for_three_seconds():
    machine = device()
    ask = request(SERVICE_GET, requested=[NameBlock.ID])
    machine.receive(frame(ask), 0)
    machine.receive(frame(ask, source=TOOL), CLIENT_HOLD_NS - 1)
    assert len(answers(machine)) == 1
    assert machine.dropped == {"held-by-other-client": 1}
    machine.receive(frame(ask, source=TOOL), CLIENT_HOLD_NS)
    assert len(answers(machine)) == 1


def test_identify_is_answered_to_anybody_meanwhile():
    machine = device()
    machine.receive(frame(request(SERVICE_GET, requested=[NameBlock.ID])), 0)
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock()), IDENTIFY_MULTICAST, TOOL), 1)
    assert len(answers(machine, 1)) == 2


@pytest.mark.parametrize("destination", [IDENTIFY_MULTICAST, PLC, b"\xff" * 6])
def test_get_and_set_come_by_unicast_only(destination):
    machine = device()
    machine.receive(frame(request(SERVICE_SET, NameBlock("axis-02", 1)), destination), 0)
    assert answers(machine) == []
    assert machine.events() == []
    assert machine.dropped == {"other-destination": 1}


def test_strange_frames_are_counted():
    machine = device()
    machine.receive(EthernetFrame(MAC, PLC, 0x0800, b""), 0)
    machine.receive(EthernetFrame(MAC, PLC, ETHERTYPE_PROFINET, b"\x80\x00" + bytes(40)), 0)
    machine.receive(EthernetFrame(MAC, PLC, ETHERTYPE_PROFINET, b"\xfe"), 0)
    machine.receive(frame(DcpPdu(0xFEFD, SERVICE_GET, TYPE_SUCCESS, 1)), 0)
    machine.receive(frame(request(SERVICE_HELLO), HELLO_MULTICAST), 0)
    machine.receive(frame(DcpPdu(0xFEFE, SERVICE_GET, TYPE_REQUEST, 1)), 0)
    assert answers(machine) == []
    assert machine.dropped == {
        "other-protocol": 1, "bad-type": 1, "short": 1, "not-a-request": 1, "hello": 1, "wrong-frame-id": 1,
    }  # fmt: skip


def test_a_silent_device_neither_answers_nor_obeys():
    machine = device()
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock()), IDENTIFY_MULTICAST), 0)
    machine.silent = True
    machine.receive(frame(request(SERVICE_SET, NameBlock("axis-02", 1))), 0)
    assert machine.to_send(0) == []
    assert machine.name == "axis-01"
    assert machine.dropped == {"silent": 2}


# -- Hello --------------------------------------------------------------------------------------------------


def hellos(machine: DcpDevice, until: int, step: int = 10 * MS) -> list[int]:
    """When Hello was sent."""
    return [now for now in range(0, until, step) for _ in machine.to_send(now)]


def test_hello_tells_everybody_who_came_up():
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
def test_who_has_no_name_or_no_address_does_not_say_hello(missing):
    machine = device(hello=HelloSettings())
    setattr(machine, missing, "" if missing == "name" else None)
    machine.link_up(0)
    assert hellos(machine, 1000 * MS) == []


def test_hello_ends_when_somebody_sets_something():
    machine = device(hello=HelloSettings())
    machine.link_up(0)
    assert len(answers(machine, 0)) == 1
    machine.receive(frame(request(SERVICE_SET, NameBlock("axis-01", 1))), 10 * MS)
    assert [answer.service_id for answer in answers(machine, 1000 * MS)] == [SERVICE_SET]


def test_hellos_are_counted_by_their_xid():
    machine = device(hello=HelloSettings())
    machine.link_up(0)
    assert [answer.xid for now in range(0, 90, 30) for answer in answers(machine, now * MS)] == [1, 2, 3]


# -- many at once -------------------------------------------------------------------------------------------


def test_each_station_that_asks_gets_its_own_answer_in_its_own_time():
    machine = device()
    stations = [bytes([2, 0, 0, 0, 0x99, n]) for n in range(5)]
    for n, station in enumerate(stations):
        asked = request(SERVICE_IDENTIFY, AllSelectorBlock(), factor=(0, 100, 2, 6400, 255)[n], xid=1000 + n)
        machine.receive(frame(asked, IDENTIFY_MULTICAST, station), 0)
    sent = []
    while (due := machine.next_deadline()) is not None:
        for octets in machine.to_send(due):
            answer = parse_ethernet(octets)
            sent.append((answer.destination, parse_dcp(answer.payload).xid, due))
    times = [response_delay_ns(MAC, factor) for factor in (0, 100, 2, 6400, 255)]
    expected = [(station, 1000 + n, times[n]) for n, station in enumerate(stations)]
    assert sent == sorted(expected, key=lambda item: item[2])


@given(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF))
def test_no_answer_waits_longer_than_its_factor_allows(low, factor):
    delay = response_delay_ns(bytes([2, 0, 0, 0]) + low.to_bytes(2, "big"), factor)
    assert delay % (10 * MS) == 0
    if 1 <= factor <= 6400:
        assert delay == low % factor * 10 * MS
        assert delay <= (factor - 1) * 10 * MS
    else:
        assert delay == 0


def test_many_devices_spread_evenly():
    delays = [response_delay_ns(bytes([2, 0, 0, 0]) + n.to_bytes(2, "big"), 64) for n in range(1024)]
    assert {delays.count(step * 10 * MS) for step in range(64)} == {16}


def test_a_set_of_many_blocks_has_one_result_for_each_in_their_order():
    machine = device()
    blocks = [NameBlock(f"axis-{n}" if n % 3 else "_", 1) for n in range(60)]
    assert setting(machine, *blocks) == [BlockError.OK if n % 3 else BlockError.SUBOPTION_NOT_SET for n in range(60)]
    assert machine.name == "axis-59"


def test_a_block_whose_result_has_no_room_is_not_set():
    machine = device()
    blocks = [SignalBlock(0)] * MAXIMUM_RESULTS + [NameBlock("axis-02", 1)]
    machine.receive_pdu(PLC, MAC, request(SERVICE_SET, *blocks), 0)
    (octets,) = machine.to_send(0)
    assert len(octets) <= 1514
    assert len(parse_dcp(parse_ethernet(octets).payload).blocks) == MAXIMUM_RESULTS
    assert machine.name == "axis-01"
    assert machine.dropped == {"response-full": 1}


@pytest.mark.parametrize("name", ["a", "ab", "abc", "x" * 63])
def test_blocks_of_odd_length_are_read_past_their_padding(name):
    machine = device()
    blocks = [NameBlock(name, 1), UnknownBlock(0x81, 1, b"odd", 0), SignalBlock()]
    assert setting(machine, *blocks) == [BlockError.OK, BlockError.OPTION_NOT_SUPPORTED, BlockError.OK]
    assert machine.name == name
    assert identify(machine, NameBlock(name), DeviceRoleBlock(1))


@pytest.mark.parametrize("tag", [VlanTag(), VlanTag(priority=6)])
def test_a_tagged_identify_is_answered_untagged(tag):
    machine = device()
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock()), IDENTIFY_MULTICAST, vlan=tag), 0)
    assert len(answers(machine)) == 1


def test_identify_by_broadcast_is_none():
    machine = device()
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock()), b"\xff" * 6), 0)
    assert answers(machine) == []
    assert machine.dropped == {"other-destination": 1}


@given(st.binary(max_size=80), st.sampled_from(range(0xFC, 0x100)), st.sampled_from([3, 4, 5, 6, 9]))
def test_any_frame_is_survived_and_any_answer_can_be_read(data, low, service_id):
    machine = device(OEM, hello=HelloSettings())
    head = bytes([0xFE, low, service_id, 0, 0, 0, 0, 1, 0, 0, 0, len(data)])
    machine.receive(EthernetFrame(MAC, PLC, ETHERTYPE_PROFINET, head + data), 0)
    for answer in answers(machine, 10**12):
        assert answer.xid == 1
