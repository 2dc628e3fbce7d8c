"""What `pnfarm import --check` finds: one farm in memory is the plant, another farm file is compared with it."""

import asyncio
import random
from ipaddress import IPv4Address, IPv4Interface
from itertools import count

import pytest
from device_cell import Cell, parse
from hypothesis import given, settings
from hypothesis import strategies as st
from slave_cell import SlaveCell

from pnfarm.buses.checking import Difference, StationFacts, compare
from pnfarm.buses.ethernetip.checking import seen
from pnfarm.buses.profibus.checking import SearchOnLine
from pnfarm.buses.profinet.controller import station_reader
from pnfarm.buses.profinet.controller.station_reader import StationReader
from pnfarm.cli.file_stations import stations_of
from pnfarm.errors import ConfigError
from pnfarm.links.base import PortSpec
from pnfarm.protocols.enip.identity_search import IdentitySearch
from pnfarm.protocols.profibus.line_search import LineSearch
from pnfarm.protocols.profibus.wire.telegram import Telegram, Token, parse_telegram
from pnfarm.protocols.profinet.wire.dcp.blocks import DeviceIdBlock, IpParameterBlock, NameBlock
from pnfarm.protocols.profinet.wire.dcp.pdu import (
    SERVICE_IDENTIFY,
    TYPE_REQUEST,
    TYPE_SUCCESS,
    DcpPdu,
    emit_dcp,
    frame_id_of,
    parse_dcp,
)
from pnfarm.protocols.profinet.wire.rpc.pdu import Opnum, PacketType, parse_rpc
from pnfarm.wire.endpoint import Datagram, Services
from pnfarm.wire.ethernet import ETHERTYPE_IPV4, ETHERTYPE_PROFINET, EthernetFrame, emit_ethernet, parse_ethernet
from pnfarm.wire.ipv4 import parse_ipv4
from pnfarm.wire.udp import parse_udp

OWN, MAC = IPv4Interface("10.77.0.200/24"), bytes.fromhex("0200000000aa")
SEEDS = count(1)
ISLAND = "gsdml/GSDML-V2.35-Example-Island-20261127.xml"


def island(name, ip, slots="{1: 16DI, 2: 8DO}"):
    return f"  - {{name: {name}, gsdml: {ISLAND}, access_point: DAP 1, ip: {ip}/24, slots: {slots}}}\n"


def drive(name, ip, more=""):
    return f"  - {{name: {name}, model: akd-profinet, ip: {ip}/24{more}}}\n"


FILE = (
    "drives:\n" + drive("feeder", "10.77.0.11") + drive("lift", "10.77.0.12")
    + "devices:\n" + island("left", "10.77.0.41") + island("right", "10.77.0.42") + island("top", "10.77.0.43")
)  # fmt: skip


def facts(text):
    config = parse("farm: cell\nlink: {kind: memory}\n" + text)
    return [one.facts for one in stations_of(config)]


class Tool:
    """A reader at a port of a plant's world."""

    def __init__(self, world, expected, own=OWN, seconds=1.0):
        self.world, self.frames = world, []
        self.link = world.link()
        (self.port,) = asyncio.run(self.link.open([PortSpec("check", MAC)]))
        self.reader = StationReader(expected, MAC, own, next(SEEDS).to_bytes(4, "big"), seconds)
        self.link.set_receiver(self.receive)

    def receive(self, _port, frame, now):
        self.reader.receive(frame, now)
        self.send()

    def send(self):
        for frame in self.reader.to_send(self.world.now):
            self.frames.append(frame)
            self.link.send(self.port.index, frame)

    def run(self, seconds=30.0):
        self.reader.start(self.world.now)
        self.send()
        end = self.world.now + seconds * 1e9
        while not self.reader.done and self.world.now < end:
            due = self.reader.next_deadline()
            self.world.run(max(1e-3, min(0.02, (due - self.world.now) / 1e9)))
            self.reader.handle_timeout(self.world.now)
            self.send()
        assert self.reader.done
        asyncio.run(self.link.close())
        return self.reader.answer()


