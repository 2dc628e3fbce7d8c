"""Speed and current control, DC link, motor and load, against closed-form answers and an independent integration."""

import math

import pytest
from bench_axis import MS, BenchAxis
from scipy.integrate import solve_ivp

from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import REACTION_QUICK_STOP

RPM = 2 * math.pi / 60
INERTIA, CONSTANT = 2e-4, 0.5
TUNED, CURRENT_LOOP = 0.002, 0.0003
GAIN, INTEGRAL_TIME = INERTIA / TUNED, 4 * TUNED


class Motor(BenchAxis):
    """A drive without friction, stepped as finely as asked for, whose ramps are no limit."""

    def __init__(self, step_ns=62_500, **fields):
        super().__init__()
        self.axis.load.settings.friction = 0.0
        self.axis.motor.settings.current_time_constant = CURRENT_LOOP
        self.axis.motor.settings.step_ns = step_ns
        self.axis.ramp.settings.acceleration = self.axis.ramp.settings.deceleration = 1e9
        for field, value in fields.items():
            AXIS.write(self.axis, field.replace("__", "."), value)

    def watch(self, milliseconds, *fields):
        """The fields after each millisecond."""
        rows = []
        for _ in range(milliseconds):
            self.run(1)
            rows.append([float(AXIS.read(self.axis, field)) for field in fields])
        return rows


def _integrated(milliseconds, speed, torque=lambda t: 0.0, *, inertia=INERTIA, gain=GAIN):
    """Speed (rad/s) and current (A) after each millisecond: the control loops as differential equations."""

    def change(t, state):
        omega, current, integral = state
        error = speed(t) - omega
        wanted = (gain * error + integral) / CONSTANT
        return [
            (CONSTANT * current - torque(t)) / inertia,
            (wanted - current) / CURRENT_LOOP,
            gain / INTEGRAL_TIME * error,
        ]

    times = [n * 1e-3 for n in range(1, milliseconds + 1)]
    solved = solve_ivp(change, (0.0, times[-1]), [0.0, 0.0, 0.0], t_eval=times, max_step=5e-5, rtol=1e-9, atol=1e-9)
    return solved.y[0], solved.y[1]


def test_the_answer_to_a_speed_step_is_that_of_the_control_loops():
    drive = Motor()
    drive.enable()
    drive.write(0x047F, 100.0, run=0)
    seen = drive.watch(30, "motor.velocity", "motor.current")
    speed, current = _integrated(30, lambda _: float(drive.axis.ramp.setpoint) * RPM)
    for (velocity, amperes), omega, wanted in zip(seen, speed, current, strict=True):
        assert velocity == pytest.approx(omega / RPM, abs=2.5)
        assert amperes == pytest.approx(wanted, abs=0.1)
    assert max(velocity for velocity, _ in seen) == pytest.approx(max(speed) / RPM, abs=1.0), "the overshoot"


def test_finer_steps_come_nearer_to_the_integrated_answer():
    speed, _ = _integrated(20, lambda _: 100.0 * RPM)

    def error(step_ns):
        drive = Motor(step_ns)
        drive.enable()
        drive.write(0x047F, 100.0, run=0)
        return max(abs(v - w / RPM) for (v,), w in zip(drive.watch(20, "motor.velocity"), speed, strict=True))

    coarse, fine = error(1_000_000), error(62_500)
    assert fine < coarse / 4


def test_a_load_that_comes_suddenly_slows_the_axis_as_integrated_and_is_made_up_for():
    drive = Motor()
    drive.enable()
    drive.axis.load.settings.added_torque = 0.5
    seen = drive.watch(40, "motor.velocity", "motor.current")
    speed, current = _integrated(40, lambda _: 0.0, lambda _: 0.5)
    assert min(v for v, _ in seen) == pytest.approx(min(speed) / RPM, rel=0.03)
    assert seen[-1][0] == pytest.approx(speed[-1] / RPM, abs=1.0)
    assert seen[-1][1] == pytest.approx(0.5 / CONSTANT, rel=0.02)
    assert seen[-1][1] == pytest.approx(current[-1], abs=0.02)


def test_a_load_heavier_than_the_drive_was_tuned_for_overshoots_as_integrated():
    drive = Motor(load__added_inertia=9 * INERTIA)
    drive.enable()
    drive.write(0x047F, 100.0, run=0)
    seen = drive.watch(60, "motor.velocity")
    speed, _ = _integrated(60, lambda _: 100.0 * RPM, inertia=10 * INERTIA)
    peak = max(v for (v,) in seen)
    assert peak == pytest.approx(max(speed) / RPM, abs=2.0)
    assert peak > 130.0


