"""Position mode: stored motion tasks and their chains."""

import pytest
from positioner import ACKNOWLEDGED, ACTIVE, HOMED, ON_TARGET, READY, START, STOPPED, Positioner, task

from pnfarm.table.axis import CMD_HOME, CMD_START_TASK
from pnfarm.table.signals import AKTSATZ, SATZANW


def test_5_10_1_satzanw_starts_the_motion_task_of_its_number_and_aktsatz_tells_which_runs():
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
