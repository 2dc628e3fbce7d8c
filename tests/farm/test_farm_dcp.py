"""Name, address, lamp and factory settings of drives, as DCP tools, neighbours and memory see them."""

import asyncio
from ipaddress import IPv4Address, IPv4Interface

import pytest
from dcp_tool import Tool, address
from virtual_line import VirtualLine

from pnfarm.buses.profinet.device.memory.factory_reset import MEMORY_AFTER_RESET, clear_memory
from pnfarm.controller import line as controller_line
from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.protocols.ip.claim import RECHECK_NS, SPREAD_NS, WAIT_NS
from pnfarm.protocols.profinet.cm.device.events import RecordWritten
from pnfarm.protocols.profinet.dcp.client import HelloReceived
from pnfarm.protocols.profinet.dcp.rules import RESET_CLEARS, HelloMode, Stored
from pnfarm.protocols.profinet.records.directory import Index
from pnfarm.protocols.profinet.wire.dcp.blocks import (
    BlockError,
    FullIpSuiteBlock,
    IpParameterBlock,
    NameBlock,
    ResetMode,
    ResetToFactoryBlock,
    SignalBlock,
)
from pnfarm.protocols.profinet.wire.records.fsu import FsHello, FsuDataAdjust
from pnfarm.protocols.profinet.wire.records.pdev import InterfaceAdjust
from pnfarm.station.event_log import EventLog

FILE = """
farm: virtual
link: {{kind: memory}}
drives:
  - {{name: 'axis-{{n:02}}', count: {count}, model: akd-profinet, ip: 10.77.0.11/23, hello: {hello}}}
"""
RECHECK_SECONDS = (RECHECK_NS + SPREAD_NS + WAIT_NS) / 1e9
NOBODY = IPv4Address(0)


class Farm:
    """Drives without a controller, unless ``more`` of the farm file has one."""

    def __init__(self, count=1, *, hello=False, memory=None, more=""):
        self.memory = memory or VolatileMemory()
        self.log = EventLog(quiet=True)
        config = parse_farm(FILE.format(count=count, hello=str(hello).lower()) + more)
        made = asyncio.run(
            controller_line.VirtualLine.create(config, memory=self.memory, log=self.log, plc_log=EventLog(quiet=True))
        )
        self.world, self.farm, self.farm_link = made.world, made.farm, made.farm_link
        if more:
            self.plc = made.plc

    def run(self, seconds):
        self.world.run(seconds)

    def events(self, name="axis-01"):
        return [entry.event for entry in self.log.entries(name)]


def shown(line, drive=0):
    return drive_snapshot(line.farm, line.farm.axes[drive], line.world.now)


# -- while a connection is open ----------------------------------------------------------------------------------------


def test_another_name_ends_the_connection_with_its_own_error():
    line = VirtualLine()
    line.connect()
    tool = Tool(line)
    assert tool.set(NameBlock("press-7", 1)) == [0]
    station = line.farm.axes[0]
    assert not station.device.ars
    assert (station.device.name, station.device.cm.station_name) == ("press-7", "press-7")
    (reason,) = station.device.losses_in_words()
    assert "DCP changed the station name" in reason
    assert line.plc.sessions[0].measures.losses == 1
    assert "DCP changed the station name" in line.plc.sessions[0].measures.last_reason


def test_another_address_is_refused_until_the_connection_is_over():
    line = VirtualLine()
    line.connect()
    tool = Tool(line)
    assert tool.set(address("10.77.0.99"), NameBlock("axis-01", 1), SignalBlock()) == [6, 0, 0]
    assert line.farm.axes[0].device.ars
    line.plc.release(line.world.now)
    line.run(0.1)
    assert tool.set(address("10.77.0.99")) == [0]
    assert str(line.farm.axes[0].device.ip.address) == "10.77.0.99/23"


def test_taking_the_address_away_ends_the_connection():
    line = VirtualLine()
    line.connect()
    assert Tool(line).set(IpParameterBlock(NOBODY, NOBODY, NOBODY, 1)) == [0]
    station = line.farm.axes[0]
    assert not station.device.ars
    (reason,) = station.device.losses_in_words()
    assert "IP suite changed" in reason


# -- the lamp ----------------------------------------------------------------------------------------------------------


