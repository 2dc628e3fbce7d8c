"""Parameters of the Moog MSD over records of a running connection; sections are those of its manual."""

from __future__ import annotations

import pytest
from virtual_line import VirtualLine

from pnfarm.drives.profiles.profidrive.pkw import Pkw

PROFILE_API, SLOT, ACCESS_POINT = 0x3A00, 1, 1
INDEX = 0xB02E


@pytest.fixture
def line() -> VirtualLine:
    line = VirtualLine(model="moog-msd", cycle="1ms", telegram=102)
    line.connect()
    return line


def place(index: int = INDEX, subslot: int = ACCESS_POINT) -> tuple[int, int, int, int]:
    return PROFILE_API, SLOT, subslot, index


def write(line: VirtualLine, request: str, index: int = INDEX) -> str:
    job = line.plc.write_record("axis-01", place(index), bytes.fromhex(request), line.world.now)
    line.run(0.02)
    assert job.done
    return job.failure


def read(line: VirtualLine, index: int = INDEX) -> bytes | str:
    job = line.plc.read_record("axis-01", place(index), line.world.now)
    line.run(0.02)
    assert job.done
    return job.data if job.ok and job.data is not None else job.failure


def test_a_request_is_written_to_0xb02e_and_its_response_read_there(line):
    """9.1, "Parameter access PROFINET"; cyclic data go on meanwhile."""
    frames = int(line.farm.columns.image[0].frames)
    assert write(line, "07 01 00 01 10 01 03 96 00 00") == ""
    assert read(line) == bytes.fromhex("07 01 00 01 42 01 00 7E")
    assert int(line.farm.columns.image[0].frames) - frames >= 38


def test_a_response_is_read_once_and_none_before_a_request(line):
    """9.1: the drive answers the read in the negative as long as it has no data."""
    assert "conflict" in str(read(line))
    assert write(line, "07 01 00 01 10 01 03 96 00 00") == ""
    assert isinstance(read(line), bytes)
    assert "conflict" in str(read(line))


def test_a_request_without_its_header_is_refused_at_once(line):
    assert "length" in write(line, "07 01 00")
    assert "conflict" in str(read(line))


def test_index_47_is_the_parameter_access_too(line):
    """9.1 knows 47 (2F hex) as the profile's data area; a channel of its own, whose axis counts (table 9.6)."""
    assert write(line, "07 01 00 01 10 01 03 96 00 00", 47) == ""
    assert "conflict" in str(read(line))
    assert read(line, 47) == bytes.fromhex("07 01 00 01 42 01 00 7E")
    assert write(line, "08 01 01 01 10 01 03 96 00 00", 47) == ""
    assert read(line, 47) == bytes.fromhex("08 81 01 01 44 01 00 19")


def test_another_index_is_no_parameter_access(line):
    """9.1 names 0xB02E for PROFINET; 0xB02F is that of a drive of several axes."""
    assert "index" in write(line, "07 01 00 01 10 01 03 96 00 00", 0xB02F)


@pytest.mark.parametrize(("limits", "answer"), [("strict", "07 81 00 01 44 01 00 22"), ("lax", "07 01 00 15")])
def test_a_farm_files_limits_say_whether_p_0974_counts(limits, answer):
    line = VirtualLine(model="moog-msd", cycle="1ms", limits=limits)
    line.connect()
    assert write(line, "07 01 00 15" + "10 01 03 96 00 00" * 21) == ""
    assert bytes(read(line)).startswith(bytes.fromhex(answer))


def test_what_base_mode_changes_the_parameter_channel_reads(line):
    """8.2.4 and 9: two ways to one parameter."""
    assert write(line, "07 02 00 01 10 01 03 96 00 00 42 01 00 21") == ""
    assert read(line) == bytes.fromhex("07 02 00 01")
    line.plc.put_parameter_task("axis-01", Pkw(1, 918))
    line.run(0.01)
    assert line.plc.parameter_answer("axis-01") == Pkw(1, 918, value=0x21)
