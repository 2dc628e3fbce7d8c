"""The address of a drive on EtherNet/IP: looked whether it is free, watched, defended; in memory and virtual time."""

from __future__ import annotations

from ipaddress import IPv4Address

import pytest
from peer import Rig

from pnfarm.protocols.enip.originator_events import ConnectionMade
from pnfarm.station.station import Station
from pnfarm.wire.arp import OPERATION_REPLY, OPERATION_REQUEST, ArpPacket, emit_arp, parse_arp
from pnfarm.wire.ethernet import ETHERTYPE_ARP, EthernetFrame, emit_ethernet, parse_ethernet

OWN = IPv4Address("10.77.0.11")
NOBODY = IPv4Address(0)
NIL, ALL = bytes(6), b"\xff" * 6
TCP_IP = 0xF5


class Wire:
    """What a station beside the drive hears and says in ARP."""

    def __init__(self) -> None:
        self.rig = Rig()
        self.peer = self.rig.peer
        self.drive: Station = self.rig.station()
        self.mac = self.peer.port.mac
        self.peer.frames.clear()

    def say(self, operation: int, sender: IPv4Address, target: IPv4Address, to: bytes = ALL) -> None:
        packet = ArpPacket(operation, self.mac, sender, NIL, target)
        frame = emit_ethernet(EthernetFrame(to, self.mac, ETHERTYPE_ARP, emit_arp(packet)))
        self.peer.link.send(self.peer.port.index, frame)
        self.peer.run(0.01)

    def heard(self) -> list[tuple[int, IPv4Address, IPv4Address]]:
        """(operation, sender, target) of the drive's packets since the last call."""
        frames, self.peer.frames[:] = list(self.peer.frames), []
        parsed = [parse_ethernet(frame) for frame in frames]
        packets = [parse_arp(frame.payload) for frame in parsed if frame.ethertype == ETHERTYPE_ARP]
        return [
            (packet.operation, packet.sender_ip, packet.target_ip)
            for packet in packets
            if packet.sender_mac == self.drive.port.mac
        ]

    def power_cycle(self, seconds: float) -> None:
        self.drive.station.power_cycle(self.rig.world.now)
        self.rig.farm.settle(self.drive.station, self.rig.world.now)
        self.peer.run(seconds)

    def answers(self) -> bool:
        self.peer.stream = self.peer.link.sockets.connect(self.peer.port.index, (OWN, 44818))
        self.peer.originator.closed(self.rig.world.now)
        self.peer.notes.clear()
        self.peer.run(0.05)
        return bool(self.peer.notes)


@pytest.fixture
def wire():
    return Wire()


def test_an_address_is_probed_for_a_second_and_announced_before_it_is_used(wire):
    wire.power_cycle(0.9)
    assert wire.heard() == [(OPERATION_REQUEST, NOBODY, OWN)]
    assert not wire.answers()
    wire.peer.run(0.2)
    assert wire.heard() == [(OPERATION_REQUEST, OWN, OWN)]
    wire.peer.connect()


def test_an_address_that_another_station_has_is_not_used_until_that_one_is_gone(wire):
    wire.power_cycle(0.5)
    wire.say(OPERATION_REPLY, OWN, OWN, wire.drive.port.mac)
    wire.peer.run(2.0)
    assert "address not used" in wire.rig.texts()
    assert wire.drive.device.view(0)["ip_conflict"] == wire.mac.hex(":")
    assert not wire.answers()
    assert (OPERATION_REQUEST, OWN, OWN) not in wire.heard()
    wire.peer.run(15.0)
    assert "address conflict over" in wire.rig.texts()
    wire.peer.connect()
    assert wire.peer.get(TCP_IP, 1, 11).data[:7] == b"\1" + wire.mac


def test_two_stations_that_probe_at_the_same_time_both_stay_without(wire):
    wire.power_cycle(0.5)
    wire.say(OPERATION_REQUEST, NOBODY, OWN)
    wire.peer.run(1.0)
    assert "address not used" in wire.rig.texts()


def test_an_address_in_use_is_defended_once_in_ten_seconds_and_its_connections_stay(wire):
    wire.peer.connect()
    assert isinstance(wire.peer.open(), ConnectionMade)
    wire.peer.run(0.1)
    wire.heard()
    for _ in range(3):
        wire.say(OPERATION_REQUEST, OWN, OWN)
    assert wire.heard() == [(OPERATION_REQUEST, OWN, OWN)]
    assert wire.rig.texts().count("address conflict") == 1
    assert wire.drive.device.connected
    found = wire.peer.get(TCP_IP, 1, 11).data
    assert (found[0], found[1:7]) == (2, wire.mac)
    assert parse_arp(found[7:]).sender_ip == OWN
    wire.peer.run(20.0)
    assert "address conflict over" in wire.rig.texts()
    wire.power_cycle(2.0)
    wire.peer.connect()
    assert wire.peer.get(TCP_IP, 1, 11).data == found, "the last conflict is kept"


def test_a_conflict_that_goes_on_is_written_to_the_memory_once(wire, monkeypatch):
    written = []
    monkeypatch.setattr(wire.drive.station, "save", lambda: written.append(wire.drive.station.kept["last_conflict"]))
    for host in range(20, 40):
        wire.say(OPERATION_REQUEST, OWN, IPv4Address(f"10.77.0.{host}"))
    assert [found[:7] for found in written] == [b"\2" + wire.mac]


def test_without_detection_an_address_is_used_at_once_and_nothing_is_watched(wire):
    wire.peer.connect()
    assert wire.peer.set(TCP_IP, 1, 10, b"\0").status == 0
    wire.power_cycle(0.01)
    assert wire.heard() == [(OPERATION_REQUEST, OWN, OWN)]
    wire.peer.connect()
    wire.say(OPERATION_REQUEST, OWN, OWN)
    assert "address conflict" not in wire.rig.texts()


def test_requests_for_the_address_are_answered_where_no_kernel_does(wire):
    wire.say(OPERATION_REQUEST, IPv4Address("10.77.1.100"), OWN)
    assert wire.heard() == [(OPERATION_REPLY, OWN, IPv4Address("10.77.1.100"))]
    wire.say(OPERATION_REQUEST, IPv4Address("10.77.1.100"), IPv4Address("10.77.0.99"))
    assert wire.heard() == []


def test_a_drive_without_supply_says_nothing_of_its_address(wire):
    wire.drive.station.power_off(wire.rig.world.now)
    wire.rig.farm.settle(wire.drive.station, wire.rig.world.now)
    wire.say(OPERATION_REQUEST, IPv4Address("10.77.1.100"), OWN)
    assert wire.heard() == []