def test_the_lamp_flashes_for_three_seconds_and_the_events_say_so():
    line = Farm()
    tool = Tool(line)
    assert not shown(line)["signalling"]
    assert tool.set(SignalBlock()) == [0]
    line.run(1.0)
    assert shown(line)["signalling"]
    assert shown(line)["signalled_seconds_ago"] == pytest.approx(1.02)
    line.run(2.5)
    assert not shown(line)["signalling"]
    assert shown(line)["signalled_seconds_ago"] == pytest.approx(3.52)
    assert [event for event in line.events() if "signal" in event] == ["signal begins", "signal ends"]


def test_the_lamp_goes_out_in_time_also_when_a_frame_comes_at_that_very_moment():
    line = Farm()
    tool = Tool(line)
    tool.set(SignalBlock())
    station = line.farm.axes[0]
    due = station.device.dcp.next_deadline()
    tool.dcp.identify(now=due)
    (question,) = tool.dcp.to_send(due)
    line.farm.receive(station.port.index, question, due)
    assert line.events()[-1] == "signal ends"


def test_a_drive_that_loses_its_supply_stops_flashing():
    line = Farm()
    Tool(line).set(SignalBlock())
    line.farm.axes[0].station.power_off(line.world.now)
    line.run(5.0)
    assert not shown(line)["signalling"]
    assert line.events()[-2:] == ["signal ends", "power off"]


# -- factory settings --------------------------------------------------------------------------------------------------

#: PDInterfaceAdjust: LLDP names of the newer kind.
ADJUST = InterfaceAdjust(1).emit()
FULL = {
    "name": "press-7", "ip": "10.77.0.99/23", "gateway": "", "dns": ["10.77.0.53", "0.0.0.0", "0.0.0.0", "0.0.0.0"],
    "drive": {"2497": 4711}, "im": {"1": b"tag"}, "pdev": {"8090": b"x"}, "hello": [1, 30, 3, 0], "snmp": {"name": "x"},
}  # fmt: skip
GONE = {
    Stored.APPLICATION: {"drive"},
    Stored.IDENTIFICATION: {"im"},
    Stored.COMMUNICATION: {"dns"},
    Stored.INTERFACE: {"pdev", "hello"},
    Stored.MANAGEMENT: {"snmp"},
}


@pytest.mark.parametrize("mode", list(ResetMode))
def test_each_reset_clears_its_keys_of_the_memory_and_leaves_the_others(mode):
    kept = dict(FULL)
    clear_memory(kept, RESET_CLEARS[mode])
    gone = {key for kind in RESET_CLEARS[mode] for key in GONE[kind]}
    assert kept.keys() == FULL.keys() - gone
    communication = Stored.COMMUNICATION in RESET_CLEARS[mode]
    for key in ("name", "ip", "gateway"):
        assert kept[key] == ("" if communication else FULL[key])
    assert MEMORY_AFTER_RESET.keys() == set(Stored)


@pytest.mark.parametrize(
    ("mode", "name", "value"),
    [(ResetMode.APPLICATION, "press-7", None), (ResetMode.COMMUNICATION, "", 4711), (ResetMode.ALL, "", None)],
)
def test_a_reset_reaches_the_drive_and_its_memory_at_once(mode, name, value):
    memory = VolatileMemory()
    line = Farm(memory=memory)
    tool, station = Tool(line), line.farm.axes[0]
    tool.set(NameBlock("press-7", 1), address("10.77.0.99"))
    default = station.store.get(2497)
    station.store.set(2497, 4711)
    station.store.set(2469, 1)  # DRV.NVSAVE
    station.station.handle_timeout(line.world.now)
    line.farm.settle(station.station, line.world.now)
    kept = memory.load("axis-01")
    more = {"im": {"0.1.45041": b"tag"}, "pdev": {"0.32768.32881": ADJUST}, "snmp": {"NAME": "x"}}
    memory.save("axis-01", {**kept, **more})
    line = Farm(memory=memory)
    tool, station = Tool(line), line.farm.axes[0]
    assert (bool(station.device.records.im.texts), bool(station.device.neighbours.pdev.written)) == (True, True)
    assert station.store.get(2497) == 4711
    assert tool.set(ResetToFactoryBlock(mode << 1)) == [0]
    for _ in range(2):
        assert station.device.name == name
        assert station.store.get(2497) == (value or default)
        assert (str(station.device.ip.address) == "10.77.0.99/23") == bool(name)
        station.station.power_cycle(line.world.now)
    clears = RESET_CLEARS[mode]
    after = memory.load("axis-01")
    assert ("im" in after) == (Stored.IDENTIFICATION not in clears)
    assert ("pdev" in after) == (Stored.INTERFACE not in clears)
    assert "snmp" not in after
    (entry,) = [e for e in line.log.entries("axis-01") if e.event == "factory reset"]
    assert entry.data == {"mode": mode.name.lower(), "clears": sorted(clears)}


