"""SNMP on a whole drive: over its own IP host, with its counters, and with a memory that outlasts the power."""

from dataclasses import replace
from ipaddress import IPv4Address

import pytest
from virtual_line import VirtualLine

from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.protocols.profinet.lldp.agent import LldpPort, LocalPort, LocalSystem
from pnfarm.protocols.profinet.wire.dcp.blocks import UnknownBlock
from pnfarm.protocols.profinet.wire.dcp.pdu import SERVICE_SET, TYPE_REQUEST, DcpPdu, emit_dcp, frame_id_of
from pnfarm.protocols.profinet.wire.lldp.pdu import parse_lldp
from pnfarm.protocols.profinet.wire.lldp.tlvs import ManagementAddress, PortDescription, SystemDescription
from pnfarm.protocols.profinet.wire.records.pdev import InterfaceAdjust, PortDataAdjust
from pnfarm.protocols.profinet.wire.records.pdev_port import AdjustPeerToPeerBoundary
from pnfarm.protocols.profinet.wire.snmp.message import (
    GET,
    GET_NEXT,
    SET,
    SNMP_PORT,
    VERSION_2C,
    Pdu,
    SnmpMessage,
    VarBind,
    emit_snmp,
    octets,
    parse_snmp,
)
from pnfarm.wire.ethernet import (
    ETHERTYPE_IPV4,
    ETHERTYPE_LLDP,
    ETHERTYPE_PROFINET,
    EthernetFrame,
    emit_ethernet,
    parse_ethernet,
)
from pnfarm.wire.ipv4 import Ipv4Packet, emit_ipv4, parse_ipv4
from pnfarm.wire.udp import UdpDatagram, emit_udp, parse_udp

DRIVE, TOOL = IPv4Address("10.77.0.11"), IPv4Address("10.77.1.77")
TOOL_MAC = bytes.fromhex("0200000000aa")
SYSTEM = (1, 3, 6, 1, 2, 1, 1)
UPTIME, CONTACT, NAME, LOCATION = ((*SYSTEM, arc, 0) for arc in (3, 4, 5, 6))
IF_ENTRY = (1, 3, 6, 1, 2, 1, 2, 2, 1)


class Tool:
    """A manager beside the controller: its frames go to the first drive of a line, whose answers it gets."""

    def __init__(self, line):
        self.line = line
        self.station = line.farm.axes[0]

    def frame(self, frame):
        """Frames that the drive sends because of this one."""
        self.line.farm.receive(self.station.port.index, frame, self.line.world.now)

    def ask(self, tag, *varbinds, community=b"public", destination=None):
        mac = self.station.port.mac
        request = emit_snmp(SnmpMessage(VERSION_2C, community, Pdu(tag, 1, varbinds=varbinds)))
        packet = Ipv4Packet(TOOL, DRIVE, 17, emit_udp(UdpDatagram(4000, SNMP_PORT, request), TOOL, DRIVE))
        said = []
        send = self.line.farm.link.send
        self.line.farm.link.send = lambda port, frame: said.append(frame)
        try:
            self.frame(emit_ethernet(EthernetFrame(mac, TOOL_MAC, ETHERTYPE_IPV4, emit_ipv4(packet))))
        finally:
            self.line.farm.link.send = send
        answers = [parse_ethernet(frame) for frame in said]
        answers = [frame for frame in answers if frame.ethertype == ETHERTYPE_IPV4]
        if not answers:
            return None
        (frame,) = answers
        datagram = parse_udp(parse_ipv4(frame.payload).payload)
        assert (frame.destination, datagram.source_port, datagram.destination_port) == (TOOL_MAC, SNMP_PORT, 4000)
        return parse_snmp(datagram.data).pdu

    def get(self, *names):
        return [varbind.value.content for varbind in self.ask(GET, *map(VarBind, names)).varbinds]

    def set(self, name, text):
        return self.ask(SET, VarBind(name, octets(text)), community=b"private").error_status


@pytest.fixture
def line():
    made = VirtualLine(1, controller=False)
    made.run(0.1)
    return made


def test_a_drive_without_power_says_nothing_and_counts_its_time_from_the_next_power_on(line):
    tool = Tool(line)
    line.run(10.0)
    (before,) = tool.get(UPTIME)
    assert 1000 <= before <= 1020
    tool.station.station.power_off(line.world.now)
    assert tool.ask(GET, VarBind(UPTIME)) is None
    line.run(5.0)
    tool.station.station.power_on(line.world.now)
    assert tool.get(UPTIME) == [0]
    line.run(1.0)
    assert tool.get(UPTIME) == [100]


def test_a_text_outlasts_the_power_and_the_farm_and_changes_no_name_of_a_station():
    memory = VolatileMemory()
    line = VirtualLine(1, controller=False, memory=memory)
    tool = Tool(line)
    assert [tool.set(CONTACT, b"hall 5"), tool.set(NAME, b"press"), tool.set(LOCATION, b"left")] == [0, 0, 0]
    assert tool.get(CONTACT, NAME, LOCATION) == [b"hall 5", b"press", b"left"]
    tool.station.station.power_cycle(line.world.now)
    assert tool.get(CONTACT, NAME, LOCATION) == [b"hall 5", b"press", b"left"]
    assert tool.station.device.name == "axis-01"
    assert line.events("axis-01").count("system text set") == 3
    again = Tool(VirtualLine(1, controller=False, memory=memory))
    assert again.get(CONTACT, NAME, LOCATION) == [b"hall 5", b"press", b"left"]


