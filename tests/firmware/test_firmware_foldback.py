"""Foldback of motor and drive, and the levels of the DC link (AKD parameter reference, IL.IFOLD and VBUS.*)."""

from __future__ import annotations

import math

import pytest
from bench_axis import BenchAxis

from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import CMD_ACKNOWLEDGE, CMD_POWER_ON, REACTION_QUICK_STOP

PEAK, CONTINUOUS = 9.0, 3.0
#: Seconds; short, for each step takes a millisecond where the code is interpreted.
DELAY, TIME = 0.2, 0.4
MOTOR_FAULT, DRIVE_FAULT = (number | REACTION_QUICK_STOP << 24 for number in (304, 524))


def folding(**fields) -> BenchAxis:
    """A drive whose shaft is held, so that it soon gives all the current that it may; its own part is slow."""
    bench = BenchAxis()
    axis = bench.axis
    axis.load.settings.friction, axis.ramp.settings.acceleration = 100.0, 1e9
    axis.motor.settings.continuous_current, axis.motor.settings.thermal_time = CONTINUOUS, 60.0
    axis.foldback.settings.delay[:] = DELAY, 100.0
    axis.foldback.settings.time[:] = TIME, 100.0
    axis.foldback.settings.warning[:] = 304, 524
    axis.motor.settings.overload_fault, axis.foldback.settings.drive_fault = MOTOR_FAULT, DRIVE_FAULT
    for name, value in fields.items():
        AXIS.write(axis, name.replace("__", "."), value)
    return bench


def at_peak(drive: BenchAxis) -> BenchAxis:
    drive.enable(1000.0)
    while drive.axis.motor.current < PEAK * 0.999:
        drive.run(1)
    return drive


def test_the_peak_current_is_there_for_its_time_and_then_falls_to_the_continuous_one():
    drive, passed, hottest = at_peak(folding(motor__thermal_time=DELAY)), 0.0, 0.0
    for delays in (0.5, 0.9, 1.5, 3.0, 6.0, 11.0):
        seconds = delays * DELAY
        drive.run(round((seconds - passed) * 1000))
        passed = seconds
        expected = CONTINUOUS + (PEAK - CONTINUOUS) * math.exp(-max(0.0, seconds - DELAY) / TIME)
        assert drive.axis.motor.current == pytest.approx(expected, abs=0.05), seconds
        assert drive.axis.motor.torque == pytest.approx(0.5 * drive.axis.motor.current)
        hottest = max(hottest, float(drive.axis.motor.thermal_load))
    assert hottest > 1.0
    assert drive.axis.faults.code[0] == 0, "the level is 0, and the heat that foldback bounds is no fault"


def test_no_current_for_the_recovery_time_gives_the_whole_time_at_the_peak_back():
    drive = at_peak(folding())
    drive.run(round(14 * DELAY * 1000))
    top = PEAK + DELAY * (PEAK - CONTINUOUS) / TIME
    seconds = (DELAY + TIME) * (PEAK / CONTINUOUS - 1)
    drive.write(0x0470, run=round(seconds * 500))
    assert drive.axis.foldback.limit[0] == pytest.approx((CONTINUOUS + top) / 2, abs=0.05)
    drive.run(round(seconds * 500))
    assert drive.axis.foldback.limit[0] == pytest.approx(top, abs=0.05)
    drive.run(round(2 * DELAY * 1000))
    assert drive.axis.foldback.limit[0] == top, "and no more"


@pytest.mark.parametrize(("slow", "fault"), [(1, MOTOR_FAULT), (0, DRIVE_FAULT)])
def test_a_limit_below_the_fault_level_is_the_fault_of_motor_or_drive_until_it_has_recovered(slow, fault):
    drive = folding(foldback__fault_level=7.0)
    drive.axis.foldback.settings.delay[:] = drive.axis.foldback.settings.time[:] = 100.0
    drive.axis.foldback.settings.delay[1 - slow], drive.axis.foldback.settings.time[1 - slow] = DELAY, TIME
    at_peak(drive)
    drive.run(round((DELAY + TIME * math.log((PEAK - CONTINUOUS) / (7.0 - CONTINUOUS))) * 1000) - 10)
    assert drive.axis.faults.code[0] == 0
    drive.run(20)
    assert list(drive.axis.faults.code[:2]) == [fault, 0]
    drive.run(20)
    drive.axis.foldback.used[1 - slow] += 1.0
    drive.command(CMD_ACKNOWLEDGE)
    drive.run(1)
    assert drive.axis.faults.code[0] == fault, "the cause is still there"
    drive.run(round(2 * DELAY * 1000))
    drive.command(CMD_ACKNOWLEDGE)
    drive.run(2)
    assert drive.axis.faults.code[0] == 0


