"""Position mode: what parameters start and end, what the status shows of it, and where editions differ."""

import pytest
from bench_axis import BenchAxis
from positioner import (
    ACKNOWLEDGED,
    ACTIVE,
    HOME,
    HOMED,
    ON_TARGET,
    READY,
    START,
    STOPPED,
    Positioner,
    task,
)

from pnfarm.firmware.motion.positioning import HALTED, JOG, STANDBY
from pnfarm.table.axis_codes import (
    CMD_ACKNOWLEDGE,
    CMD_CONTINUE,
    CMD_DISABLE,
    CMD_HOLD_FAULT,
    CMD_HOME,
    CMD_RAISE_FAULT,
    CMD_RAISE_WARNING,
    CMD_RELEASE_FAULT,
    CMD_SET_POSITION,
    CMD_START_TASK,
    CMD_STOP,
    DISABLE_STOPPED,
    HOME_MARK,
    REACTION_QUICK_STOP,
    STOP_HALT,
    TASK_FROM_ACTUAL,
    TASK_FROM_COMMAND,
    TASK_FROM_TARGET,
    TASK_PASSING,
    TASKS_NONE,
)
from pnfarm.table.signals import DRIVE_INPUTS, DRIVE_MOTION_STATUS, HOME_MODE, MT_FEEDRATE, SATZANW

TASK_ACTIVE, HOMING_ACTIVE, HOMING_FAILED, EMERGENCY_STOP = 0x0001, 0x0008, 0x0010, 0x0080
TASK_REFUSED, TASK_REACHED, TASK_SPEED = 0x0400, 0x0800, 0x1000


def status(drive):
    """DRV.MOTIONSTAT."""
    return int(drive.image.sent[DRIVE_MOTION_STATUS])


def commanded(drive, code, argument=0, run=1):
    drive.command(code, argument)
    drive.run(run)


# DRV.STOP, MT.CONTINUE


def test_a_halted_task_is_not_active_and_goes_on_to_its_target_when_continued():
    drive = Positioner()
    drive.move(5.0)
    drive.run(200)
    commanded(drive, CMD_STOP, STOP_HALT, run=300)
    assert drive.axis.positioning.state == HALTED
    assert drive.zsw1 & (STOPPED | ACTIVE | ON_TARGET) == STOPPED
    held = drive.place
    assert 1.0 < held < 4.0
    drive.stw(READY & ~0x0020, 100)
    drive.stw(READY, 100)
    assert drive.place == pytest.approx(held, abs=1e-3), "STW1.5 does not continue what a parameter halted"
    commanded(drive, CMD_CONTINUE)
    assert drive.zsw1 & ACTIVE
    drive.settle()
    assert drive.place == pytest.approx(5.0, abs=2e-3)


def test_a_halted_task_is_over_once_it_is_rejected_or_another_begins():
    drive = Positioner()
    for end in ("reject", "another"):
        drive.move(5.0)
        drive.run(200)
        commanded(drive, CMD_STOP, STOP_HALT, run=300)
        if end == "reject":
            drive.stw(READY & ~0x0010, 20)
            drive.stw(READY, 20)
        else:
            drive.move(-1.0)
            drive.settle()
        held = drive.place
        commanded(drive, CMD_CONTINUE, run=100)
        assert drive.place == pytest.approx(held, abs=2e-3)


def test_a_halt_ends_homing_and_leaves_the_home_position_unknown():
    drive = Positioner(homed=False)
    drive.stand_at(0.4)
    drive.stw(HOME, 20)
    commanded(drive, CMD_STOP, STOP_HALT, run=500)
    assert drive.zsw1 & (STOPPED | HOMED) == STOPPED
    assert drive.axis.positioning.state == STANDBY, "STW1.11 still stands, and starts homing once only"


def test_a_continuation_without_a_halted_task_and_a_halt_without_motion_do_nothing():
    drive = Positioner()
    commanded(drive, CMD_CONTINUE, run=50)
    commanded(drive, CMD_STOP, STOP_HALT, run=50)
    assert drive.axis.positioning.state == STANDBY
    assert drive.place == 0.0


# DRV.DIS


