"""The time that a drive boots: from power-on until it answers, and until S1, on every model."""

from __future__ import annotations

from ipaddress import IPv4Address

import pytest
from dcp_tool import Tool
from virtual_line import VirtualLine

from pnfarm.farm.views.snapshot import drive_snapshot

#: Model, its telegram of speed, a cycle.
MODELS = [
    ("akd-profinet", 1, "16ms"),
    ("akd-profinet-2012", 1, "8ms"),
    ("hiwin-e1", 3, "1ms"),
    ("moog-msd", 1, "1ms"),
]
BOOT = "{boot_time: {answers: 3s, ready: 5s}}"


def line_of(realism: str, model: str = "akd-profinet", telegram: int = 1, cycle: str = "16ms") -> VirtualLine:
    return VirtualLine(model=model, telegram=telegram, cycle=cycle, realism=realism)


def spoken(line: VirtualLine, seconds: float) -> list[bytes]:
    """What the drive puts on the wire in this time."""
    frames: list[bytes] = []
    mac = line.farm.axes[0].port.mac
    send = line.farm_link.send

    def listen(port: int, frame: bytes) -> None:
        if frame[6:12] == mac:
            frames.append(frame)
        send(port, frame)

    line.farm_link.send = listen
    line.run(seconds)
    line.farm_link.send = send
    return frames


@pytest.mark.parametrize(("model", "telegram", "cycle"), MODELS)
def test_a_drive_that_boots_is_silent_then_connects_then_reaches_s1(model, telegram, cycle):
    line = line_of(BOOT, model, telegram, cycle)
    axis = line.farm.columns.axis[0]
    assert spoken(line, 2.9) == []
    assert not line.plc.all_connected
    assert line.world.run(1.5, until=lambda: line.plc.all_connected), line.reasons()
    # it exchanges data, and its status word says that it has not come to S1 yet
    line.run(0.1)
    assert int(axis.drive.state) == 0
    assert int(line.plc.columns.image[0].received[0]) & 0x0200 == 0, "control is not requested"
    line.run(5.05 - 4.6)
    line.enable()
    assert (line.world.now - 1_000_000_000_000) / 1e9 > 5.0


@pytest.mark.parametrize(("model", "telegram", "cycle"), MODELS)
def test_each_power_cycle_takes_as_long(model, telegram, cycle):
    line = line_of(BOOT, model, telegram, cycle)
    assert line.world.run(20.0, until=lambda: line.plc.all_running), line.reasons()
    station = line.farm.axes[0]
    station.station.power_cycle(line.world.now)
    line.farm.settle(station.station, line.world.now)
    assert spoken(line, 2.9) == []
    assert drive_snapshot(line.farm, station, line.world.now)["state"] == "boot"
    assert line.world.run(20.0, until=lambda: line.plc.all_running), line.reasons()
    assert line.events("axis-01").count("booted") == 2


def test_a_plain_duration_is_both_times():
    line = line_of("{boot_time: 2s}")
    axis = line.farm.columns.axis[0]
    line.run(1.99)
    assert int(axis.drive.state) == 0
    line.run(0.05)
    assert int(axis.drive.state) == 1
    line.connect()


def test_a_drive_without_boot_time_answers_at_once():
    line = line_of("off")
    assert spoken(line, 0.1)
    assert line.farm.axes[0].station.on_the_wire


def test_a_loss_of_supply_while_the_drive_boots_restarts_the_boot_time():
    line = line_of("{boot_time: {answers: 3s}}")
    station = line.farm.axes[0]
    line.run(2.0)
    station.station.power_off(line.world.now)
    line.farm.settle(station.station, line.world.now)
    assert spoken(line, 2.0) == []
    assert not station.station.on_the_wire
    station.station.power_on(line.world.now)
    line.farm.settle(station.station, line.world.now)
    assert spoken(line, 2.9) == []
    line.run(0.2)
    assert station.station.on_the_wire


def test_a_reset_by_parameter_boots_as_long():
    """AKD, DRV.REBOOT (PNU 3013)."""
    line = line_of("{boot_time: {answers: 2s}}")
    line.run(2.1)
    line.connect()
    station = line.farm.axes[0]
    station.store.set("DRV.REBOOT", 1)
    line.farm.settle(station.station, line.world.now)
    assert not station.station.on_the_wire
    assert spoken(line, 1.9) == []
    line.run(0.2)
    assert station.station.on_the_wire


def test_the_power_cycle_of_the_fault_catalogue_boots_the_drive():
    line = line_of("{boot_time: {answers: 1s}}")
    faults = line.farm.injections
    line.run(1.1)
    line.connect()
    fault = faults.inject({"kind": "power-cycle", "on": "all", "params": {"off": "500ms"}}, line.world.now)
    line.run(0.6)
    assert fault.state == "ended"
    assert line.farm.axes[0].powered
    assert not line.farm.axes[0].station.on_the_wire
    line.run(1.0)
    assert line.farm.axes[0].station.on_the_wire
    line.enable()


def test_a_drive_that_boots_does_not_answer():
    """Neither DCP nor ARP nor LLDP: it is not there yet, and nothing that was said meanwhile is answered later."""
    line = line_of("{boot_time: {answers: 3s}}")
    station = line.farm.axes[0]
    tool = Tool(line)
    tool.use("10.77.1.77/23")
    line.run(1.0)
    assert station.port.mac not in tool.identify()
    tool.ip.probe(IPv4Address("10.77.0.11"), line.world.now)
    tool.send_pending(line.world.now)
    assert spoken(line, 1.0) == []
    assert station.station.next_deadline() == 1_000_000_000_000 + 3_000_000_000
    assert not any(station.device.discards().values())
    line.run(1.5)
    assert station.port.mac in tool.identify()
