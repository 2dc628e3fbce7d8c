"""Position mode on standstill and direction: ZSW1.13 and POS_ZSW2, where no profile and the shaft disagree."""

import pytest
from positioner import HOME, HOMED, ON_TARGET, READY, START, STOPPED, Positioner

from pnfarm.table.signals import DRIVE_MOTION_STATUS, POS_ZSW2

FORWARDS, BACKWARDS = 0x0010, 0x0020


@pytest.mark.parametrize("distance", [-0.5, 0.0, 0.5])
def test_5_10_3_bits_10_11_and_13_stay_0_until_homing_is_over_also_where_it_turns_at_the_mark(distance):
    """AKD PROFINET manual 5.10.3: false while homing runs, true when it is finished."""
    drive = Positioner(homed=False)
    drive.axis.homing.settings.distance = distance
    # CS.VTHRESH: what counts as rest
    drive.axis.ramp.settings.standstill = 100.0
    drive.stand_at(0.4)
    seen = drive.stw(HOME)
    while not seen & HOMED:
        assert not seen & (ON_TARGET | STOPPED)
        drive.run(1)
        seen = drive.zsw1
        assert drive.now < 10e9
    drive.until(ON_TARGET | HOMED | STOPPED)
    assert drive.axis.motor.position == pytest.approx(1.0 + distance, abs=0.01)


def test_5_5_bit_13_is_set_when_a_coasting_axis_turns_slower_than_standstill():
    """AKD PROFINET manual 5.5: axis is not moving; without dry friction it never comes to rest altogether."""
    drive = Positioner()
    drive.axis.load.settings.friction, drive.axis.load.settings.damping = 0.0, 1e-3
    drive.move(50.0)
    drive.run(300)
    drive.stw(READY & ~0x0002, 500)
    assert drive.axis.motor.velocity > drive.axis.ramp.settings.standstill
    assert not drive.zsw1 & STOPPED
    drive.run(5000)
    assert 0.0 < drive.axis.motor.velocity < drive.axis.ramp.settings.standstill
    assert drive.zsw1 & STOPPED


def test_edition_b_5_10_1_bit_13_is_0_while_jogging_also_where_a_limit_lets_the_axis_go_no_further():
    """Its figure: bits 10 and 13 are false in the state of jogging."""
    later, earlier = Positioner(), Positioner()
    earlier.axis.positioning.settings.rest_without_task = 1
    for drive in (later, earlier):
        drive.axis.machine.settings.fault_limits = 2
        drive.stw(0x050F, 100)
        assert drive.axis.motor.velocity == pytest.approx(0.0, abs=0.1)
    assert later.zsw1 & STOPPED
    assert not earlier.zsw1 & STOPPED
    earlier.stw(0x040F, 20)
    assert earlier.zsw1 & STOPPED


def test_hiwin_table_3_5_2_1_bit_10_falls_when_the_axis_is_turned_away_from_its_target_without_power():
    """0 is: not at target position; also once it is enabled again, until a task brings it there."""
    drive = Positioner()
    drive.move(2.0)
    drive.settle()
    drive.stw(READY & ~0x0001, 20)
    assert drive.zsw1 & ON_TARGET
    drive.axis.motor.position += 0.5
    drive.run(5)
    assert not drive.zsw1 & ON_TARGET
    for word in (0x0437, READY, READY):
        assert not drive.stw(word, 10) & ON_TARGET
    drive.move(2.0)
    drive.settle()
    assert drive.place == pytest.approx(2.0, abs=2e-3)


def test_5_5_bit_10_is_bit_11_of_drv_motionstat_at_every_moment_of_a_task():
    """AKD PROFINET manual 5.5: target position reached."""
    drive = Positioner()
    drive.axis.positioning.settings.gain = 10.0
    drive.data(3.0)
    drive.stw(START)
    seen = set()
    for _ in range(3000):
        reached = int(drive.image.sent[DRIVE_MOTION_STATUS]) & 0x0800 != 0
        assert (drive.zsw1 & ON_TARGET != 0) == reached
        seen.add(reached)
        drive.run(1)
    assert seen == {False, True}


@pytest.mark.parametrize("before", [0x040F, 0x050F, 0x060F])
def test_edition_b_5_10_1_both_jog_bits_are_the_state_of_jogging_at_rest(before):
    """Its figure: STW1 bit 8 or 9 or 8 and 9 leads to jogging, where bits 10 and 13 are false; it ends without both."""
    drive = Positioner()
    axis = drive.axis
    axis.positioning.settings.rest_without_task = axis.profidrive.settings.reached_without_task = 1
    drive.stw(before, 300)
    drive.stw(0x070F, 300)
    assert axis.motor.velocity == pytest.approx(0.0, abs=0.1)
    assert not drive.zsw1 & (ON_TARGET | STOPPED)
    drive.stw(0x060F, 300)
    assert axis.motor.velocity == pytest.approx(-50.0, abs=0.5)
    drive.stw(0x070F, 300)
    assert drive.stw(0x040F, 20) & (ON_TARGET | STOPPED) == ON_TARGET | STOPPED


@pytest.mark.parametrize(("target", "told"), [(2.0, FORWARDS), (-2.0, BACKWARDS)])
def test_hiwin_table_3_15_1_an_axis_that_begins_to_move_is_never_told_to_move_the_other_way(target, told):
    """Bits 4 and 5 of POS_ZSW2; dry friction holds the shaft for the first moments of a gentle task."""
    drive = Positioner()
    drive.axis.load.settings.friction = 0.5
    drive.data(target, up=800.0, down=800.0)
    drive.stw(START)
    assert drive.axis.motor.velocity == 0.0
    seen = set()
    while not drive.zsw1 & ON_TARGET:
        seen.add(int(drive.image.sent[POS_ZSW2]) & (FORWARDS | BACKWARDS))
        drive.run(1)
        assert drive.now < 20e9
    assert seen <= {told, 0}
    assert told in seen