def test_a_speed_ramp_is_followed_as_integrated_and_without_a_lasting_error():
    drive = Motor(ramp__acceleration=10_000.0)
    drive.enable()
    drive.write(0x047F, 3000.0, run=0)
    seen = drive.watch(60, "ramp.command", "motor.velocity")
    speed, _ = _integrated(60, lambda t: 10_000.0 * t * RPM)
    lags = [ramp - velocity for ramp, velocity in seen]
    wanted = [10_000.0 * 1e-3 * n - omega / RPM for n, omega in enumerate(speed, start=1)]
    assert max(lags) == pytest.approx(max(wanted), rel=0.1)
    assert abs(lags[-1]) < 0.01


def test_the_current_limit_gives_the_greatest_acceleration():
    drive = Motor(load__friction=0.05)
    drive.enable(6000.0)
    drive.run(10)
    before = float(drive.axis.motor.velocity)
    drive.run(10)
    assert drive.axis.motor.current == pytest.approx(9.0)
    assert drive.axis.motor.velocity - before == pytest.approx(
        (9.0 * CONSTANT - 0.05) / INERTIA * 0.010 / RPM, rel=1e-6
    )


def test_a_speed_step_at_the_current_limit_does_not_overshoot():
    drive = Motor()
    drive.enable(6000.0)
    peak = max(v for (v,) in drive.watch(200, "motor.velocity"))
    assert peak < 6000.0 * 1.03, "the integral part wound up"
    assert drive.axis.motor.velocity == pytest.approx(6000.0, abs=1.0)


def test_work_of_the_motor_is_kinetic_energy_and_friction_heat():
    drive = Motor(load__friction=0.05, load__damping=1e-4)
    drive.enable(3000.0)
    work = heat = 0.0
    for _ in range(800):
        omega = float(drive.axis.motor.velocity) * RPM
        drive.run(1, 62_500)
        mean = 0.5 * (omega + float(drive.axis.motor.velocity) * RPM)
        work += float(drive.axis.motor.torque) * mean * 62.5e-6
        heat += (0.05 + 1e-4 * mean) * mean * 62.5e-6
    kinetic = 0.5 * INERTIA * (float(drive.axis.motor.velocity) * RPM) ** 2
    assert drive.axis.motor.velocity > 2900.0
    assert work == pytest.approx(kinetic + heat, rel=0.01)


@pytest.mark.parametrize("step_ns", [62_500, 250_000, 1_000_000])
def test_dry_friction_brings_a_coasting_axis_to_rest_after_speed_times_inertia_over_friction(step_ns):
    drive = Motor(step_ns, load__friction=0.05)
    drive.enable(1000.0)
    drive.run(100)
    drive.axis.motor.settings.coast_method = 2
    start = float(drive.axis.motor.position)
    drive.write(0x0474, run=1)
    omega = 1000.0 * RPM
    turns = omega * omega * INERTIA / (2 * 0.05) / (2 * math.pi)
    milliseconds = 1
    while drive.axis.motor.velocity != 0.0:
        drive.run(1)
        milliseconds += 1
    assert milliseconds == pytest.approx(omega * INERTIA / 0.05 * 1000, abs=2)
    assert drive.axis.motor.position - start == pytest.approx(turns, rel=0.02)


def test_a_resting_axis_stays_where_friction_holds_it_and_draws_no_growing_current():
    drive = Motor(load__friction=0.05, load__torque=0.04)
    drive.enable()
    drive.run(2000)
    assert drive.axis.motor.velocity == 0.0
    assert abs(float(drive.axis.motor.current)) <= 0.05 / CONSTANT


