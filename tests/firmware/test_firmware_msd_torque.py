"""Torque control and the limits of speed and torque of the Moog MSD (tables 10.1, 10.12, 10.13, 10.14 and 15.1)."""

from __future__ import annotations

from math import inf, pi

import pytest
from msd_bench import TASKS, MsdBench

from pnfarm.drives.parameters.factor_group import float_bits
from pnfarm.drives.parameters.parameter import ParameterError

PEAK = 4.5  # N m: 9 A at 0.5 N m/A
INERTIA, FRICTION = 2e-4, 0.05
RPM = 2 * pi / 60
#: STW1.0 taken back, STW1.3 still set.
OFF_1 = 0x047E


def running(speed: int = 0, **params: float) -> MsdBench:
    """In operation under speed control without a ramp; numbers with a fraction are floats of the drive."""
    bench = MsdBench(1, 0x0101, **{n: float_bits(v) if isinstance(v, float) else v for n, v in params.items()})
    bench.enable(NSOLL_A=speed & 0xFFFF)
    bench.run(300)
    return bench


# speed limits


@pytest.mark.parametrize(
    ("params", "forwards", "backwards"),
    [
        ({}, 3000, 3000),
        ({"P_0328": 50.0}, 1500, 1500),
        ({"P_0334": 40.0}, 1200, 3000),
        ({"P_0333": 30.0}, 3000, 900),
        ({"P_0328": 50.0, "P_0333": 80.0, "P_0334": 20.0}, 600, 1500),
        ({"P_0458": 2000.0}, 2000, 2000),
        ({"P_0458": 2000.0, "P_0328": 10.0}, 200, 200),
        ({"P_0458": 6000.0}, 3000, 3000),
        ({"P_0328": 0.0}, 0, 0),
    ],
)
def test_p_0328_p_0333_and_p_0334_limit_the_speed_in_percent_of_p_0458(
    params: dict[str, float], forwards: int, backwards: int
) -> None:
    """Tables 10.12 and 10.13; never faster than the motor."""
    assert running(3200, **params).speed == pytest.approx(forwards, abs=2)
    assert running(-3200, **params).speed == pytest.approx(-backwards, abs=2)


def test_speed_limits_hold_for_positions_and_at_once() -> None:
    bench = MsdBench(9, P_1278=100, P_1279=100)
    bench.enable(TASKS, VELOCITY_A=2000)
    bench.send(600, STW1=TASKS | 0x0040, TARPOS_A=1000 * 65536)
    assert bench.speed == pytest.approx(2000, abs=2)
    bench.store.set("P-0334", float_bits(25.0))
    bench.run(500)
    assert bench.speed == pytest.approx(750, abs=2)


# torque limits


@pytest.mark.parametrize(
    ("params", "forwards", "backwards"),
    [
        ({"P_0460": 2.0}, 2.0, 2.0),
        ({"P_0329": 50.0}, PEAK / 2, PEAK / 2),
        ({"P_0460": 2.0, "P_0331": 25.0}, 0.5, 2.0),
        ({"P_0460": 2.0, "P_0330": 30.0}, 2.0, 0.6),
        ({"P_0460": 2.0, "P_0329": 50.0, "P_0330": 30.0, "P_0331": 80.0}, 1.0, 0.6),
        ({"P_0460": 2.0, "P_0332": 40.0}, 0.8, 0.8),
        ({"P_0460": 2.0, "P_0329": 400.0, "P_0330": 400.0, "P_0331": 200.0}, 4.0, PEAK),
        ({"P_0460": 2.0, "P_0331": 50.0, "P_1286": 100}, PEAK / 10, PEAK / 10),
    ],
)
def test_p_0329_to_p_0332_limit_the_torque_in_percent_of_p_0460(
    params: dict[str, float], forwards: float, backwards: float
) -> None:
    """Table 10.12; the online factors of table 15.1 act beside them, and so does the drive's peak current."""
    bench = running(1000, **params)
    bench.send(5, NSOLL_A=2900)
    assert bench.axis.motor.torque == pytest.approx(forwards, rel=0.01)
    assert bench.zsw2 & 0xC == 0x4
    bench.send(8, NSOLL_A=-2900 & 0xFFFF)
    assert bench.axis.motor.torque == pytest.approx(-backwards, rel=0.01)
    assert bench.zsw2 & 0xC == 0x8


