"""Drives and the controller know each other by LLDP, in virtual time."""

from ipaddress import IPv4Address

import pytest
from virtual_line import VirtualLine

from pnfarm.buses.profinet.device import segment
from pnfarm.buses.profinet.device.management.neighbours import StationNeighbours
from pnfarm.buses.profinet.device.pump import DevicePump
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.protocols.profinet.dcp.device import identify_matches
from pnfarm.protocols.profinet.records.pdev_checks import CheckFailed, CheckPassed
from pnfarm.protocols.profinet.wire.dcp.blocks import AliasBlock
from pnfarm.protocols.profinet.wire.dcp.pdu import DcpPdu
from pnfarm.protocols.profinet.wire.records.pdev import InterfaceAdjust, PortDataAdjust, PortDataCheck
from pnfarm.protocols.profinet.wire.records.pdev_port import AdjustPeerToPeerBoundary, CheckPeers, ExpectedPeer


def stations_known(line):
    return sorted(n.station_name for n in line.plc.lldp.neighbours)


def test_every_drive_knows_the_controller_and_the_controller_every_drive():
    line = VirtualLine(20)
    line.run(6)
    assert stations_known(line) == [f"axis-{n:02}" for n in range(1, 21)]
    for station in line.farm.axes:
        (neighbour,) = station.device.neighbours.lldp.neighbours
        assert (neighbour.station_name, neighbour.port_name) == ("plc", "port-001")
        assert neighbour.ip == IPv4Address("10.77.1.250")


def test_drives_of_one_farm_do_not_receive_each_others_lldp():
    line = VirtualLine(3, controller=False)
    line.run(20)
    assert all(station.device.neighbours.lldp.sent >= 4 for station in line.farm.axes)
    assert not any(station.device.neighbours.lldp.neighbours for station in line.farm.axes)


def test_a_frame_to_all_drives_is_parsed_once(monkeypatch):
    parsed = []
    original = segment.parse_lldp
    monkeypatch.setattr(segment, "parse_lldp", lambda data: parsed.append(1) or original(data))
    line = VirtualLine(16)
    line.run(60)
    assert all(station.device.neighbours.lldp.received >= 12 for station in line.farm.axes)
    assert len(parsed) == 1


def test_the_drives_send_in_many_turns_few_at_a_time():
    line = VirtualLine(50, controller=False)
    moments = []
    line.farm_link.send = lambda port, frame: moments.append(line.world.now) if frame[12:14] == b"\x88\xcc" else None
    line.run(20)
    assert len(moments) >= 4 * 50 - 1
    # every 100 ms of the 5 s those of a fiftieth of the interval
    assert max(moments.count(moment) for moment in set(moments)) <= 3
    assert len({moment % 5_000_000_000 for moment in moments}) >= 30


def test_a_drive_that_only_sends_lldp_sends_the_same_at_the_same_time_as_by_a_whole_turn(monkeypatch):
    def run():
        line, sent = VirtualLine(3), []
        send = line.farm_link.send
        line.farm_link.send = lambda port, frame: sent.append((line.world.now, port, frame)) or send(port, frame)
        line.run(30)
        line.plc.lldp.send_frames(False, line.world.now)
        line.run(40)
        assert not line.farm.axes[0].device.neighbours.lldp.neighbours
        return line, sent

    turns = []
    whole_turn = DevicePump.pump
    monkeypatch.setattr(DevicePump, "pump", lambda self, now: turns.append(now) or whole_turn(self, now))
    line, sent = run()
    few = len(turns)
    monkeypatch.setattr(StationNeighbours, "only_sends", lambda _self, _now: False)
    other, also_sent = run()
    assert sent == also_sent
    assert len(turns) - 2 * few >= 3 * 12
    for one, two in zip(line.farm.axes, other.farm.axes, strict=True):
        assert one.device.traffic.sent == two.device.traffic.sent


def test_a_snapshot_shows_the_neighbour():
    line = VirtualLine(1)
    line.run(7)
    (seen,) = drive_snapshot(line.farm, line.farm.axes[0], line.world.now)["neighbours"]
    assert seen == {
        "port": "port-001",
        "station": "plc",
        "chassis": "plc",
        "port_id": "port-001",
        "system_name": "plc",
        "mac": line.plc.port.mac.hex(":"),
        "ip": "10.77.1.250",
        "seen_seconds_ago": pytest.approx(2.0, abs=0.1),
    }


def test_without_lldp_no_drive_sends_and_no_neighbour_is_known():
    line = VirtualLine(top="lldp: false")
    line.world.run(30)
    assert line.plc.lldp is None
    assert line.farm.axes[0].device.neighbours.lldp.sent == 0
    assert line.farm.axes[0].device.neighbours.lldp.neighbours == ()


