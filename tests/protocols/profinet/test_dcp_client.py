from ipaddress import IPv4Address, IPv4Interface

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.profinet.dcp.client import (
    COLLECT_MARGIN_NS,
    READABLE,
    RETRIES,
    TIMEOUT_NS,
    DcpClient,
    GetFinished,
    HelloReceived,
    IdentifyAnswered,
    IdentifyFinished,
    SetFinished,
    station_info,
)
from pnfarm.protocols.profinet.dcp.device import DcpDevice
from pnfarm.protocols.profinet.dcp.rules import (
    RESET_CLEARS,
    DcpIdentity,
    FactoryReset,
    HelloSettings,
    IpSet,
    NameSet,
    SignalBegan,
)
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    AliasBlock,
    DeviceIdBlock,
    DeviceInstanceBlock,
    DeviceOptionsBlock,
    DeviceRoleBlock,
    FactoryResetBlock,
    IpParameterBlock,
    MacBlock,
    NameBlock,
    OemDeviceIdBlock,
    OptionId,
    ResetMode,
    ResponseBlock,
    StartBlock,
    StationTypeBlock,
    StopBlock,
)
from pnfarm.protocols.profinet.wire.dcp.pdu import SERVICE_IDENTIFY, TYPE_SUCCESS, DcpPdu, emit_dcp, frame_id_of
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, parse_ethernet

MS = 10**6
PLC = bytes.fromhex("020000000099")
IDENTITY = DcpIdentity("AKD", 0x0105, 0x0203, oem=(1, 2))


def farm(count: int) -> list[DcpDevice]:
    return [
        DcpDevice(bytes([2, 0, 0, 0, 1, n]), IDENTITY, name=f"axis-{n:02}", address=IPv4Interface(f"10.0.0.{n}/24"))
        for n in range(1, count + 1)
    ]


def join(client: DcpClient, devices: list[DcpDevice], now: int = 0) -> None:
    """Carry frames both ways until everybody is silent."""
    for _ in range(20):
        frames = [parse_ethernet(octets) for octets in client.to_send(now)]
        for frame in frames:
            for machine in devices:
                machine.receive(frame, now)
        answers = [parse_ethernet(octets) for machine in devices for octets in machine.to_send(now)]
        for frame in answers:
            client.receive(frame, now)
        if not frames and not answers:
            return
    raise AssertionError("the machines never fall silent")


def run(client: DcpClient, devices: list[DcpDevice], until: int, step: int = 10 * MS) -> None:
    for now in range(0, until + 1, step):
        join(client, devices, now)


# -- Identify -----------------------------------------------------------------------------------------------


def test_everybody_answers_and_the_collection_ends():
    client, devices = DcpClient(PLC), farm(5)
    xid = client.identify(now=0)
    join(client, devices)
    found = client.events()
    assert [(event.xid, event.mac, event.info.name) for event in found] == [
        (xid, machine.mac, machine.name) for machine in devices
    ]
    info = found[0].info
    assert (info.station_type, info.vendor_id, info.device_id, info.role) == ("AKD", 0x0105, 0x0203, 1)
    assert (info.instance, info.oem, info.ip, info.ip_info) == ((0, 1), (1, 2), IPv4Address("10.0.0.1"), 1)
    assert NameBlock.ID in info.options
    assert client.next_deadline() == 10 * MS + COLLECT_MARGIN_NS
    client.handle_timeout(client.next_deadline())
    assert client.events() == [IdentifyFinished(xid, 5)]
    assert client.next_deadline() is None


def test_a_delay_factor_spreads_the_answers_and_the_client_waits_for_the_last():
    client, devices = DcpClient(PLC), farm(20)
    client.identify(now=0, delay_factor=8)
    join(client, devices)
    at_once = len(client.events())
    assert 0 < at_once < 20
    run(client, devices, 80 * MS + COLLECT_MARGIN_NS)
    events = client.events()
    assert len(events) == 20 - at_once + 1
    assert events[-1] == IdentifyFinished(1, 20)


def test_a_name_is_found_among_many_and_ends_the_search_at_once():
    client, devices = DcpClient(PLC), farm(20)
    xid = client.identify([NameBlock("axis-13")], now=0, expected=1)
    join(client, devices)
    answer, finished = client.events()
    assert isinstance(answer, IdentifyAnswered)
    assert answer.mac == devices[12].mac
    assert finished == IdentifyFinished(xid, 1)