def test_a_farms_motor_with_a_rated_torque_is_what_the_percentages_are_of() -> None:
    bench = MsdBench()
    bench.axis.torque.settings.rated = 1.2
    bench.store.power_on()
    bench.store.set("P-0331", float_bits(50.0))
    assert float(bench.axis.torque.settings.limit_positive) == pytest.approx(0.6)
    assert float(bench.axis.torque.settings.limit_negative) == pytest.approx(1.2)


def test_limits_and_additive_set_points_are_kept_over_a_power_cycle() -> None:
    bench = MsdBench(P_0460=float_bits(2.0), P_0330=float_bits(30.0), P_0333=float_bits(20.0), P_0401=float_bits(-0.5))
    bench.store.set("P-0971", 1)
    bench.store.power_on()
    axis = bench.axis
    assert float(axis.torque.settings.limit_negative) == pytest.approx(0.6, rel=1e-6)
    assert float(axis.travel.settings.velocity_limit_negative) == pytest.approx(600.0, rel=1e-6)
    assert float(axis.torque.settings.additive) == -0.5


@pytest.mark.parametrize("number", ["P-0328", "P-0332", "P-0401", "P-0402", "P-0460"])
def test_a_value_that_is_no_number_is_refused(number: str) -> None:
    bench = MsdBench()
    before = bench.store.get(number)
    for value in (float_bits(inf), float_bits(-inf), 0x7FC00000, 0xFFC00000, 0xFFFFFFFF):
        with pytest.raises(ParameterError, match="0x02"):
            bench.store.set(number, value)
    assert bench.store.get(number) == before


# additive set points


def test_p_0401_is_added_to_the_torque_of_the_speed_controller() -> None:
    bench = running(P_0401=0.6)
    bench.axis.load.settings.torque = 0.6
    bench.run(200)
    assert bench.axis.motor.torque == pytest.approx(0.6, abs=FRICTION)
    assert abs(float(bench.axis.motor.speed_integral)) <= FRICTION
    bench.store.set("P-0401", float_bits(0.0))
    bench.run(200)
    assert bench.axis.motor.torque == pytest.approx(0.6, abs=FRICTION)
    assert bench.axis.motor.speed_integral == pytest.approx(0.6, abs=FRICTION)


def test_p_0402_is_added_to_the_speed_in_operation() -> None:
    bench = running(500, P_0402=-120.0)
    assert bench.speed == pytest.approx(380, abs=1)
    bench.store.set("P-0402", float_bits(3000.0))
    bench.run(300)
    assert bench.speed == pytest.approx(3000, abs=2)
    bench.send(1000, STW1=OFF_1)
    assert (round(bench.speed), bench.state) == (0, 2)


def test_p_0402_shifts_a_position_by_what_its_controller_takes_up() -> None:
    """Table 10.14: the position controller stays in command."""
    bench = MsdBench(9, P_1278=100, P_1279=100, P_0402=float_bits(30.0))
    bench.enable(TASKS, VELOCITY_A=1000)
    bench.run(500)
    assert bench.speed == pytest.approx(0.0, abs=0.5)
    assert bench.axis.positioning.following_error == pytest.approx(-30 / 60 / 50, rel=0.05)


# torque control


def torque_line(**params: int) -> MsdBench:
    """A mapping of the torque both ways, and P-0300 = 1."""
    bench = MsdBench(111, P_0300=1, **params)
    bench.store.write(915, 0, [967, 1272])
    bench.store.write(916, 0, [968, 1273, 1272])
    bench.enable()
    return bench


