"""What bounds a motion: a feed rate of 0, software limits, velocity limits."""

import pytest
from positioner import ACTIVE, HOME, HOMED, ON_TARGET, READY, START, STOPPED, Positioner, task

from pnfarm.table.axis_codes import TASK_PASSING
from pnfarm.table.signals import MT_FEEDRATE, SATZANW


@pytest.mark.parametrize("target", [3.0, -3.0])
def test_5_8_a_feedrate_of_0_holds_a_passing_task_and_the_next_one_waits_for_its_target(target):
    """AKD PROFINET manual 5.8, signal 101 (MT.FEEDRATE), with a task that hands its target over at speed (5.10.1)."""
    drive = Positioner()
    drive.axis.profidrive.settings.feedrate_signal = 1
    drive.image.received[MT_FEEDRATE] = 100
    task(drive, 1, target, following=2)
    task(drive, 2, 2 * target)
    drive.axis.motion_tasks.settings.kind[1] |= TASK_PASSING
    drive.image.received[SATZANW] = 1
    drive.stw(START)
    drive.stw(READY, 150)
    drive.image.received[MT_FEEDRATE] = 0
    drive.run(300)
    held = drive.place
    assert 0.1 < held / target < 0.9
    assert drive.axis.positioning.task == 1
    assert drive.zsw1 & (STOPPED | ACTIVE | ON_TARGET) == STOPPED | ACTIVE
    drive.image.received[MT_FEEDRATE] = 50
    drive.run(20)
    assert abs(drive.place) > abs(held), "on in its own direction"
    while drive.axis.positioning.task == 1:
        drive.run(1)
    assert drive.place == pytest.approx(target, abs=0.3)
    drive.settle()
    assert drive.place == pytest.approx(2 * target, abs=2e-3)


@pytest.mark.parametrize(("bit", "stands"), [(0x0100, 2.0), (0x0200, -1.0)])
def test_5_4_a_jog_never_moves_against_its_direction_where_the_axis_is_beyond_the_software_limit(bit, stands):
    """AKD PROFINET manual 5.4: a jog runs up to its set point; limits by software may be narrowed around the axis."""
    drive = Positioner()
    axis = drive.axis
    drive.move(stands)
    drive.settle()
    axis.travel.settings.software_limits, axis.travel.settings.low, axis.travel.settings.high = 3, -0.5, 1.0
    drive.stw(0x040F | bit, 300)
    assert drive.place == pytest.approx(stands, abs=2e-3)
    drive.stw(0x040F, 50)
    drive.stw(0x040F | (bit ^ 0x0300), 400)
    assert abs(drive.place) < abs(stands) - 0.1, "and back it goes"


@pytest.mark.parametrize(("word", "direction"), [(0x050F, 1.0), (0x060F, -1.0), (0x143F, 1.0), (0x343F, -1.0)])
def test_5_4_a_jog_in_position_mode_keeps_to_the_velocity_limits_and_the_axis_follows(word, direction):
    """AKD PROFINET manual 5.4 and 5.6 (VL.LIMITP, VL.LIMITN): by set points and in real time."""
    drive = Positioner()
    axis = drive.axis
    axis.travel.settings.velocity_limit_positive = axis.travel.settings.velocity_limit_negative = 50.0
    axis.jog.settings.velocity[0], axis.jog.settings.velocity[1] = 600.0, -600.0
    axis.jog.settings.acceleration = 30_000.0
    drive.data(0.0, velocity=600.0)
    drive.stw(word, 1000)
    assert axis.motor.velocity == pytest.approx(direction * 50.0, abs=0.5)
    assert axis.positioning.following_error == pytest.approx(0.0, abs=0.05)
    assert drive.zsw1 & 0x0100


def test_5_10_3_homing_that_turns_at_the_mark_keeps_to_the_velocity_limit_of_each_direction():
    """AKD PROFINET manual 5.10.3 and 5.6 (HOME.DIST, VL.LIMITP, VL.LIMITN)."""
    drive = Positioner(homed=False)
    axis = drive.axis
    axis.homing.settings.distance = -2.0
    axis.travel.settings.velocity_limit_positive, axis.travel.settings.velocity_limit_negative = 200.0, 60.0
    drive.stand_at(0.2)
    drive.stw(HOME)
    fastest = slowest = largest = 0.0
    while not drive.zsw1 & HOMED:
        drive.run(1)
        # MT.VCMD: the shaft itself overshoots a little
        fastest, slowest = max(fastest, float(axis.profile.velocity)), min(slowest, float(axis.profile.velocity))
        largest = max(largest, abs(float(axis.positioning.following_error)))
        assert drive.now < 20e9
    assert (fastest, slowest) == (pytest.approx(200.0), pytest.approx(-60.0))
    assert largest < 0.2
    assert axis.motor.position == pytest.approx(-1.0, abs=2e-3)
