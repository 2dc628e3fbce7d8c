"""Position mode: stored motion tasks and their chains."""

import pytest
from positioner import ACKNOWLEDGED, ACTIVE, HOMED, ON_TARGET, READY, START, STOPPED, Positioner, task

from pnfarm.table.axis_codes import CMD_HOME, CMD_START_TASK, TASK_PASSING
from pnfarm.table.signals import AKTSATZ, DRIVE_MOTION_STATUS, SATZANW


def test_5_10_1_satzanw_starts_the_motion_task_of_its_number_and_aktsatz_shows_which_runs():
    drive = Positioner()
    task(drive, 5, 2.0)
    task(drive, 6, -1.0, relative=True)
    drive.image.received[SATZANW] = 5
    assert drive.stw(START, 20) & (ACKNOWLEDGED | ACTIVE) == ACKNOWLEDGED | ACTIVE
    assert drive.image.sent[AKTSATZ] == 5
    drive.stw(READY)
    drive.settle()
    assert drive.place == pytest.approx(2.0, abs=2e-3)
    assert drive.image.sent[AKTSATZ] == 0
    drive.image.received[SATZANW] = 6
    drive.stw(START)
    drive.stw(READY)
    drive.settle()
    assert drive.place == pytest.approx(1.0, abs=2e-3)


def test_5_10_1_aktsatz_shows_the_running_motion_task_while_satzanw_prepares_another():
    drive = Positioner()
    task(drive, 5, 2.0)
    drive.image.received[SATZANW] = 5
    drive.stw(START, 20)
    drive.image.received[SATZANW] = 0x8000
    drive.stw(READY)
    assert drive.image.sent[AKTSATZ] == 5
    drive.stw(START)
    assert drive.image.sent[AKTSATZ] == 0x8000, "and of MDI once its task runs"


@pytest.mark.parametrize("number", [7, 128, 129, 0x7FFF])
def test_a_motion_task_that_is_not_there_is_not_acknowledged(number):
    drive = Positioner()
    task(drive, 5, 2.0)
    drive.image.received[SATZANW] = number
    assert not drive.stw(START, 50) & (ACKNOWLEDGED | ACTIVE)


def test_a_chained_motion_task_is_followed_after_its_dwell_and_the_last_one_reaches_the_target():
    drive = Positioner()
    task(drive, 1, 1.0, following=2, dwell=0.2)
    task(drive, 2, 3.0, following=3)
    task(drive, 3, 0.5)
    drive.image.received[SATZANW] = 1
    drive.stw(START)
    seen = []
    for _ in range(1600):
        drive.run(1)
        seen.append((int(drive.image.sent[AKTSATZ]), round(drive.place, 1), bool(drive.zsw1 & ON_TARGET)))
    numbers = [number for number, _, _ in seen]
    assert [n for i, n in enumerate(numbers) if i == 0 or numbers[i - 1] != n] == [1, 2, 3, 0]
    assert sum(1 for number, place, _ in seen if (number, place) == (1, 1.0)) >= 200, "the dwell"
    assert not any(reached for number, _, reached in seen if number)
    assert seen[-1] == (0, 0.5, True)


def test_a_chain_whose_next_task_is_gone_ends():
    drive = Positioner()
    task(drive, 1, 1.0, following=9)
    drive.image.received[SATZANW] = 1
    drive.stw(START)
    drive.stw(READY)
    drive.settle()
    assert drive.place == pytest.approx(1.0, abs=2e-3)
    assert not drive.zsw1 & ACTIVE


def test_commands_start_a_motion_task_and_homing_as_the_control_word_does():
    drive = Positioner(homed=False)
    task(drive, 4, 1.5)
    drive.image.received[SATZANW] = 0
    drive.command(CMD_HOME)
    drive.run(5)
    assert not drive.zsw1 & STOPPED
    drive.until(ON_TARGET | HOMED | STOPPED)
    drive.command(CMD_START_TASK, 4)
    drive.run(20)
    assert drive.image.sent[AKTSATZ] == 4
    drive.settle()
    assert drive.place == pytest.approx(1.5, abs=2e-3)


