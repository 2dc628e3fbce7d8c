"""Control parameters of the Moog MSD that its manual names (tables 10.12 to 10.14 and 15.1), on the bench."""

from __future__ import annotations

import pytest
from msd_bench import RUN, TASKS, MsdBench

from pnfarm.drives.parameters.factor_group import float_bits, float_of
from pnfarm.drives.parameters.parameter import ParameterError

PEAK = 4.5  # N m: 9 A at 0.5 N m/A


def running(**params: int) -> MsdBench:
    bench = MsdBench(**params)
    bench.enable(NSOLL_A=1000)
    bench.run(300)
    return bench


def test_p_0167_is_a_percentage_of_every_speed() -> None:
    bench = running()
    bench.store.set("P-0167", float_bits(40.0))
    bench.run(300)
    assert bench.speed == pytest.approx(400, abs=1)
    other = MsdBench(9, P_0167=float_bits(50.0), P_1278=100, P_1279=100)
    other.enable(TASKS, VELOCITY_A=1000)
    other.send(400, STW1=TASKS | 0x0040, TARPOS_A=100 * 65536)
    assert other.speed == pytest.approx(500, abs=2)
    other.store.set("P-0167", float_bits(0.0))
    other.run(500)
    assert round(other.speed) == 0


@pytest.mark.parametrize(
    ("params", "forwards", "backwards"),
    [
        ({}, PEAK, PEAK),
        ({"P_1286": 500}, PEAK / 2, PEAK / 2),
        ({"P_1287": 100}, PEAK / 10, PEAK),
        ({"P_1286": 500, "P_1288": 200}, PEAK / 2, PEAK / 10),
        ({"P_1286": 2000, "P_1287": 500}, PEAK, 2 * PEAK),
    ],
)
def test_p_1286_to_p_1288_scale_the_torque(params: dict[str, int], forwards: float, backwards: float) -> None:
    """Table 15.1, in 1/1000; never more than the drive's peak."""
    bench = running(**params)
    bench.send(5, NSOLL_A=2900)
    assert bench.axis.motor.torque == pytest.approx(min(PEAK, forwards), rel=0.01)
    assert bench.zsw2 & 0xC == 0x4
    bench.send(5, NSOLL_A=-2900 & 0xFFFF)
    assert bench.axis.motor.torque == pytest.approx(-min(PEAK, backwards), rel=0.01)
    assert bench.zsw2 & 0xC == 0x8


def test_table_14_5_a_telegram_brings_the_torque_limits() -> None:
    bench = MsdBench(111, P_0300=2, P_0301=1)
    bench.store.write(915, 0, [967, 1270, 1270, 1287, 1288])
    bench.enable(TORQUE_LIMIT_POSITIVE=1000, TORQUE_LIMIT_NEGATIVE=1000)
    bench.send(5, REF_SPEED=2900, TORQUE_LIMIT_POSITIVE=200)
    assert bench.axis.motor.torque == pytest.approx(PEAK / 5, rel=0.01)
    bench.send(50, REF_SPEED=-2900, TORQUE_LIMIT_NEGATIVE=0)
    assert bench.axis.motor.torque == pytest.approx(0.0, abs=0.01)
    # and without access permission the last ones count
    bench.send(50, STW1=0, TORQUE_LIMIT_NEGATIVE=1000)
    assert bench.axis.motor.torque == pytest.approx(0.0, abs=0.01)


def test_p_0320_p_0321_and_p_0360_are_the_gains_of_the_loops() -> None:
    bench = MsdBench()
    assert (bench.axis.motor.settings.speed_gain, bench.axis.motor.settings.speed_integral_time) == (0.0, 0.0)
    assert bench.axis.positioning.settings.gain == pytest.approx(50.0)
    for name, value in (("P-0320", 0.02), ("P-0321", 10.0), ("P-0360", 6000.0)):
        bench.store.set(name, float_bits(value))
    axis = bench.axis
    assert axis.motor.settings.speed_gain == pytest.approx(0.02 * 60 / 6.283185307179586, rel=1e-6)
    assert axis.motor.settings.speed_integral_time == pytest.approx(0.01, rel=1e-6)
    assert axis.positioning.settings.gain == pytest.approx(100.0, rel=1e-6)


def test_p_0414_and_p_0417_are_what_the_controllers_see() -> None:
    bench = MsdBench(9, P_1278=100, P_1279=100)
    bench.enable(TASKS, VELOCITY_A=1000)
    bench.send(60, STW1=TASKS | 0x0040, TARPOS_A=100 * 65536)
    error = float(bench.axis.positioning.following_error) * 65536
    assert float_of(bench.store.get("P-0414")) == pytest.approx(error, rel=1e-6)
    difference = float(bench.axis.ramp.command) - bench.speed
    assert float_of(bench.store.get("P-0417")) == pytest.approx(difference, rel=1e-5)
    assert abs(difference) > 0.01


def test_p_1273_is_the_torque_in_units_of_p_0295() -> None:
    bench = running(P_0295=float_bits(0.001))
    bench.send(5, NSOLL_A=2900)
    assert bench.store.get("P-1273") == pytest.approx(PEAK * 1000, rel=0.01)
    with pytest.raises(ParameterError, match="0x02"):
        bench.store.set("P-0295", float_bits(0.0))


def test_bits_4_to_6_of_the_ramp_generator() -> None:
    """10.4 and table 10.4: bit 4 makes the output zero, bit 5 freezes it, bit 6 makes the input zero."""
    bench = MsdBench(1, 0x0001, P_1278=10, P_1279=10)
    bench.enable(NSOLL_A=600)
    bench.run(500)
    frozen = float(bench.axis.ramp.command)
    assert frozen == pytest.approx(300, abs=5)
    bench.send(200, STW1=RUN & ~0x0020)
    assert bench.axis.ramp.command == pytest.approx(frozen, abs=1)
    bench.send(200, STW1=RUN & ~0x0040)
    assert bench.axis.ramp.command == pytest.approx(frozen - 120, abs=5)
    bench.send(2000, STW1=RUN)
    assert bench.speed == pytest.approx(600, abs=1)
    bench.send(2000, STW1=RUN & ~0x0010)
    assert (round(bench.speed), bench.state) == (0, 4)


def test_p_0375_and_p_0376_scale_what_is_fed_forward() -> None:
    """Table 10.14: percent of the profile's speed, and of the torque that its acceleration asks for (assumed)."""
    bench = MsdBench(9, P_1278=100, P_1279=100)
    assert (bench.axis.motor.settings.speed_feed_forward, bench.axis.motor.settings.acceleration_gain) == (1.0, 0.0)
    bench.store.set("P-0375", float_bits(50.0))
    bench.store.set("P-0376", float_bits(80.0))
    bench.enable(TASKS, VELOCITY_A=1000)
    bench.send(500, STW1=TASKS | 0x0040, TARPOS_A=100 * 65536)
    left = 0.5 * 1000 / 60 / float(bench.axis.positioning.settings.gain)
    assert bench.axis.positioning.following_error == pytest.approx(left, rel=0.01)
    assert bench.axis.motor.settings.acceleration_gain == pytest.approx(0.8)
