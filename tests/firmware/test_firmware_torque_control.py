"""Torque control of the axis, what is added to set points, and the speed limits, against closed-form answers."""

from math import exp, pi

import pytest
from bench_axis import BenchAxis

from pnfarm.firmware.axis import AXIS
from pnfarm.table.image import LOST_STOP
from pnfarm.table.signals import ITIST_GLATT, TORQUE_SETPOINT

RPM = 2 * pi / 60
INERTIA, FRICTION, CONSTANT, PEAK = 2e-4, 0.05, 0.5, 9.0
#: N m of one increment: what the peak current gives is 16384.
STEP = CONSTANT * PEAK / 16384


class TorqueAxis(BenchAxis):
    """A drive in torque mode; ``torque`` sends a set point."""

    def __init__(self, **fields):
        super().__init__()
        self.axis.drive.settings.opmode = 0
        for field, value in fields.items():
            AXIS.write(self.axis, field.replace("__", "."), value)

    def torque(self, newton_metres, run=0):
        self.image.received[TORQUE_SETPOINT] = round(newton_metres / STEP) & 0xFFFF
        self.run(run)

    @property
    def speed(self):
        return float(self.axis.motor.velocity)


@pytest.fixture
def drive():
    bench = TorqueAxis()
    bench.enable()
    return bench


def gain(torque, milliseconds):
    """rpm that a torque beside the friction brings."""
    return torque / INERTIA * milliseconds * 1e-3 / RPM


@pytest.mark.parametrize("torque", [1.0, -0.4])
@pytest.mark.parametrize("step_ns", [62_500, 1_000_000])
def test_a_constant_torque_accelerates_by_what_friction_leaves_of_it_over_the_inertia(torque, step_ns):
    drive = TorqueAxis(motor__step_ns=step_ns)
    drive.enable()
    drive.torque(torque, 40)
    sign = 1 if torque > 0 else -1
    assert drive.speed == pytest.approx(gain(torque - sign * FRICTION, 40), rel=1e-3)
    assert drive.axis.motor.torque == pytest.approx(torque, rel=1e-3)


def test_against_viscous_friction_it_comes_to_the_speed_that_takes_the_torque_up_with_the_motors_time_constant():
    drive = TorqueAxis(load__damping=2e-3, load__friction=0.0, motor__step_ns=62_500)
    drive.enable()
    for milliseconds in (100, 900):
        drive.torque(0.4, milliseconds)
    assert drive.speed * RPM == pytest.approx(0.4 / 2e-3, rel=1e-3)
    other = TorqueAxis(load__damping=2e-3, load__friction=0.0, motor__step_ns=62_500)
    other.enable()
    other.torque(0.4, 100)
    assert other.speed * RPM == pytest.approx(0.4 / 2e-3 * (1 - exp(-0.1 * 2e-3 / INERTIA)), rel=0.01)


def test_a_torque_that_friction_holds_does_not_move_the_shaft(drive):
    drive.torque(0.9 * FRICTION, 500)
    assert drive.speed == 0.0
    assert drive.axis.motor.torque == pytest.approx(0.9 * FRICTION, rel=1e-2)


def test_a_load_heavier_than_the_set_point_turns_the_shaft_backwards(drive):
    drive.axis.load.settings.added_torque = 1.0
    drive.torque(0.5, 20)
    assert drive.speed == pytest.approx(-gain(0.5 - FRICTION, 20), rel=1e-2)


def test_the_current_signal_returns_the_set_point(drive):
    drive.torque(0.25, 5)
    assert int(drive.image.sent[ITIST_GLATT]) == pytest.approx(0.25 / STEP, abs=1)


def test_torque_limits_hold_for_the_set_point_too(drive):
    drive.axis.torque.settings.limit_positive = 0.3
    drive.torque(2.0, 20)
    assert drive.speed == pytest.approx(gain(0.3 - FRICTION, 20), rel=1e-2)


def test_speed_control_bits_of_the_control_word_mean_nothing(drive):
    drive.write(0x040F, run=1)
    drive.torque(0.5, 20)
    assert drive.speed == pytest.approx(gain(0.5 - FRICTION, 20), rel=1e-2)


class TestSpeedLimit:
    """The limits of the speed where the model has them hold."""

    @staticmethod
    def _drive(**fields):
        drive = TorqueAxis(
            torque__speed_limited=1,
            travel__velocity_limit_positive=800.0,
            travel__velocity_limit_negative=300.0,
            **fields,
        )
        drive.enable()
        return drive

    @pytest.mark.parametrize(("torque", "limit"), [(1.0, 800.0), (-1.0, -300.0)])
    def test_each_direction_has_its_own(self, torque, limit):
        drive = self._drive()
        fastest = 0.0
        for _ in range(300):
            drive.torque(torque, 1)
            fastest = max(fastest, abs(drive.speed))
        droop = FRICTION / (INERTIA / 0.002) / RPM
        assert abs(drive.speed) == pytest.approx(abs(limit) - droop, rel=1e-3)
        assert drive.speed * limit > 0
        assert fastest <= abs(limit)

    def test_below_it_nothing_is_taken_from_the_torque(self):
        drive = self._drive()
        drive.torque(0.5, 10)
        assert drive.speed == pytest.approx(gain(0.5 - FRICTION, 10), rel=1e-2)
        assert drive.speed < 300.0

    def test_a_load_that_drives_the_shaft_is_braked_there(self):
        drive = self._drive(load__torque=-0.5)
        drive.torque(0.0, 300)
        assert 800.0 < drive.speed < 800.0 + 0.5 / (INERTIA / 0.002) / RPM

    def test_a_model_without_it_runs_on_until_it_is_too_fast(self):
        drive = TorqueAxis(travel__velocity_limit_positive=800.0, motor__overspeed=1500.0, motor__overspeed_fault=302)
        drive.enable()
        drive.torque(0.5, 200)
        assert drive.axis.faults.code[0] == 302