class TestDcLink:
    """Voltage and energy."""

    @staticmethod
    def _drive(**fields):
        return Motor(
            250_000,
            supply__nominal=325.0,
            supply__voltage=325.0,
            supply__capacitance=4e-4,
            motor__resistance=1.5,
            motor__inductance=4e-3,
            supply__overvoltage_fault=501 | REACTION_QUICK_STOP << 24,
            **fields,
        )

    def test_without_load_the_motor_runs_as_fast_as_its_voltage_meets_that_of_the_dc_link(self):
        drive = self._drive()
        drive.enable(11_000.0)
        drive.run(1000)
        assert drive.axis.motor.velocity * RPM * CONSTANT / 3 == pytest.approx(
            float(drive.axis.supply.voltage) / math.sqrt(6), rel=1e-3
        )
        assert drive.axis.motor.current == pytest.approx(0.0, abs=0.1)

    def test_under_load_it_runs_slower_by_the_voltage_of_its_windings(self):
        drive = self._drive(load__torque=2.0)
        drive.enable(11_000.0)
        drive.run(1000)
        amperes = 2.0 / CONSTANT
        assert drive.axis.motor.current == pytest.approx(amperes, rel=0.01)
        assert drive.axis.motor.velocity * RPM * CONSTANT / 3 == pytest.approx(
            325.0 / math.sqrt(6) - amperes * 1.5, rel=0.01
        )

    def test_a_braking_motor_charges_the_dc_link_with_its_energy_less_what_the_windings_take(self):
        drive = self._drive(ramp__deceleration=30_000.0)
        drive.enable(3000.0)
        drive.run(300)
        kinetic = 0.5 * INERTIA * (float(drive.axis.motor.velocity) * RPM) ** 2
        before = float(drive.axis.supply.voltage)
        drive.write(0x047F, 0.0, run=0)
        copper = 0.0
        for _ in range(250 * 16):
            drive.run(1, 62_500)
            copper += 3 * 1.5 * float(drive.axis.motor.current) ** 2 * 62.5e-6
        stored = 0.5 * 4e-4 * (float(drive.axis.supply.voltage) ** 2 - before**2)
        assert stored == pytest.approx(kinetic - copper, rel=0.01)
        assert drive.axis.supply.voltage > 340.0

    def test_what_the_drive_itself_takes_brings_the_dc_link_back_to_the_mains(self):
        drive = self._drive(supply__load=15.0)
        drive.axis.supply.voltage = 400.0
        drive.run(500)
        left = 400.0**2 - 2 * 15.0 * 0.5 / 4e-4
        assert drive.axis.supply.voltage == pytest.approx(math.sqrt(left), rel=1e-3)
        drive.run(2000)
        assert drive.axis.supply.voltage == 325.0

    def test_a_braking_resistor_holds_it(self):
        drive = self._drive(
            supply__brake=380.0, supply__limit=410.0, ramp__deceleration=30_000.0, load__added_inertia=2e-3
        )
        drive.enable(3000.0)
        drive.run(1500)
        drive.write(0x047F, 0.0, run=0)
        assert max(u for (u,) in drive.watch(800, "supply.voltage")) == 380.0
        assert drive.axis.faults.code[0] == 0

    def test_without_one_a_heavy_load_trips_the_drive(self):
        drive = self._drive(supply__limit=410.0, ramp__deceleration=30_000.0, load__added_inertia=2e-3)
        drive.enable(3000.0)
        drive.run(1500)
        drive.write(0x047F, 0.0, run=400)
        assert drive.axis.faults.code[0] & 0xFFFFFF == 501


def test_an_overloaded_motor_trips_after_its_thermal_time_constant_times_the_logarithm():
    fault = 304 | REACTION_QUICK_STOP << 24
    drive = Motor(
        1_000_000,
        motor__continuous_current=3.0,
        motor__thermal_time=1.0,
        motor__overload_fault=fault,
        load__torque=2.0,
        load__friction=0.0,
    )
    drive.enable()
    milliseconds = 0
    while drive.axis.faults.code[0] == 0:
        drive.run(1)
        milliseconds += 1
    ratio = (2.0 / CONSTANT / 3.0) ** 2
    assert milliseconds == pytest.approx(1000 * math.log(ratio / (ratio - 1)), rel=0.01)
    assert drive.axis.faults.code[0] == fault


def test_at_its_continuous_current_a_motor_never_trips():
    drive = Motor(
        1_000_000, motor__continuous_current=3.0, motor__thermal_time=0.1, motor__overload_fault=304, load__torque=1.499
    )
    drive.enable()
    drive.run(2000)
    assert drive.axis.motor.thermal_load == pytest.approx(1.0, abs=2e-3)
    assert drive.axis.faults.code[0] == 0


def test_a_shaft_that_the_load_drives_too_fast_trips_the_drive():
    drive = Motor(motor__overspeed=1000.0, motor__overspeed_fault=302, load__torque=-6.0)
    drive.enable()
    drive.run(300)
    assert drive.axis.faults.code[0] == 302


