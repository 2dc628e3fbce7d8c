"""Speed mode without a ramp generator, 32-bit velocities, the dynamic brake, the message word (HIWIN E1 manual)."""

from __future__ import annotations

import pytest
from bench_axis import VELOCITY_STEP, BenchAxis
from from_python import called
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.firmware.profidrive.messages import message_word
from pnfarm.firmware.profidrive.telegram import (
    clamp16,
    current_step,
    from_setpoints,
    no_setpoints,
    to_actuals,
)
from pnfarm.firmware.whole_numbers import clamp32
from pnfarm.table.axis_codes import CMD_CLEAR_HISTORY, CMD_RAISE_FAULT, RAMP_ABSENT, VELOCITY_NSOLL_A, VELOCITY_NSOLL_B
from pnfarm.table.signals import (
    DRV_ACC,
    DRV_DEC,
    FAULT_CODE,
    G1_XIST1,
    G1_XIST2,
    MELDW,
    NIST_A,
    NIST_B,
    NSOLL_A,
    NSOLL_B,
    WARN_CODE,
)

RPM_3000 = 3000.0 / 0x4000


@pytest.fixture
def drive() -> BenchAxis:
    bench = BenchAxis()
    bench.axis.ramp.settings.generator, bench.axis.profidrive.settings.velocity_signal = RAMP_ABSENT, VELOCITY_NSOLL_B
    bench.axis.profidrive.settings.velocity_step = RPM_3000
    return bench


def command(drive: BenchAxis, rpm: float, stw1: int = 0x040F, run: int = 1) -> None:
    drive.image.received[NSOLL_B] = round(rpm / 3000.0 * 0x40000000)
    drive.write(stw1, run=run)
    drive.image.received[NSOLL_A] = 0


# 6.1


@pytest.mark.parametrize(
    ("word", "rpm"), [(0x40000000, 3000.0), (0x20000000, 1500.0), (-0x40000000, -3000.0), (1, 3000.0 / 2**30)]
)
def test_nsoll_b_is_a_share_of_the_reference_value(drive, word, rpm):
    drive.image.received[NSOLL_B] = word
    called(from_setpoints)(drive.axis, drive.image)
    assert drive.axis.ramp.setpoint == pytest.approx(rpm, rel=1e-12)


@pytest.mark.parametrize(("word", "rpm"), [(0x4000, 3000.0), (0xC000, -3000.0)])
def test_nsoll_a_is_the_same_share_in_16_bits(drive, word, rpm):
    drive.axis.profidrive.settings.velocity_signal = VELOCITY_NSOLL_A
    drive.image.received[NSOLL_A] = word
    called(from_setpoints)(drive.axis, drive.image)
    assert drive.axis.ramp.setpoint == pytest.approx(rpm)


@given(st.floats(-20_000, 20_000))
def test_nist_b_is_the_upper_half_of_nist_a_and_stops_at_its_range(rpm):
    drive = BenchAxis()
    drive.axis.profidrive.settings.velocity_step = RPM_3000
    drive.axis.motor.velocity = rpm
    called(to_actuals)(drive.axis, drive.image)
    wide, narrow = int(drive.image.sent[NIST_B]), drive.nist_a
    assert -(2**31) <= wide < 2**31
    exact = rpm / 3000.0 * 2**30
    assert wide == pytest.approx(max(-(2**31), min(2**31 - 1, exact)), abs=1)
    assert abs(wide / 65536 - narrow) <= 0.51 or abs(exact) > 2**31 - 2**16


# telegram 3: 3.3.1 reserves bits 4 to 6, 8 and 9


def test_the_set_point_needs_no_bits_of_a_ramp_generator_and_knows_no_ramp(drive):
    for word in (0x0400, 0x0406, 0x0407, 0x040F):
        drive.write(word)
    command(drive, 1000.0)
    assert drive.axis.ramp.command == pytest.approx(1000.0, abs=1e-5)
    command(drive, -500.0, stw1=0x040F | 0x0300)
    assert drive.axis.ramp.command == pytest.approx(-500.0, abs=1e-5)
    drive.run(100)
    assert drive.axis.motor.velocity == pytest.approx(-500.0, abs=0.1)


