"""What readings of a drive on EtherNet/IP show: by its front in memory, or by a farm in virtual time."""

from __future__ import annotations

import asyncio

import yaml
from assembly_bench import ENABLE, MOVE, RELATIVE, REVOLUTION, VELOCITY, AssemblyBench, command

from pnfarm.controller.line import VirtualLine
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.table.axis_codes import CMD_RAISE_FAULT
from pnfarm.table.image import LOST_STOP

NAME = "akd-ethernetip"
FARM = """
farm: cip
link: {{kind: memory}}
drives:
  - {{name: axis-01, model: akd-ethernetip, ip: 10.77.0.11/24, behaviour: {behaviour}}}
"""
#: A move of so many revolutions at 600 rpm.
FAST = {"velocity": 10 * REVOLUTION, "up": 100 * REVOLUTION, "down": 100 * REVOLUTION}


def bench(behaviour: str, mode: int | None = None) -> AssemblyBench:
    """Enabled, in position mode or another one."""
    chosen = {"behaviour": yaml.safe_load(behaviour)}
    drive = AssemblyBench(**chosen) if mode is None else AssemblyBench(mode, **chosen)
    drive.enable(50)
    assert drive.first & 0x80
    return drive


def mode_change(behaviour: str) -> object:
    """The number of the error of a change in operation, and whether the mode is the new one."""

    def error() -> int | None:
        try:
            drive.store.set("DRV.OPMODE", 2)
        except ParameterError as exc:
            return exc.number
        return None

    drive = bench(behaviour, VELOCITY)
    seen = error(), drive.store.get("DRV.OPMODE") == 2
    drive.send(command(0), 50)
    assert error() is None, "and in any case while the power stage is off"
    return seen


def relative_task(behaviour: str) -> object:
    """Where a way of one revolution ends that begins one revolution from the start of a move over five."""
    drive = bench(behaviour)
    start = float(drive.axis.motor.position)
    drive.load(ENABLE, MOVE, position=5 * REVOLUTION, **FAST)
    while float(drive.axis.profile.position) - start < 0.95:
        drive.run(1)
    drive.load(ENABLE | RELATIVE, MOVE, position=REVOLUTION, **FAST)
    drive.run(1500)
    assert drive.first & 0x04, "in position"
    return round(float(drive.axis.motor.position) - start)


def fault_history(behaviour: str) -> object:
    """Whether the fault buffer has anything behind a power cycle."""
    farm, station, world = _farm(behaviour)
    farm.injections.inject({"kind": "drive-fault", "on": "all", "params": {"fault": 702}}, world.now)
    world.run(0.1)
    station.store.set("DRV.CLRFAULTS", 1)
    world.run(0.1)
    assert not station.handle.axis.faults.code.any()
    assert station.handle.axis.faults.buffer.any()
    _power_cycle(station, world)
    return bool(station.handle.axis.faults.buffer.any())


def home_after_power_on(behaviour: str) -> object:
    """Whether the home position is known behind a power cycle."""
    _, station, world = _farm(behaviour)
    station.handle.axis.homing.homed = 1
    _power_cycle(station, world)
    return bool(station.handle.axis.homing.homed)


def enable_behind_fault(behaviour: str) -> object:
    """Whether the power stage goes on when a fault is cleared while Enable is set."""
    drive = bench(behaviour)
    drive.store.handle.push_command(CMD_RAISE_FAULT, drive.store.model.fault("702").code)
    drive.run(500)
    assert not drive.first & 0x80
    drive.store.set("DRV.CLRFAULTS", 1)
    drive.run(100)
    assert not drive.first & 0x08, "no fault is left"
    return bool(drive.first & 0x80)


def idle_controller(behaviour: str) -> object:
    """Whether the power stage is on 20 ms after the controller became idle; in the end it is off."""
    drive = bench(behaviour)
    drive.load(ENABLE, MOVE, position=50 * REVOLUTION, **FAST)
    drive.run(500)
    assert float(drive.axis.motor.velocity) > 500
    drive.lose(LOST_STOP, 20)
    on = bool(drive.first & 0x80)
    drive.run(2000)
    assert not drive.first & 0x80
    assert abs(float(drive.axis.motor.velocity)) < 1.0
    return on


def _farm(behaviour: str):
    line = asyncio.run(VirtualLine.create(parse_farm(FARM.format(behaviour=behaviour))))
    line.world.run(0.5)
    return line.farm, line.farm.axes[0], line.world


def _power_cycle(station, world) -> None:
    station.station.power_cycle(world.now)
    world.run(1.0)
