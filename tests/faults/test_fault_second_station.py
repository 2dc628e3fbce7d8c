"""duplicate-ip and duplicate-name: what a second station does to the drive and to its controller."""

import pytest
from fault_line import FaultLine
from storm import left_behind

from pnfarm.faults.errors import InjectionError
from pnfarm.wire.arp import OPERATION_REPLY, OPERATION_REQUEST, ArpPacket, emit_arp, parse_arp
from pnfarm.wire.ethernet import ETHERTYPE_ARP, EthernetFrame, emit_ethernet, parse_ethernet
from pnfarm.wire.mac import BROADCAST, NIL, parse_mac

#: The drive has probed for its address by then, and uses it.
SETTLED = 3.0
OTHER = "02:aa:00:00:00:07"
ASKER = parse_mac("02:aa:00:00:00:99")


class Bystander:
    """A station on the same switch that asks and keeps what it hears."""

    def __init__(self, line: FaultLine) -> None:
        self._line = line
        self._switch = line.farm_link._switch
        self.heard = []
        self.port = self._switch.attach(ASKER, lambda _, frame, now: self.heard.append(parse_ethernet(frame)))

    def ask(self) -> set[bytes]:
        """Who has the first drive's address."""
        ip = self._line.farm.axes[0].device.ip.wanted.ip
        packet = ArpPacket(OPERATION_REQUEST, ASKER, ip + 100, NIL, ip)
        self.heard.clear()
        payload = emit_ethernet(EthernetFrame(BROADCAST, ASKER, ETHERTYPE_ARP, emit_arp(packet)))
        self._switch.send(self.port.index, payload, self._line.world.now)
        self._line.run(0.02)
        arps = [parse_arp(frame.payload) for frame in self.heard if frame.ethertype == ETHERTYPE_ARP]
        return {arp.sender_mac for arp in arps if arp.operation == OPERATION_REPLY and arp.sender_ip == ip}


def test_two_stations_answer_arp_for_the_drives_address_until_it_ends(line):
    line.run(SETTLED)
    bystander, drive = Bystander(line), line.farm.axes[0].port.mac
    assert bystander.ask() == {drive}
    fault = line.add("duplicate-ip", params={"mac": OTHER}, as_="two")
    assert bystander.ask() == {drive, parse_mac(OTHER)}
    assert fault.evidence().confirmed
    line.clear("two")
    assert bystander.ask() == {drive}
    assert left_behind(line) == {}


def test_a_drive_in_operation_finds_the_second_station_defends_its_address_and_keeps_its_connection(line):
    line.run(SETTLED)
    line.add("duplicate-ip", params={"mac": OTHER}, as_="two")
    line.run(0.1)
    addressing = line.farm.axes[0].device.addressing
    assert addressing.conflict_mac == parse_mac(OTHER)
    assert addressing.dcp.ip_conflict
    assert addressing.dcp.ip_in_use
    line.run(30.0)
    assert line.losses() == 0
    line.clear("two")
    line.run(30.0)
    assert addressing.conflict_mac is None, "the conflict is over"


def test_a_drive_that_boots_leaves_its_address_to_the_second_station_and_takes_it_back(line):
    line.run(SETTLED)
    line.add("duplicate-ip", params={"mac": OTHER}, as_="two")
    line.add("power-cycle", params={"off": "100ms"})
    line.run(3.0)
    device = line.farm.axes[0].device
    assert device.ip.address is None
    assert not device.dcp.ip_in_use
    line.clear("two")
    assert line.until(lambda: device.ip.address is not None, 30.0)
    line.connect(30.0)


def test_the_controller_finds_two_stations_of_a_name_and_connects_when_the_second_is_gone(line):
    fault = line.add("duplicate-name", as_="two")
    line.run(1.0)
    assert line.losses() == 0, "a connection that stands goes on"
    line.add("ar-abort")
    line.run(5.0)
    assert not line.plc.all_connected
    assert fault.evidence().activations > 0
    assert fault.evidence().confirmed
    line.clear("two")
    line.connect(20.0)
    line.enable(10.0)
    assert left_behind(line) == {}


def test_the_second_station_of_a_drive_has_a_locally_administered_address_that_stays_the_same(line):
    line.run(SETTLED)
    bystander, drive = Bystander(line), line.farm.axes[0].port.mac
    macs = []
    for _ in range(2):
        line.add("duplicate-ip", as_="two")
        (other,) = bystander.ask() - {drive}
        macs.append(other)
        line.clear("two")
    assert macs[0] == macs[1]
    assert macs[0][0] & 3 == 2


def test_a_drive_without_address_or_name_and_a_wrong_mac_are_refused_with_the_reason(line):
    with pytest.raises(InjectionError, match=r"params\.mac: .* is the address of axis-01 itself"):
        line.add("duplicate-ip", params={"mac": line.farm.axes[0].port.mac.hex(":")})
    for wrong in ("01:00:00:00:00:00", "00:00:00:00:00:00", "ff:ff:ff:ff:ff:ff", "02:00", 7, ""):
        with pytest.raises(InjectionError, match=r"params\.mac: is .*; allowed: the MAC address of one station"):
            line.add("duplicate-name", params={"mac": wrong})
    with pytest.raises(InjectionError, match=r"params\.every: .*10ms"):
        line.add("duplicate-ip", params={"every": "1us"})
    device = line.farm.axes[0].device
    device.addressing.set_address(None, None, line.world.now)
    with pytest.raises(InjectionError, match="axis-01 has no IP address"):
        line.add("duplicate-ip")
    device.dcp.name = ""
    with pytest.raises(InjectionError, match="axis-01 has no station name"):
        line.add("duplicate-name")
    assert line.faults.list() == []