def test_a_software_disable_takes_the_power_away_and_the_control_word_leads_back():
    drive = Positioner()
    commanded(drive, CMD_DISABLE)
    assert drive.axis.drive.state == 1
    assert drive.zsw1 & 0x0047 == 0x0040
    drive.stw(READY, 100)
    assert drive.axis.drive.state == 1, "the control word stands as before: switching on is inhibited"
    for word in (0x0436, 0x0437, READY, READY):
        drive.stw(word)
    assert drive.axis.drive.state == 4


def test_a_software_disable_with_a_stop_first_brakes_along_the_quick_stop_ramp():
    drive = Positioner()
    drive.move(50.0)
    drive.run(300)
    speed = float(drive.axis.motor.velocity)
    drive.axis.drive.settings.disable_method = DISABLE_STOPPED
    commanded(drive, CMD_DISABLE)
    assert drive.axis.drive.state == 5
    assert status(drive) & EMERGENCY_STOP
    took = 1
    while drive.axis.drive.state == 5:
        drive.run(1)
        took += 1
    assert drive.axis.drive.state == 1
    assert took >= speed / drive.axis.ramp.settings.quick_stop_deceleration * 1000


def test_a_software_disable_of_a_drive_that_is_off_is_forgotten():
    drive = BenchAxis()
    drive.write(0x0476)
    drive.command(CMD_DISABLE)
    drive.run(1)
    assert drive.axis.drive.state == 2
    for word in (0x0477, 0x047F, 0x047F):
        drive.write(word)
    assert drive.axis.drive.state == 4


# HOME.SET, HOME.MOVE, MT.MOVE


def test_setting_the_home_position_drops_what_runs():
    drive = Positioner()
    drive.move(5.0)
    drive.run(200)
    drive.axis.homing.settings.position = 0.25
    commanded(drive, CMD_SET_POSITION)
    assert drive.zsw1 & (HOMED | ACTIVE) == HOMED
    drive.run(300)
    assert drive.zsw1 & STOPPED
    held = drive.place
    commanded(drive, CMD_CONTINUE, run=100)
    assert drive.place == held


def test_a_command_in_a_step_that_cannot_carry_it_out_is_gone():
    drive = Positioner()
    task(drive, 1, 2.0)
    drive.stw(0x0437, 5)
    for code, argument in ((CMD_START_TASK, 1), (CMD_HOME, 0), (CMD_CONTINUE, 0), (CMD_STOP, STOP_HALT)):
        drive.command(code, argument)
    drive.run(3)
    drive.stw(READY, 100)
    assert drive.axis.positioning.state == STANDBY
    assert drive.place == 0.0


def test_tasks_by_command_homing_and_jogging_need_no_telegram_of_tasks():
    """5.10.3 and 5.4 ask for position mode and operation, and for no certain telegram."""
    drive = Positioner(homed=False)
    drive.axis.profidrive.settings.task_form = TASKS_NONE
    drive.axis.homing.settings.method = HOME_MARK
    drive.stand_at(0.4)
    drive.stw(HOME, 20)
    drive.until(HOMED | STOPPED)
    assert drive.axis.motor.position == pytest.approx(1.0, abs=5e-3), "HOME.MODE counts, not mode 0"
    drive.stw(0x050F, 500)
    assert drive.axis.motor.velocity == pytest.approx(100.0, abs=0.5)
    drive.stw(0x040F, 500)
    task(drive, 3, -1.0)
    drive.stw(READY)
    assert not drive.stw(START, 20) & ACKNOWLEDGED, "no telegram brings SATZANW"
    commanded(drive, CMD_START_TASK, 3)
    drive.settle()
    assert drive.place == pytest.approx(-1.0, abs=2e-3)


# homing by the level of STW1.11


def test_5_10_1_homing_waits_for_a_running_task_and_begins_after_it():
    drive = Positioner()
    drive.move(1.0)
    drive.stw(HOME, 50)
    assert drive.zsw1 & (HOMED | ACTIVE) == HOMED | ACTIVE
    while drive.zsw1 & ACTIVE:
        drive.run(1)
    drive.run(5)
    assert not drive.zsw1 & HOMED
    drive.until(HOMED | STOPPED | ON_TARGET)