def test_the_fault_level_is_the_peak_current_at_most():
    drive = at_peak(folding(foldback__fault_level=500.0))
    drive.run(round(DELAY * 1000) - 10)
    assert drive.axis.faults.code[0] == 0
    drive.run(20)
    assert drive.axis.faults.code[0] == MOTOR_FAULT


def test_a_limit_below_the_warning_level_is_a_warning_while_it_is():
    drive = at_peak(folding(foldback__warning_level=8.0))
    drive.run(round((DELAY + TIME * math.log(6.0 / 5.0)) * 1000) - 10)
    assert drive.zsw1 & 0x0080 == 0
    drive.run(20)
    assert (drive.axis.warnings.code, drive.zsw1 & 0x0080) == (304, 0x0080)
    drive.axis.foldback.settings.warning_level = 0.0
    drive.run(1)
    assert drive.axis.warnings.code == 0
    drive.axis.foldback.settings.warning_level = 8.0
    drive.write(0x0470, run=round(DELAY * 1000))
    assert drive.axis.warnings.code == 0


@pytest.mark.parametrize("field", ["motor.thermal_time", "motor.continuous_current"])
def test_a_motor_that_stays_cool_or_bears_any_current_is_not_limited(field):
    drive = at_peak(folding(**{field: 0.0}))
    drive.run(round(5 * DELAY * 1000))
    assert drive.axis.motor.current == pytest.approx(PEAK)


def test_power_on_begins_with_all_of_the_peak_current():
    drive = at_peak(folding())
    drive.run(round(10 * DELAY * 1000))
    assert drive.axis.foldback.current < 4.0
    drive.command(CMD_POWER_ON)
    drive.run(2)
    assert drive.axis.foldback.limit[0] == pytest.approx(PEAK + DELAY * (PEAK - CONTINUOUS) / TIME)


def linked(**fields) -> BenchAxis:
    """A DC link of 560 V that a braking motor charges to 760 V."""
    bench = BenchAxis()
    axis = bench.axis
    (
        axis.supply.settings.nominal,
        axis.supply.settings.capacitance,
        axis.supply.settings.brake,
        axis.supply.settings.load,
    ) = 560.0, 4e-4, 760.0, 15.0
    axis.load.settings.inertia, axis.ramp.settings.deceleration = 4e-3, 30_000.0
    axis.supply.settings.warning[:] = 502, 501
    axis.supply.settings.undervoltage_fault = 502
    for name, value in fields.items():
        AXIS.write(axis, name.replace("__", "."), value)
    bench.run(1)
    return bench


def test_a_dc_link_above_its_warning_level_is_a_warning_while_it_is():
    drive = linked()
    drive.axis.supply.settings.levels[1] = 700.0
    drive.enable(3000.0)
    drive.run(500)
    assert drive.axis.warnings.code == 0
    drive.write(0x047F, 0.0, run=100)
    assert drive.axis.supply.voltage > 700.0
    assert (drive.axis.warnings.code, drive.zsw1 & 0x0080) == (501, 0x0080)
    drive.run(5000)
    assert drive.axis.supply.voltage < 700.0
    assert (drive.axis.warnings.code, drive.zsw1 & 0x0080) == (0, 0)


@pytest.mark.parametrize(("level", "number"), [(0.0, 0), (559.0, 0), (561.0, 502)])
def test_a_dc_link_below_its_warning_level_is_a_warning(level, number):
    drive = linked()
    drive.axis.supply.settings.levels[0] = level
    drive.run(1)
    assert drive.axis.warnings.code == number


@pytest.mark.parametrize(("mode", "off"), [(0, 502), (1, 0)])
def test_a_dc_link_below_its_limit_is_a_fault_at_any_time_or_once_the_power_stage_goes_on(mode, off):
    drive = linked(supply__undervoltage_limit=600.0, supply__undervoltage_mode=mode)
    assert drive.axis.faults.code[0] == off
    for word in (0x0470, 0x0476, 0x0477, 0x047F, 0x047F):
        drive.write(word)
    assert drive.axis.faults.code[0] == 502
    assert drive.axis.drive.state < 4
    drive.axis.supply.settings.nominal = drive.axis.supply.voltage = 610.0
    drive.write(0x0470)
    drive.write(0x04F0, run=2)
    drive.write(0x0470)
    assert drive.axis.faults.code[0] == 0
    drive.enable()


def test_a_drive_without_a_dc_link_in_its_data_does_not_monitor_one():
    drive = BenchAxis()
    drive.axis.supply.settings.undervoltage_limit, drive.axis.supply.settings.undervoltage_fault = 600.0, 502
    drive.axis.supply.settings.levels[0], drive.axis.supply.settings.warning[0] = 600.0, 502
    drive.enable()
    assert (drive.axis.faults.code[0], drive.axis.warnings.code) == (0, 0)