def checked(plant, file=FILE):
    """States and differences of stations by name, and the frames that were sent."""
    cell = Cell(plant, controller=None)
    expected = facts(file)
    tool = Tool(cell.world, expected)
    answer = tool.run()
    found = {one.name: one for one in compare(expected, answer.stations, by_name=True)}
    return found, tool.frames


def changes(check):
    return {one.what: (one.expected, one.found) for one in check.differences}


def test_a_plant_that_is_as_the_file_says_has_no_differences():
    found, _ = checked(FILE)
    assert {name: (one.state, one.remarks) for name, one in found.items()} == dict.fromkeys(
        ("feeder", "lift", "left", "right", "top"), ("equal", ())
    )


def test_each_difference_of_a_plant_is_found():
    plant = (
        "drives:\n" + drive("feeder", "10.77.0.11", ", identity: {software_version: V7.8.9}")
        + drive("lift", "10.77.0.19") + "devices:\n" + island("links", "10.77.0.41")
        + island("right", "10.77.0.42", "{1: 16DI, 2: EX-AI-4}") + island("new", "10.77.0.77")
    )  # fmt: skip
    found, _ = checked(plant)
    assert {name: one.state for name, one in found.items()} == {
        "feeder": "differs", "lift": "differs", "left": "differs", "right": "differs", "top": "missing", "new": "extra",
    }  # fmt: skip
    assert changes(found["feeder"])["firmware"][1] == "V7.8.9"
    assert changes(found["lift"]) == {"address": ("10.77.0.12", "10.77.0.19")}
    assert changes(found["left"]) == {"name": ("left", "links")}
    # of a slot with another module only that is said
    assert changes(found["right"]).keys() == {"slot 2"}
    wanted, there = changes(found["right"])["slot 2"]
    assert wanted.startswith("0x")
    assert wanted != there


def test_a_module_that_nobody_plugged_and_one_too_many_are_found():
    plant = FILE.replace("{1: 16DI, 2: 8DO}", "{1: 16DI}", 1).replace(
        "10.77.0.42/24, slots: {1: 16DI, 2: 8DO}", "10.77.0.42/24, slots: {1: 16DI, 2: 8DO, 3: EX-AI-4}"
    )
    found, _ = checked(plant)
    assert changes(found["left"])["slot 2"][1] == "nothing"
    assert changes(found["right"])["slot 3"][0] == "nothing"


def test_a_drive_whose_telegram_the_file_leaves_open_may_have_any_and_one_with_a_telegram_that_alone():
    plant = "drives:\n" + drive("feeder", "10.77.0.11", ", telegram: 9")
    found, _ = checked(plant, "drives:\n" + drive("feeder", "10.77.0.11"))
    assert found["feeder"].state == "equal"
    found, _ = checked(plant, "drives:\n" + drive("feeder", "10.77.0.11", ", telegram: 1"))
    assert "slot 1" in " ".join(changes(found["feeder"]))


def test_nothing_but_searches_and_reads_leaves():
    _, frames = checked(FILE)
    opnums = []
    for data in frames:
        frame = parse_ethernet(data)
        if frame.ethertype == ETHERTYPE_PROFINET:
            pdu = parse_dcp(frame.payload)
            assert (pdu.service_id, pdu.service_type) == (SERVICE_IDENTIFY, TYPE_REQUEST)
        elif frame.ethertype == ETHERTYPE_IPV4:
            packet = parse_ipv4(frame.payload)
            pdu = parse_rpc(parse_udp(packet.payload).data)
            if pdu.packet_type == PacketType.REQUEST:
                opnums.append(pdu.opnum)
    # I&M0, APIData, and each API of each station
    assert set(opnums) == {Opnum.READ_IMPLICIT}
    assert len(opnums) >= 3 * 5


def test_a_plant_whose_controller_is_at_work_is_compared_without_disturbing_it():
    cell = Cell(FILE)
    cell.connect()
    expected = facts(FILE)
    found = list(compare(expected, Tool(cell.world, expected).run().stations, by_name=True))
    assert {one.state for one in found} == {"equal"}
    assert cell.plc.all_connected
    assert {(row["connects"], row["losses"]) for row in cell.plc.snapshot()} == {(1, 0)}


