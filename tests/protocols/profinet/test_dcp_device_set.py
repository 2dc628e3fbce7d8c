"""What a DCP client may set and reset, and what the device says to it."""

from ipaddress import IPv4Address, IPv4Interface

import pytest
from dcp_bench import ADDRESS, GATEWAY, MASK, MS, PLC, PLC_NET, ZERO, answers, device, frame, request, setting

from pnfarm.protocols.profinet.dcp.device import SIGNAL_NS
from pnfarm.protocols.profinet.dcp.rules import (
    NO_DNS,
    RESET_CLEARS,
    AbortRequired,
    FactoryReset,
    IpSet,
    NameSet,
    SignalBegan,
    SignalEnded,
    Stored,
    check_ip_suite,
)
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    PERMANENT,
    AliasBlock,
    AllSelectorBlock,
    BlockError,
    DeviceIdBlock,
    DeviceInitiativeBlock,
    DeviceRoleBlock,
    DhcpBlock,
    FactoryResetBlock,
    FullIpSuiteBlock,
    IpParameterBlock,
    MacBlock,
    NameBlock,
    OptionId,
    ResetMode,
    ResetToFactoryBlock,
    ResponseBlock,
    SignalBlock,
    StandardGatewayBlock,
    StartBlock,
    StopBlock,
    UnknownBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import SERVICE_GET, SERVICE_SET
from pnfarm.wire.ethernet import VlanTag

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
def test_a_gateway_is_0_or_in_the_subnet(gateway):
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
