"""Address and ports of a drive on EtherNet/IP that the machine refuses."""

from __future__ import annotations

import pytest
from cip_line import CipLine

from pnfarm.errors import EnvironmentError_


def refusing(monkeypatch: pytest.MonkeyPatch, line: CipLine, port: int) -> list[int]:
    """Let the link refuse a port its address as long as the list is not empty; each try takes one of it."""
    sockets = line.farm._sockets
    serve, left = sockets.serve, [1, 2, 3]

    def refuse(number: int, services: object) -> None:
        if number == port and left:
            left.pop()
            raise EnvironmentError_("a port of 10.77.0.11 at axis-01 cannot be opened: too many open files")
        serve(number, services)

    monkeypatch.setattr(sockets, "serve", refuse)
    return left


def test_a_drive_that_gets_no_ports_from_the_machine_is_tried_again_and_ends_no_farm(monkeypatch):
    line = CipLine(2)
    line.connect()
    drive = line.farm.axes[0]
    left = refusing(monkeypatch, line, drive.station.port.index)
    drive.station.power_cycle(line.world.now)
    line.farm.settle(drive.station, line.world.now)
    line.run(1.5)
    assert left, "it was tried again at once, not each second"
    assert not drive.device.connected
    assert line.scanners[1].connected
    assert line.until(lambda: not left, 10.0)
    line.enable(60.0)
    told = [entry for entry in line.farm.log.entries("axis-01") if entry.event == "ports not opened"]
    assert len(told) == 1


def test_a_drive_that_is_switched_off_while_it_waits_for_its_ports_is_not_tried_again(monkeypatch):
    line = CipLine(1)
    line.connect()
    drive = line.farm.axes[0]
    left = refusing(monkeypatch, line, drive.station.port.index)
    drive.station.power_cycle(line.world.now)
    line.farm.settle(drive.station, line.world.now)
    line.run(0.2)
    drive.station.power_off(line.world.now)
    line.farm.settle(drive.station, line.world.now)
    before = len(left)
    line.run(5.0)
    assert len(left) == before


def test_a_drive_whose_listener_the_machine_refuses_behind_a_fault_gets_it_again_and_keeps_its_connections(monkeypatch):
    line = CipLine(1)
    line.connect()
    sockets, drive = line.farm._sockets, line.farm.axes[0]
    refuse, left = sockets.refuse, [1, 2]

    def no_file(port: int, *, refused: bool) -> None:
        if not refused and left:
            left.pop()
            raise EnvironmentError_("a port of 10.77.0.11 at axis-01 cannot be opened: too many open files")
        refuse(port, refused=refused)

    monkeypatch.setattr(sockets, "refuse", no_file)
    line.farm.injections.inject({"kind": "tcp-refuse", "on": "axis-01"}, line.world.now)
    line.run(0.1)
    line.farm.injections.clear(None, line.world.now)
    line.run(0.5)
    assert len(left) == 1, "it was tried again at once, not each second"
    line.run(2.0)
    assert not left
    assert drive.device.connected
    told = [entry for entry in line.farm.log.entries("axis-01") if entry.event == "ports not opened"]
    assert len(told) == 1
    drive.station.power_cycle(line.world.now)
    line.farm.settle(drive.station, line.world.now)
    line.enable(60.0)