def test_a_station_that_answers_no_reads_is_not_called_equal_and_the_others_are_read():
    cell = Cell(FILE, controller=None)
    cell.device("left").rpc.receive = lambda *_args: None
    expected = facts(FILE)
    begin = cell.world.now
    answer = Tool(cell.world, expected).run()
    found = {one.name: one for one in compare(expected, answer.stations, by_name=True)}
    assert found["left"].state == "unread"
    assert "in time" in found["left"].remarks[0] or "cannot be read" in found["left"].remarks[0]
    assert {found[name].state for name in ("feeder", "lift", "right", "top")} == {"equal"}
    assert cell.world.now - begin < 12e9


def test_an_interface_without_an_address_compares_names_and_says_that_nothing_was_read():
    cell = Cell(FILE, controller=None)
    expected = facts(FILE)
    answer = Tool(cell.world, expected, own=None).run()
    found = list(compare(expected, answer.stations, by_name=True))
    assert {one.state for one in found} == {"unread"}
    assert "no IPv4 address" in found[0].remarks[0]


def test_malformed_answers_and_a_flood_of_stations_end_with_the_search(monkeypatch):
    monkeypatch.setattr(station_reader, "MOST_STATIONS", 50)
    cell = Cell(FILE, controller=None)
    tool = Tool(cell.world, facts(FILE))
    flooded = []

    def flood(_port, frame, now):
        tool.reader.receive(frame, now)
        fields = parse_ethernet(frame)
        if fields.ethertype == ETHERTYPE_PROFINET and fields.destination == MAC and not flooded:
            for number in range(1, 200):
                source = (0x020000100000 + number).to_bytes(6, "big")
                again = emit_ethernet(EthernetFrame(MAC, source, fields.ethertype, fields.payload))
                flooded.append(again)
                tool.reader.receive(again[:-number], now)
                tool.reader.receive(again, now)
        tool.send()

    tool.link.set_receiver(flood)
    answer = tool.run()
    assert len(answer.stations) == 50
    assert "more than 50 stations answer" in answer.remarks[0]


@pytest.mark.parametrize("seed", range(4))
def test_answers_with_wrong_octets_are_differences_or_remarks_and_never_an_error(seed):
    rng = random.Random(seed)
    cell = Cell(FILE, controller=None)
    expected = facts(FILE)
    tool = Tool(cell.world, expected)

    def damaged(port, frame, now):
        octets = bytearray(frame)
        while rng.random() < 0.6:
            octets[rng.randrange(14, len(octets))] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))
        tool.receive(
            port, bytes(octets[: rng.choice((len(octets), len(octets), rng.randrange(15, len(octets) + 1)))]), now
        )

    tool.link.set_receiver(damaged)
    answer = tool.run(60.0)
    for one in answer.stations:
        assert one.name.isprintable()
        assert all(text.isprintable() for text in one.versions.values())
    assert len(list(compare(expected, answer.stations, by_name=True))) >= len(expected)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.binary(max_size=80), max_size=20))
def test_any_octets_of_other_stations_leave_the_search_as_it_is(frames):
    reader = StationReader([StationFacts("a", "10.77.0.1")], MAC, OWN, b"seed", 1.0)
    reader.start(0)
    for place, octets in enumerate(frames):
        reader.receive(MAC + bytes.fromhex("020000000001 8892 feff") + octets, place)
        reader.receive(octets, place)
    reader.to_send(10)
    reader.handle_timeout(10**12)
    reader.handle_timeout(2 * 10**12)
    assert reader.done


def test_ten_thousand_stations_are_compared_in_a_moment():
    names = [f"station-{number}" for number in range(10_000)]
    expected = [StationFacts(name, f"10.1.{n >> 8}.{n & 255}", {"vendor": "1"}) for n, name in enumerate(names)]
    found = [StationFacts(one.name + "x" * (place == 7), one.address, {"vendor": "1"})
             for place, one in enumerate(reversed(expected))]  # fmt: skip
    checks = list(compare(expected, found, by_name=True))
    assert len(checks) == 10_000
    (renamed,) = [one for one in checks if one.state != "equal"]
    assert renamed.differences == (Difference("name", "name", "station-9992", "station-9992x"),)