def test_a_renamed_drive_is_another_neighbour_at_once():
    line = VirtualLine(1)
    line.run(6)
    station = line.farm.axes[0]
    station.device.dcp.name = "press-7"
    station.device.neighbours.update("press-7", station.device.dcp.address, None, line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(0.01)
    assert stations_known(line) == ["axis-01", "press-7"]
    line.run(25)
    assert stations_known(line) == ["press-7"]


def test_a_drive_that_is_switched_off_ages_out_and_has_no_neighbours_when_it_is_back():
    line = VirtualLine(1)
    line.run(6)
    station = line.farm.axes[0]
    station.station.power_off(line.world.now)
    assert drive_snapshot(line.farm, station, line.world.now)["neighbours"] == []
    line.run(21)
    assert stations_known(line) == []
    station.station.power_on(line.world.now)
    assert station.device.neighbours.lldp.neighbours == ()
    line.farm.settle(station.station, line.world.now)
    line.run(6)
    assert stations_known(line) == ["axis-01"]
    assert len(station.device.neighbours.lldp.neighbours) == 1


def test_neighbours_of_a_farm_that_stops_forget_it():
    line = VirtualLine(3)
    line.run(6)
    line.farm.stop(line.world.now)
    line.run(0.01)
    assert stations_known(line) == []


def test_a_pulled_cable_leaves_a_drive_alone_until_it_is_plugged():
    line = VirtualLine(2)
    faults = line.farm.injections
    line.run(6)
    faults.inject({"kind": "link-down", "on": "axis-01", "for": "10s"}, line.world.now)
    line.run(1)
    pulled, other = line.farm.axes
    assert pulled.device.neighbours.lldp.neighbours == ()
    assert len(other.device.neighbours.lldp.neighbours) == 1
    line.run(20)
    assert len(pulled.device.neighbours.lldp.neighbours) == 1


def test_a_drive_is_found_by_the_port_that_it_is_connected_to():
    line = VirtualLine(1)
    ask = DcpPdu(0xFEFE, 5, 0, 1, (AliasBlock("port-001.plc"),))
    assert not identify_matches(ask, line.farm.axes[0].device.dcp)
    line.run(6)
    assert identify_matches(ask, line.farm.axes[0].device.dcp)


# -- the physical device's records


def write(station, index, data, now, subslot=0x8001):
    assert station.device.neighbours.pdev.write(None, 0, 0, subslot, index, data, now) is None


def test_a_wrong_neighbour_fails_the_check_and_is_noted():
    line = VirtualLine(1)
    line.run(6)
    station = line.farm.axes[0]
    for name, expected in ((b"other", CheckFailed), (b"plc", CheckPassed)):
        check = PortDataCheck(0, 0x8001, (CheckPeers((ExpectedPeer(b"port-001", name),)),))
        write(station, 0x802B, check.emit(), line.world.now)
        line.farm.settle(station.station, line.world.now)
        standing = [(d.slot, d.subslot, d.error_type, d.ext_error_type) for d in station.device.cm.diagnosis]
        assert standing == ([(0, 0x8001, 0x8001, 0x8000)] if expected is CheckFailed else [])
    noted = [entry.event for entry in line.log.entries("axis-01") if entry.event.startswith("port check")]
    assert noted == ["port check failed", "port check passed"]


def test_a_neighbour_that_goes_fails_the_check_when_it_ages_out():
    line = VirtualLine(1)
    line.run(6)
    station = line.farm.axes[0]
    check = PortDataCheck(0, 0x8001, (CheckPeers((ExpectedPeer(b"port-001", b"plc"),)),))
    write(station, 0x802B, check.emit(), line.world.now)
    line.run(10)
    assert list(station.device.cm.diagnosis) == []
    line.plc.lldp.send_frames(False, line.world.now)
    line.run(21)
    (found,) = station.device.cm.diagnosis
    assert (found.error_type, found.ext_error_type) == (0x8001, 0x8005)


def test_the_controller_chooses_the_names_and_mutes_a_port():
    line = VirtualLine(1)
    line.run(6)
    station = line.farm.axes[0]
    write(station, 0x8071, InterfaceAdjust(1).emit(), line.world.now, 0x8000)
    line.farm.settle(station.station, line.world.now)
    line.run(2)
    newer = line.plc.lldp.neighbours[-1]
    assert newer.port_id.text == "port-001.axis-01"
    assert newer.chassis.text.split()[0] == "AKD"
    assert newer.station_name == "axis-01"
    sent = station.device.neighbours.lldp.sent
    adjust = PortDataAdjust(0, 0x8001, (AdjustPeerToPeerBoundary(1),))
    write(station, 0x802F, adjust.emit(), line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(30)
    assert station.device.neighbours.lldp.sent == sent
    assert stations_known(line) == []
