"""What a model's data makes the firmware do: set points without ramp, waiting for telegrams, one fault a situation."""

from __future__ import annotations

import pytest
from bench_axis import MS, BenchAxis, take_commands
from from_python import called

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.firmware.profidrive.axis_program import step_program
from pnfarm.firmware.profidrive.telegram import from_setpoints
from pnfarm.table.axis_codes import (
    CMD_ACKNOWLEDGE,
    CMD_CLEAR_HISTORY,
    CMD_RAISE_FAULT,
    RAMP_ABSENT,
    RAMP_PASSED_BY,
    VELOCITY_NSOLL_A,
    VELOCITY_NSOLL_B,
    VELOCITY_REF_SPEED,
)
from pnfarm.table.image import IMAGE, LOST_CLOSED, LOST_EXPIRED, LOST_NOT, LOST_STOP
from pnfarm.table.program import CONSTANT, PROGRAM
from pnfarm.table.signals import NIST_B, NSOLL_A, NSOLL_B, REF_SPEED, STW1, ZSW1

FULL = 0x40000000


def valid(bench: BenchAxis, stw1: int, milliseconds: int = 1) -> None:
    bench.image.valid, bench.image.lost = 1, LOST_NOT
    bench.image.received[STW1] = stw1
    bench.run(milliseconds, frame=True)


def enabled(bench: BenchAxis) -> BenchAxis:
    for word in (0x0476, 0x0477, 0x047F):
        valid(bench, word, 2)
    assert bench.axis.drive.state == 4
    return bench


def faults(bench: BenchAxis) -> list[int]:
    return [int(code) & 0xFFFFFF for code in bench.axis.faults.code if code]