@pytest.mark.parametrize(("mode", "im", "pdev"), [(1, False, True), (2, True, False), (4, False, False)])
def test_a_reset_clears_the_records_that_the_drive_has_in_hand(mode, im, pdev):
    line = Farm()
    station = line.farm.axes[0]
    station.device.records.im.texts[0, 1, 0xAFF1] = b"tag"
    assert station.device.neighbours.pdev.write(None, 0, 0, 0x8000, 0x8071, ADJUST, line.world.now) is None
    assert Tool(line).set(ResetToFactoryBlock(mode << 1)) == [0]
    assert (bool(station.device.records.im.texts), bool(station.device.neighbours.pdev.written)) == (im, pdev)


def test_what_a_controller_wrote_for_interface_and_ports_survives_a_power_cycle():
    memory = VolatileMemory()
    line = Farm(memory=memory)
    station = line.farm.axes[0]
    assert station.device.neighbours.pdev.write(None, 0, 0, 0x8000, 0x8071, ADJUST, line.world.now) is None
    station.device.connections.take(RecordWritten(1, 0, 0, 0x8000, 0x8071, ADJUST), line.world.now)
    station.station.power_cycle(line.world.now)
    assert station.device.neighbours.pdev.read(None, 0, 0, 0x8000, 0x8071, 4096, line.world.now) == ADJUST
    again = Farm(memory=memory).farm.axes[0]
    assert again.device.neighbours.pdev.read(None, 0, 0, 0x8000, 0x8071, 4096, 0) == ADJUST


def test_a_reset_of_the_device_answers_first_and_restarts_then():
    line = VirtualLine()
    line.connect()
    station = line.farm.axes[0]
    before = station.device.dcp
    assert Tool(line).set(ResetToFactoryBlock(ResetMode.DEVICE << 1)) == [0]
    assert station.device.dcp is not before
    assert (station.device.name, station.device.ip.address, station.powered) == ("", None, True)
    events = line.events("axis-01")
    assert events[events.index("factory reset") :].index("power off") < events[events.index("factory reset") :].index(
        "power on"
    )
    assert "reset to factory" in line.plc.sessions[0].measures.last_reason.lower()


@pytest.mark.parametrize(("mode", "error"), [(3, 2), (9, 2), (5, 3), (0, 3)])
def test_a_reset_that_a_drive_has_not_changes_nothing(mode, error):
    line = VirtualLine()
    line.connect()
    assert Tool(line).set(ResetToFactoryBlock(mode << 1)) == [error]
    assert line.farm.axes[0].device.ars
    assert "factory reset" not in line.events("axis-01")


def test_name_servers_outlive_a_restart_when_they_are_permanent():
    memory = VolatileMemory()
    line = Farm(memory=memory)
    tool, station = Tool(line), line.farm.axes[0]
    servers = (IPv4Address("10.77.0.53"), IPv4Address("10.77.0.54"))
    own = IPv4Interface("10.77.0.99/23")
    for permanent, expected in ((True, servers), (False, ())):
        suite = FullIpSuiteBlock(own.ip, own.netmask, own.ip, (*servers, NOBODY, NOBODY), permanent)
        tool.dcp.set_blocks(station.port.mac, [suite], now=line.world.now)
        tool.send_pending(line.world.now)
        line.run(0.02)
        assert tool.found.pop().error is None
        again = Farm(memory=memory).farm.axes[0]
        assert tuple(ip for ip in again.device.dcp.dns if ip != NOBODY) == expected


def test_a_temporary_nothing_deletes_what_was_stored():
    memory = VolatileMemory()
    line = Farm(memory=memory)
    tool = Tool(line)
    assert tool.set(NameBlock("press-7", 1), address("10.77.0.99")) == [0, 0]
    assert (memory.load("axis-01")["name"], memory.load("axis-01")["ip"]) == ("press-7", "10.77.0.99/23")
    assert tool.set(NameBlock("", 0), IpParameterBlock(NOBODY, NOBODY, NOBODY, 0)) == [0, 0]
    assert (memory.load("axis-01")["name"], memory.load("axis-01")["ip"]) == ("", "")
    again = Farm(memory=memory).farm.axes[0]
    assert (again.device.name, again.device.ip.address) == ("", None)


