"""A drive that counts the other way than its shaft (AKD parameter reference, DRV.DIR)."""

import pytest
from positioner import HOME, HOMED, READY, Positioner

from pnfarm.table.axis_codes import MACHINE_STOP_HIGH, MACHINE_SWITCH_HIGH


def off(drive):
    for word in (0x0430, 0x0436):
        drive.stw(word)
    drive.run(200)


def on(drive):
    for word in (0x0437, 0x043F, 0x043F):
        drive.stw(word)
    assert drive.axis.drive.state == 4


def test_turning_it_round_changes_the_sign_of_the_position_and_the_home_is_lost():
    drive = Positioner()
    drive.move(1.25)
    drive.settle()
    off(drive)
    drive.axis.direction.settings.reversed = 1
    drive.run(1)
    assert drive.place == pytest.approx(-1.25, abs=2e-3)
    assert not drive.zsw1 & HOMED
    drive.run(100)
    assert drive.place == pytest.approx(-1.25, abs=2e-3), "once"
    drive.axis.direction.settings.reversed = 0
    drive.run(1)
    assert drive.place == pytest.approx(1.25, abs=2e-3)


def test_a_position_that_counts_from_another_place_than_the_encoders_changes_its_sign_too():
    drive = Positioner()
    drive.axis.homing.settings.method, drive.axis.homing.settings.position = 0, 3.0
    drive.stw(HOME, 5)
    drive.stw(READY, 5)
    assert drive.place == pytest.approx(3.0, abs=2e-3)
    off(drive)
    drive.axis.direction.settings.reversed = 1
    drive.run(1)
    assert drive.place == pytest.approx(-3.0, abs=2e-3)


def test_it_waits_until_the_power_stage_is_off():
    drive = Positioner()
    drive.move(2.0)
    drive.axis.direction.settings.reversed = 1
    drive.settle()
    assert drive.place == pytest.approx(2.0, abs=2e-3)
    assert drive.zsw1 & HOMED
    off(drive)
    assert drive.place == pytest.approx(-2.0, abs=2e-3)
    assert not drive.zsw1 & HOMED


@pytest.mark.parametrize(("direction", "sign"), [(0, 1.0), (1, -1.0)])
def test_the_load_on_the_shaft_asks_for_torque_of_the_other_sign(direction, sign):
    drive = Positioner()
    off(drive)
    drive.axis.direction.settings.reversed = direction
    drive.axis.load.settings.friction, drive.axis.load.settings.torque, drive.axis.load.settings.added_torque = (
        0.0,
        0.75,
        0.25,
    )
    drive.axis.brake.settings.torque, drive.axis.motor.velocity = 0.0, 0.0
    on(drive)
    drive.run(1000)
    assert drive.axis.motor.torque == pytest.approx(sign, abs=0.02)


def test_switches_and_stops_of_the_machine_stay_where_they_are_on_the_shaft():
    drive = Positioner()
    axis = drive.axis
    off(drive)
    axis.machine.settings.parts, axis.machine.settings.switch_high, axis.machine.settings.stop_high = (
        MACHINE_SWITCH_HIGH | MACHINE_STOP_HIGH,
        1.0,
        1.5,
    )
    axis.direction.settings.reversed, axis.homing.settings.required = 1, 0
    drive.run(1)
    on(drive)
    drive.data(-0.9)
    drive.stw(0x047F)
    drive.stw(0x043F)
    drive.settle()
    assert axis.machine.limit_switch == 0
    drive.data(-5.0)
    drive.stw(0x047F, 2000)
    assert axis.machine.limit_switch == 2, "the input at that end, which stops the other direction only"
    assert axis.motor.position == -1.5
    assert axis.motor.velocity == 0.0