@pytest.mark.parametrize("refused", ["not there", "beyond a software limit"])
def test_a_chain_whose_next_task_cannot_begin_ends_with_the_error_of_it_until_another_begins(refused):
    """AKD parameter reference, DRV.MOTIONSTAT: bit 10 is for a following task that was never set up, too."""
    drive = Positioner()
    task(drive, 1, 1.0, following=9)
    if refused != "not there":
        task(drive, 9, 3.0)
        drive.axis.travel.settings.software_limits, drive.axis.travel.settings.high = 2, 2.0
    drive.axis.warnings.settings.task[0], drive.axis.warnings.settings.task[1] = 160, 154
    drive.image.received[SATZANW] = 1
    drive.stw(START)
    drive.stw(READY)
    assert not drive.image.sent[DRIVE_MOTION_STATUS] & 0x0400
    drive.settle()
    assert drive.image.sent[DRIVE_MOTION_STATUS] & 0x0C00 == 0x0C00, "reached, and the next one could not be activated"
    assert (drive.axis.warnings.code, drive.zsw1 & 0x0088) == (154, 0x0080)
    drive.stw(START)
    assert not drive.image.sent[DRIVE_MOTION_STATUS] & 0x0400
    assert (drive.axis.warnings.code, drive.zsw1 & 0x0088) == (0, 0)


def test_a_passing_task_whose_next_one_cannot_begin_reports_it():
    drive = Positioner()
    task(drive, 1, 1.0, following=9)
    drive.axis.motion_tasks.settings.kind[1] |= TASK_PASSING
    drive.image.received[SATZANW] = 1
    drive.stw(START)
    drive.stw(READY)
    drive.settle()
    assert drive.image.sent[DRIVE_MOTION_STATUS] & 0x0C00 == 0x0C00
    assert drive.place == pytest.approx(1.0, abs=2e-3)


def test_a_task_that_could_not_be_started_is_a_warning_until_one_is_or_faults_are_acknowledged():
    drive = Positioner()
    drive.axis.warnings.settings.task[0], drive.axis.warnings.settings.task[1] = 160, 154
    drive.image.received[SATZANW] = 7
    drive.stw(START)
    assert (drive.axis.warnings.code, drive.zsw1 & 0x0080) == (160, 0x0080)
    drive.stw(READY | 0x0080)
    assert (drive.axis.warnings.code, drive.zsw1 & 0x0080) == (0, 0)


def test_a_chain_that_goes_on_forgets_that_another_task_was_refused_meanwhile():
    drive = Positioner()
    task(drive, 1, 1.0, following=2)
    task(drive, 2, 3.0)
    drive.image.received[SATZANW] = 1
    drive.stw(START)
    drive.stw(READY)
    drive.image.received[SATZANW] = 7
    drive.stw(START)
    assert drive.image.sent[DRIVE_MOTION_STATUS] & 0x0400
    while drive.axis.positioning.task == 1:
        drive.run(1)
    assert not drive.image.sent[DRIVE_MOTION_STATUS] & 0x0400


@pytest.mark.parametrize(("number", "place"), [(3, -1.0), (7, 3.0)])
def test_a_task_that_is_asked_for_in_the_step_of_a_chains_next_one_goes_before_it(number, place):
    def begun():
        drive = Positioner()
        task(drive, 1, 1.0, following=2)
        task(drive, 2, 3.0)
        task(drive, 3, -1.0)
        drive.image.received[SATZANW] = 1
        drive.stw(START)
        drive.stw(READY)
        return drive

    drive, steps = begun(), 0
    while drive.axis.positioning.task == 1:
        drive.run(1)
        steps += 1
    drive = begun()
    drive.run(steps - 1)
    drive.image.received[SATZANW] = number
    drive.stw(START)
    drive.stw(READY)
    drive.settle()
    assert drive.place == pytest.approx(place, abs=2e-3)