# -- Hello -------------------------------------------------------------------------------------------------------------


def greetings(tool):
    return [event.info.name for event in tool.found if isinstance(event, HelloReceived)]


@pytest.mark.parametrize(("hello", "expected"), [(True, 3), (False, 0)])
def test_a_drive_sends_hello_at_power_on_if_the_farm_file_says_so(hello, expected):
    line = Farm(hello=hello)
    tool = Tool(line)
    line.run(1.0)
    assert greetings(tool) == ["axis-01"] * expected
    tool.found.clear()
    station = line.farm.axes[0]
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(1.0)
    assert greetings(tool) == ["axis-01"] * expected


def test_the_fast_start_up_record_rules_over_the_farm_file_until_it_is_reset():
    memory = VolatileMemory()
    line = Farm(memory=memory)
    station = line.farm.axes[0]
    record = FsuDataAdjust((FsHello(2, 100, 2, 500),)).emit()
    station.device.addressing.record_written(Index.INTERFACE_FSU_DATA_ADJUST, record, line.world.now)
    assert "hello set" in line.events()
    tool = Tool(line)
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(0.4)
    assert greetings(tool) == []
    line.run(0.6)
    assert greetings(tool) == ["axis-01"] * 2
    tool.set(ResetToFactoryBlock(ResetMode.COMMUNICATION << 1))
    assert station.device.dcp.hello_settings.mode is HelloMode.OFF
    assert "hello" not in memory.load("axis-01")


@pytest.mark.parametrize("mode", [0, 3, 0xFFFF_FFFF])
def test_a_fast_start_up_record_can_switch_hello_off(mode):
    line = Farm(hello=True)
    station = line.farm.axes[0]
    record = FsuDataAdjust((FsHello(mode, 0xFFFF_FFFF, 0xFFFF_FFFF, 0xFFFF_FFFF),)).emit()
    station.device.addressing.record_written(Index.INTERFACE_FSU_DATA_ADJUST, record, line.world.now)
    line.run(1.0)
    tool = Tool(line)
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(1.0)
    assert greetings(tool) == []


def test_hellos_of_a_farm_do_not_circulate_in_it():
    line = Farm(30, hello=True)
    tool = Tool(line)
    line.run(1.0)
    assert len(greetings(tool)) == 90
    assert line.farm_link.counters.received == 0


def test_other_records_and_broken_ones_change_nothing():
    line = Farm(hello=True)
    station = line.farm.axes[0]
    before = station.device.dcp.hello_settings
    record = FsuDataAdjust((FsHello(0, 100, 2, 500),)).emit()
    station.device.addressing.record_written(0x802F, record, line.world.now)
    station.device.addressing.record_written(Index.INTERFACE_FSU_DATA_ADJUST, record[:-1], line.world.now)
    station.device.addressing.record_written(Index.INTERFACE_FSU_DATA_ADJUST, FsuDataAdjust(()).emit(), line.world.now)
    assert station.device.dcp.hello_settings == before
    assert line.events().count("fast start-up record not understood") == 1


# -- two with one address ----------------------------------------------------------------------------------------------


def test_an_address_that_another_drive_has_is_not_used_until_that_drive_is_gone():
    line = Farm(2)
    tool = Tool(line)
    line.run(2.0)
    first, second = line.farm.axes
    assert tool.set(address("10.77.0.11"), drive=1) == [0]
    assert (str(first.device.ip.address), second.device.ip.address) == ("10.77.0.11/23", None)
    assert shown(line, 1)["ip_conflict"] == first.port.mac.hex(":")
    said = tool.identify()
    assert (said[first.port.mac].ip_info, said[second.port.mac].ip_info) == (0x01, 0x80)
    assert str(said[second.port.mac].ip) == "10.77.0.11"
    assert "address not used" in line.events("axis-02")
    line.run(RECHECK_SECONDS)
    assert second.device.ip.address is None
    first.station.power_off(line.world.now)
    line.run(RECHECK_SECONDS)
    assert str(second.device.ip.address) == "10.77.0.11/23"
    assert tool.identify()[second.port.mac].ip_info == 0x01
    assert line.events("axis-02")[-1] == "address conflict over"
    assert shown(line, 1)["ip_conflict"] is None


