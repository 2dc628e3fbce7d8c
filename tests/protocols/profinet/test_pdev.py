from ipaddress import IPv4Address, IPv4Interface

import pytest
from cm_support import CAPTURE_NAMES, calls
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.profinet.description import SubmoduleDescription
from pnfarm.protocols.profinet.errors import AccessError, RecordError
from pnfarm.protocols.profinet.lldp.agent import LldpPort, LocalPort, LocalSystem
from pnfarm.protocols.profinet.records.directory import Index
from pnfarm.protocols.profinet.records.pdev import InterfaceFacts, PhysicalDevice
from pnfarm.protocols.profinet.records.pdev_checks import CheckFailed, CheckPassed, PortCounters, PortFacts
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import RawBlock, split_blocks
from pnfarm.protocols.profinet.wire.lldp.pdu import NameMode
from pnfarm.protocols.profinet.wire.records import iod
from pnfarm.protocols.profinet.wire.records import pdev as p
from pnfarm.protocols.profinet.wire.records import pdev_port as b
from pnfarm.wire.ethernet import parse_ethernet

SECOND = 1_000_000_000
T0 = 1_000 * SECOND
MAC = bytes.fromhex("020000000001")
SWITCH = bytes.fromhex("02ff00000001")
LONG = 10_000
REMOTE, IMPOSSIBLE = 0x8001, 0x8000


class Bench:
    """A drive with an interface and two ports; the cable is at the first."""

    def __init__(self):
        self.lldp = LldpPort(LocalSystem(MAC, "axis-01"), LocalPort(1, MAC))
        self.ports = {0x8001: PortFacts(), 0x8002: PortFacts(link_up=False)}
        self.facts = InterfaceFacts("axis-01", MAC, IPv4Interface("10.77.0.11/24"), IPv4Address("10.77.0.1"))
        dap = [SubmoduleDescription(0, subslot, 0, 1, 1) for subslot in (1, 0x8000, 0x8001, 0x8002)]
        self.device = PhysicalDevice(
            dap,
            lambda: self.facts,
            lambda subslot: self.ports[subslot],
            lambda subslot: self.lldp.neighbours if subslot == 0x8001 else (),
        )

    def hear(self, name="switch", port=3, now=T0, **fields):
        peer = LldpPort(LocalSystem(SWITCH, name, **fields), LocalPort(port, SWITCH))
        self.lldp.receive(parse_ethernet(peer.to_send(now)[0]), now)
        self.device.evaluate(now)

    def read(self, index, subslot=0x8001, slot=0, api=0, max_length=LONG):
        return self.device.read(None, api, slot, subslot, index, max_length, T0)

    def write(self, index, data, subslot=0x8001, slot=0, api=0, now=T0):
        return self.device.write(None, api, slot, subslot, index, data, now)

    def check(self, *checks, subslot=0x8001, now=T0):
        assert self.write(0x802B, p.PortDataCheck(0, subslot, checks).emit(), subslot, now=now) is None
        return self.device.events()

    def failing(self, subslot=0x8001):
        return {f.key for f in self.device.findings.get((0, subslot), ())}


def peers(port=b"port-003", station=b"switch"):
    return b.CheckPeers((b.ExpectedPeer(port, station),))


# -- reading what is


def test_a_port_shows_its_neighbour():
    bench = Bench()
    bench.hear()
    (value,) = parse_blocks(bench.read(0x802A))
    assert value == p.PortDataReal(
        0, 0x8001, b"port-001", (p.PeerReal(b"port-003", b"switch", 0, SWITCH),), 0x10, 0, 0, 0, 1, 1
    )


def test_a_neighbour_with_the_newer_names_reads_the_same():
    bench = Bench()
    bench.hear(name_mode=NameMode.PORT_AND_STATION, description="SCALANCE")
    (value,) = parse_blocks(bench.read(0x802A))
    assert value.peers == (p.PeerReal(b"port-003", b"switch", 0, SWITCH),)


def test_a_port_without_cable_has_no_peers_and_its_link_is_down():
    (value,) = parse_blocks(Bench().read(0x802A, 0x8002))
    assert (value.own_port_name, value.peers, value.link_state_link) == (b"port-002", (), 2)


def test_the_interface_shows_its_name_and_addresses():
    bench = Bench()
    assert parse_blocks(bench.read(0x8080, 0x8000)) == (
        p.InterfaceDataReal(
            b"axis-01", MAC, IPv4Address("10.77.0.11"), IPv4Address("255.255.255.0"), IPv4Address("10.77.0.1")
        ),
    )
    bench.facts = InterfaceFacts("", MAC)
    (value,) = parse_blocks(bench.read(0x8080, 0x8000))
    assert (value.name, value.ip, value.mask, value.gateway) == (b"", *[IPv4Address(0)] * 3)