def answers(request, count, address="10.1.{}.{}"):
    """What so many stations answer to a search: the octets of an example with other names and addresses."""
    asked = parse_dcp(parse_ethernet(request).payload)
    frame = frame_id_of(SERVICE_IDENTIFY, TYPE_SUCCESS)
    for number in range(count):
        ip = IPv4Address(address.format(number >> 8, number & 255))
        blocks = (
            NameBlock(f"station-{number}"), DeviceIdBlock(0x0105, 1),
            IpParameterBlock(ip, IPv4Address("255.255.0.0"), IPv4Address(0)),
        )  # fmt: skip
        pdu = DcpPdu(frame, SERVICE_IDENTIFY, TYPE_SUCCESS, asked.xid, blocks)
        source = (0x020000200000 + number).to_bytes(6, "big")
        yield emit_ethernet(EthernetFrame(MAC, source, ETHERTYPE_PROFINET, emit_dcp(pdu)))


def test_thousands_of_stations_that_answer_no_reads_end_in_bounded_time():
    expected = [StationFacts(f"station-{n}", f"10.1.{n >> 8}.{n & 255}", {"vendor": "0x0105"}) for n in range(2000)]
    reader = StationReader(expected, MAC, IPv4Interface("10.1.255.1/16"), b"seed", 1.0)
    reader.start(0)
    (request,) = reader.to_send(0)
    for frame in answers(request, 2000):
        reader.receive(frame, 1)
    assert reader.to_send(2) == []
    now = most = 0
    while not reader.done:
        now = max(now + 1_000_000, reader.next_deadline())
        reader.handle_timeout(now)
        most = max(most, len(reader.to_send(now)))
    assert now < 140e9
    assert most <= 2 * station_reader.AT_ONCE
    found = list(compare(expected, reader.answer().stations, by_name=True))
    assert {one.state for one in found} == {"unread"}
    assert any("too many stations" in remark for one in found for remark in one.remarks)


def test_a_name_that_is_given_twice_is_told_and_the_address_says_which_is_meant():
    expected = [StationFacts("a", "10.0.0.1")]
    found = [StationFacts("a", "10.0.0.9"), StationFacts("a", "10.0.0.1")]
    same, other = compare(expected, found, by_name=True)
    assert (same.state, other.state, other.address) == ("equal", "extra", "10.0.0.9")
    assert other.remarks == ("the name a is given twice",)


# -- EtherNet/IP


CIP = "drives:\n  - {name: 'cip-{n}', count: 3, model: akd-ethernetip, ip: 10.77.0.51/24%s}\n"


def identities(text):
    """What the devices of a farm answer to ListIdentity."""
    cell = Cell(text, controller=None)
    cell.world.run(3.0)
    link = cell.world.link()
    (port,) = asyncio.run(link.open([PortSpec("check", MAC)]))
    search = IdentitySearch()
    link.sockets.set_user(lambda event, _now: search.datagram(event.data, event.peer))
    link.sockets.serve(port.index, Services(OWN, datagrams=(50_000,)))
    everyone = IPv4Address("255.255.255.255"), 44818
    link.sockets.act(port.index, Datagram(50_000, everyone, search.question()))
    cell.world.run(search.duration_ns / 1e9)
    return search


def test_a_device_on_ethernetip_is_known_by_its_address_and_its_identity_is_compared():
    plant = CIP % ", identity: {revision: '1.99'}"
    plant += "  - {name: other, model: akd-ethernetip, ip: 10.77.0.77/24}\n"
    found = list(
        compare(facts(CIP.replace("count: 3", "count: 4") % ""), seen(identities(plant)).stations, by_name=False)
    )
    states = {one.address: one.state for one in found}
    assert states == {
        "10.77.0.51": "differs", "10.77.0.52": "differs", "10.77.0.53": "differs", "10.77.0.54": "missing",
        "10.77.0.77": "extra",
    }  # fmt: skip
    assert [one.what for one in found[0].differences] == ["minor revision"]
    assert found[0].differences[0].found == "99"
    same = compare(facts(CIP % ""), seen(identities(CIP % "")).stations, by_name=False)
    assert {one.state for one in same} == {"equal"}