def test_a_bit_11_that_stays_set_homes_once_and_again_after_it_fell():
    drive = Positioner(homed=False)
    drive.stand_at(0.4)
    drive.stw(HOME, 1500)
    assert drive.zsw1 & HOMED
    assert drive.axis.motor.position == pytest.approx(1.0, abs=1e-3)
    drive.stw(HOME, 1500)
    assert drive.axis.motor.position == pytest.approx(1.0, abs=1e-3)
    drive.stw(READY)
    drive.stw(HOME, 1500)
    assert drive.axis.motor.position == pytest.approx(2.0, abs=1e-3)


def test_a_bit_11_that_is_there_when_operation_begins_homes():
    drive = Positioner(homed=False)
    drive.stw(0x0437)
    drive.stw(HOME, 1500)
    assert drive.zsw1 & HOMED


def test_a_fault_while_homing_leaves_the_home_position_unknown():
    drive = Positioner(homed=False)
    drive.stand_at(0.4)
    drive.stw(HOME, 50)
    commanded(drive, CMD_RAISE_FAULT, 301 | REACTION_QUICK_STOP << 24, run=500)
    assert drive.axis.drive.state == 1
    assert not drive.zsw1 & HOMED
    commanded(drive, CMD_ACKNOWLEDGE)
    for word in (0x0436, 0x0437, READY, READY):
        drive.stw(word)
    drive.run(300)
    assert drive.zsw1 & (HOMED | STOPPED) == STOPPED


# motion tasks of the drive's own


@pytest.mark.parametrize(
    ("base", "place"), [(TASK_FROM_COMMAND, None), (TASK_FROM_ACTUAL, None), (TASK_FROM_TARGET, 6.0), (0, 6.0)]
)
def test_a_relative_task_on_the_fly_counts_from_what_mt_cntl_says(base, place):
    drive = Positioner()
    task(drive, 1, 5.0)
    task(drive, 2, 1.0, relative=True)
    drive.axis.motion_tasks.settings.kind[2] |= base
    drive.image.received[SATZANW] = 1
    drive.stw(START, 200)
    drive.stw(READY)
    begun = float(drive.axis.profile.position)
    drive.image.received[SATZANW] = 2
    drive.stw(START)
    assert drive.axis.profile.target == pytest.approx(place or begun + 1.0, abs=0.02)


def test_a_passing_task_hands_its_target_over_at_speed():
    drive = Positioner()
    task(drive, 1, 3.0, following=2)
    task(drive, 2, 6.0)
    drive.axis.motion_tasks.settings.kind[1] |= TASK_PASSING
    drive.axis.motion_tasks.settings.velocity[2] = 300.0
    drive.image.received[SATZANW] = 1
    drive.stw(START)
    drive.stw(READY)
    while drive.axis.positioning.task == 1:
        assert drive.place < 3.3
        drive.run(1)
    assert drive.axis.profile.velocity >= 570.0, "no stop at the target"
    drive.run(200)
    assert drive.axis.profile.velocity == pytest.approx(300.0, abs=1.0)
    drive.settle()
    assert drive.place == pytest.approx(6.0, abs=2e-3)


def test_a_passing_task_backwards_without_a_next_one_comes_back_to_its_target():
    drive = Positioner()
    task(drive, 1, -3.0, following=9)
    drive.axis.motion_tasks.settings.kind[1] |= TASK_PASSING
    drive.image.received[SATZANW] = 1
    drive.stw(START)
    drive.stw(READY)
    drive.settle()
    assert drive.place == pytest.approx(-3.0, abs=2e-3)


def test_mt_feedrate_scales_the_velocity_of_a_task_while_it_runs():
    drive = Positioner()
    drive.axis.profidrive.settings.feedrate_signal = 1
    drive.image.received[MT_FEEDRATE] = 50
    drive.move(50.0, velocity=600.0)
    drive.run(300)
    assert drive.axis.motor.velocity == pytest.approx(300.0, abs=1.0)
    drive.image.received[MT_FEEDRATE] = 100
    drive.run(300)
    assert drive.axis.motor.velocity == pytest.approx(600.0, abs=1.0)
    drive.image.received[MT_FEEDRATE] = 0
    drive.run(300)
    assert drive.zsw1 & (STOPPED | ACTIVE) == STOPPED | ACTIVE
    drive.image.received[MT_FEEDRATE] = 100
    drive.settle()