def test_counters_are_the_links_and_an_interface_has_their_sum():
    bench = Bench()
    bench.ports[0x8001] = PortFacts(counters=PortCounters(0xFFFF_FFFF, 2, 3, 4, 5, 6))
    bench.ports[0x8002] = PortFacts(counters=PortCounters(2, 2, 2, 2, 2, 2))
    assert parse_blocks(bench.read(0x8072)) == (p.PortStatistic(0xFFFF_FFFF, 2, 3, 4, 5, 6),)
    assert parse_blocks(bench.read(0x8072, 0x8000)) == (p.PortStatistic(1, 4, 5, 6, 7, 8),)


def test_counters_without_a_source_are_marked_and_zero():
    (value,) = parse_blocks(Bench().read(0x8072))
    assert value == p.PortStatistic(status=0x3F, version=0x0101)


def test_real_data_holds_interface_and_ports_with_their_statistic():
    bench = Bench()
    bench.hear()
    found = parse_blocks(bench.read(0xF841, subslot=0))
    assert [(m.api, m.slot, m.subslot) for m in found] == [(0, 0, 0x8000), (0, 0, 0x8001), (0, 0, 0x8002)]
    assert [[b.block_type for b in m.blocks] for m in found] == [[0x0240, 0x0251], [0x020F, 0x0251], [0x020F, 0x0251]]
    assert split_blocks(bench.read(0x802A)) == found[1].blocks[:1]


def test_expected_data_holds_what_was_written_by_submodule():
    bench = Bench()
    assert bench.read(0xF842, subslot=0) == b""
    bench.check(peers())
    assert bench.write(0x8071, p.InterfaceAdjust(1).emit(), 0x8000) is None
    found = parse_blocks(bench.read(0xF842, subslot=0))
    assert [(m.subslot, [b.block_type for b in m.blocks]) for m in found] == [(0x8000, [0x0250]), (0x8001, [0x0200])]


# -- writing what is wanted


def test_what_was_written_is_read_back_octet_for_octet_and_nothing_before():
    bench = Bench()
    data = p.PortDataAdjust(0, 0x8001, (b.AdjustMauType(0x10), b.AdjustDcpBoundary(1))).emit()
    assert bench.read(0x802F) == b""
    assert bench.write(0x802F, data) is None
    assert bench.read(0x802F) == data
    assert bench.read(0x802F, 0x8002) == b""


def test_the_record_of_a_real_controller_is_taken_and_renames_us():
    bench = Bench()
    for name in CAPTURE_NAMES[1:]:
        for call in calls(name):
            if call.opnum == 3 and call.request:
                for write in iod.parse_write_request(call.payload).writes:
                    index, subslot = write.header.index, write.header.subslot
                    if PhysicalDevice.handles(subslot, index):
                        assert bench.write(index, write.data, subslot) is None, hex(index)
                        assert bench.read(index, subslot) == write.data
    assert bench.device.name_mode is NameMode.PORT_AND_STATION
    assert bench.write(0x8071, p.InterfaceAdjust(0).emit(), 0x8000) is None
    assert bench.device.name_mode is NameMode.PORT


def test_a_boundary_mutes_lldp_at_its_port_until_it_is_taken_back():
    bench = Bench()
    for boundary, mute in ((1, {0x8001}), (6, set()), (3, {0x8001})):
        adjust = p.PortDataAdjust(0, 0x8001, (b.AdjustPeerToPeerBoundary(boundary),))
        assert bench.write(0x802F, adjust.emit()) is None
        assert bench.device.mute_ports == mute
    assert bench.write(0x802F, p.PortDataAdjust(0, 0x8001).emit()) is None
    assert bench.device.mute_ports == set()


@pytest.mark.parametrize(
    ("index", "subslot", "error"),
    [
        (0x802A, 0x8003, AccessError.INVALID_SLOT_SUBSLOT),
        (0x802A, 0x8100, AccessError.INVALID_SLOT_SUBSLOT),
        (0x802A, 1, AccessError.INVALID_SLOT_SUBSLOT),
        (0x802A, 0x8000, AccessError.INVALID_INDEX),
        (0x8080, 0x8001, AccessError.INVALID_INDEX),
        (0x8050, 0x8000, AccessError.INVALID_INDEX),
        (0x8054, 0x8001, AccessError.INVALID_INDEX),
    ],
)
def test_a_read_in_the_wrong_place_is_refused(index, subslot, error):
    assert Bench().read(index, subslot) == RecordError(error)


