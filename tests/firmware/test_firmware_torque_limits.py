"""Torque limits by parameters, for each direction, and their bit of MELDW (HIWIN E1 manual 6.3, 3.16)."""

from __future__ import annotations

from math import inf, pi

import pytest
from bench_axis import BenchAxis

from pnfarm.table.signals import MELDW

NOT_LIMITED = 0x0002
#: N m: what the peak current of the bench gives.
PEAK = 9.0 * 0.5


@pytest.fixture
def drive() -> BenchAxis:
    bench = BenchAxis()
    bench.axis.load.settings.inertia = 0.1
    bench.axis.ramp.settings.acceleration = bench.axis.ramp.settings.deceleration = 1e6
    return bench


def gained(drive: BenchAxis, rpm: float) -> float:
    """Speed after 100 ms towards ``rpm`` from rest."""
    drive.enable(rpm)
    drive.run(100)
    return float(drive.axis.motor.velocity)


def expected(torque: float) -> float:
    """The same by the inertia and the dry friction of the bench."""
    return (torque - 0.05) / 0.1 * 0.1 * 60 / (2 * pi)


def not_limited(drive: BenchAxis) -> bool:
    return bool(int(drive.image.sent[MELDW]) & NOT_LIMITED)


def test_without_limits_the_peak_current_is_the_limit(drive):
    assert drive.axis.torque.settings.limit_positive == drive.axis.torque.settings.limit_negative == inf
    assert gained(drive, 3000.0) == pytest.approx(expected(PEAK), rel=0.05)
    assert not not_limited(drive)


@pytest.mark.parametrize(("rpm", "positive", "negative", "torque"), [
    (3000.0, 2.0, inf, 2.0), (3000.0, 2.0, 0.5, 2.0), (3000.0, inf, 0.5, PEAK),
    (-3000.0, 2.0, inf, PEAK), (-3000.0, 2.0, 0.5, 0.5), (3000.0, 99.0, 99.0, PEAK),
])  # fmt: skip
def test_each_direction_has_its_own_limit_and_none_goes_beyond_the_peak(drive, rpm, positive, negative, torque):
    drive.axis.torque.settings.limit_positive, drive.axis.torque.settings.limit_negative = positive, negative
    assert abs(gained(drive, rpm)) == pytest.approx(expected(torque), rel=0.05)
    assert abs(float(drive.axis.motor.torque)) == pytest.approx(torque)
    assert not not_limited(drive)


def test_braking_is_limited_in_the_direction_of_its_torque(drive):
    drive.axis.torque.settings.limit_negative = 1.0
    gained(drive, 3000.0)
    drive.write(0x047F, 0.0, run=10)
    before = float(drive.axis.motor.velocity)
    drive.run(100)
    lost = (1.0 + 0.05) / 0.1 * 0.1 * 60 / (2 * pi)
    assert before - float(drive.axis.motor.velocity) == pytest.approx(lost, rel=0.05)


def test_a_limit_of_zero_gives_no_torque_and_a_load_moves_the_axis(drive):
    drive.axis.torque.settings.limit_positive = 0.0
    assert gained(drive, 1000.0) == 0.0
    assert not not_limited(drive)


def test_the_bit_comes_back_when_less_is_asked_and_when_the_power_stage_is_off(drive):
    drive.axis.torque.settings.limit_positive = 1.0
    gained(drive, 3000.0)
    assert not not_limited(drive)
    drive.write(0x047F, float(drive.axis.motor.velocity) / 2)
    drive.run(2000)
    assert not_limited(drive)
    gained(drive, 3000.0)
    drive.write(0x047D)
    assert not_limited(drive)