def test_an_address_in_use_is_kept_and_the_conflict_shown_until_it_is_over():
    line = VirtualLine()
    line.connect()
    line.run(1.0)
    tool = Tool(line)
    station = line.farm.axes[0]
    tool.use("10.77.0.11/23")
    assert tool.identify()[station.port.mac].ip_info == 0x81
    assert station.device.ars  # a running axis does not stop for it
    assert shown(line)["ip_conflict"] == tool.mac.hex(":")
    tool.use(None)
    line.run(RECHECK_SECONDS)
    assert tool.identify()[station.port.mac].ip_info == 0x01
    events = line.events("axis-01")
    assert [e for e in events if "conflict" in e] == ["address conflict", "address conflict over"]


def test_an_address_of_the_farm_file_that_another_station_has_is_not_used():
    line = Farm()
    tool = Tool(line)
    tool.ip.set_address(IPv4Interface("10.77.0.11/23"))
    line.run(0.1)
    (said,) = tool.identify().values()
    assert said.ip_info == 0x80
    assert "address not used" in line.events()
    assert shown(line)["ip_conflict"] == tool.mac.hex(":")


def test_a_conflict_that_lasts_is_reported_once():
    line = Farm()
    line.run(1.1)
    tool = Tool(line)
    for _ in range(4):
        tool.use("10.77.0.11/23")
        line.run(9.0)
    assert line.events().count("address conflict") == 1


def test_another_address_ends_the_conflict():
    line = Farm()
    tool = Tool(line)
    tool.use("10.77.0.11/23")
    assert tool.set(address("10.77.0.99")) == [0]
    line.run(2.0)
    (said,) = tool.identify().values()
    assert (str(said.ip), said.ip_info) == ("10.77.0.99", 0x01)


# -- many drives -------------------------------------------------------------------------------------------------------


def test_announcements_of_many_drives_reach_only_those_they_concern():
    line = Farm(60)
    tool = Tool(line)
    line.run(1.0)
    assert line.farm_link.counters.received == 0
    # a question still finds the one drive, and one that changed its address is found under the new one
    tool.use("10.77.1.200/23")
    tool.set(address("10.77.0.99"), drive=7)
    before = line.farm_link.counters.received
    for wanted in ("10.77.0.11", "10.77.0.99", "10.77.0.18"):
        tool.ip.probe(IPv4Address(wanted), line.world.now)
    tool.send_pending(line.world.now)
    line.run(0.02)
    found = {event.ip: event.conflict_mac for event in tool.ip.events()}
    stations = line.farm.axes
    assert found == {
        IPv4Address("10.77.0.11"): stations[0].port.mac,
        IPv4Address("10.77.0.99"): stations[7].port.mac,
    }
    assert line.farm_link.counters.received == before + 2


# -- a built-in controller beside them ---------------------------------------------------------------------------------


CONTROLLER = "controller: {name: plc, ip: 10.77.1.250/23, cycle: 16ms, reconnect: {after: 30s}}\n"


@pytest.mark.parametrize(("hello", "connected"), [(True, True), (False, False)])
def test_a_drive_that_says_hello_is_not_waited_for(hello, connected):
    line = Farm(hello=hello, more=CONTROLLER)
    assert line.world.run(5.0, until=lambda: line.plc.all_connected)
    station = line.farm.axes[0].station
    station.power_off(line.world.now)
    line.run(1.0)
    assert not line.plc.all_connected
    station.power_on(line.world.now)
    line.farm.settle(station, line.world.now)
    line.run(10.0)
    assert line.plc.all_connected is connected


def test_a_controller_answers_who_asks_it_and_keeps_its_name_and_its_address():
    line = Farm(more=CONTROLLER)
    assert line.world.run(5.0, until=lambda: line.plc.all_connected)
    tool = Tool(line)
    mac = line.plc.port.mac
    asked = (NameBlock("plc-7", 1), address("10.77.0.99"), ResetToFactoryBlock(ResetMode.ALL << 1))
    assert tool.set(*asked, mac=mac) == [BlockError.SET_NOT_POSSIBLE] * 3
    assert tool.set(SignalBlock(0x0100), mac=mac) == [BlockError.OK]
    found = tool.identify()[mac]
    assert (found.name, str(found.ip)) == ("plc", "10.77.1.250")
    assert line.plc.all_connected