def test_a_read_of_another_api_or_into_too_little_space_is_refused():
    assert Bench().read(0x802A, api=0x3A00) == RecordError(AccessError.INVALID_SLOT_SUBSLOT)
    assert Bench().read(0x802A, max_length=20) == RecordError(AccessError.INVALID_RANGE)


GOOD = p.PortDataCheck(0, 0x8001, (peers(),)).emit()


@pytest.mark.parametrize(
    ("index", "subslot", "data", "error"),
    [
        (0x802B, 0x8001, b"", AccessError.WRITE_LENGTH_ERROR),
        (0x802B, 0x8001, GOOD[:-1], AccessError.WRITE_LENGTH_ERROR),
        (0x802B, 0x8001, GOOD + b"\0", AccessError.WRITE_LENGTH_ERROR),
        (0x802B, 0x8001, GOOD + GOOD, AccessError.WRITE_LENGTH_ERROR),
        (0x802B, 0x8001, RawBlock(0x0200, GOOD[6:-4]).emit(), AccessError.WRITE_LENGTH_ERROR),
        (0x802F, 0x8001, GOOD, AccessError.INVALID_PARAMETER),
        (0x802B, 0x8002, GOOD, AccessError.INVALID_PARAMETER),
        (0x802B, 0x8001, RawBlock(0x0200, GOOD[6:], 0x0200).emit(), AccessError.INVALID_PARAMETER),
        (0x8071, 0x8000, RawBlock(0x0250, bytes(4)).emit(), AccessError.WRITE_LENGTH_ERROR),
        (0x8052, 0x8000, RawBlock(0x0213, bytes(4)).emit(), AccessError.INVALID_PARAMETER),
        (0x802B, 0x8003, GOOD, AccessError.INVALID_SLOT_SUBSLOT),
        (0x802A, 0x8001, GOOD, AccessError.ACCESS_DENIED),
        (0x8080, 0x8000, GOOD, AccessError.ACCESS_DENIED),
        (0xF841, 0, GOOD, AccessError.ACCESS_DENIED),
        (0x802B, 0x8000, GOOD, AccessError.INVALID_INDEX),
        (0x8060, 0x8001, GOOD, AccessError.INVALID_INDEX),
    ],
)
def test_a_wrong_write_is_refused_and_changes_nothing(index, subslot, data, error):
    bench = Bench()
    bench.check(peers())
    assert bench.write(index, data, subslot) == RecordError(error)
    assert bench.read(0x802B) == GOOD
    assert bench.read(0xF842, subslot=0) == p.MultipleBlock(0, 0, 0x8001, split_blocks(GOOD)).emit()


def test_it_handles_the_physical_devices_records_and_no_others():
    handles = PhysicalDevice.handles
    assert all(handles(0x8001, index) for index in (0x802A, 0x802B, 0x802F, 0x8053, 0x8072))
    assert all(handles(0x8000, index) for index in (0x8051, 0x8052, 0x8070, 0x8071, 0x8080, 0x8090))
    assert handles(0, Index.PD_REAL_DATA)
    assert handles(0, Index.PD_EXPECTED_DATA)
    assert not handles(0x8001, 0xAFF0)
    assert not handles(2, 0x802A)
    assert not handles(0x8000, 0xB02E)


@given(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF), st.binary(max_size=120))
def test_no_write_and_no_read_ever_raises(slot, subslot, index, data):
    bench = Bench()
    for place in ((slot, subslot), (0, 0x8000), (0, 0x8001)):
        for what in (index, 0x802B, 0x802F, 0x8071):
            kind = {0x802B: 0x0200, 0x802F: 0x0202, 0x8071: 0x0250}.get(what, index)
            for octets in (data, RawBlock(kind, data).emit(), RawBlock(kind, bytes(4) + data).emit()):
                assert isinstance(bench.write(what, octets, place[1], place[0]), RecordError | None)
                assert isinstance(bench.read(what, place[1], place[0]), RecordError | bytes)


# -- checks


def test_the_expected_neighbour_is_no_finding():
    bench = Bench()
    bench.hear()
    assert bench.check(peers(), b.CheckLinkState(0, 1), b.CheckMauType(0x10), b.CheckMauTypeDifference(1)) == []


