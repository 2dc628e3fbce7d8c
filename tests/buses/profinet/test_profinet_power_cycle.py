"""What a PROFINET drive has in its memory, shows and counts after its supply went, or a reset restarted it."""

from __future__ import annotations

import pytest
from virtual_line import VirtualLine

from pnfarm.protocols.profinet.wire.block import RawBlock
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
