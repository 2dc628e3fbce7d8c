"""Noise of measured values: in what the drive tells, the same for the same seed, and never in the motor."""

from __future__ import annotations

import statistics

import numpy as np
import pytest
from bench_axis import MS, VELOCITY_STEP, BenchAxis
from msd_bench import MsdBench

from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.profidrive.smoothed import show_smoothed
from pnfarm.table.signals import (
    ACT_CURRENT,
    AIST_GLATT,
    IAIST_GLATT,
    ITIST_GLATT,
    M_ACT,
    MIST_GLATT,
    NIST_A,
    NIST_A_GLATT,
    NIST_B,
    PIST_GLATT,
    XIST_A,
    XIST_ERROR,
    ZSW1,
)

TARGET = 0x0100
REACHED = 0x0400
ENABLED = 0x047F


def noisy(*, seed: int = 7, velocity: float = 0.0, current: float = 0.0, position: float = 0.0) -> BenchAxis:
    """A drive that runs at 60 rpm, with this noise."""
    bench = BenchAxis()
    for word in (0x0406, 0x0407, 0x040F):
        bench.write(word)
    bench.axis.measurement.settings.velocity_noise = velocity
    bench.axis.measurement.settings.current_noise = current
    bench.axis.measurement.settings.position_noise = position
    bench.axis.measurement.settings.seed = seed
    bench.write(ENABLED, 60.0, run=500)
    return bench


def seen(bench: BenchAxis, slot: int, steps: int) -> list[int]:
    found = []
    for _ in range(steps):
        bench.run(1)
        found.append(int(bench.image.sent[slot]))
    return found


def signed(words: list[int]) -> list[int]:
    return [word - 0x10000 if word & 0x8000 else word for word in words]


def test_noise_has_the_effective_value_that_was_asked_for_and_no_mean():
    bench = noisy(velocity=2.0)
    speeds = [word * VELOCITY_STEP for word in seen(bench, NIST_A, 4000)]
    assert statistics.fmean(speeds) == pytest.approx(float(bench.axis.motor.velocity), abs=0.15)
    assert statistics.pstdev(speeds) == pytest.approx(2.0, rel=0.05)
    assert max(abs(speed - 60.0) for speed in speeds) < 3.5 * 2.0 + 1.0


def test_neighbouring_values_of_noise_have_nothing_to_do_with_each_other():
    speeds = np.array(seen(noisy(velocity=2.0), NIST_A, 4000), float)
    speeds -= speeds.mean()
    for lag in (1, 2, 3, 4):
        assert abs(float((speeds[lag:] * speeds[:-lag]).mean() / speeds.var())) < 0.06, lag


def test_noise_of_the_speed_is_in_every_form_of_it_and_hunts_in_the_bits_that_compare_it():
    bench = noisy(velocity=1.83)
    words = {int(bench.image.sent[ZSW1]) & (TARGET | REACHED) for _ in range(400) if bench.run(1) is None}
    assert words == {0, TARGET | REACHED}
    assert len(set(seen(bench, NIST_B, 50))) > 40
    assert float(bench.axis.motor.velocity) == pytest.approx(60.0, abs=0.3), "the motor runs as before"


def test_noise_of_the_current_and_of_the_position_is_in_their_signals():
    bench = noisy(current=0.1, position=1e-3)
    assert statistics.pstdev(signed(seen(bench, ITIST_GLATT, 2000))) == pytest.approx(0.1 / 9.0 * 16384.0, rel=0.1)
    currents = np.array(seen(bench, ACT_CURRENT, 500), np.int32).view(np.float32)
    assert float(currents.std()) == pytest.approx(0.1, rel=0.15)
    # a thousandth of a revolution is 65 steps, in the position and in the deviation
    assert statistics.pstdev(np.diff(seen(bench, XIST_A, 2000)).tolist()) == pytest.approx(65.5 * 2**0.5, rel=0.1)
    assert statistics.pstdev(seen(bench, XIST_ERROR, 2000)) == pytest.approx(65.5, rel=0.1)


