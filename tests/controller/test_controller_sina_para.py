"""SINA_PARA as a PLC program (`configs/programs/sina_para.py`): parameters of drives, read and written as records."""

from __future__ import annotations

import math
import struct
import sys

import pytest
from block_rig import PROGRAMS, BlockRig
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.controller.program_file import load_program

READ, WRITE = False, True
BLOCK = load_program(PROGRAMS / "sina_para.py", "SinaPara")


@pytest.fixture
def rig():
    with BlockRig("sina_para.py", "SinaPara", telegram=1) as opened:
        yield opened


def job(rig: BlockRig, way: bool, *parameters: tuple, within: float = 2.0) -> list:
    """One job from edge to end; parameters are numbers with index and value."""
    rig.set(Start=False)
    for place, (number, index, *value) in enumerate(parameters, 1):
        one = rig.block.sxParameter[place]
        one.siParaNo, one.siIndex, one.srValue, one.sdValue = number, index, *(value * 2 or (0.0, 0))
    rig.set(0.0, ParaNo=len(parameters), ReadWrite=way, Start=True)
    seen = []
    assert rig.wait(lambda: seen.append(rig.block.Busy) or rig.block.Done or rig.block.Error, within)
    assert any(seen), "it was busy meanwhile"
    assert (rig.block.Busy, rig.block.Ready) == (False, True)
    return rig.block.sxParameter[1 : len(parameters) + 1]


def test_a_read_has_value_and_format_by_type(rig):
    word, real, double = job(rig, READ, (922, 0), (2000, 0), (2571, 0))
    assert (rig.block.Done, rig.block.Error, rig.block.ErrorId, rig.block.DiagId) == (True, False, 0, 0)
    assert (word.srValue, word.syFormat) == (1.0, 0x06)
    assert (real.srValue, real.syFormat) == (3000.0, 0x08)
    assert (double.sdValue, double.syFormat) == (30_000, 0x07)
    assert [one.swErrorNo for one in (word, real, double)] == [0, 0, 0]


def test_sixteen_parameters_are_read_at_once(rig):
    found = job(rig, READ, *((964, index) for index in range(7)), *[(2585, 0)] * 9)
    assert rig.block.Done
    assert found[0].srValue == 0xFFFF
    assert [one.sdValue for one in found[7:]] == [-300] * 9


def test_a_write_reads_the_format_and_changes_the_drive(rig):
    real, double = job(rig, WRITE, (2000, 0, 1500.0), (2585, 0, -600))
    assert rig.block.Done
    assert (real.syFormat, double.syFormat) == (0x08, 0x04)
    assert rig.store.read(2585) == [-600]
    assert rig.store.read(2000)[0] == struct.unpack(">I", struct.pack(">f", 1500.0))[0]


@pytest.mark.parametrize(
    ("parameter", "number"),
    [((1, 0), 0x00), ((964, 9), 0x03), ((922, 0, 3), 0x01), ((2571, 0, 0), 0x02)],
    ids=["no such parameter", "no such index", "read only", "below its limit"],
)
def test_an_error_has_its_number_in_the_parameter_and_its_bit_in_error_id(rig, parameter, number):
    way = WRITE if len(parameter) == 3 else READ
    good, bad = job(rig, way, (2585, 0, -300), parameter)
    assert (rig.block.Done, rig.block.Error) == (False, True)
    assert rig.block.ErrorId == 0x0002_0000, "the second parameter"
    assert (good.swErrorNo, bad.swErrorNo) == (0, number)


def test_a_write_whose_parameter_cannot_be_read_changes_nothing(rig):
    job(rig, WRITE, (2585, 0, -600), (1, 0, 5))
    assert rig.block.ErrorId == 0x0002_0000
    assert rig.store.read(2585) == [-300]


def test_an_axis_that_the_drive_does_not_have_is_an_error_of_each_parameter(rig):
    rig.block.AxisNo = 5
    found = job(rig, READ, (922, 0), (2000, 0))
    assert rig.block.ErrorId == 0x0003_0000
    assert {one.swErrorNo for one in found} == {0x19}


