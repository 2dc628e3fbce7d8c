"""What a DCP device answers, and which requests it accepts."""

import pytest
import scapy.contrib.pnio_dcp as oracle
from dcp_bench import (
    ADDRESS,
    GATEWAY,
    IDENTITY,
    MAC,
    MASK,
    MS,
    OEM,
    PLC,
    TOOL,
    ZERO,
    answers,
    device,
    frame,
    identify,
    request,
    setting,
)
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.profinet.dcp.device import (
    CLIENT_HOLD_NS,
    MAXIMUM_RESULTS,
    PENDING_LIMIT,
    DcpDevice,
    identify_matches,
)
from pnfarm.protocols.profinet.dcp.rules import HelloSettings, response_delay_ns
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    AliasBlock,
    AllSelectorBlock,
    BlockError,
    DeviceIdBlock,
    DeviceInitiativeBlock,
    DeviceInstanceBlock,
    DeviceOptionsBlock,
    DeviceRoleBlock,
    DhcpBlock,
    FullIpSuiteBlock,
    IpParameterBlock,
    MacBlock,
    NameBlock,
    OemDeviceIdBlock,
    OptionId,
    ResetToFactoryBlock,
    RsiPropertiesBlock,
    SignalBlock,
    StandardGatewayBlock,
    StationTypeBlock,
    UnknownBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import (
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
    parse_dcp,
)
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, VlanTag, parse_ethernet

# -- Identify -----------------------------------------------------------------------------------------------


def test_identify_all_is_answered_with_all_blocks_of_the_device():
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
def test_block_info_shows_whether_the_address_is_in_use_and_in_conflict(named, conflict, in_use, info):
    machine = device(named=named)
    machine.ip_conflict, machine.ip_in_use = conflict, in_use
    machine.receive(frame(request(SERVICE_IDENTIFY, AllSelectorBlock()), IDENTIFY_MULTICAST), 0)
    machine.receive(frame(request(SERVICE_GET, requested=[IpParameterBlock.ID, FullIpSuiteBlock.ID])), 0)
    got, identified = answers(machine)
    told = [b for b in (*identified.blocks, *got.blocks) if isinstance(b, (IpParameterBlock, FullIpSuiteBlock))]
    assert [block.info for block in told] == [info] * 3
    # the configured address is reported either way
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


def test_a_request_without_any_filter_matches_no_device():
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
    assert machine.next_deadline() == (due if steps else None)
    if steps:
        assert answers(machine, due - 1) == []
    machine.handle_timeout(due)
    assert machine.next_deadline() is None
    (answer,) = answers(machine, due)
    assert answer.response_delay_factor == 0


def ask(machine, who, xid, factor=6400):
    pdu = request(SERVICE_IDENTIFY, AllSelectorBlock(), factor=factor, xid=xid)
    machine.receive(frame(pdu, IDENTIFY_MULTICAST, who), 0)


def asker(number):
    return bytes([2, 0, 0, 9]) + number.to_bytes(2, "big")


def test_answers_wait_in_order_one_for_each_station_that_asked_and_a_newer_one_replaces_an_older():
    machine = device()
    ask(machine, asker(1), 1)
    ask(machine, asker(2), 2, factor=1000)
    ask(machine, asker(1), 3, factor=0)
    assert [answer.xid for answer in answers(machine, 0)] == [3]
    ask(machine, asker(1), 4)
    assert machine.dropped == {"superseded": 1}
    assert [answer.xid for answer in answers(machine, 10**12)] == [2, 4]
    assert machine.next_deadline() is None


def test_a_station_that_asks_again_and_again_leaves_room_for_everybody_else():
    machine = device()
    for xid in range(100):
        ask(machine, asker(1), xid)
    ask(machine, asker(2), 1000)
    waiting = answers(machine, 10**12)
    assert [answer.xid for answer in waiting] == [99, 1000]


def test_a_request_beyond_the_queue_is_answered_at_once_and_replaces_no_other():
    machine = device()
    for number in range(PENDING_LIMIT):
        ask(machine, asker(number), number)
    assert answers(machine, 0) == []
    for number in range(PENDING_LIMIT, PENDING_LIMIT + 5):
        ask(machine, asker(number), number)
    assert [answer.xid for answer in answers(machine, 0)] == list(range(PENDING_LIMIT, PENDING_LIMIT + 5))
    # one that waits is replaced in its place
    ask(machine, asker(3), 333)
    assert answers(machine, 0) == []
    later = {answer.xid for answer in answers(machine, 10**12)}
    assert later == {*range(PENDING_LIMIT), 333} - {3}


def test_an_answer_that_waited_says_what_the_device_is_called_when_it_leaves():
    machine = device()
    ask(machine, asker(1), 1)
    by_name = request(SERVICE_IDENTIFY, NameBlock("axis-01"), factor=6400)
    machine.receive(frame(by_name, IDENTIFY_MULTICAST, asker(2)), 0)
    assert setting(machine, NameBlock("press-7", 1)) == [BlockError.OK]
    (answer,) = answers(machine, 64_000 * MS)
    assert answer.blocks[0] == NameBlock("press-7")
    assert machine.dropped["filter"] == 1


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


# -- who is listened to -------------------------------------------------------------------------------------


def test_after_a_request_only_this_client_is_served_for_three_seconds():
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


# -- many at once -------------------------------------------------------------------------------------------


def test_each_station_that_asks_gets_its_own_answer_in_its_own_time():
    machine = device()
    stations = [bytes([2, 0, 0, 0, 0x99, n]) for n in range(5)]
    for n, station in enumerate(stations):
        asked = request(SERVICE_IDENTIFY, AllSelectorBlock(), factor=(0, 100, 2, 6400, 255)[n], xid=1000 + n)
        machine.receive(frame(asked, IDENTIFY_MULTICAST, station), 0)
    sent = []
    due = 0
    while due is not None:
        for octets in machine.to_send(due):
            answer = parse_ethernet(octets)
            sent.append((answer.destination, parse_dcp(answer.payload).xid, due))
        due = machine.next_deadline()
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


def test_identify_by_broadcast_is_ignored():
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
