"""Motion tasks of an AKD by its parameters: edited, kept, saved, started."""

import pytest

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model
from pnfarm.drives.motion_tasks import MotionTask
from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import (
    CMD_CONTINUE,
    CMD_HOME,
    CMD_START_TASK,
    CMD_STOP,
    MOTION_HALTED,
    STOP_HALT,
    TASK_CHAINED,
    TASK_DEFINED,
    TASK_FROM_ACTUAL,
    TASK_FROM_COMMAND,
    TASK_FROM_TARGET,
    TASK_PASSING,
    TASK_RELATIVE,
)
from pnfarm.table.image import IMAGE

AKD = model("akd-profinet")
#: One revolution by PN.POSSCALE and UNIT.PROTARY as they come.
REVOLUTION = 65536


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
    edit(drive, 3, 2.5, V=600_000, ACC=5_000_000, DEC=7_000_000, CNTL=0x31, MTNEXT=4, TNEXT=250)
    axis = drive.handle.axis
    assert axis.motion_tasks.settings.position[3] == pytest.approx(2.5, abs=1e-6)
    assert (
        axis.motion_tasks.settings.velocity[3],
        axis.motion_tasks.settings.acceleration[3],
        axis.motion_tasks.settings.deceleration[3],
    ) == (600.0, 5000.0, 7000.0)
    assert (axis.motion_tasks.settings.next[3], axis.motion_tasks.settings.dwell_ns[3]) == (4, 250_000_000)
    assert axis.motion_tasks.settings.kind[3] == TASK_DEFINED | TASK_RELATIVE | TASK_FROM_COMMAND | TASK_CHAINED
    assert axis.motion_tasks.settings.kind.sum() == axis.motion_tasks.settings.kind[3]


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
    assert list(drive.handle.axis.motion_tasks.settings.kind.nonzero()[0]) == [1, 128]
    drive.set("MT.CLEAR", -1)
    assert not drive.handle.axis.motion_tasks.settings.kind.any()