class TestEnds:
    """What ends operation brakes as in the other modes; the axis is led by its speed then."""

    @staticmethod
    def _fast(**fields):
        drive = TorqueAxis(**fields)
        drive.enable()
        drive.torque(0.5, 50)
        return drive

    def test_off_1_brakes_along_the_ramp(self):
        drive = self._fast()
        top = drive.speed
        drive.write(0x047E, run=20)
        assert drive.axis.drive.state == 5
        assert drive.speed == pytest.approx(top - 5000.0 * 0.020, abs=5.0)
        drive.run(int(top / 5.0) + 50)
        assert (drive.speed, int(drive.axis.drive.state)) == (0.0, 2)

    def test_a_quick_stop_brakes_along_its_own(self):
        drive = self._fast(ramp__quick_stop_deceleration=20_000.0)
        top = drive.speed
        drive.write(0x047B, run=40)
        assert drive.speed == pytest.approx(top - 20_000.0 * 0.040, abs=5.0)
        drive.run(200)
        assert (drive.speed, int(drive.axis.drive.state)) == (0.0, 1)

    def test_without_the_enable_the_axis_coasts_against_friction_alone(self):
        drive = self._fast(motor__coast_method=2)
        top = drive.speed
        drive.write(0x0477, run=20)
        assert drive.axis.drive.state == 3
        assert drive.axis.motor.torque == 0.0
        assert drive.speed == pytest.approx(top - gain(FRICTION, 20), rel=1e-3)

    def test_the_end_of_cyclic_data_takes_the_torque_away_and_stops_the_axis(self):
        drive = self._fast()
        drive.lose(LOST_STOP)
        assert drive.axis.torque.setpoint == 0.0
        drive.run(2000)
        assert drive.speed == 0.0

    def test_speed_control_takes_over_at_the_speed_and_with_the_torque_at_hand(self):
        drive = self._fast(load__added_torque=0.2)
        drive.torque(0.25, 50)
        before, torque = drive.speed, float(drive.axis.motor.torque)
        drive.axis.drive.settings.opmode = 1
        drive.write(0x045F, run=1)
        assert drive.speed == pytest.approx(before, abs=2.0)
        assert drive.axis.motor.torque == pytest.approx(torque, abs=0.05)

    def test_a_holding_brake_is_open_before_the_torque_counts(self):
        drive = TorqueAxis(brake__torque=3.0, brake__release=0.050, brake__apply=0.030)
        drive.torque(0.5)
        drive.enable()
        drive.run(40)
        assert (drive.speed, float(drive.axis.motor.torque)) == (0.0, pytest.approx(0.0, abs=1e-9))
        drive.run(40)
        assert drive.speed > 100.0


class TestAdditive:
    """Beside the controller's set points."""

    def test_an_additive_torque_carries_a_load_without_the_integral_part(self):
        drive = BenchAxis()
        drive.axis.load.settings.friction = 0.0
        drive.axis.load.settings.torque = drive.axis.torque.settings.additive = 0.8
        drive.enable()
        drive.run(500)
        assert drive.axis.motor.torque == pytest.approx(0.8)
        assert drive.axis.motor.speed_integral == pytest.approx(0.0, abs=1e-3)

    def test_in_torque_control_it_is_added_to_the_set_point(self, drive):
        drive.axis.torque.settings.additive = 0.3
        drive.torque(0.2, 20)
        assert drive.speed == pytest.approx(gain(0.5 - FRICTION, 20), rel=1e-2)

    def test_an_additive_speed_counts_after_the_ramp_within_the_limits_and_in_operation_only(self):
        drive = BenchAxis()
        drive.axis.travel.settings.velocity_limit_positive = 1000.0
        drive.enable(600.0)
        drive.run(500)
        drive.axis.ramp.settings.additive_speed = 150.0
        drive.run(50)
        assert drive.axis.motor.velocity == pytest.approx(750.0, abs=1.0)
        assert drive.axis.ramp.command == pytest.approx(600.0, abs=1.0)
        assert abs(float(drive.axis.positioning.following_error)) < 0.1
        drive.axis.ramp.settings.additive_speed = 900.0
        drive.run(50)
        assert drive.axis.motor.velocity == pytest.approx(1000.0, abs=1.0)
        drive.write(0x047E, run=1000)
        assert (float(drive.axis.motor.velocity), int(drive.axis.drive.state)) == (0.0, 2)

    def test_an_additive_speed_alone_starts_a_resting_axis(self):
        drive = BenchAxis()
        drive.enable()
        # so little that friction holds what the proportional part gives
        drive.axis.ramp.settings.additive_speed = -4.0
        drive.run(300)
        assert drive.axis.motor.velocity == pytest.approx(-4.0, abs=0.1)