def test_the_limits_of_motor_and_parameter_hold(drive):
    drive.enable()
    drive.axis.motor.settings.max_velocity = 2000.0
    command(drive, 3000.0)
    assert drive.axis.ramp.command == 2000.0
    drive.axis.travel.settings.velocity_limit = 800.0
    command(drive, -3000.0)
    assert drive.axis.ramp.command == -800.0
    drive.axis.travel.settings.velocity_limit = 9000.0
    command(drive, 3000.0)
    assert drive.axis.ramp.command == 2000.0


@pytest.mark.parametrize(("stw1", "then"), [(0x040E, 2), (0x040B, 1)])
def test_off_and_quick_stop_use_the_same_ramp(drive, stw1, then):
    drive.axis.ramp.settings.quick_stop_deceleration = 10_000.0
    drive.enable()
    command(drive, 1000.0, run=200)
    drive.write(stw1, run=50)
    assert drive.axis.drive.state == 5
    assert drive.axis.ramp.command == pytest.approx(500.0, abs=21)
    drive.run(80)
    assert drive.axis.motor.velocity == pytest.approx(0.0, abs=0.5)
    assert drive.axis.drive.state == then


# 6.5


def stopped_after(method: int, brake: float = 0.01) -> tuple[BenchAxis, int]:
    drive = BenchAxis()
    drive.axis.motor.settings.coast_method = method
    drive.axis.motor.settings.brake_damping = brake
    drive.axis.load.settings.friction = 0.001
    drive.enable(1000.0)
    drive.run(1000)
    drive.write(0x047D)
    assert drive.axis.drive.state == 1
    time = 0
    while abs(drive.axis.motor.velocity) > drive.axis.ramp.settings.standstill and time < 5000:
        drive.run(1)
        time += 1
    return drive, time


def test_the_dynamic_brake_stops_a_motor_that_runs_free_for_long():
    assert stopped_after(0)[1] < 300
    assert stopped_after(1)[1] < 300
    assert stopped_after(2)[1] > 1000
    assert stopped_after(0, brake=0.0)[1] > 1000


def test_the_brake_stays_applied_or_is_released_after_the_stop():
    speeds = []
    for method in (0, 1):
        drive, _ = stopped_after(method)
        drive.axis.ramp.settings.standstill = 50.0  # well above the creeping of a braked load
        drive.axis.load.settings.torque = -0.02
        drive.run(300)
        speeds.append(abs(float(drive.axis.motor.velocity)))
    held, free = speeds
    assert held < 0.6 * free


def test_a_very_light_load_stays_stable_under_the_brake():
    drive = BenchAxis()
    drive.axis.motor.settings.brake_damping = 1.0
    drive.enable(1000.0)
    drive.run(1000)
    drive.axis.load.settings.inertia = 1e-7
    drive.axis.load.settings.friction = 0.0
    drive.write(0x047D, run=100)
    assert abs(drive.axis.motor.velocity) < 1.0


# 3.16, FAULT_CODE, PNU 944 and 952


def test_meldw_shows_enable_ready_and_pulses(drive):
    assert called(message_word)(drive.axis) == 0x01C2
    drive.enable()
    drive.run(1)
    assert int(drive.image.sent[MELDW]) == 0x39C2
    drive.axis.motor.torque = -drive.axis.motor.settings.peak_current * drive.axis.motor.settings.torque_constant
    assert called(message_word)(drive.axis) == 0x39C0


def test_fault_code_is_the_models_word_or_the_number(drive):
    drive.axis.profidrive.settings.fault_words[73] = 0xFB1
    assert drive.image.sent[FAULT_CODE] == 0
    drive.command(CMD_RAISE_FAULT, 73)
    drive.run(1)
    assert drive.image.sent[FAULT_CODE] == 0xFB1
    assert drive.image.sent[WARN_CODE] == 0
    other = BenchAxis()
    other.command(CMD_RAISE_FAULT, 702)
    other.run(1)
    assert other.image.sent[FAULT_CODE] == 702


