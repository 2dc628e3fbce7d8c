"""Floods of Connect requests in the controller's name: no connection is lost, and recovery takes as long as without."""

from __future__ import annotations

from ipaddress import IPv4Address

import pytest
from impostor import Impostor
from virtual_line import VirtualLine

from pnfarm.buses.profinet.device.connect_budget import CONNECTS

MAC = bytes.fromhex("020000000066")
IP = IPv4Address("10.77.1.66")
PLC_IP = IPv4Address("10.77.1.250")


def running(drives: int, **options: object) -> VirtualLine:
    line = VirtualLine(drives, **options)  # type: ignore[arg-type]  # the options are the line's own
    line.connect(10.0)
    return line


@pytest.mark.parametrize("forged", ["nothing", "the MAC address in the request", "the IP address, too"])
def test_a_thousand_connects_a_second_in_the_controllers_name_cost_no_drive_its_connection(forged: str) -> None:
    line = running(20)
    claims = b"" if forged == "nothing" else line.plc.port.mac
    impostor = Impostor(line, MAC, PLC_IP if forged == "the IP address, too" else IP, claims)
    impostor.flood(1000, 2.0)
    assert impostor.sent == 2000
    assert [session.measures.losses for session in line.plc.sessions] == [0] * 20
    assert line.plc.all_connected


@pytest.mark.parametrize("seconds", [0.5, 2.0])
def test_drives_that_lose_their_connection_in_a_flood_are_back_as_soon_after_a_long_one_as_after_a_short_one(
    seconds: float,
) -> None:
    line = running(4)
    # the station forges everything, as no device can tell
    impostor = Impostor(line, line.plc.port.mac, PLC_IP, line.plc.port.mac)
    line.world.switch.detach(impostor.port.index)
    impostor.port = line.world.switch.attach(MAC, lambda *_: None, name="impostor")
    impostor.flood(300, seconds)
    assert any(session.measures.losses for session in line.plc.sessions)
    line.connect(within=3.0)


def test_a_station_that_asks_too_often_is_ignored_for_a_while_and_the_controller_is_not() -> None:
    line = running(1)
    impostor = Impostor(line, MAC, IP)
    impostor.flood(400, 0.5)
    (station,) = line.farm.axes
    assert station.device.discards()["connect-flood"] == pytest.approx(200 - CONNECTS, abs=2)
    # the controller has just restarted
    line.plc.sessions[0].machine.abort(line.world.now)
    line.plc.touch(line.plc.sessions[0], line.world.now)
    assert line.world.run(0.2, until=lambda: not line.plc.all_connected)
    line.connect(within=1.0)
    line.run(1.0)
    before = len(line.log.entries("axis-01"))
    impostor.flood(100, 0.1)
    assert len(line.log.entries("axis-01")) > before


def test_ars_that_replace_each_other_within_a_tick_do_not_end_the_farm() -> None:
    line = running(1)
    impostor = Impostor(line, line.plc.port.mac, PLC_IP, line.plc.port.mac)
    line.world.switch.detach(impostor.port.index)
    station = line.farm.axes[0]
    for _ in range(50):
        # a burst that the loop takes before the engine's next tick
        line.farm.receive(station.port.index, impostor.connect_frame(0), line.world.now)
    assert len(station.device.ars) <= 1
    assert int(line.farm.columns.engine[0].ppm_rows) <= line.farm.columns.ppm.shape[0]
    line.run(0.1)
    line.connect(within=5.0)
