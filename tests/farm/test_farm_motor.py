"""Motor and load as the farm file gives them, down to the shaft, in virtual time."""

import math

import pytest
from farm_file import GOOD, parse
from virtual_line import VirtualLine

from pnfarm.config.axis import Load
from pnfarm.farm.file.reading import FarmFileError, expand, parse_farm
from pnfarm.firmware.axis import AXIS

FILE = """
farm: bench
link: {{kind: memory}}
drives:
  - {{name: a, model: {model}, ip: 10.0.0.1/24, motor: {motor}, load: {load}}}
"""


def axis_of(**options):
    line = VirtualLine(program="{kind: constant, speed_rpm: 600}", **options)
    line.enable()
    line.run(1.0)
    return line.farm.columns.axis[0]


def test_a_spindle_that_lifts_a_mass_draws_the_current_of_its_weight():
    axis = axis_of(load="{friction: 0, damping: 0, lead: 10, gear: 2, mass: 100, force: 981}")
    torque = 981 * 0.010 / 2 / (2 * math.pi)
    assert axis.motor.current == pytest.approx(torque / float(axis.motor.settings.torque_constant), rel=0.01)
    assert axis.load.settings.inertia == pytest.approx(2.0e-4 + 100 * (0.005 / (2 * math.pi)) ** 2)


@pytest.mark.parametrize("step", ["62.5us", "125us", "1ms"])
def test_the_controllers_step_is_as_fine_as_the_file_asks(step):
    axis = axis_of(motor=f"{{step: {step}}}")
    assert axis.motor.settings.step_ns == {"62.5us": 62_500, "125us": 125_000, "1ms": 1_000_000}[step]
    assert axis.motor.velocity == pytest.approx(600.0, abs=0.5)


def test_everything_that_the_file_says_of_the_motor_arrives():
    text = (
        "{torque_constant: 1.5, peak_current: 20, continuous_current: 6, thermal_time: 30,"
        " current_time_constant: 0.0002, velocity_time_constant: 0.004,"
        " max_velocity: 2000, resistance: 0.8, inductance: 0.003,"
        " bus_voltage: 650, braking_resistor: false, encoder_steps: 4096, holding_brake: 8, brake_release: 0.04,"
        " brake_apply: 0.02}"
    )
    axis = axis_of(motor=text)
    for field, value in {
        "motor.torque_constant": 1.5,
        "motor.peak_current": 20,
        "motor.continuous_current": 6,
        "motor.thermal_time": 30,
        "motor.current_time_constant": 0.0002,
        "motor.velocity_time_constant": 0.004,
        "motor.max_velocity": 2000,
        "motor.resistance": 0.8,
        "motor.inductance": 0.003,
        "supply.nominal": 650,
        "supply.brake": 0,
        "motor.encoder_steps": 4096,
        "brake.torque": 8,
        "brake.release": 0.04,
        "brake.apply": 0.02,
    }.items():
        assert AXIS.read(axis, field) == value, field


@pytest.mark.parametrize(
    ("motor", "load", "field", "words"),
    [
        ("{step: 50us}", "{}", "motor.step", "62.5"),
        ("{step: 2ms}", "{}", "motor.step", "1"),
        ("{step: 1}", "{}", "motor.step", "unit"),
        ("{resistance: -1}", "{}", "motor.resistance", "0"),
        ("{kind: linear}", "{}", "motor.kind", "rotary"),
        ("{}", "{gear: 0}", "load.gear", "from 0.0001 to"),
        ("{}", "{mass: 3}", "load", "lead"),
        ("{}", "{force: 3}", "load", "lead"),
    ],
)
def test_an_impossible_value_is_reported_with_its_field(motor, load, field, words):
    with pytest.raises(FarmFileError) as wrong:
        parse_farm(FILE.format(model="akd-profinet", motor=motor, load=load))
    (issue,) = wrong.value.issues
    assert issue.field == f"drives[0].{field}"
    assert words in issue.what + issue.allowed


def test_a_linear_motor_takes_a_mass_but_no_spindle():
    parse_farm(FILE.format(model="hiwin-e1", motor="{kind: linear}", load="{mass: 3, force: 5}"))
    with pytest.raises(FarmFileError, match="behind a linear motor"):
        parse_farm(FILE.format(model="hiwin-e1", motor="{kind: linear}", load="{lead: 5, mass: 3}"))


def test_5_6_the_akds_vl_thresh_is_the_speed_at_which_it_trips():
    line = VirtualLine(program="{kind: constant, speed_rpm: 600}")
    line.enable()
    line.run(1.0)
    station = line.farm.axes[0]
    station.store.set("VL.THRESH_32", 700_000)
    line.run(0.5)
    assert not any(station.handle.axis.faults.code)
    station.store.set("VL.THRESH_32", 500_000)
    line.run(0.5)
    assert station.fault_counts == {302: 1}


def test_a_load_behind_gear_and_spindle_counts_as_the_shaft_feels_it():
    load = expand(
        parse(GOOD.replace("inertia: 2.0e-4", "gear: 4, lead: 20, mass: 50, force: 490, driven_inertia: 1.6e-3"))
    )[0].load
    way = 0.020 / 4 / (2 * math.pi)
    assert load.referred_inertia(0.0) == pytest.approx(50 * way**2 + 1e-4)
    assert load.referred_torque(0.0) == pytest.approx(490 * way)


def test_a_mass_on_a_linear_motor_needs_no_spindle():
    assert Load(mass=5.0).referred_inertia(32.0) == pytest.approx(5 * (0.032 / (2 * math.pi)) ** 2)