def test_a_name_given_twice_shows_as_two_answers():
    client, devices = DcpClient(PLC), farm(2)
    devices[1].name = "axis-01"
    client.identify([NameBlock("axis-01")], now=0)
    join(client, devices)
    assert len(client.events()) == 2


def test_no_device_is_a_result_too():
    client = DcpClient(PLC)
    xid = client.identify(now=0, window_ns=5)
    client.to_send(0)
    client.handle_timeout(5)
    assert client.events() == [IdentifyFinished(xid, 0)]


def test_an_answer_counts_once_and_a_late_one_not_at_all():
    client, (machine,) = DcpClient(PLC), farm(1)
    client.identify(now=0)
    (request,) = (parse_ethernet(octets) for octets in client.to_send(0))
    machine.receive(request, 0)
    (answer,) = (parse_ethernet(octets) for octets in machine.to_send(0))
    client.receive(answer, 0)
    client.receive(answer, 0)
    client.handle_timeout(10**10)
    client.receive(answer, 10**10)
    assert len(client.events()) == 2
    assert client.dropped == {"duplicate": 1, "unknown-xid": 1}


# -- Set and Get --------------------------------------------------------------------------------------------


def test_name_and_address_arrive_at_one_device_only():
    client, devices = DcpClient(PLC), farm(2)
    target = devices[0]
    first = client.set_name(target.mac, "spindle", now=0)
    second = client.set_ip(target.mac, IPv4Interface("10.0.0.77/24"), permanent=False, now=0)
    join(client, devices)
    assert client.events() == [
        SetFinished(first, target.mac, (ResponseBlock(OptionId(2, 2), 0),), None),
        SetFinished(second, target.mac, (ResponseBlock(OptionId(1, 2), 0),), None),
    ]
    assert target.events() == [
        NameSet("spindle", permanent=True),
        IpSet(IPv4Interface("10.0.0.77/24"), None, permanent=False),
    ]
    assert devices[1].events() == []


def test_name_and_address_are_taken_away():
    client, (machine,) = DcpClient(PLC), farm(1)
    client.set_name(machine.mac, "", now=0)
    client.set_ip(machine.mac, None, now=0)
    join(client, [machine])
    assert machine.events() == [NameSet("", permanent=True), IpSet(None, None, permanent=True)]


def test_signal_and_resets_arrive():
    client, (machine,) = DcpClient(PLC), farm(1)
    client.signal(machine.mac, now=0)
    client.reset_to_factory(machine.mac, ResetMode.APPLICATION, now=0)
    client.set_blocks(machine.mac, [FactoryResetBlock()], now=0)
    join(client, [machine])
    assert machine.events()[:3] == [
        SignalBegan(),
        FactoryReset(ResetMode.APPLICATION, RESET_CLEARS[ResetMode.APPLICATION]),
        FactoryReset(ResetMode.ALL, RESET_CLEARS[ResetMode.ALL]),
    ]
    assert [event.error for event in client.events()] == [None] * 3


def test_a_refusal_is_reported_as_text():
    client, (machine,) = DcpClient(PLC), farm(1)
    machine.in_operation = True
    client.set_ip(machine.mac, IPv4Interface("10.0.0.99/24"), now=0)
    client.set_name(machine.mac, "Wrong", now=0)
    client.set_blocks(machine.mac, [FactoryResetBlock(), DeviceIdBlock(1, 2), AliasBlock("x")], now=0)
    join(client, [machine])
    first, second, third = client.events()
    assert first.error == "IP parameter (1/2): in operation, set not possible"
    assert second.error == "name of station (2/2): suboption not set"
    assert third.error.count("suboption not supported") == 2
    assert [result.error for result in third.results] == [0, 2, 2]


def test_get_reads_blocks():
    client, (machine,) = DcpClient(PLC), farm(1)
    xid = client.get(machine.mac, [NameBlock.ID, IpParameterBlock.ID], now=0)
    join(client, [machine])
    (event,) = client.events()
    assert isinstance(event, GetFinished)
    assert (event.xid, event.error) == (xid, None)
    assert station_info(event.blocks).name == "axis-01"
    assert station_info(event.blocks).mask == IPv4Address("255.255.255.0")
    client.get(machine.mac, [OptionId(0x80, 1)], now=0)
    join(client, [machine])
    (event,) = client.events()
    assert event.error == "manufacturer's option (128/1): option not supported"