def test_p_0300_at_1_follows_p_1272_as_process_data_in_units_of_p_0295() -> None:
    bench = torque_line(P_0295=float_bits(0.001))
    bench.send(20, REF_TORQUE=500)
    assert bench.speed == pytest.approx((0.5 - FRICTION) / INERTIA * 0.020 / RPM, rel=0.03)
    assert bench.see("ACT_TORQUE") == pytest.approx(500, abs=1)
    assert bench.store.get("P-1273") == bench.see("ACT_TORQUE")
    bench.send(30, REF_TORQUE=-500 & 0xFFFF)
    assert bench.axis.motor.torque == pytest.approx(-0.5, rel=0.01)
    assert bench.store.get("P-1272") == -500
    assert bench.store.get("P-1273") == pytest.approx(-500, abs=1)
    assert bench.store.get("P-0930") == 0


def test_p_1272_counts_as_a_parameter_where_no_telegram_brings_it() -> None:
    bench = MsdBench(1, P_0300=1, P_0295=float_bits(0.01))
    bench.enable(NSOLL_A=1500)
    assert (bench.speed, int(bench.axis.ramp.command)) == (0.0, 0), "a speed means nothing"
    bench.store.set("P-1272", 40)
    bench.run(20)
    assert bench.axis.motor.torque == pytest.approx(0.4, rel=0.01)
    bench.store.set("P-1272", 0)
    bench.run(5)
    assert bench.axis.motor.torque == pytest.approx(0.0, abs=0.01)


def test_in_torque_control_limits_and_the_additive_torque_act() -> None:
    bench = torque_line(
        P_0295=float_bits(0.001),
        P_0460=float_bits(2.0),
        P_0331=float_bits(30.0),
        P_0334=float_bits(20.0),
        P_0401=float_bits(0.1),
    )
    bench.send(5, REF_TORQUE=100)
    assert bench.axis.motor.torque == pytest.approx(0.2, rel=0.01)
    bench.send(5, REF_TORQUE=2000)
    assert bench.axis.motor.torque == pytest.approx(0.6, rel=0.01)
    assert bench.zsw2 & 0xC == 0x4
    bench.run(500)
    assert 590 < bench.speed <= 600


def test_torque_needs_the_control_location_and_the_reference_selector() -> None:
    """14.1.1: P-0165 = 9."""
    bench = torque_line(P_0165=3)
    bench.send(50, REF_TORQUE=2)
    assert bench.speed == 0.0
    bench.store.set("P-0165", 9)
    bench.run(50)
    assert bench.speed > 1000


def test_the_end_of_operation_in_torque_control_brakes_as_in_the_other_modes() -> None:
    """Tables 10.2 to 10.7: along the deceleration of P-1279."""
    bench = torque_line(P_0295=float_bits(0.001), P_1279=50)
    bench.send(30, REF_TORQUE=500)
    top = bench.speed
    bench.send(100, STW1=OFF_1)
    assert bench.speed == pytest.approx(top - 50 * 60 * 0.1, abs=10)
    bench.run(300)
    assert (round(bench.speed), bench.state) == (0, 2)


def test_status_words_in_torque_control_show_no_speed_set_point() -> None:
    """Tables 10.8 and 10.9: bits 8 and 10 are of speeds, and the profile generator rests."""
    bench = torque_line(P_0295=float_bits(0.001))
    assert bench.zsw1 & 0x0500 == 0
    for _ in range(30):
        bench.send(1, REF_TORQUE=500)
        assert bench.zsw1 & 0x0500 == 0
        assert bench.zsw2 & 0x3 == 0


def test_u_f_operation_runs_as_speed_control() -> None:
    bench = MsdBench(1, 0x0101, P_0300=0)
    bench.enable(NSOLL_A=700)
    bench.run(300)
    assert bench.speed == pytest.approx(700, abs=1)