# DRV.MOTIONSTAT, ZSW1 and warnings


def test_motion_status_shows_tasks_homing_and_their_errors():
    drive = Positioner(homed=False)
    drive.axis.positioning.settings.target_velocity_window = 10.0
    drive.data(1.0)
    drive.stw(START, 5)
    assert status(drive) & TASK_REFUSED, "not homed"
    drive.stw(READY)
    drive.stand_at(0.4)
    drive.stw(HOME, 20)
    assert status(drive) & (HOMING_ACTIVE | 0x0006) == HOMING_ACTIVE
    drive.until(HOMED | STOPPED)
    assert status(drive) & (HOMING_ACTIVE | HOMING_FAILED | 0x0006) == 0x0006
    drive.move(5.0)
    assert status(drive) & (TASK_ACTIVE | TASK_REFUSED | TASK_SPEED | TASK_REACHED) == TASK_ACTIVE
    drive.run(200)
    assert status(drive) & TASK_SPEED
    drive.settle()
    assert status(drive) & (TASK_ACTIVE | TASK_REACHED | TASK_SPEED) == TASK_REACHED


def test_homing_that_runs_into_a_limit_switch_is_an_error_until_the_next_homing():
    drive = Positioner(homed=False)
    drive.stand_at(0.4)
    drive.stw(HOME, 50)
    drive.axis.machine.settings.fault_limits = 2
    drive.run(300)
    assert status(drive) & (HOMING_FAILED | HOMING_ACTIVE) == HOMING_FAILED
    assert not drive.zsw1 & HOMED
    drive.axis.machine.settings.fault_limits = 0
    drive.stw(READY)
    drive.stw(HOME, 2)
    assert not status(drive) & HOMING_FAILED


def test_an_acknowledgement_forgets_the_error_of_a_task():
    drive = Positioner(homed=False)
    drive.data(1.0)
    drive.stw(START, 5)
    assert status(drive) & TASK_REFUSED
    commanded(drive, CMD_ACKNOWLEDGE)
    assert not status(drive) & TASK_REFUSED


def test_edition_b_5_5_bit_13_needs_that_no_task_is_active():
    later, earlier = Positioner(), Positioner()
    earlier.axis.positioning.settings.rest_without_task = 1
    for drive in (later, earlier):
        drive.move(5.0)
        drive.run(100)
        drive.stw(READY & ~0x0020, 300)
    assert later.zsw1 & STOPPED
    assert not earlier.zsw1 & STOPPED


def test_edition_b_5_5_bit_10_is_set_while_no_motion_is_active():
    drive = Positioner()
    drive.axis.profidrive.settings.reached_without_task = 1
    assert drive.zsw1 & ON_TARGET or drive.stw(READY) & ON_TARGET
    drive.move(5.0)
    drive.run(100)
    assert not drive.zsw1 & ON_TARGET
    drive.stw(READY & ~0x0010)
    assert not drive.zsw1 & ON_TARGET, "braking"
    drive.stw(READY, 300)
    assert drive.zsw1 & ON_TARGET, "5.10.1: back in the basic state"
    drive.stw(0x050F, 50)
    assert not drive.zsw1 & ON_TARGET
    drive.stw(0x040F, 500)
    assert drive.zsw1 & ON_TARGET
    drive.axis.homing.settings.method = HOME_MARK
    drive.stw(HOME, 5)
    assert not drive.zsw1 & ON_TARGET


def test_a_software_limit_that_is_reached_is_a_warning_until_it_is_left():
    drive = Positioner()
    axis = drive.axis
    axis.travel.settings.software_limits, axis.travel.settings.low, axis.travel.settings.high = 3, -1.0, 2.0
    axis.warnings.settings.limit[0], axis.warnings.settings.limit[1] = 108, 107
    drive.move(2.0)
    drive.settle()
    assert axis.warnings.code == 107
    assert drive.zsw1 & 0x0080
    drive.move(0.0)
    drive.settle()
    assert not drive.zsw1 & 0x0080
    drive.move(-1.0)
    drive.settle()
    assert axis.warnings.code == 108


