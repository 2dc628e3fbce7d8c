"""Data in the assemblies beside motion: Get Attribute, maps, and the tasks that the event loop does."""

from __future__ import annotations

from struct import pack, unpack_from

import pytest
from assembly_bench import (
    ENABLE,
    JOG,
    LOAD,
    MOVE,
    PARAMETER,
    REVOLUTION,
    SET_ATTRIBUTE,
    VELOCITY,
    AssemblyBench,
    command,
)
from from_python import called
from hypothesis import given, settings
from hypothesis import strategies as st

from pnfarm.firmware.ethernetip.tasks import REPEAT_NS, tells

STATIC = bytes(28)


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        (1, 16), (2, int.from_bytes(bytes(range(1, 9)), "little")), (3, 0), (4, 65536), (5, 65536), (6, 1234),
        (7, REVOLUTION), (8, 10922852), (9, 10922852), (10, 0), (11, 0), (17, 1), (25, 0), (58, 0), (100, 0),
    ],
)  # fmt: skip
def test_6_2_2_8_each_attribute_is_in_each_response_with_its_number(attribute: int, value: int) -> None:
    drive = AssemblyBench()
    drive.enable()
    drive.axis.ethernetip.target_units = 1234
    found = drive.send(command(ENABLE, attribute=attribute))
    assert found[32] == attribute
    assert drive.long(24) == value
    assert drive.error == (0, 0)


@pytest.mark.parametrize("attribute", [12, 16, 18, 24, 57, 59, 99, 101, 102, 255])
def test_an_attribute_that_cannot_be_read_is_an_error_while_it_is_asked_for(attribute: int) -> None:
    drive = AssemblyBench()
    drive.send(command(0, attribute=attribute))
    assert drive.error == (0x14, 0xFF)
    drive.send(command(0))
    assert drive.error == (0, 0)


def test_6_2_2_8_the_value_is_new_in_each_response() -> None:
    drive = AssemblyBench(VELOCITY)
    drive.enable()
    drive.load(ENABLE, JOG, attribute=11, velocity=REVOLUTION, up=REVOLUTION, down=REVOLUTION)
    assert drive.long(24) == 1
    assert drive.response[32] == 11


# maps


def test_map_type_0_leaves_the_dynamic_part_zero_and_2_has_what_is_mapped() -> None:
    drive = AssemblyBench()
    drive.store.write(drive.store.model.resolve("EIP.RSPMAP")[0].pnu, 0, [286, 0, 478, 8195, 8193, 8192, 288])
    drive.enable()
    drive.store.handle.push_command(7, 0)
    drive.send(command(ENABLE), 5)
    assert drive.response[33] == 0
    assert drive.response[36:] == bytes(28)
    drive.axis.homing.origin = -2.0
    drive.send(command(ENABLE, map_type=2), 3)
    assert drive.response[33] == 2
    position, fault, inputs, status, volts, error = unpack_from("<iHBBHi", drive.response, 36)
    assert position == 2 * REVOLUTION
    assert (fault, inputs) == (0, 0)
    assert status & 0x03 == 0x03
    assert volts == round(float(drive.axis.supply.voltage))
    assert abs(error) < 100
    assert drive.response[50:] == bytes(14)


def test_a_map_that_is_longer_than_the_assembly_ends_with_the_last_whole_entry() -> None:
    drive = AssemblyBench()
    pnu = drive.store.model.resolve("EIP.RSPMAP")[0].pnu
    drive.store.write(pnu, 0, [8195] + [286] * 15)
    drive.axis.homing.origin = -1.0
    drive.send(command(0, map_type=2))
    assert unpack_from("<i", drive.response, 57) == (REVOLUTION,)
    assert drive.response[61:] == bytes(3)


def test_map_type_1_is_echoed_and_holds_nothing() -> None:
    drive = AssemblyBench()
    drive.store.write(drive.store.model.resolve("EIP.RSPMAP")[0].pnu, 0, [286])
    drive.send(command(0, map_type=1))
    assert drive.response[33:] == bytes([1]) + bytes(30)


def test_mapped_set_points_are_reported_when_they_change_and_not_again() -> None:
    drive = AssemblyBench()
    drive.store.write(drive.store.model.resolve("EIP.CMDMAP")[0].pnu, 0, [383, 384, 386])
    data = pack("<Hii", 3, -100, 100)
    drive.send(command(0, map_type=2, dynamic=data))
    task = int(drive.image.parameter_task)
    assert task >> 24 & 0xFF == 3
    drive.image.parameter_answered = task
    drive.run(50)
    assert int(drive.image.parameter_task) == task
    drive.send(command(0, map_type=2, dynamic=pack("<Hii", 3, -100, 101)))
    assert int(drive.image.parameter_task) != task