def test_tasks_outlive_a_power_cycle_only_after_drv_nvsave():
    drive = store()
    edit(drive, 1, 1.0)
    drive.set("DRV.NVSAVE", 1)
    edit(drive, 2, 2.0)
    kept = drive.snapshot()
    drive.power_on()
    assert list(drive.handle.axis.motion_tasks.settings.kind.nonzero()[0]) == [1]
    again = store(kept)
    assert list(again.handle.axis.motion_tasks.settings.kind.nonzero()[0]) == [1]
    assert again.handle.axis.motion_tasks.settings.position[1] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("tasks", "words"),
    [
        ({"200": {}}, "not within 0..128"),
        ({"1": {"2273": 500}}, "2273"),
        ({"x": {}}, "motion task x"),
        ({"1": [1]}, "no such task"),
    ],
)
def test_kept_tasks_that_do_not_fit_are_left_out_with_a_reason(tasks, words):
    drive = ParameterStore(AKD, AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    (sentence,) = drive.restore({"model": "akd-profinet", "parameters": {}, "motion_tasks": tasks})
    assert words in sentence


def test_6_2_a_new_scale_of_positions_changes_the_numbers_of_tasks_and_not_their_positions():
    """Section 6.2: PNU value = parameter value / PN.POSSCALE."""
    drive = store()
    edit(drive, 1, 1.0)
    before = drive.get("MT.P")
    drive.set("PN.POSSCALE", 500)
    assert drive.handle.axis.motion_tasks.settings.position[1] == pytest.approx(1.0, abs=1e-6)
    drive.set("MT.LOAD", 1)
    assert drive.get("MT.P") == pytest.approx(2 * before, abs=1)


@pytest.mark.parametrize(
    ("control", "flags"),
    [
        (0x00, 0),
        (0x01, TASK_RELATIVE | TASK_FROM_COMMAND),
        (0x03, TASK_RELATIVE | TASK_FROM_TARGET),
        (0x07, TASK_RELATIVE | TASK_FROM_ACTUAL),
        (0x10, TASK_CHAINED),
        (0x210, TASK_CHAINED | TASK_PASSING),
        (0x310, TASK_CHAINED | TASK_PASSING),
        (0x200, 0),
    ],
)
def test_mt_cntl_says_what_the_position_is_and_how_the_next_task_follows(control, flags):
    """5.10.1, MT parameters: the bits as the parameter reference has them."""
    drive = store()
    edit(drive, 1, 1.0, CNTL=control)
    assert drive.handle.axis.motion_tasks.settings.kind[1] == TASK_DEFINED | flags


@pytest.mark.parametrize(("control", "dwell"), [(0x10, 0), (0x30, 250), (0xF0, 250), (0x210, 0), (0x20, 0)])
def test_mt_tnext_counts_only_where_mt_cntl_says_so(control, dwell):
    drive = store()
    edit(drive, 1, 1.0, CNTL=control, TNEXT=250)
    assert drive.handle.axis.motion_tasks.settings.dwell_ns[1] == dwell * 1_000_000


@pytest.mark.parametrize(
    "wrong", [{"V": 0}, {"CNTL": 0x05}, {"CNTL": 0x08}, {"CNTL": 0x02}, {"CNTL": 0x50}, {"CNTL": 0x70}]
)
def test_mt_set_refuses_a_task_that_cannot_be_carried_out_and_keeps_the_one_before(wrong):
    drive = store()
    edit(drive, 1, 1.0)
    with pytest.raises(ParameterError) as caught:
        edit(drive, 1, 9.0, **wrong)
    assert caught.value.number == ParameterErrorNumber.VALUE_IMPERMISSIBLE
    assert drive.handle.axis.motion_tasks.settings.position[1] == pytest.approx(1.0, abs=1e-6)


def test_drv_stop_and_mt_continue_reach_the_firmware_in_position_mode():
    drive = store()
    axis = drive.handle.axis
    drive.set("DRV.STOP", 1)
    assert axis.commands.settings.head == 0, "nothing runs that could end"
    axis.drive.state, axis.drive.settings.opmode = 4, 2
    drive.set("DRV.STOP", 1)
    with pytest.raises(ParameterError):
        drive.set("MT.CONTINUE", 1)
    axis.positioning.state = MOTION_HALTED
    drive.set("MT.CONTINUE", 1)
    assert list(axis.commands.settings.ring[:2]) == [CMD_STOP | STOP_HALT << 8, CMD_CONTINUE]
    axis.drive.settings.opmode = 1
    with pytest.raises(ParameterError) as caught:
        drive.set("DRV.STOP", 1)
    assert caught.value.number == ParameterErrorNumber.OPERATING_STATE


def test_mt_move_and_home_move_need_operation_in_position_mode():
    drive = store()
    edit(drive, 1, 1.0)
    axis = drive.handle.axis
    for state, opmode in ((3, 2), (4, 1)):
        axis.drive.state, axis.drive.settings.opmode = state, opmode
        for name in ("MT.MOVE", "HOME.MOVE"):
            with pytest.raises(ParameterError) as caught:
                drive.set(name, 1)
            assert caught.value.number == ParameterErrorNumber.OPERATING_STATE
    axis.drive.state, axis.drive.settings.opmode = 4, 2
    drive.set("MT.MOVE", 1)
    drive.set("HOME.MOVE", 1)
    assert list(axis.commands.settings.ring[:2]) == [CMD_START_TASK | 1 << 8, CMD_HOME]


def test_nvload_restores_the_saved_motion_tasks_and_rstvar_clears_them():
    drive = store()
    drive.set("PN.POSSCALE", 500)
    edit(drive, 3, 4.0, V=600_000, ACC=5_000_000, DEC=5_000_000)
    drive.set("DRV.NVSAVE", 1)
    axis = drive.handle.axis
    place = float(axis.motion_tasks.settings.position[3])
    drive.set("PN.POSSCALE", 1000)
    edit(drive, 4, 1.0, V=600_000, ACC=5_000_000, DEC=5_000_000)
    drive.set("MT.CLEAR", 3)
    drive.set("DRV.NVLOAD", 1)
    assert [n for n in range(8) if axis.motion_tasks.settings.kind[n] & TASK_DEFINED] == [3]
    assert axis.motion_tasks.settings.position[3] == place, "in the saved unit, too"
    drive.set("DRV.RSTVAR", 1)
    assert axis.motion_tasks.settings.kind.sum() == 0
    drive.power_on()
    assert axis.motion_tasks.settings.position[3] == place
    assert axis.motion_tasks.settings.kind[3] & TASK_DEFINED


def test_tasks_of_a_commissioning_tool_are_there_at_power_on_and_can_be_loaded_and_cleared():
    drive = ParameterStore(AKD, AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    drive.commission({"PN.POSSCALE": 500})
    drive.commission_tasks([
        MotionTask(7, 2.0, 600.0, 30_000.0, 20_000.0),
        MotionTask(8, -0.5, 60.0, 1000.0, 1000.0, relative=True, following=7, dwell_ns=250_000_000),
    ])  # fmt: skip
    assert not drive.handle.axis.motion_tasks.settings.kind.any()
    drive.power_on()
    axis = drive.handle.axis
    assert (
        axis.motion_tasks.settings.velocity[7],
        axis.motion_tasks.settings.acceleration[7],
        axis.motion_tasks.settings.deceleration[7],
    ) == (600.0, 30_000.0, 20_000.0)
    assert axis.motion_tasks.settings.position[7] == pytest.approx(2.0, abs=1e-6)
    assert axis.motion_tasks.settings.kind[8] == TASK_DEFINED | TASK_RELATIVE | TASK_FROM_COMMAND | TASK_CHAINED
    assert (axis.motion_tasks.settings.next[8], axis.motion_tasks.settings.dwell_ns[8]) == (7, 250_000_000)
    drive.set("MT.NUM", 7)
    drive.set("MT.LOAD", 1)
    assert drive.get("MT.P") == 4 * REVOLUTION
    drive.set("MT.CLEAR", 7)
    assert list(axis.motion_tasks.settings.kind.nonzero()[0]) == [8]
    drive.power_on()
    assert list(axis.motion_tasks.settings.kind.nonzero()[0]) == [7, 8]


def test_a_task_that_was_saved_in_place_of_a_commissioning_tools_outlives_a_power_cycle():
    drive = ParameterStore(AKD, AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    drive.commission_tasks([MotionTask(number, 2.0, 600.0, 30_000.0, 20_000.0) for number in (7, 8)])
    drive.power_on()
    drive.set("MT.NUM", 7)
    drive.set("MT.LOAD", 1)
    drive.set("MT.P", 3 * REVOLUTION)
    drive.set("MT.SET", 1)
    drive.set("MT.CLEAR", 8)
    drive.set("DRV.NVSAVE", 1)
    drive.power_on()
    tasks = drive.handle.axis.motion_tasks.settings
    assert list(tasks.kind.nonzero()[0]) == [7]
    assert tasks.position[7] == pytest.approx(3.0, abs=1e-4)


def test_a_task_of_a_commissioning_tool_goes_further_than_the_32_bits_of_mt_p_show():
    drive = ParameterStore(AKD, AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    drive.commission_tasks([MotionTask(1, 40_000.0, 99_999.0, 30_000.0, 30_000.0)])
    drive.power_on()
    axis = drive.handle.axis
    assert (axis.motion_tasks.settings.position[1], axis.motion_tasks.settings.velocity[1]) == (40_000.0, 99_999.0)
    drive.set("MT.NUM", 1)
    drive.set("MT.LOAD", 1)
    assert drive.get("MT.V") == 12_000_000
    drive.set("MT.P", REVOLUTION)
    drive.set("MT.SET", 1)
    assert axis.motion_tasks.settings.position[1] == pytest.approx(1.0, abs=1e-6)


def test_a_drive_without_mt_parameters_has_the_tasks_of_its_commissioning_tool():
    """Edition B: motion tasks (5.10.1), and no PNU above 1007 to edit them by."""
    earlier = model("akd-profinet-2012")
    assert earlier.motion_tasks is None
    drive = ParameterStore(earlier, AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    drive.commission_tasks([MotionTask(1, 1.5, 600.0, 30_000.0, 30_000.0)])
    drive.power_on()
    assert drive.handle.axis.motion_tasks.settings.position[1] == 1.5
    assert list(drive.handle.axis.motion_tasks.settings.kind.nonzero()[0]) == [1]


@pytest.mark.parametrize(("name", "number"), [("akd-profinet", 129), ("akd-profinet", -1), ("moog-msd", 0)])
def test_a_task_that_the_drive_cannot_keep_is_refused(name, number):
    drive = ParameterStore(model(name), AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    with pytest.raises(ConfigError, match=f"keeps no motion task {number}"):
        drive.commission_tasks([MotionTask(number, 1.0, 1.0, 1.0, 1.0)])