def test_a_software_limit_does_not_take_the_place_of_another_warning():
    drive = Positioner()
    axis = drive.axis
    axis.travel.settings.software_limits, axis.travel.settings.high = 2, 2.0
    axis.warnings.settings.limit[1] = 107
    drive.command(CMD_RAISE_WARNING, 77)
    drive.move(2.0)
    drive.settle()
    assert list(axis.warnings.active[:3]) == [77, 107, 0], "but stands behind it"
    drive.move(0.0)
    drive.settle()
    assert axis.warnings.code == 77


def test_5_8_1_bit_6_shows_that_torque_is_allowed_until_it_is_safely_off():
    drive = Positioner()
    assert not drive.image.sent[DRIVE_INPUTS] & 0x40, "a drive without this fault"
    drive.axis.faults.settings.sto_fault = 602
    drive.run(1)
    assert drive.image.sent[DRIVE_INPUTS] & 0x70 == 0x40
    commanded(drive, CMD_HOLD_FAULT, 602)
    assert not drive.image.sent[DRIVE_INPUTS] & 0x40
    commanded(drive, CMD_RELEASE_FAULT, 602)
    assert drive.image.sent[DRIVE_INPUTS] & 0x40


def test_home_mode_by_its_signal_counts_with_every_telegram_that_brings_it():
    drive = Positioner(homed=False)
    drive.axis.profidrive.settings.home_signals, drive.axis.homing.settings.method = 1, HOME_MARK
    drive.image.received[HOME_MODE] = 0
    drive.stand_at(0.4)
    drive.stw(HOME, 5)
    assert drive.zsw1 & HOMED
    assert drive.axis.motor.position == pytest.approx(0.4, abs=1e-3)


# jogging


def test_5_4_a_jog_in_velocity_mode_begins_at_standstill_only():
    drive = BenchAxis()
    drive.axis.ramp.settings.deceleration = 500.0
    drive.enable(300.0)
    drive.run(200)
    drive.write(0x050F, 300.0, run=100)
    assert drive.axis.motor.velocity > 200.0, "still on the way down along its own ramp"
    down = float(drive.axis.motor.velocity)
    drive.run(100)
    assert down - float(drive.axis.motor.velocity) == pytest.approx(50.0, abs=3.0)
    drive.run(2000)
    assert drive.axis.motor.velocity == pytest.approx(100.0, abs=0.5), "it stood, and jogs now"


def test_5_4_a_jog_in_velocity_mode_brakes_along_its_own_ramp_and_can_turn_round():
    drive = BenchAxis()
    drive.enable()
    drive.axis.jog.settings.deceleration = 200.0
    drive.write(0x050F, run=500)
    drive.write(0x040F, run=100)
    assert drive.axis.motor.velocity == pytest.approx(80.0, abs=1.0)
    drive.write(0x060F, run=1000)
    assert drive.axis.motor.velocity == pytest.approx(-50.0, abs=0.5)


def test_5_4_bits_4_to_6_end_a_jog_of_velocity_mode():
    drive = BenchAxis()
    drive.enable()
    drive.write(0x050F, run=500)
    drive.write(0x057F, 0.0, run=500)
    assert drive.axis.motor.velocity == pytest.approx(0.0, abs=0.5)
    assert not drive.axis.ramp.jogging


def test_5_4_a_jog_in_position_mode_waits_for_standstill():
    drive = Positioner()
    drive.move(50.0)
    drive.run(300)
    drive.stw(0x050F, 2)
    assert drive.axis.positioning.state != JOG, "bit 4 rejects the task first"
    drive.run(500)
    assert drive.axis.positioning.state == JOG
    assert drive.axis.motor.velocity == pytest.approx(100.0, abs=0.5)


def test_set_points_of_another_source_are_not_followed():
    """DRV.CMDSOURCE: with any other than the fieldbus NSOLL_A means nothing."""
    drive = BenchAxis()
    drive.axis.drive.settings.setpoint_ignored = 1
    drive.enable(300.0)
    drive.run(500)
    assert drive.axis.motor.velocity == 0.0
    drive.axis.drive.settings.setpoint_ignored = 0
    drive.run(500)
    assert drive.axis.motor.velocity == pytest.approx(300.0, abs=1.0)