# tasks


def reported(drive: AssemblyBench) -> int:
    """The task as the engine reports it: kind, write, number."""
    assert called(tells)(drive.axis.ethernetip, drive.image, drive.now)
    return int(drive.image.parameter_task)


def answer(drive: AssemblyBench, status: int = 0, value: int = 0) -> None:
    drive.axis.ethernetip.settings.answer_status = status
    drive.image.parameter_answer = value
    drive.image.parameter_answered = drive.image.parameter_task


def test_6_2_2_7_a_parameter_is_asked_for_once_and_its_value_stays_in_octets_24_to_31() -> None:
    drive = AssemblyBench()
    drive.load(0, PARAMETER, data=286)
    task = reported(drive)
    assert (task >> 24 & 0xFF, task >> 16 & 1, task & 0xFFFF) == (2, 0, 286)
    drive.run(30)
    assert not drive.second & 0x80, "some parameters take a long time"
    answer(drive, value=-5)
    drive.run(1)
    assert drive.second & 0x80
    assert drive.long(24) == -5
    drive.send(command(0), 10)
    assert drive.long(24) == -5
    drive.send(command(0, attribute=4))
    assert drive.long(24) == 65536


def test_6_2_2_7_a_parameter_is_written_with_octet_6() -> None:
    drive = AssemblyBench()
    drive.load(0, PARAMETER, data=136 | 1 << 16, value=2)
    task = reported(drive)
    assert (task >> 24 & 0xFF, task >> 16 & 1, task & 0xFFFF) == (2, 1, 136)
    assert int(drive.axis.ethernetip.task_value) == 2
    answer(drive, status=0xFF09)
    drive.run(1)
    assert drive.error == (0x09, 0xFF)
    assert drive.response[6:8] == bytes([0x3F, 0x20])


def test_6_2_2_6_an_attribute_is_set() -> None:
    drive = AssemblyBench()
    drive.load(0, SET_ATTRIBUTE, data=101, value=1)
    task = reported(drive)
    assert (task >> 24 & 0xFF, task & 0xFFFF) == (1, 101)
    answer(drive)
    drive.run(1)
    assert drive.second & 0x80


def test_a_task_without_an_answer_is_reported_again_and_one_with_an_answer_is_not() -> None:
    drive = AssemblyBench()
    drive.load(0, PARAMETER, data=286)
    reported(drive)
    assert not called(tells)(drive.axis.ethernetip, drive.image, drive.now + REPEAT_NS - 1)
    assert called(tells)(drive.axis.ethernetip, drive.image, drive.now + REPEAT_NS)
    answer(drive)
    assert not called(tells)(drive.axis.ethernetip, drive.image, drive.now + 10 * REPEAT_NS)


def test_a_second_task_waits_for_the_answer_to_the_first_one() -> None:
    drive = AssemblyBench()
    drive.load(0, PARAMETER, data=286)
    first = reported(drive)
    drive.load(0, PARAMETER, data=288)
    assert int(drive.image.parameter_task) == first
    answer(drive, value=1)
    drive.run(1)
    assert not drive.second & 0x80, "that was the answer to the other one"
    assert reported(drive) & 0xFFFF == 288
    answer(drive, value=2)
    drive.run(1)
    assert drive.long(24) == 2
    assert drive.second & 0x80


def test_an_answer_that_comes_when_load_start_has_fallen_is_nobodys() -> None:
    drive = AssemblyBench()
    drive.load(0, PARAMETER, data=286)
    reported(drive)
    drive.send(command(0))
    answer(drive, status=0xFF16)
    drive.run(2)
    assert drive.error == (0, 0)
    assert not drive.second & 0x80


def test_without_valid_data_nothing_of_the_command_is_echoed() -> None:
    drive = AssemblyBench()
    drive.send(command(0, MOVE, response=5, attribute=4, map_type=2))
    drive.lose(1)
    assert drive.response[3] == 0
    assert drive.response[32:] == bytes(32)


@settings(max_examples=200)
@given(st.lists(st.binary(min_size=64, max_size=64), min_size=1, max_size=6))
def test_any_octets_get_a_response_and_leave_the_axis_finite(assemblies: list[bytes]) -> None:
    drive = SHARED[0] if SHARED else SHARED.append(AssemblyBench()) or SHARED[0]
    for octets in assemblies:
        drive.send(octets, 3)
        drive.send(bytes([octets[0] | LOAD]) + octets[1:], 3)
        drive.image.parameter_answered = drive.image.parameter_task
    assert abs(float(drive.axis.motor.velocity)) < 1e6
    assert drive.response[2] & 0x61 == 0
    assert drive.response[34:36] == b"\0\0"


SHARED: list[AssemblyBench] = []
