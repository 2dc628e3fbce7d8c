"""STW1.10: what a controller does to edges while it does not control, and STW1.11 that stays set through a task."""

import pytest
from bench_axis import BenchAxis
from positioner import ACKNOWLEDGED, ACTIVE, HOME, HOMED, READY, START, STOPPED, Positioner

from pnfarm.firmware.motion.positioning import HOMING, STANDBY, TASK
from pnfarm.table.axis_codes import CONTROL_BY_PLC, HOME_AT_ONCE, TASKS_POS_STW
from pnfarm.table.signals import POS_STW2

AWAY = ~CONTROL_BY_PLC


def test_5_4_an_edge_of_bit_6_while_bit_10_is_0_starts_nothing_when_bit_10_returns():
    drive = Positioner()
    drive.data(1.0)
    drive.stw(READY & AWAY, 5)
    drive.stw(START & AWAY, 5)
    assert not drive.stw(START, 50) & (ACKNOWLEDGED | ACTIVE)
    drive.stw(READY)
    assert drive.stw(START) & (ACKNOWLEDGED | ACTIVE) == ACKNOWLEDGED | ACTIVE, "the next edge does"


def test_5_4_bit_6_that_rises_with_bit_10_starts_as_bit_7_acknowledges_then():
    drive = Positioner()
    drive.move(0.2)
    drive.settle()
    drive.data(1.0)
    drive.stw(START)
    drive.settle()
    # in force it stays 1 all the while; the word that came in was without it
    drive.stw(READY & AWAY, 5)
    drive.data(2.0)
    drive.stw(START)
    assert drive.zsw1 & ACTIVE
    drive.settle()
    assert drive.place == pytest.approx(2.0, abs=2e-3)


def test_5_4_homing_ends_when_bit_11_fell_while_bit_10_was_0():
    drive = Positioner(homed=False)
    drive.stand_at(0.4)
    drive.axis.homing.settings.velocity = 6.0
    drive.stw(HOME, 20)
    drive.stw(READY & AWAY, 20)
    assert drive.axis.positioning.state == HOMING, "nothing is taken over"
    drive.stw(READY, 200)
    assert drive.axis.positioning.state == STANDBY
    assert drive.zsw1 & (STOPPED | HOMED) == STOPPED


@pytest.mark.parametrize("by_edge", [0, 1])
def test_5_10_3_a_bit_11_that_stays_set_through_a_task_homes_after_it_by_its_level_and_not_by_its_edge(by_edge):
    drive = Positioner()
    drive.axis.homing.settings.method = HOME_AT_ONCE
    drive.axis.homing.settings.by_edge = by_edge
    drive.move(1.0)
    drive.stw(HOME, 20)
    assert drive.axis.positioning.state == TASK, "no motion task may be active"
    drive.until(STOPPED)
    drive.run(50)
    assert drive.place == pytest.approx(1.0 if by_edge else 0.0, abs=2e-3)
    drive.stw(READY)
    drive.stw(HOME, 5)
    assert drive.place == pytest.approx(0.0, abs=2e-3), "a new edge homes in either reading"


@pytest.mark.parametrize("by_edge", [0, 1])
def test_5_10_3_a_bit_11_that_rises_while_bit_10_is_0_homes_by_its_level_and_not_by_its_edge(by_edge):
    drive = Positioner(homed=False)
    drive.axis.homing.settings.method = HOME_AT_ONCE
    drive.axis.homing.settings.by_edge = by_edge
    drive.stw(HOME & AWAY, 5)
    assert bool(drive.stw(HOME, 20) & HOMED) == (not by_edge)


def test_an_edge_of_pos_stw2_while_bit_10_is_0_sets_no_reference_point_when_bit_10_returns():
    """HIWIN E1 manual 3.13: POS_STW2.1."""
    drive = BenchAxis()
    drive.axis.drive.settings.opmode = 2
    drive.axis.profidrive.settings.task_form = TASKS_POS_STW
    drive.write(0x0430)
    drive.write(0x0030)
    drive.image.received[POS_STW2] = 0x0002
    drive.write(0x0030, run=5)
    drive.write(0x0430, run=5)
    assert not drive.axis.homing.homed
    drive.image.received[POS_STW2] = 0
    drive.write(0x0430)
    drive.image.received[POS_STW2] = 0x0002
    drive.write(0x0430)
    assert drive.axis.homing.homed
