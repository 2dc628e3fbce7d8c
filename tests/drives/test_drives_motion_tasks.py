"""Motion tasks of an AKD by its parameters: edited, kept, saved, started."""

from __future__ import annotations

import pytest

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model
from pnfarm.drives.parameter import ParameterError, ParameterErrorNumber
from pnfarm.drives.store import ParameterStore
from pnfarm.table.axis import AXIS, CMD_HOME, CMD_START_TASK, TASK_CHAINED, TASK_DEFINED, TASK_RELATIVE
from pnfarm.table.image import IMAGE

AKD = model("akd-profinet")
#: One revolution by PN.POSSCALE and UNIT.PROTARY as they come.
REVOLUTION = 2**32 / 1000


def store(kept=None):
    made = ParameterStore(AKD, AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    assert made.restore(kept) == []
    made.power_on()
    return made


def edit(drive, number, revolutions, **other):
    drive.set("MT.NUM", number)
    drive.set("MT.P", round(revolutions * REVOLUTION))
    for name, value in other.items():
        drive.set(f"MT.{name}", value)
    drive.set("MT.SET", 1)


def test_mt_set_keeps_the_edited_task_in_the_units_of_the_axis():
    drive = store()
    edit(drive, 3, 2.5, V=600_000, ACC=5_000_000, DEC=7_000_000, CNTL=0x11, MTNEXT=4, TNEXT=250)
    axis = drive.handle.axis
    assert axis.mt_position[3] == pytest.approx(2.5, abs=1e-6)
    assert (axis.mt_velocity[3], axis.mt_acceleration[3], axis.mt_deceleration[3]) == (600.0, 5000.0, 7000.0)
    assert (axis.mt_next[3], axis.mt_dwell_ns[3]) == (4, 250_000_000)
    assert axis.mt_flags[3] == TASK_DEFINED | TASK_RELATIVE | TASK_CHAINED
    assert axis.mt_flags.sum() == axis.mt_flags[3]


def test_mt_load_brings_a_task_back_and_refuses_one_that_is_not_there():
    drive = store()
    edit(drive, 3, 2.5)
    edit(drive, 4, -1.0)
    drive.set("MT.NUM", 3)
    drive.set("MT.LOAD", 1)
    assert drive.get("MT.P") == round(2.5 * REVOLUTION)
    drive.set("MT.NUM", 9)
    with pytest.raises(ParameterError) as caught:
        drive.set("MT.LOAD", 1)
    assert caught.value.number == ParameterErrorNumber.VALUE_IMPERMISSIBLE


def test_mt_clear_forgets_one_or_all():
    drive = store()
    for number in (1, 2, 128):
        edit(drive, number, 1.0)
    drive.set("MT.CLEAR", 2)
    assert list(drive.handle.axis.mt_flags.nonzero()[0]) == [1, 128]
    drive.set("MT.CLEAR", -1)
    assert not drive.handle.axis.mt_flags.any()


def test_tasks_outlive_a_power_cycle_only_after_drv_nvsave():
    drive = store()
    edit(drive, 1, 1.0)
    drive.set("DRV.NVSAVE", 1)
    edit(drive, 2, 2.0)
    kept = drive.snapshot()
    drive.power_on()
    assert list(drive.handle.axis.mt_flags.nonzero()[0]) == [1]
    again = store(kept)
    assert list(again.handle.axis.mt_flags.nonzero()[0]) == [1]
    assert again.handle.axis.mt_position[1] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("tasks", "words"),
    [
        ({"200": {}}, "not within 0..128"),
        ({"1": {"2273": 500}}, "2273"),
        ({"x": {}}, "motion task x"),
        ({"1": [1]}, "no such task"),
    ],
)
def test_kept_tasks_that_do_not_fit_are_left_out_with_a_sentence(tasks, words):
    drive = ParameterStore(AKD, AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    (sentence,) = drive.restore({"model": "akd-profinet", "parameters": {}, "motion_tasks": tasks})
    assert words in sentence


def test_a_new_scale_of_positions_counts_for_tasks_too():
    drive = store()
    edit(drive, 1, 1.0)
    drive.set("PN.POSSCALE", 500)
    assert drive.handle.axis.mt_position[1] == pytest.approx(0.5, abs=1e-6)


def test_mt_move_and_home_move_need_operation_in_position_mode():
    drive = store()
    edit(drive, 1, 1.0)
    axis = drive.handle.axis
    for state, opmode in ((3, 2), (4, 1)):
        axis.state, axis.opmode = state, opmode
        for name in ("MT.MOVE", "HOME.MOVE"):
            with pytest.raises(ParameterError) as caught:
                drive.set(name, 1)
            assert caught.value.number == ParameterErrorNumber.OPERATING_STATE
    axis.state, axis.opmode = 4, 2
    drive.set("MT.MOVE", 1)
    drive.set("HOME.MOVE", 1)
    assert list(axis.command[:2]) == [CMD_START_TASK | 1 << 8, CMD_HOME]


def test_the_earlier_edition_has_no_motion_tasks():
    assert model("akd-profinet-2012").motion_tasks is None
