"""Position mode: homing and jogging."""

import pytest
from positioner import HOME, HOMED, ON_TARGET, READY, STOPPED, Positioner, task

from pnfarm.table.signals import DRIVE_MOTION_STATUS, SATZANW


def test_5_10_3_homing_clears_bits_10_11_13_and_sets_them_at_its_end():
    drive = Positioner(homed=False)
    drive.axis.homing.settings.position = 0.25
    drive.stand_at(0.4)
    assert not drive.stw(HOME, 20) & (ON_TARGET | HOMED | STOPPED)
    drive.until(ON_TARGET | HOMED | STOPPED)
    assert drive.axis.motor.position == pytest.approx(1.0, abs=1e-3), "the zero mark of the encoder"
    assert drive.place == pytest.approx(0.25, abs=1e-3)
    assert drive.image.sent[DRIVE_MOTION_STATUS] & 0x0006 == 0x0006


def test_homing_backwards_moves_on_by_the_homing_distance():
    drive = Positioner(homed=False)
    drive.axis.homing.settings.direction = -1.0
    drive.axis.homing.settings.distance = -0.5
    drive.stand_at(0.4)
    drive.stw(HOME, 20)
    drive.until(ON_TARGET | HOMED | STOPPED)
    assert drive.axis.motor.position == pytest.approx(-0.5, abs=1e-3)
    assert drive.place == pytest.approx(-0.5, abs=1e-3)


def test_homing_that_is_aborted_leaves_the_home_position_unknown():
    drive = Positioner()
    drive.stw(HOME, 30)
    drive.stw(READY, 300)
    assert drive.zsw1 & (HOMED | STOPPED) == STOPPED
    assert not drive.image.sent[DRIVE_MOTION_STATUS] & 0x0006


def test_jogging_runs_at_the_jog_set_point_and_stops():
    drive = Positioner()
    drive.stw(0x050F, 500)
    assert drive.axis.motor.velocity == pytest.approx(100.0, abs=0.5)
    drive.stw(0x040F, 500)
    assert drive.zsw1 & STOPPED
    drive.stw(0x060F, 500)
    assert drive.axis.motor.velocity == pytest.approx(-50.0, abs=0.5)
    drive.stw(0x070F, 500)
    assert drive.zsw1 & STOPPED, "both at once"


def test_jogging_needs_bits_4_to_6_at_zero():
    drive = Positioner()
    drive.stw(READY | 0x0100, 200)
    assert drive.zsw1 & STOPPED


def test_5_4_real_time_jogging_follows_the_data_of_the_task_and_the_direction_bit():
    drive = Positioner()
    drive.data(0.0, velocity=240.0)
    drive.stw(READY | 0x1000, 300)
    assert drive.axis.motor.velocity == pytest.approx(240.0, abs=0.5)
    drive.data(0.0, velocity=120.0)
    drive.run(300)
    assert drive.axis.motor.velocity == pytest.approx(120.0, abs=0.5)
    drive.stw(READY | 0x3000, 300)
    assert drive.axis.motor.velocity == pytest.approx(-120.0, abs=0.5)
    drive.stw(READY, 300)
    assert drive.zsw1 & STOPPED


def test_5_4_bit_4_that_falls_alone_leaves_a_real_time_jog_alone():
    """It rejects traversing tasks; jogging by bits 8 and 9 asks for it to be 0."""
    drive = Positioner()
    drive.data(0.0, velocity=240.0)
    drive.stw(READY | 0x1000, 300)
    drive.stw((READY | 0x1000) & ~0x0010, 300)
    assert drive.axis.motor.velocity == pytest.approx(240.0, abs=0.5)


def test_5_4_real_time_jogging_uses_the_telegrams_data_whatever_satzanw_names():
    drive = Positioner()
    task(drive, 5, 1.0)
    drive.data(0.0, velocity=240.0)
    drive.image.received[SATZANW] = 5
    drive.stw(READY | 0x1000, 300)
    assert drive.axis.motor.velocity == pytest.approx(240.0, abs=0.5)