def test_nsoll_b_is_a_part_of_the_drives_full_speed_and_so_is_nist_b() -> None:
    bench = enabled(BenchAxis())
    bench.axis.profidrive.settings.velocity_signal, bench.axis.profidrive.settings.velocity_step_b = (
        VELOCITY_NSOLL_B,
        3000.0 / FULL,
    )
    bench.image.received[NSOLL_B] = -FULL // 10
    bench.run(500)
    assert abs(float(bench.axis.motor.velocity) + 300.0) < 0.1
    assert abs(int(bench.image.sent[NIST_B]) + FULL // 10) < FULL // 10_000


def test_nist_b_stops_at_its_ends() -> None:
    bench = BenchAxis()
    bench.axis.profidrive.settings.velocity_step_b = 3000.0 / FULL
    for velocity, end in ((9000.0, 0x7FFFFFFF), (-9000.0, -0x80000000)):
        bench.axis.motor.velocity = velocity
        bench.axis.motor.settings.velocity_time_constant = 1e9
        bench.axis.load.settings.friction = 0.0
        bench.run(1)
        assert int(bench.image.sent[NIST_B]) == end


@pytest.mark.parametrize(("step_b", "increments"), [(0.0, 600 << 16), (3000.0 / FULL, round(FULL / 5))])
def test_a_program_gives_its_speed_in_both_widths(step_b: float, increments: int) -> None:
    """NSOLL_B in the drive's own step, or 65536 increments to one of NSOLL_A."""
    program, image = PROGRAM.allocate(1)[0], IMAGE.allocate(1)[0]
    program.enable, program.kind, program.speed = 1, CONSTANT, -600.0
    program.velocity_step, program.velocity_step_b = 1.0, step_b
    image.valid, image.received[ZSW1] = 1, 0x0237
    step_program(program, image, MS)
    assert (image.sent[NSOLL_A], image.sent[NSOLL_B]) == (0x10000 - 600, -increments)
    program.speed = 1e9
    step_program(program, image, 2 * MS)
    assert (image.sent[NSOLL_A], image.sent[NSOLL_B]) == (0x7FFF, 0x7FFFFFFF)
    program.velocity_step = program.velocity_step_b = 0.0
    step_program(program, image, 3 * MS)
    assert (image.sent[NSOLL_A], image.sent[NSOLL_B]) == (0, 0)


def test_a_speed_in_two_words_has_the_step_of_nsoll_a() -> None:
    bench = enabled(BenchAxis())
    bench.axis.profidrive.settings.velocity_signal, bench.axis.profidrive.settings.velocity_step = (
        VELOCITY_REF_SPEED,
        1.0,
    )
    bench.image.received[REF_SPEED] = -250
    bench.run(500)
    assert abs(float(bench.axis.motor.velocity) + 250.0) < 0.1


@pytest.mark.parametrize(
    ("signal", "rpm"), [(VELOCITY_NSOLL_A, 100.0), (VELOCITY_NSOLL_B, 300.0), (VELOCITY_REF_SPEED, -250.0)]
)
def test_only_the_set_point_that_the_telegram_brings_counts(signal: int, rpm: float) -> None:
    bench = BenchAxis()
    (
        bench.axis.profidrive.settings.velocity_signal,
        bench.axis.profidrive.settings.velocity_step,
        bench.axis.profidrive.settings.velocity_step_b,
    ) = signal, 1.0, 3000.0 / FULL
    bench.image.received[NSOLL_A], bench.image.received[REF_SPEED] = 100, -250
    bench.image.received[NSOLL_B] = FULL // 10
    called(from_setpoints)(bench.axis, bench.image)
    assert abs(float(bench.axis.ramp.setpoint) - rpm) < 0.001


def test_a_direct_set_point_passes_the_ramp_generator_and_stops_keep_their_ramps() -> None:
    bench = enabled(BenchAxis())
    bench.axis.ramp.settings.generator = RAMP_PASSED_BY
    bench.axis.profidrive.settings.velocity_step = 1.0
    bench.image.received[NSOLL_A] = 1000
    bench.run(1)
    assert bench.axis.ramp.command == 1000.0
    bench.run(100)
    valid(bench, 0x047E, 50)
    # 5000 rpm/s for 50 ms
    assert abs(float(bench.axis.ramp.command) - 750.0) < 10.0


def test_bits_4_to_6_work_where_the_ramp_generator_is_bypassed_and_not_where_there_is_none() -> None:
    for kind, rpm in ((RAMP_PASSED_BY, 0.0), (RAMP_ABSENT, 1000.0)):
        bench = enabled(BenchAxis())
        bench.axis.ramp.settings.generator, bench.axis.profidrive.settings.velocity_step = kind, 1.0
        bench.image.received[NSOLL_A] = 1000
        valid(bench, 0x047F & ~0x0040, 5)
        assert bench.axis.ramp.command == rpm


def test_a_jog_without_ramps_of_its_own_takes_those_of_the_drive() -> None:
    bench = enabled(BenchAxis())
    bench.axis.jog.settings.acceleration = bench.axis.jog.settings.deceleration = 0.0
    bench.axis.ramp.settings.acceleration = 200.0
    valid(bench, 0x050F, 250)
    assert abs(float(bench.axis.ramp.command) - 50.0) < 1.0


def test_a_drive_that_waits_raises_its_fault_when_telegrams_stay_away_for_its_time() -> None:
    bench = enabled(BenchAxis())
    bench.axis.faults.settings.loss_delay_ns = 50 * MS
    bench.image.valid, bench.image.lost = 0, LOST_EXPIRED
    bench.run(49)
    assert faults(bench) == []
    assert bench.axis.profidrive.stw1 == 0
    bench.run(2)
    assert faults(bench) == [702]


def test_telegrams_that_come_back_in_time_leave_no_fault() -> None:
    bench = enabled(BenchAxis())
    bench.axis.faults.settings.loss_delay_ns = 50 * MS
    for _ in range(3):
        bench.image.valid, bench.image.lost = 0, LOST_EXPIRED
        bench.run(40)
        valid(bench, 0x0476)
    assert faults(bench) == []


def test_a_controller_in_stop_sends_telegrams_and_one_that_then_goes_is_missed() -> None:
    bench = enabled(BenchAxis())
    bench.axis.faults.settings.loss_delay_ns = 50 * MS
    bench.image.valid, bench.image.lost = 0, LOST_STOP
    bench.run(200)
    assert faults(bench) == []
    bench.image.lost = LOST_CLOSED
    bench.run(52)
    assert faults(bench) == [702]


def test_a_loss_is_reported_once_and_not_before_the_first_telegram() -> None:
    bench = BenchAxis()
    bench.axis.faults.settings.loss_delay_ns = 50 * MS
    bench.run(200)
    assert faults(bench) == []
    enabled(bench)
    bench.image.valid, bench.image.lost = 0, LOST_EXPIRED
    bench.run(60)
    AxisHandle(bench.axis, bench.image).push_command(CMD_ACKNOWLEDGE)
    bench.run(200)
    assert faults(bench) == []
    assert bench.axis.faults.counter == 1


def test_a_memory_of_one_fault_a_situation_moves_by_one_place_and_is_cleared_but_for_the_active_one() -> None:
    bench = BenchAxis()
    bench.axis.faults.settings.places = 1
    handle = AxisHandle(bench.axis, bench.image)
    for number in (11, 12, 13):
        handle.push_command(CMD_RAISE_FAULT, number)
        handle.push_command(CMD_RAISE_FAULT, number + 100)
        called(take_commands)(bench.axis, bench.now)
        if number != 13:
            handle.push_command(CMD_ACKNOWLEDGE)
    assert [int(number) for number in bench.axis.faults.buffer[:4]] == [13, 12, 11, 0]
    assert faults(bench) == [13, 113]
    handle.push_command(CMD_CLEAR_HISTORY)
    called(take_commands)(bench.axis, bench.now)
    assert [int(number) for number in bench.axis.faults.buffer[:4]] == [13, 0, 0, 0]
    assert bench.axis.faults.counter == 1