def test_noise_moves_no_motor():
    quiet, loud = noisy(seed=0), noisy(velocity=50.0, current=2.0, position=0.01)
    for bench in (quiet, loud):
        bench.write(ENABLED, 1000.0, run=300)
        bench.write(ENABLED, -200.0, run=300)
        bench.write(0x0400, run=300)
    for field in (
        "motor.position",
        "motor.velocity",
        "motor.current",
        "motor.torque",
        "drive.state",
        "positioning.following_error",
        "motor.speed_integral",
    ):
        assert AXIS.read(quiet.axis, field) == AXIS.read(loud.axis, field), field


def test_dynamic_servo_control_counts_from_the_position_that_was_sent_noise_and_all():
    """XERR is a deviation from G1_XIST1 as the controller has it: the noise in it moves no shaft."""
    bench = MsdBench(5)
    bench.axis.measurement.settings.position_noise = 0.005
    bench.axis.measurement.settings.seed = 7
    bench.enable(KPC=50_000)
    shown, places = set(), []
    for _ in range(400):
        bench.send(1, XERR=round(0.1 * 2**20) - bench.see("G1_XIST1"), KPC=50_000)
        shown.add(bench.see("G1_XIST1"))
        places.append(float(bench.axis.motor.position))
    assert len(shown) > 300
    assert places[-1] == pytest.approx(0.1, abs=1e-4)
    assert max(places[250:]) - min(places[250:]) < 1e-4


def test_the_same_seed_is_the_same_noise_and_another_seed_another():
    first, again, other = noisy(velocity=2.0), noisy(velocity=2.0), noisy(seed=8, velocity=2.0)
    shown = [seen(bench, NIST_A, 100) for bench in (first, again, other)]
    assert shown[0] == shown[1]
    assert shown[0] != shown[2]


def test_without_noise_nothing_is_drawn():
    bench = noisy(seed=0, velocity=2.0)
    assert len(set(seen(bench, NIST_A, 100))) <= 2
    assert int(bench.axis.measurement.noise) == 0


def test_smoothed_values_begin_at_0_when_the_drive_is_switched_on():
    bench = BenchAxis()
    bench.axis.profidrive.settings.shows = 4
    bench.axis.profidrive.settings.smoothing = 1.0
    bench.enable(1000.0)
    bench.run(2000)
    assert bench.image.sent[NIST_A_GLATT] > 0.8 * bench.nist_a
    bench.axis.motor.velocity = 0.0
    bench.off_and_on(10)
    assert [int(bench.image.sent[word]) for word in (NIST_A_GLATT, IAIST_GLATT, MIST_GLATT, PIST_GLATT)] == [0] * 4


def test_smoothed_values_are_shares_of_their_references():
    bench = BenchAxis()
    axis, image = bench.axis, bench.image
    profidrive = axis.profidrive
    # 0x4000 is 3000 rpm, 8 A, 4 N m, and the power of both
    profidrive.settings.velocity_step = 3000.0 / 0x4000
    profidrive.settings.current_step = 8.0 / 0x4000
    profidrive.settings.torque_step = 4.0 / 0x4000
    profidrive.settings.smoothing = 0.0
    axis.torque.settings.limit_positive, axis.torque.settings.limit_negative = 8.0, 2.0
    axis.torque.settings.scale = axis.torque.shares_in_force[0] = axis.torque.shares_in_force[1] = 1.0
    words = (NIST_A_GLATT, IAIST_GLATT, MIST_GLATT, PIST_GLATT, AIST_GLATT, M_ACT)

    def after(milliseconds: int, speed: float, torque: float) -> list[int]:
        axis.motor.velocity, axis.motor.torque, axis.motor.current = speed, torque, torque / 0.5
        axis.last_ns += milliseconds * MS
        show_smoothed(axis, image)
        return signed([int(image.sent[word]) for word in words])

    assert after(1, 1500.0, -1.0) == [0x2000, 0x1000, -0x1000, -0x0800, 0x2000, -0x1000]
    # forwards, the peak current of 9 A allows 4.5 N m
    assert after(1, -1500.0, 4.5) == [-0x2000, 0x4800, 0x4800, -0x2400, 0x4000, 0x4800]
    profidrive.settings.smoothing = 0.02
    assert after(20, 1500.0, 4.5) == [0, 0x4800, 0x4800, 0, 0x4000, 0x4800]
    assert after(20, 1500.0, 0.0) == [0x1000, 0x2400, 0x2400, 0, 0x2000, 0]
