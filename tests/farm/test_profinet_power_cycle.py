"""What a PROFINET drive has in its memory, shows and counts after its supply went, or a reset restarted it."""

from __future__ import annotations

from ipaddress import IPv4Address

import pytest
from dcp_tool import Tool, address
from virtual_line import VirtualLine

from pnfarm.buses.profinet.device.modules import modules_view
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.protocols.profinet.wire.block import RawBlock
from pnfarm.protocols.profinet.wire.dcp.blocks import IpParameterBlock, ResetMode, ResetToFactoryBlock
from pnfarm.protocols.profinet.wire.records.pdev_port import PdevBlockType

INTERFACE = 0x8000
NC_CHECK, MRP_CHECK, EXPECTED_DATA = 0x8070, 0x8051, 0xF842


@pytest.fixture
def line() -> VirtualLine:
    line = VirtualLine()
    line.connect()
    return line


def written(line: VirtualLine, index: int, octets: int, block_type: int = PdevBlockType.NC_DATA_CHECK) -> str:
    data = RawBlock(block_type, bytes(octets - 6)).emit()
    job = line.plc.write_record("axis-01", (0, 0, INTERFACE, index), data, line.world.now)
    line.run(0.1)
    assert job.done
    return job.failure


def test_a_record_of_the_interface_that_memory_would_not_take_back_is_refused(line: VirtualLine) -> None:
    assert written(line, NC_CHECK, 4096) == ""
    assert "length" in written(line, NC_CHECK, 4097)
    line.farm.axes[0].station.power_cycle(line.world.now)
    line.run(2.0)
    line.connect()
    job = line.plc.read_record("axis-01", (0, 0, INTERFACE, NC_CHECK), line.world.now)
    line.run(0.1)
    assert job.data is not None
    assert len(job.data) == 4096


def test_what_a_controller_expects_of_the_interface_can_be_read_however_much_it_wrote(line: VirtualLine) -> None:
    written(line, NC_CHECK, 60_000)
    written(line, MRP_CHECK, 60_000, PdevBlockType.INTERFACE_MRP_DATA_CHECK)
    job = line.plc.read_record("axis-01", (0, 0, 0, EXPECTED_DATA), line.world.now)
    line.run(0.1)
    assert job.done
    assert job.failure == ""


def suite(line: VirtualLine, tool: Tool) -> tuple[str, str]:
    """Address and gateway as DCP reads them."""
    tool.dcp.get(line.farm.axes[0].port.mac, [IpParameterBlock.ID], now=line.world.now)
    tool.send_pending(line.world.now)
    line.run(0.02)
    (block,) = tool.found.pop().blocks
    return str(block.address), str(block.gateway)


def test_the_own_address_as_gateway_is_read_back_after_a_power_cycle_as_it_was_set() -> None:
    line = VirtualLine(controller=False)
    tool = Tool(line)
    assert tool.set(address("10.77.0.99")) == [0]
    assert suite(line, tool) == ("10.77.0.99", "10.77.0.99")
    line.farm.axes[0].station.power_cycle(line.world.now)
    line.run(2.0)
    assert suite(line, tool) == ("10.77.0.99", "10.77.0.99")


@pytest.mark.parametrize("gateway", ["0.0.0.0", "10.77.0.11"])
def test_the_address_that_a_connected_drive_has_is_accepted_in_both_ways_of_saying_no_gateway(
    line: VirtualLine, gateway: str
) -> None:
    block = IpParameterBlock(IPv4Address("10.77.0.11"), IPv4Address("255.255.254.0"), IPv4Address(gateway))
    tool = Tool(line)
    assert tool.set(block) == [0]
    assert suite(line, tool) == ("10.77.0.11", gateway)
    line.run(5.0)
    assert line.farm.axes[0].device.connected


def test_a_drive_that_is_off_has_no_connection_and_no_module_has_an_owner(line: VirtualLine) -> None:
    (station,) = line.farm.axes
    station.station.power_off(line.world.now)
    assert drive_snapshot(line.farm, station, line.world.now)["details"]["connections"] == []
    owners = {one["owner"] for module in modules_view(station.device) for one in module["submodules"]}
    assert owners == {None}


def test_the_counters_of_a_drive_that_a_reset_restarts_begin_behind_the_answer_to_it() -> None:
    line = VirtualLine(controller=False)
    (station,) = line.farm.axes
    line.run(6.0)
    assert Tool(line).set(ResetToFactoryBlock(ResetMode.DEVICE << 1)) == [0]
    counted = station.device.traffic.counters(station.device.discards())
    assert (counted.out_unicast, counted.out_multicast) == (0, station.device.neighbours.lldp.sent)