def test_everything_that_a_device_has_is_read_in_one_request():
    client, (machine,) = DcpClient(PLC), farm(1)
    machine.dns = tuple(IPv4Address(text) for text in ("10.0.0.53", "0.0.0.0", "10.0.0.54", "0.0.0.0"))
    machine.ip_conflict = True
    machine.hello_settings = HelloSettings()
    client.read(machine.mac, now=0)
    join(client, [machine])
    (event,) = client.events()
    assert event.error == "RSI properties (2/10): suboption not supported, or no data set available"
    assert len(event.blocks) == len(READABLE)
    info = station_info(event.blocks)
    assert (info.mac, info.name, info.station_type, info.oem) == (machine.mac, "axis-01", "AKD", (1, 2))
    assert info.dns == (IPv4Address("10.0.0.53"), IPv4Address("10.0.0.54"))
    assert info.ip_conflict


def test_blocks_are_set_together_in_a_transaction():
    client, (machine,) = DcpClient(PLC), farm(1)
    client.set_blocks(machine.mac, [StartBlock(1), NameBlock("spindle", 1), DeviceIdBlock(1, 2), StopBlock(1)], now=0)
    join(client, [machine])
    (event,) = client.events()
    assert [result.error for result in event.results] == [0, 0, 2, 0]
    assert event.error == "device ID (2/3): suboption not supported, or no data set available"


FILTERS = [
    NameBlock("axis-01"),
    AliasBlock("port-001.plc"),
    StationTypeBlock("AKD"),
    DeviceIdBlock(0x0105, 0x0203),
    DeviceRoleBlock(1),
    DeviceOptionsBlock((NameBlock.ID,)),
    DeviceInstanceBlock(0, 1),
    OemDeviceIdBlock(1, 2),
    MacBlock(bytes([2, 0, 0, 0, 1, 1])),
    IpParameterBlock(IPv4Address("10.0.0.1"), IPv4Address("255.255.255.0"), IPv4Address(0)),
]


@pytest.mark.parametrize("block", FILTERS, ids=repr)
def test_every_filter_finds_its_device_by_multicast_and_by_unicast(block):
    client, (machine,) = DcpClient(PLC), farm(1)
    machine.aliases = frozenset({"port-001.plc"})
    client.identify([block], now=0, expected=1)
    client.identify([block], now=0, expected=1, destination=machine.mac)
    client.identify([block, NameBlock("axis-02")], now=0, window_ns=5)
    join(client, [machine])
    client.handle_timeout(5)
    assert [type(event) for event in client.events()] == [
        IdentifyAnswered, IdentifyFinished, IdentifyAnswered, IdentifyFinished, IdentifyFinished,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("option_id", "error", "words"),
    [
        ((2, 2), 5, "name of station (2/2): set not possible for local reasons"),
        ((3, 61), 4, "DHCP (3/61): resource error"),
        ((9, 9), 1, "option (9/9): option not supported"),
        ((0xFE, 3), 77, "manufacturer's option (254/3): error 77"),
    ],
)
def test_numbers_are_reported_as_text(option_id, error, words):
    client = DcpClient(PLC)
    mac = bytes([2, 0, 0, 0, 1, 1])
    xid = client.set_name(mac, "spindle", now=0)
    octets = emit_dcp(DcpPdu(0xFEFD, 4, 1, xid, (ResponseBlock(OptionId(*option_id), error),)))
    client.receive(EthernetFrame(PLC, mac, ETHERTYPE_PROFINET, octets), 0)
    assert [event.error for event in client.events()] == [words]


def test_a_lost_request_is_repeated():
    client, (machine,) = DcpClient(PLC), farm(1)
    client.set_name(machine.mac, "spindle", now=0)
    assert len(client.to_send(0)) == 1  # lost
    join(client, [machine], TIMEOUT_NS)
    assert [event.error for event in client.events()] == [None]
    assert machine.name == "spindle"


def test_a_silent_device_ends_in_an_error_after_all_tries():
    client, (machine,) = DcpClient(PLC), farm(1)
    machine.silent = True
    client.set_name(machine.mac, "spindle", now=0)
    sent = 0
    now = 0
    while (deadline := client.next_deadline()) is not None:
        sent += len(client.to_send(now))
        now = deadline
        client.handle_timeout(now)
    assert sent == 1 + RETRIES
    assert now == (1 + RETRIES) * TIMEOUT_NS
    (event,) = client.events()
    assert event.error == "no answer from 02:00:00:00:01:01"