def test_the_newer_names_are_expected_as_the_classic_ones():
    bench = Bench()
    bench.hear(name_mode=NameMode.PORT_AND_STATION, description="SCALANCE X208")
    assert bench.check(peers()) == []
    assert bench.check(peers(b"port-003.switch", b"SCALANCE X208")) == []


@pytest.mark.parametrize(
    ("check", "ext"),
    [
        (peers(station=b"other"), {(REMOTE, 0x8000)}),
        (peers(port=b"port-004"), {(REMOTE, 0x8001)}),
        (peers(b"port-004", b"other"), {(REMOTE, 0x8000), (REMOTE, 0x8001)}),
        (b.CheckMauType(0x1E), {(IMPOSSIBLE, 0x8001)}),
        (b.CheckLinkState(0, 2), {(IMPOSSIBLE, 0x8000)}),
    ],
)
def test_what_differs_is_named(check, ext):
    bench = Bench()
    bench.hear()
    events = bench.check(check)
    assert {(e.slot, e.subslot) for e in events} == {(0, 0x8001)}
    assert {(e.error_type, e.ext_error_type) for e in events if isinstance(e, CheckFailed)} == ext
    assert bench.failing() == ext
    assert set(bench.check()) == {CheckPassed(0, 0x8001, *key) for key in ext}
    assert bench.failing() == set()


def test_a_neighbour_of_another_speed_differs():
    bench = Bench()
    peer = LldpPort(LocalSystem(SWITCH, "switch"), LocalPort(3, SWITCH, mau_type=0x1E))
    bench.lldp.receive(parse_ethernet(peer.to_send(T0)[0]), T0)
    bench.check(b.CheckMauTypeDifference(1))
    assert bench.failing() == {(REMOTE, 0x8003)}
    bench.check(b.CheckMauTypeDifference(0))
    assert bench.failing() == set()


def test_a_missing_neighbour_is_missing_after_one_interval():
    bench = Bench()
    assert bench.check(peers()) == []
    assert bench.device.next_deadline() == T0 + 5 * SECOND
    bench.device.handle_timeout(T0 + 5 * SECOND)
    assert bench.device.events() == [CheckFailed(0, 0x8001, REMOTE, 0x8005, "no neighbour is heard")]
    assert bench.device.next_deadline() is None


def test_a_neighbour_that_comes_in_time_was_never_missing():
    bench = Bench()
    bench.check(peers())
    bench.hear(now=T0 + 3 * SECOND)
    bench.device.handle_timeout(T0 + 5 * SECOND)
    assert bench.device.events() == []


def test_a_check_that_is_written_again_keeps_the_missing_peer_reported():
    bench = Bench()
    bench.check(peers())
    bench.device.handle_timeout(T0 + 5 * SECOND)
    bench.device.events()
    assert bench.check(peers(), now=T0 + 60 * SECOND) == []
    assert bench.failing() == {(REMOTE, 0x8005)}


def test_a_neighbour_that_goes_is_missing_at_once_and_passes_when_it_is_back():
    bench = Bench()
    bench.hear()
    bench.check(peers())
    bench.device.handle_timeout(T0 + 5 * SECOND)
    bench.lldp.handle_timeout(T0 + 20 * SECOND)
    bench.device.evaluate(T0 + 20 * SECOND)
    bench.hear(now=T0 + 30 * SECOND)
    assert bench.device.events() == [
        CheckFailed(0, 0x8001, REMOTE, 0x8005, "no neighbour is heard"),
        CheckPassed(0, 0x8001, REMOTE, 0x8005),
    ]


def test_a_pulled_cable_fails_the_link_and_the_neighbour_at_once():
    bench = Bench()
    bench.hear()
    bench.check(peers(), b.CheckLinkState(0, 1), b.CheckMauType(0x10))
    bench.ports[0x8001] = PortFacts(link_up=False)
    bench.device.evaluate(T0 + SECOND)
    assert bench.failing() == {(REMOTE, 0x8005), (IMPOSSIBLE, 0x8000)}


def test_one_right_neighbour_among_several_will_do():
    bench = Bench()
    bench.hear("intruder", 1)
    bench.check(peers())
    assert bench.failing() == {(REMOTE, 0x8000), (REMOTE, 0x8001)}
    bench.hear("switch", 3)
    assert bench.failing() == set()


def test_delays_and_synchronisation_find_nothing():
    assert Bench().check(b.CheckLineDelay(100), b.CheckSyncDifference(3), b.CheckPeers(())) == []