# -- PROFIBUS


ISLAND_SLAVE = "  - {name: island, gsd: gsd/EXMP1D01.gsd, address: 5, slots: {1: 16DI}}\n"
SLAVES = "devices:\n" + ISLAND_SLAVE
VALVE = "  - {name: valve, gsd: gsd/EXMP1D02.gsd, address: 9}\n"


def searched(cell, expected, seconds=30.0):
    """The answer, and the telegrams that were sent."""
    link = cell.world.link(baud=1_500_000)
    (port,) = asyncio.run(link.open([PortSpec("check", b"", line="profibus", link_type=257)]))
    sent = []
    original = link.send
    link.send = lambda index, octets: (sent.append(parse_telegram(octets)), original(index, octets))
    search = SearchOnLine(link, port, LineSearch(2, 1_500_000, [int(one.address) for one in expected], heard_ns=10**9))
    search.start(cell.world.now)
    end = cell.world.now + seconds * 1e9
    while not search.done and cell.world.now < end:
        cell.world.run(0.005)
        search.service(cell.world.now)
    assert search.done
    return search.answer(), sent


def test_slaves_of_a_line_are_found_by_their_addresses_and_only_diagnoses_are_read():
    cell = SlaveCell(SLAVES + VALVE, controller=None)
    expected = facts(
        "devices:\n" + VALVE.replace("address: 9", "address: 5") + ISLAND_SLAVE.replace("address: 5", "address: 7")
    )
    answer, sent = searched(cell, expected)
    found = {one.address: one for one in compare(expected, answer.stations, by_name=False)}
    assert {address: one.state for address, one in found.items()} == {"5": "differs", "7": "missing", "9": "extra"}
    assert changes(found["5"]).keys() == {"ident"}
    assert {one.dsap for one in sent} == {60}
    assert not any(one.data for one in sent)


def test_a_line_whose_master_is_at_work_is_only_listened_to():
    cell = SlaveCell(SLAVES)
    cell.connect()
    answer, sent = searched(cell, facts(SLAVES))
    assert sent == []
    assert [one.address for one in answer.stations] == ["5"]
    assert "is active on this line" in answer.remarks[0]


def test_a_silent_line_ends_and_a_master_that_appears_later_stops_the_requests():
    search = LineSearch(2, 1_500_000)
    now, asked = 0, 0
    search.start(now)
    while not search.done:
        now = search.next_deadline()
        search.handle_timeout(now)
        octets = search.to_send()
        if octets is not None:
            asked += 1
            search.sent(len(octets), now)
        if asked == 20:
            search.receive(Token(1, 3), now)
            asked += 100
    assert asked == 120
    assert search.master == 3
    assert now < 10e9


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 127), st.integers(0, 127), st.integers(0, 255), st.binary(max_size=40))))
def test_any_telegrams_leave_the_search_of_a_line_with_an_end(telegrams):
    search = LineSearch(2, 1_500_000)
    search.start(0)
    for destination, source, function, data in telegrams:
        search.receive(Telegram(destination, source, function, 62, 60, data), 1)
    now = 0
    for _ in range(1000):
        if search.done:
            break
        now = search.next_deadline()
        search.handle_timeout(now)
        if (octets := search.to_send()) is not None:
            search.sent(len(octets), now)
    assert search.done
    assert set(search.found) <= set(range(127))


def test_an_own_address_that_a_slave_of_the_file_has_is_refused():
    from pnfarm.buses.registry import checking

    with pytest.raises(ConfigError, match="choose another one"):
        checking()["profibus"].checked_line(None, None, facts(SLAVES), 5, 1_500_000)