def test_a_reset_to_factory_forgets_the_texts(line):
    tool = Tool(line)
    tool.set(CONTACT, b"hall 5")
    tool.set(NAME, b"press")
    mac = tool.station.port.mac
    # ResetToFactory, mode 2 (communication parameters) keeps no text either
    block = UnknownBlock(5, 6, (2 << 1).to_bytes(2, "big"), None)
    pdu = DcpPdu(frame_id_of(SERVICE_SET, TYPE_REQUEST), SERVICE_SET, TYPE_REQUEST, 1, (block,))
    tool.frame(emit_ethernet(EthernetFrame(mac, TOOL_MAC, ETHERTYPE_PROFINET, emit_dcp(pdu))))
    assert "factory reset" in line.events("axis-01")
    assert tool.station.device.snmp_texts == {}
    assert "snmp" not in line.memory.load("axis-01")


def test_cyclic_frames_count_before_during_and_after_a_connection():
    line = VirtualLine(1)
    tool = Tool(line)
    columns = [(*IF_ENTRY, arc, 1) for arc in (10, 11, 16, 17)]
    line.connect()
    line.run(1.0)
    first = tool.get(*columns)
    # 16 ms: 62 or 63 frames each way in a second, of 64 octets (with FCS) each, and those of the start-up
    assert all(count > 60 for count in (first[1], first[3]))
    line.run(10.0)
    second = tool.get(*columns)
    grown = [b - a for a, b in zip(first, second, strict=True)]
    assert 620 <= grown[1] <= 632
    assert 620 <= grown[3] <= 632
    assert 64 * 620 <= grown[0] <= 70 * 635
    assert 64 * 620 <= grown[2] <= 70 * 635
    line.plc.release(line.world.now)
    line.run(1.0)
    third = tool.get(*columns)
    assert all(b >= a for a, b in zip(second, third, strict=True)), "a counter went back when the connection closed"
    line.run(5.0)


def test_counters_start_again_at_power_on():
    line = VirtualLine(1)
    tool = Tool(line)
    line.connect()
    line.run(1.0)
    columns = [(*IF_ENTRY, arc, 1) for arc in (10, 11, 13, 14, 16, 17)]
    assert tool.get(*columns)[0] > 5000
    tool.station.station.power_cycle(line.world.now)
    octets_in, frames_in, discards, errors, octets_out, _ = tool.get(*columns)
    # nothing but this request has come, and the announcement of the address has gone
    assert (frames_in, discards, errors) == (1, 0, 0)
    assert octets_in < 200
    assert octets_out <= 64


def test_what_was_dropped_is_shown_by_its_kind(line):
    tool = Tool(line)
    mac = tool.station.port.mac
    names = [(*IF_ENTRY, arc, 1) for arc in (13, 14, 15)]
    assert tool.get(*names) == [0, 0, 0]
    tool.frame(b"")
    tool.frame(mac + TOOL_MAC)  # cut within its header
    tool.frame(emit_ethernet(EthernetFrame(mac, TOOL_MAC, 0x86DD, bytes(46))))
    tool.frame(emit_ethernet(EthernetFrame(TOOL_MAC, mac, 0x86DD, bytes(46))))  # for somebody else
    closed = Ipv4Packet(TOOL, DRIVE, 17, emit_udp(UdpDatagram(4000, 9, b""), TOOL, DRIVE))
    tool.frame(emit_ethernet(EthernetFrame(mac, TOOL_MAC, ETHERTYPE_IPV4, emit_ipv4(closed))))
    assert tool.get(*names) == [1, 2, 1]


def test_the_interface_is_behind_the_ports_and_has_the_address(line):
    tool = Tool(line)
    (number,) = tool.get((1, 3, 6, 1, 2, 1, 2, 1, 0))
    assert number == 2
    assert tool.get((*IF_ENTRY, 2, 1), (*IF_ENTRY, 2, 2)) == [b"Port X11", b"Interface"]
    address = (1, 0, 8802, 1, 1, 2, 1, 3, 8, 1)
    (first,) = tool.ask(GET_NEXT, VarBind(address)).varbinds
    assert first.name == (*address, 3, 1, 4, *DRIVE.packed)
    assert tool.get((*address, 5, 1, 4, *DRIVE.packed)) == [2]


