"""A memory that cannot be written: each bus refuses what was asked for in its own words, and the drives go on."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import pytest
from away_memory import Away
from dcp_tool import Tool, address
from record_line import access, changing, value_of
from virtual_line import VirtualLine

from pnfarm.controller import line as controller_line
from pnfarm.drives.catalogue import model
from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.base_mode import parse_response
from pnfarm.farm.file.reading import parse_farm
from pnfarm.protocols.profinet.wire.dcp.blocks import BlockError, NameBlock, ResetMode, ResetToFactoryBlock
from pnfarm.station.event_log import EventLog

REFUSED = ParameterErrorNumber.OPERATING_STATE


def one_drive(name: str, memory: Away) -> tuple[controller_line.VirtualLine, EventLog]:
    keys = "address: 11" if model(name).bus == "profibus" else "ip: 10.77.0.11/24"
    text = f"farm: away\nlink: {{kind: memory}}\ndrives: [{{name: axis-01, model: {name}, {keys}}}]\n"
    log = EventLog(quiet=True)
    line = asyncio.run(controller_line.VirtualLine.create(parse_farm(text), memory=memory, log=log))
    line.world.run(0.05)
    return line, log


#: By what a drive is told to save.
SAVING = {"akd-profinet": "DRV.NVSAVE", "akd-ethernetip": "DRV.NVSAVE", "moog-msd": "971", "moog-msd-dp": "971"}


@pytest.mark.parametrize("name", SAVING)
def test_a_drive_told_to_save_refuses_and_has_what_it_had_after_its_supply_returns(name):
    memory = Away()
    line, log = one_drive(name, memory)
    (station,) = line.farm.axes
    command = SAVING[name]
    before = dict(station.station.kept)
    memory.away = True
    with pytest.raises(ParameterError) as caught:
        station.store.set(command, 1)
    assert caught.value.number == REFUSED
    line.farm.settle(station.station, line.world.now)
    assert "memory not written" in [entry.event for entry in log.entries("axis-01")]
    assert "parameters saved" not in [entry.event for entry in log.entries("axis-01")]
    assert station.station.kept == before
    memory.away = False
    station.store.set(command, 1)
    line.farm.settle(station.station, line.world.now)
    assert memory.load("axis-01")["drive"] == station.store.snapshot()


def test_a_drive_that_saves_each_write_refuses_each():
    memory = Away()
    line, _ = one_drive("hiwin-e1", memory)
    (station,) = line.farm.axes
    parameter = next(
        one for one in station.model.parameters.values()
        if one.nonvolatile and one.writable and not one.elements and one.allows(one.default + 1)
    )  # fmt: skip
    memory.away = True
    with pytest.raises(ParameterError) as caught:
        station.store.write(parameter.pnu, 0, [parameter.default + 1])
    assert caught.value.number == REFUSED
    station.station.power_cycle(line.world.now)
    assert station.store.read(parameter.pnu) == [parameter.default]


def test_a_parameter_request_gets_the_error_in_its_response():
    memory = Away()
    line = VirtualLine(memory=memory)
    line.connect()
    memory.away = True
    answer = access(line, changing(2469, 0x42, 1))
    (entry,) = parse_response(answer).entries
    assert entry.values[0] == REFUSED
    assert line.plc.all_connected
    memory.away = False
    (entry,) = parse_response(access(line, changing(2469, 0x42, 1))).entries
    assert entry.values == ()
    assert value_of(line, 930)


def test_dcp_sets_nothing_permanently_and_everything_else():
    memory = Away()
    line, _ = one_drive("akd-profinet", memory)
    tool = Tool(SimpleNamespace(world=line.world, farm=line.farm, run=line.world.run))
    memory.away = True
    assert tool.set(NameBlock("press-7", 1)) == [BlockError.SET_NOT_POSSIBLE]
    assert tool.set(address("10.77.0.99")) == [BlockError.SET_NOT_POSSIBLE]
    assert tool.set(ResetToFactoryBlock(ResetMode.COMMUNICATION)) == [BlockError.SET_NOT_POSSIBLE]
    # temporary settings need no memory
    assert tool.set(NameBlock("press-8", 0)) == [0]
    memory.away = False
    assert tool.set(NameBlock("press-7", 1)) == [0]
    assert memory.load("axis-01")["name"] == "press-7"


def test_what_a_drive_keeps_by_itself_is_held_and_written_when_it_can_be():
    memory = Away()
    line, log = one_drive("akd-profinet", memory)
    (station,) = line.farm.axes
    memory.away = True
    station.raise_fault(702, hold=False)
    line.world.run(0.05)
    assert station.station.kept["faults"]
    assert [entry.event for entry in log.entries("axis-01")].count("memory not written") == 1
    station.station.power_cycle(line.world.now)
    assert station.station.kept["faults"]