@pytest.mark.parametrize("count", [0, 17, -1])
def test_a_number_of_parameters_beyond_sixteen_is_an_error_without_a_request(rig, count):
    rig.set(ParaNo=count, Start=True)
    assert (rig.block.Error, rig.block.Busy, rig.block.ErrorId) == (True, False, 1)


@pytest.mark.parametrize(("number", "value"), [(2585, 1 << 40), (2585, math.inf), (2585, math.nan), (2000, 1e39)])
def test_a_value_that_its_format_cannot_hold_is_an_error_before_the_write(rig, number, value):
    before = rig.store.read(number)
    job(rig, WRITE, (number, 0, value))
    assert (rig.block.Error, rig.block.ErrorId) == (True, 1)
    assert rig.store.read(number) == before


def test_a_drive_that_takes_its_time_is_asked_again_until_it_has_answered(rig):
    rig.inject("parameter-busy")
    rig.block.sxParameter[1].siParaNo = 922
    rig.set(1.0, Start=True)
    assert rig.block.Busy
    rig.clear()
    assert rig.wait(lambda: rig.block.Done)
    assert rig.block.sxParameter[1].srValue == 1.0


def test_a_refused_record_is_an_error_with_the_drives_status_in_diag_id(rig):
    rig.inject("record-error")
    job(rig, READ, (922, 0))
    assert (rig.block.Error, rig.block.ErrorId, rig.block.DiagId) == (True, 1, 0x80A2)


def test_without_a_connection_a_job_is_an_error(rig):
    rig.inject("link-down")
    assert rig.wait(lambda: not rig.block.connected)
    rig.set(1.0)
    job(rig, READ, (922, 0), within=12.0)
    assert (rig.block.Error, rig.block.ErrorId, rig.block.DiagId) == (True, 1, 0xFFFF)


def test_a_drive_that_is_busy_for_ten_seconds_is_an_error(rig):
    rig.inject("parameter-busy")
    job(rig, READ, (922, 0), within=12.0)
    assert (rig.block.Error, rig.block.ErrorId, rig.block.DiagId) == (True, 1, 0x80B5)


def test_start_taken_back_ends_the_job_and_its_results(rig):
    rig.inject("parameter-busy")
    rig.set(0.1, ParaNo=1, Start=True)
    assert rig.block.Busy
    rig.set(Start=False)
    assert (rig.block.Busy, rig.block.Ready, rig.block.Done, rig.block.Error) == (False, True, False, False)


def test_the_farm_files_program_reads_telegram_and_identification():
    with BlockRig("sina_para.py", telegram=111) as rig:
        assert rig.wait(lambda: rig.block.Done)
        assert [one.srValue for one in rig.block.sxParameter[1:4]] == [111.0, float(0xFFFF), 1.0]


def test_the_block_reads_and_writes_a_slave_of_profibus_as_well():
    with BlockRig("sina_para.py", "SinaPara", model="moog-msd-dp", telegram=1, line=True, cycle="4ms") as rig:
        rig.block.AxisNo = 0
        (found,) = job(rig, READ, (922, 0))
        assert (rig.block.Done, found.srValue) == (True, 1.0)
        job(rig, READ, (64000, 0))
        assert rig.block.ErrorId == 0x0001_0000


@given(st.binary(max_size=80), st.integers(1, 3))
def test_any_answer_is_taken_or_is_none(answer, count):
    block = BLOCK()
    block.reference, block.ParaNo = 1, count
    module = sys.modules[BLOCK.__module__]
    for code in (1, 2):
        block.job = module.Job(code, 0, asked=block.sxParameter[1 : count + 1])
        for octets in (answer, bytes([1, code, 1, count]) + answer):
            wrong = block._values(octets)
            assert wrong is None or 0 <= wrong < 1 << count