@pytest.mark.parametrize("name", ["akd-profinet", "moog-msd"])
def test_lldp_mib_and_frames_of_a_drive_agree(name):
    line = VirtualLine(1, controller=False, model=name)
    sent = []
    line.world.switch.attach(TOOL_MAC, lambda _port, frame, _now: sent.append(parse_ethernet(frame)))
    line.run(6.0)
    pdu = parse_lldp(next(frame.payload for frame in sent if frame.ethertype == ETHERTYPE_LLDP))
    tlvs = {type(tlv): tlv for tlv in pdu.tlvs}
    management = tlvs[ManagementAddress]
    local = (1, 0, 8802, 1, 1, 2, 1, 3)
    own = (management.subtype, len(management.address), *management.address)
    tool = Tool(line)
    columns = [(*local, 2, 0), (*local, 4, 0), (*local, 7, 1, 3, 1), (*local, 7, 1, 4, 1)]
    said = [pdu.chassis.value, tlvs[SystemDescription].value, pdu.port.value, tlvs[PortDescription].value]
    assert tool.get(*columns) == said
    columns = [(*local, 8, 1, column, *own) for column in (4, 5)]
    assert tool.get(*columns) == [management.interface_subtype, management.interface_number]
    # and the number is that of the interface which has the address
    assert tool.get((*IF_ENTRY, 2, management.interface_number)) == [b"Interface"]


@pytest.mark.parametrize(("enabled", "status"), [(True, 3), (False, 4)])
def test_a_station_says_whether_its_port_sends_lldp(line, enabled, status):
    line.farm.axes[0].device.neighbours.enabled = enabled
    assert Tool(line).get((1, 0, 8802, 1, 1, 2, 1, 1, 6, 1, 2, 1)) == [status]


@pytest.mark.parametrize(("newer", "tail"), [(0, b""), (1, b".axis-01")])
def test_every_port_has_the_name_that_the_controllers_choice_gives_it(newer, tail):
    line = VirtualLine(1, controller=False, model="moog-msd")
    pdev, now = line.farm.axes[0].device.neighbours.pdev, line.world.now
    assert pdev.write(None, 0, 0, 0x8000, 0x8071, InterfaceAdjust(newer).emit(), now) is None
    port_id = (1, 0, 8802, 1, 1, 2, 1, 3, 7, 1, 3)
    assert Tool(line).get((*port_id, 1), (*port_id, 2)) == [b"port-001" + tail, b"port-002" + tail]


def test_a_port_that_the_controller_muted_only_receives_lldp(line):
    pdev, now = line.farm.axes[0].device.neighbours.pdev, line.world.now
    adjust = PortDataAdjust(0, 0x8001, (AdjustPeerToPeerBoundary(1),))
    assert pdev.write(None, 0, 0, 0x8001, 0x802F, adjust.emit(), now) is None
    assert Tool(line).get((1, 0, 8802, 1, 1, 2, 1, 1, 6, 1, 2, 1)) == [2]


def test_a_manager_reads_the_neighbour_on_the_drives_port():
    line = VirtualLine(1, limits="lax", cycle="4ms")
    line.run(6)
    tool = Tool(line)
    remote = (1, 0, 8802, 1, 1, 2, 1, 4, 1, 1)
    found = {}
    for column in (5, 7, 9):
        (row,) = tool.ask(GET_NEXT, VarBind((*remote, column))).varbinds
        assert row.name[: len(remote) + 1] == (*remote, column)
        found[column] = row.value.content
    assert (found[5], found[7], found[9]) == (b"plc", b"port-001", b"plc")


def test_lldps_statistics_count_neighbours_that_come_change_and_go():
    line = VirtualLine(1)
    line.run(6.0)
    tool = Tool(line)
    statistics, port = (1, 0, 8802, 1, 1, 2, 1, 2), tool.station.device.neighbours.lldp.port.number
    last, inserts, deletes, drops, ageouts = ((*statistics, arc, 0) for arc in range(1, 6))
    frames, aged = ((*statistics, 7, 1, column, port) for column in (4, 7))

    def rows():
        row = (1, 0, 8802, 1, 1, 2, 1, 4, 1, 1, 9)
        found = tool.ask(GET_NEXT, VarBind(row)).varbinds[0].name
        return [found[len(row)]] if found[: len(row)] == row else []

    came, *counts = tool.get(last, inserts, deletes, drops, ageouts)
    assert (counts, rows()) == ([1, 0, 0, 0], [came])
    lldp = line.plc.lldp
    lldp.update(replace(lldp.system, description="another"), line.world.now)
    line.run(6.0)
    changed, *counts = tool.get(last, inserts, deletes, drops, ageouts)
    assert (counts, rows()) == ([1, 0, 0, 0], [changed])
    assert changed > came
    for number in range(10):
        own = bytes([2, 0, 0, 0, 9, number])
        other = LldpPort(LocalSystem(own, f"other-{number}"), LocalPort(1, own))
        for frame in other.to_send(line.world.now):
            tool.frame(frame)
    heard = tool.station.device.neighbours.lldp
    assert tool.get(inserts, deletes, drops, frames) == [8, 0, 3, heard.received]
    lldp.send_frames(False, line.world.now)
    line.run(30.0)
    assert tool.get(deletes, ageouts, aged) == [8, 8, 8]


def test_dropped_messages_are_among_the_stations_discards(line):
    tool = Tool(line)
    assert tool.ask(GET, VarBind(UPTIME), community=b"guess") is None
    assert tool.station.device.discards()["bad-community"] == 1