class TestHoldingBrake:
    """A hanging load of 1 N m, a brake of 3 N m that opens in 50 ms and closes in 30 ms."""

    @staticmethod
    def _drive():
        drive = Motor(
            load__friction=0.02,
            load__torque=1.0,
            brake__torque=3.0,
            brake__release=0.050,
            brake__apply=0.030,
            ramp__acceleration=10_000.0,
            ramp__quick_stop_deceleration=20_000.0,
        )
        drive.axis.brake.open = 0
        drive.axis.motor.velocity = 0.0
        drive.run(100)
        drive.start = float(drive.axis.motor.position)
        return drive

    def test_it_holds_the_load_of_a_disabled_drive(self):
        drive = self._drive()
        drive.run(500)
        assert drive.axis.motor.position == drive.start

    def test_the_axis_does_not_move_before_it_is_open(self):
        drive = self._drive()
        for word in (0x0470, 0x0476, 0x0477, 0x047F):
            drive.write(word)
        drive.write(0x047F, 500.0, run=40)
        assert (drive.axis.drive.state, drive.axis.ramp.command, drive.axis.motor.velocity) == (4, 0.0, 0.0)
        drive.run(200)
        assert drive.axis.motor.velocity == pytest.approx(500.0, abs=1.0)

    def test_the_load_sinks_little_when_it_opens(self):
        drive = self._drive()
        drive.enable()
        drive.run(400)
        assert 0.0 < drive.start - float(drive.axis.motor.position) < 0.02
        assert drive.axis.motor.current == pytest.approx(1.0 / CONSTANT, rel=0.05)

    def test_a_stop_ends_with_it_closed_and_the_load_where_it_was(self):
        drive = self._drive()
        drive.enable(500.0)
        drive.run(300)
        drive.write(0x047E, run=0)
        while abs(float(drive.axis.motor.velocity)) > 0.5:
            drive.run(1)
        place = float(drive.axis.motor.position)
        drive.run(5)
        assert drive.axis.drive.state == 5, "the power stage holds until the brake does"
        drive.run(60)
        assert drive.axis.drive.state == 2
        drive.run(500)
        assert drive.axis.motor.position == pytest.approx(place, abs=2e-3)

    def test_a_drive_that_coasts_lets_the_load_fall_until_it_closes(self):
        drive = self._drive()
        drive.enable()
        drive.run(300)
        place = float(drive.axis.motor.position)
        drive.write(0x047D, run=200)
        seconds = 0.030
        fallen = 0.5 * (0.98 / INERTIA) * seconds**2 / (2 * math.pi)
        assert place - float(drive.axis.motor.position) > 0.9 * fallen
        assert drive.axis.motor.velocity == 0.0


def test_a_coarse_encoder_shows_whole_steps_only_and_makes_the_current_noisy():
    def ripple(steps):
        drive = Motor(motor__encoder_steps=steps, load__friction=0.05)
        drive.enable(33.0)
        drive.run(300)
        rows = drive.watch(200, "motor.current", "motor.measured_position")
        if steps:
            assert all((place * steps).is_integer() for _, place in rows)
        return max(i for i, _ in rows) - min(i for i, _ in rows)

    assert ripple(0) < 0.001
    assert ripple(4096) > 20 * ripple(2**20)


@pytest.mark.parametrize("step_ns", [62_500, 125_000, 500_000, 1_000_000])
def test_where_the_axis_ends_does_not_depend_on_the_motors_step(step_ns):
    drive = Motor(step_ns, load__friction=0.05, ramp__acceleration=10_000.0, ramp__deceleration=10_000.0)
    drive.enable(1000.0)
    drive.run(200)
    drive.write(0x047F, 0.0, run=300)
    assert drive.axis.motor.position == pytest.approx((0.2 + 0.001) * 1000.0 / 60, abs=0.02)
    assert drive.axis.motor.velocity == pytest.approx(0.0, abs=0.05)


def test_the_answer_is_finite_for_any_step_inertia_and_gain():
    for inertia in (1e-8, 1e-3, 10.0):
        for tuned in (1e-5, 1e-1):
            drive = Motor(
                1_000_000,
                load__inertia=inertia,
                motor__velocity_time_constant=tuned,
                load__friction=0.05,
                supply__nominal=325.0,
                motor__resistance=1.0,
                motor__inductance=1e-5,
            )
            drive.enable(3000.0)
            drive.run(200)
            assert abs(float(drive.axis.motor.velocity)) < 4000.0
            assert abs(float(drive.axis.motor.current)) <= 9.0 + 1e-9


def test_stepping_the_firmware_slowly_changes_nothing_for_the_motor():
    drive = Motor(load__friction=0.05, ramp__acceleration=10_000.0)
    drive.enable(1000.0)
    drive.run(50, 4 * MS)
    assert drive.axis.motor.velocity == pytest.approx(1000.0, abs=0.5)