def test_an_unsupported_service_and_an_unknown_error_are_reported():
    client, (machine,) = DcpClient(PLC), farm(1)
    for service_type, blocks in ((5, ()), (1, (ResponseBlock(OptionId(2, 2), 99),))):
        xid = client.set_name(machine.mac, "spindle", now=0)
        octets = emit_dcp(DcpPdu(0xFEFD, 4, service_type, xid, blocks))
        client.receive(EthernetFrame(PLC, machine.mac, ETHERTYPE_PROFINET, octets), 0)
    assert [event.error for event in client.events()] == [
        "the device does not support the service",
        "name of station (2/2): error 99",
    ]


def test_an_answer_from_a_stranger_is_not_the_answer():
    client, devices = DcpClient(PLC), farm(2)
    xid = client.set_name(devices[0].mac, "spindle", now=0)
    octets = emit_dcp(DcpPdu(0xFEFD, 4, 1, xid, (ResponseBlock(OptionId(2, 2)),)))
    client.receive(EthernetFrame(PLC, devices[1].mac, ETHERTYPE_PROFINET, octets), 0)
    assert client.events() == []
    assert client.dropped == {"unknown-xid": 1}


# -- the rest -----------------------------------------------------------------------------------------------


def test_hello_is_received():
    client, (machine,) = DcpClient(PLC), farm(1)
    machine.hello_settings = HelloSettings()
    machine.link_up(0)
    join(client, [machine])
    (event,) = client.events()
    assert isinstance(event, HelloReceived)
    assert (event.mac, event.info.name) == (machine.mac, "axis-01")


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (EthernetFrame(PLC, b"\2" * 6, 0x0800, b""), "other-protocol"),
        (EthernetFrame(PLC, b"\2" * 6, ETHERTYPE_PROFINET, b"\xfe\xfd"), "short"),
        (
            EthernetFrame(b"\2" * 6, b"\4" * 6, ETHERTYPE_PROFINET, emit_dcp(DcpPdu(0xFEFD, 4, 1, 1))),
            "other-destination",
        ),
        (EthernetFrame(PLC, b"\2" * 6, ETHERTYPE_PROFINET, emit_dcp(DcpPdu(0xFEFD, 4, 0, 1))), "request"),
    ],
)
def test_frames_that_are_no_answers_are_counted(frame, reason):
    client = DcpClient(PLC)
    client.receive(frame, 0)
    assert client.dropped == {reason: 1}


def test_numbers_of_transactions_wrap():
    client = DcpClient(PLC, first_xid=0xFFFF_FFFF)
    assert client.identify(now=0) == 0xFFFF_FFFF
    assert client.identify(now=0) == 0


@given(st.binary(max_size=80), st.sampled_from(range(0xFC, 0x100)), st.sampled_from([3, 4, 5, 6, 9]))
def test_any_frame_is_survived(data, low, service_id):
    client = DcpClient(PLC)
    client.identify(now=0)
    client.set_name(b"\2" * 6, "spindle", now=0)
    head = bytes([0xFE, low, service_id, 1, 0, 0, 0, 1 + (service_id == 4), 0, 0, 0, len(data)])
    client.receive(EthernetFrame(PLC, b"\2" * 6, ETHERTYPE_PROFINET, head + data), 0)
    client.events()


def test_an_identify_ends_although_ever_new_stations_answer():
    client = DcpClient(PLC)
    xid = client.identify(now=0, quiet_ns=COLLECT_MARGIN_NS)
    frame_id = frame_id_of(SERVICE_IDENTIFY, TYPE_SUCCESS)
    answer = emit_dcp(DcpPdu(frame_id, SERVICE_IDENTIFY, TYPE_SUCCESS, xid, blocks=(NameBlock("x"),)))
    for number in range(600):
        now = number * 100 * MS
        client.receive(EthernetFrame(PLC, b"\x02" + number.to_bytes(5, "big"), ETHERTYPE_PROFINET, answer), now)
        client.handle_timeout(now)
    ended = [event for event in client.events() if isinstance(event, IdentifyFinished)]
    assert len(ended) == 1
    assert 90 < ended[0].answers < 120
    assert client.next_deadline() is None
