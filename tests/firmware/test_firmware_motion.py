"""Ramp generator and motor, against closed-form answers."""

import math

import pytest
from bench_axis import MS, BenchAxis
from from_python import called

from pnfarm.firmware.motion.ramp import approach
from pnfarm.firmware.profidrive.telegram import signed16
from pnfarm.firmware.whole_numbers import signed32
from pnfarm.table.signals import ITIST_GLATT, XIST_A


def test_ramp_up_takes_speed_over_acceleration():
    drive = BenchAxis()
    drive.enable(1000.0)
    drive.run(98)
    assert drive.axis.ramp.command == pytest.approx(990.0, abs=10.1)
    drive.run(2)
    assert drive.axis.ramp.command == pytest.approx(1000.0, abs=0.2)


def test_stopping_distance_is_v_squared_over_two_a():
    drive = BenchAxis()
    drive.enable(3000.0)
    drive.run(400)
    start = float(drive.axis.motor.position)
    drive.write(0x047F, 0.0, run=700)
    distance = float(drive.axis.motor.position) - start
    expected = 3000.0**2 / (2 * 5000.0) / 60.0
    assert distance == pytest.approx(expected, rel=0.01)


def test_actual_speed_lags_the_ramp_and_settles_on_it():
    drive = BenchAxis()
    drive.enable(2000.0)
    drive.run(50)
    assert drive.axis.motor.velocity < drive.axis.ramp.command
    drive.run(250)
    assert drive.axis.motor.velocity == pytest.approx(drive.axis.ramp.setpoint, abs=0.2)
    assert drive.zsw1 & 0x0500 == 0x0500


def test_current_while_accelerating_is_inertia_and_friction_over_the_torque_constant():
    drive = BenchAxis()
    drive.enable(2000.0)
    drive.run(100)
    alpha = 10_000.0 * 2 * math.pi / 60
    assert drive.axis.motor.current == pytest.approx((2e-4 * alpha + 0.05) / 0.5, rel=0.02)
    drive.run(200)
    assert drive.axis.motor.current == pytest.approx(0.05 / 0.5, rel=0.02)


def test_akd_5_12_4_itist_glatt_is_16384_at_peak_current():
    drive = BenchAxis()
    drive.enable(500.0)
    drive.run(200)
    assert drive.image.sent[ITIST_GLATT] == round(float(drive.axis.motor.current) / 9.0 * 16384)


def test_frozen_ramp_keeps_its_speed():
    drive = BenchAxis()
    drive.enable(2000.0)
    drive.run(50)
    held = drive.write(0x045F, 2000.0) and float(drive.axis.ramp.command)
    drive.run(100)
    assert drive.axis.ramp.command == pytest.approx(held)


def test_without_enable_set_point_the_axis_ramps_to_zero():
    drive = BenchAxis()
    drive.enable(500.0)
    drive.run(200)
    drive.write(0x043F, 500.0, run=50)
    assert 0.0 < drive.axis.ramp.command < 500.0
    drive.run(100)
    assert drive.axis.ramp.command == 0.0


def test_switched_off_ramp_generator_gives_zero():
    drive = BenchAxis()
    drive.enable(500.0)
    drive.run(200)
    drive.write(0x046F, 500.0, run=200)
    assert drive.axis.ramp.command == 0.0


def test_jog_1_and_2_run_their_own_speeds_on_their_own_ramps():
    drive = BenchAxis()
    drive.enable()
    drive.write(0x050F, run=50)
    assert drive.axis.ramp.command == pytest.approx(50.0, abs=1.1)
    drive.run(200)
    assert drive.axis.motor.velocity == pytest.approx(100.0, abs=0.1)
    drive.write(0x040F, run=200)
    drive.write(0x060F, run=200)
    assert drive.axis.motor.velocity == pytest.approx(-50.0, abs=0.1)


def test_both_jog_bits_at_once_stop_the_axis():
    drive = BenchAxis()
    drive.enable()
    drive.write(0x070F, run=100)
    assert drive.axis.ramp.command == 0.0


def test_torque_limit_bounds_the_acceleration():
    drive = BenchAxis()
    drive.axis.load.settings.inertia = 0.1
    drive.enable(1000.0)
    drive.run(100)
    assert drive.axis.motor.current == pytest.approx(9.0)
    alpha = (9.0 * 0.5 - 0.05) / 0.1
    assert drive.axis.motor.velocity == pytest.approx(alpha * 0.1 * 60 / (2 * math.pi), rel=0.05)


def test_coasting_axis_loses_speed_to_dry_friction_and_stops():
    drive = BenchAxis()
    drive.enable(500.0)
    drive.run(200)
    speed = float(drive.axis.motor.velocity)
    drive.write(0x0474, run=50)
    decay = 0.05 / 2e-4 * 60 / (2 * math.pi) * 0.050
    assert drive.axis.motor.velocity == pytest.approx(max(0.0, speed - decay), abs=60)
    drive.run(500)
    assert drive.axis.motor.velocity == 0.0


def test_load_torque_below_friction_does_not_move_a_disabled_axis_but_above_it_does():
    drive = BenchAxis()
    drive.axis.load.settings.torque = 0.04
    drive.run(100)
    assert drive.axis.motor.position == 0.0
    drive.axis.load.settings.torque = 0.2
    drive.run(100)
    assert drive.axis.motor.position < 0.0


def test_enabled_axis_holds_against_a_load_with_the_matching_current():
    drive = BenchAxis()
    drive.axis.load.settings.torque = 0.5
    drive.enable()
    drive.run(500)
    assert abs(float(drive.axis.motor.velocity)) < 30.0
    assert drive.axis.motor.current == pytest.approx(1.0, abs=0.11)


def test_position_mode_does_not_follow_the_velocity_set_point():
    drive = BenchAxis()
    drive.axis.drive.settings.opmode = 2
    drive.enable(500.0)
    drive.run(100)
    assert drive.axis.motor.velocity == 0.0


def test_speed_signal_saturates_instead_of_wrapping():
    drive = BenchAxis()
    drive.axis.motor.velocity = 20_000.0
    drive.axis.powered = 1
    drive.run(1)
    assert drive.nist_a == 0x7FFF


def test_position_signal_counts_65536_per_revolution_and_wraps_at_32_bits():
    drive = BenchAxis()
    drive.axis.motor.position = 40_000.0
    drive.run(1)
    assert int(drive.image.sent[XIST_A]) == called(signed32)(40_000 * 65536)


@pytest.mark.parametrize("step_ms", [1, 2, 4, 16])
def test_result_does_not_depend_on_how_often_the_firmware_is_stepped(step_ms):
    drive = BenchAxis()
    drive.enable(1000.0)
    drive.run(160 // step_ms, step_ms * MS)
    assert drive.axis.motor.position == pytest.approx(1.83, abs=0.03)


@pytest.mark.parametrize(
    ("value", "target", "expected"),
    [(0, 100, 10), (100, 0, 95), (-100, 0, -95), (3, -100, -4), (95, 100, 100), (-3, 100, 4)],
)
def test_ramp_step_grows_with_up_and_shrinks_with_down(value, target, expected):
    assert approach(float(value), float(target), 10.0, 5.0, 1.0) == pytest.approx(expected)


def test_signed_words():
    assert called(signed16)(0xFFFF) == -1
    assert called(signed16)(0x7FFF) == 32767
    assert called(signed32)(0xFFFFFFFF) == -1


def test_without_supply_nothing_moves():
    drive = BenchAxis()
    drive.enable(500.0)
    drive.axis.powered = 0
    drive.run(5)
    assert drive.axis.motor.velocity == 0.0