def test_every_change_of_the_fault_buffer_counts_and_its_history_can_be_forgotten(drive):
    axis = drive.axis
    for number in (17, 18):
        drive.command(CMD_RAISE_FAULT, number)
        drive.run(1)
    assert (axis.faults.changes, axis.faults.counter) == (2, 1)
    drive.write(0x0480)
    assert (axis.faults.changes, axis.faults.counter) == (3, 1)
    drive.command(CMD_RAISE_FAULT, 19)
    drive.run(1)
    assert (axis.faults.changes, axis.faults.counter) == (4, 2)
    drive.command(CMD_CLEAR_HISTORY)
    drive.run(1)
    assert (axis.faults.changes, axis.faults.counter) == (5, 1)
    assert [int(number) for number in axis.faults.buffer if number] == [19]
    drive.write(0x0400)
    drive.write(0x0480)
    drive.command(CMD_CLEAR_HISTORY)
    drive.run(1)
    assert (axis.faults.changes, axis.faults.counter) == (7, 0)
    assert not axis.faults.buffer.any()
    drive.command(CMD_CLEAR_HISTORY)
    drive.run(1)
    assert axis.faults.changes == 7, "there was nothing to forget"


def test_a_sensor_without_a_step_sends_no_position(drive):
    drive.axis.motor.position = 1.5
    drive.run(1)
    assert drive.image.sent[G1_XIST1] == 0
    drive.axis.sensor.settings.step = 2.0**-23
    drive.run(1)
    assert drive.image.sent[G1_XIST1] == 3 << 22


def test_the_second_position_of_a_sensor_has_a_step_of_its_own_or_stays_0(drive):
    drive.axis.motor.position = 1.5
    drive.axis.sensor.settings.step = 2.0**-23
    drive.run(1)
    assert (drive.image.sent[G1_XIST1], drive.image.sent[G1_XIST2]) == (3 << 22, 0)
    drive.axis.sensor.settings.step_2 = 2.0**-20
    drive.run(1)
    assert (drive.image.sent[G1_XIST1], drive.image.sent[G1_XIST2]) == (3 << 22, 3 << 19)


def test_a_drive_with_a_ramp_generator_keeps_it():
    drive = BenchAxis()
    drive.enable(1000.0)
    assert drive.axis.ramp.command == pytest.approx(10.0, abs=0.5)
    assert drive.image.sent[NIST_A] == round(drive.axis.motor.velocity / VELOCITY_STEP)


# what does not fit stops at the end of its range


@pytest.mark.parametrize(
    ("value", "word"),
    [(32766.6, 0x7FFF), (32767.6, 0x7FFF), (1e9, 0x7FFF), (-32767.6, 0x8000), (-32768.6, 0x8000), (-1e9, 0x8000)],
)
def test_a_signal_of_16_bits_never_changes_its_sign_at_the_end_of_its_range(value, word):
    assert called(clamp16)(value) == word


@pytest.mark.parametrize(
    ("value", "number"), [(2147483647.6, 2**31 - 1), (-2147483648.6, -(2**31)), (1e12, 2**31 - 1), (-1e12, -(2**31))]
)
def test_a_signal_of_32_bits_never_changes_its_sign_at_the_end_of_its_range(value, number):
    assert called(clamp32)(value) == number


def test_currents_are_shares_of_the_drives_own_reference_or_of_the_peak_current(drive):
    profidrive, motor = drive.axis.profidrive, drive.axis.motor
    motor.settings.peak_current = 9.0
    assert called(current_step)(profidrive, motor) == pytest.approx(9.0 / 0x4000)
    profidrive.settings.current_step = 5.0 / 0x4000
    assert called(current_step)(profidrive, motor) == pytest.approx(5.0 / 0x4000)


def test_without_a_controller_the_ramps_are_the_drives_own(drive):
    profidrive, ramp = drive.axis.profidrive, drive.axis.ramp
    profidrive.settings.acceleration_step = 1000.0
    drive.image.received[DRV_ACC], drive.image.received[DRV_DEC] = 3, 7
    called(from_setpoints)(drive.axis, drive.image)
    assert (ramp.up, ramp.down) == (3000.0, 7000.0)
    called(no_setpoints)(drive.axis.torque, ramp)
    assert (ramp.up, ramp.down) == (ramp.settings.acceleration, ramp.settings.deceleration)
    assert (ramp.setpoint, drive.axis.torque.setpoint) == (0.0, 0.0)
