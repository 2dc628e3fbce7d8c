"""SINA_POS as a PLC program (`configs/programs/sina_pos.py`) against telegram 111 of the drive that is the profile."""

from __future__ import annotations

import textwrap

import pytest
from block_rig import PROGRAMS, BlockRig

RELATIVE, ABSOLUTE, SET_UP, HOMING, SET_REFERENCE, BLOCK, JOG, JOG_INCREMENTAL = range(1, 9)
TURN = 10_000  # LU
SLOW = 3_000  # 1000 LU/min: 300 rpm
TASKS = "[{number: 7, position: 2.0, velocity: 300, acceleration: 6000}]"


@pytest.fixture
def rig():
    with BlockRig("sina_pos.py", "SinaPos", telegram=111, tasks=TASKS) as opened:
        enable(opened)
        yield opened


def enable(rig: BlockRig) -> None:
    assert rig.wait(lambda: rig.block.connected and rig.block.Status == 0x7002)
    rig.set(EnableAxis=True, Velocity=SLOW)
    assert rig.wait(lambda: rig.block.AxisEnabled and rig.block.Status == 0x7002)


def move(rig: BlockRig, mode: int, **inputs) -> None:
    """Choose a mode, wait until it is the actual one, and start it."""
    rig.set(ModePos=mode, **inputs)
    assert rig.wait(lambda: rig.block.ActMode == mode)
    rig.set(ExecuteMode=True)
    rig.block.ExecuteMode = False


def arrives(rig: BlockRig, position: int) -> bool:
    return rig.wait(lambda: rig.block.AxisPosOk and abs(rig.block.ActPosition - position) < 20)


# modes


def test_mode_1_moves_by_a_distance_each_time_it_is_executed(rig):
    for times in (1, 2):
        move(rig, RELATIVE, Position=TURN)
        assert not rig.block.AxisPosOk
        assert arrives(rig, times * TURN)
    assert rig.wait(lambda: rig.block.AxisSpFixed, 0.5)


def test_mode_2_moves_to_a_position_and_back(rig):
    for position in (3 * TURN, -TURN):
        move(rig, ABSOLUTE, Position=position)
        assert rig.block.EPosZSW2 & 0x8000
        assert arrives(rig, position)
    assert rig.axis.motor.position - rig.axis.homing.origin == pytest.approx(-1.0, abs=0.002)


@pytest.mark.parametrize(("inputs", "rpm"), [({"Positive": True}, 300.0), ({"Negative": True}, -300.0)])
def test_mode_3_holds_a_speed_until_the_job_is_cancelled(rig, inputs, rpm):
    move(rig, SET_UP, **inputs)
    rig.set(1.0)
    assert rig.rpm == pytest.approx(rpm, abs=2.0)
    assert rig.block.ActVelocity == pytest.approx(rpm / 3000 * 0x40000000, rel=0.01)
    rig.set(0.5, CancelTraversing=False)
    assert rig.rpm == pytest.approx(0.0, abs=1.0)


def test_mode_3_changes_to_mode_2_on_the_way(rig):
    move(rig, SET_UP, Positive=True)
    rig.set(0.5)
    move(rig, ABSOLUTE, Position=TURN)
    assert arrives(rig, TURN)


@pytest.mark.parametrize(("inputs", "way"), [({"Positive": True}, 1), ({"Negative": True}, -1), ({}, 1)])
def test_mode_4_looks_for_the_reference_point_in_the_direction_that_is_asked_for(rig, inputs, way):
    rig.set(ModePos=HOMING, **inputs)
    rig.set(0.1, ExecuteMode=True)
    assert rig.block.EPosZSW1 & 0x0800
    assert not rig.block.AxisRef
    assert rig.rpm * way > 1.0
    assert rig.wait(lambda: rig.block.AxisRef)
    assert rig.block.ActPosition == pytest.approx(0, abs=20)


def test_mode_5_makes_the_place_the_reference_point_without_motion(rig):
    move(rig, ABSOLUTE, Position=TURN)
    assert arrives(rig, TURN)
    before = float(rig.axis.motor.position)
    move(rig, SET_REFERENCE)
    assert rig.wait(lambda: rig.block.AxisRef and abs(rig.block.ActPosition) < 20)
    assert rig.axis.motor.position == pytest.approx(before, abs=0.002)


def test_mode_6_runs_the_traversing_block_of_its_number(rig):
    move(rig, BLOCK, Position=7)
    assert rig.block.EPosZSW1 == 0x2007
    assert arrives(rig, 2 * TURN)


@pytest.mark.parametrize(("jog", "rpm"), [("Jog1", -30.0), ("Jog2", 30.0)])
def test_mode_7_jogs_while_the_signal_is_there(rig, jog, rpm):
    rig.set(1.0, ModePos=JOG, **{jog: True})
    assert rig.rpm == pytest.approx(rpm, abs=1.0)
    assert rig.block.EPosZSW1 & 0x0400
    rig.set(0.5, **{jog: False})
    assert rig.rpm == pytest.approx(0.0, abs=1.0)
    rig.set(0.5, Jog1=True, Jog2=True)
    assert rig.rpm == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize(("jog", "place"), [("Jog1", -1000), ("Jog2", 1000)])
def test_mode_8_jogs_by_the_distance_of_the_drive(rig, jog, place):
    for times in (1, 2):
        rig.set(1.5, ModePos=JOG_INCREMENTAL, **{jog: True})
        assert rig.block.ActPosition == pytest.approx(times * place, abs=20)
        rig.set(0.1, **{jog: False})


def test_an_intermediate_stop_waits_and_the_job_goes_on(rig):
    move(rig, ABSOLUTE, Position=5 * TURN)
    rig.set(0.5, IntermediateStop=False)
    assert rig.rpm == pytest.approx(0.0, abs=1.0)
    waits = rig.block.ActPosition
    assert 0 < waits < 5 * TURN
    rig.set(IntermediateStop=True)
    assert arrives(rig, 5 * TURN)


def test_the_velocity_override_acts_on_a_running_job(rig):
    move(rig, SET_UP, Positive=True)
    for share, rpm in ((50, 150.0), (199, 597.0), (0, 0.0)):
        rig.set(1.0, OverV=share)
        assert rig.rpm == pytest.approx(rpm, abs=2.0)


def test_flying_homing_takes_the_place_of_the_probe_while_a_job_runs(rig):
    move(rig, SET_UP, Positive=True)
    rig.set(0.5, FlyRef=True)
    assert rig.block.EPosZSW1 & 0x1000
    before = rig.block.ActPosition
    rig.inject("digital-input", input=0)
    rig.set()
    assert not rig.block.EPosZSW1 & 0x1000
    assert rig.block.AxisRef
    assert rig.block.ActPosition < before
    rig.set(2.0)
    assert rig.block.Status == 0x7002


@pytest.mark.parametrize(
    ("config", "stops"), [(0x00000003, False), (0x0000000B, True)], ids=["switches off", "switches on"]
)
def test_config_epos_says_whether_limit_switches_count(rig, config, stops):
    rig.set(ConfigEPos=config)
    rig.inject("limit-switch", side="positive")
    rig.set(ModePos=SET_UP, Positive=True)
    rig.set(0.5, ExecuteMode=True)
    assert (abs(rig.rpm) < 1.0) is stops


def test_config_epos_transfers_set_points_without_an_edge(rig):
    rig.set(ConfigEPos=0x00000103)
    move(rig, ABSOLUTE, Position=5 * TURN)
    rig.set(Position=TURN)
    assert arrives(rig, TURN)


# errors


@pytest.mark.parametrize("mode", [-1, 9, 300])
def test_a_wrong_mode_is_8202_and_nothing_starts(rig, mode):
    rig.set(0.2, ModePos=mode, ExecuteMode=True, Position=TURN)
    assert (rig.block.Error, rig.block.Status) == (True, 0x8202)
    assert rig.block.ActPosition == pytest.approx(0, abs=20)
    rig.set(ModePos=ABSOLUTE)
    assert (rig.block.Error, rig.block.Status) == (False, 0x7002)


@pytest.mark.parametrize("inputs", [{"OverV": 200}, {"OverV": -1}, {"OverAcc": 101}, {"OverDec": -1}])
def test_an_override_beyond_its_limits_is_8203(rig, inputs):
    rig.set(**inputs)
    assert (rig.block.Error, rig.block.Status) == (True, 0x8203)


@pytest.mark.parametrize("number", [-1, 64])
def test_a_traversing_block_that_cannot_be_is_8204(rig, number):
    rig.set(ModePos=BLOCK, Position=number, ExecuteMode=True)
    assert (rig.block.Error, rig.block.Status) == (True, 0x8204)


def test_a_fault_of_the_drive_is_8401_and_is_acknowledged_by_an_edge(rig):
    move(rig, SET_UP, Positive=True)
    rig.inject("drive-fault", fault="16")
    assert rig.wait(lambda: rig.block.Status == 0x8401)
    assert (rig.block.Error, rig.block.AxisError, rig.block.ActFault) == (True, True, 16)
    rig.clear()
    rig.set(0.5)
    assert rig.block.AxisError, "it stays until it is acknowledged"
    rig.set(AckError=True)
    assert (rig.block.Status, rig.block.ActFault) == (0x8402, 0), "the enable has to go first"
    rig.set(EnableAxis=False, AckError=False)
    enable(rig)


@pytest.mark.parametrize("config", [0x00000002, 0x00000001], ids=["OFF2", "OFF3"])
def test_without_off2_or_off3_switching_on_is_inhibited_which_is_8402(rig, config):
    rig.set(0.5, ConfigEPos=config)
    assert (rig.block.Lockout, rig.block.Status, rig.block.AxisEnabled) == (True, 0x8402, False)
    rig.set(0.1, ConfigEPos=0x00000003)
    assert rig.block.Status == 0x8402, "the enable has to go first"


def test_without_the_enable_the_axis_is_off_and_nothing_starts(rig):
    rig.set(0.5, EnableAxis=False)
    assert (rig.block.AxisEnabled, rig.block.Status) == (False, 0x7002)
    move(rig, ABSOLUTE, Position=TURN)
    rig.set(0.5)
    assert rig.block.ActPosition == pytest.approx(0, abs=20)


def test_flying_homing_that_cannot_start_is_8403():
    """HIWIN E1 manual 3.13: POS_STW2.8 is reserved there."""
    with BlockRig("sina_pos.py", "SinaPos", model="hiwin-e1", telegram=111) as rig:
        enable(rig)
        rig.set(0.5, FlyRef=True)
        assert rig.block.Status == 0x7002
        rig.set(1.0)
        assert (rig.block.Error, rig.block.Status) == (True, 0x8403)
        rig.set(FlyRef=False)
        assert rig.block.Status == 0x7002


def test_a_lost_connection_is_8600_and_the_block_goes_on_behind_it(rig):
    rig.inject("link-down")
    assert rig.wait(lambda: rig.block.Status == 0x8600)
    assert (rig.block.Error, rig.block.DiagId, rig.block.AxisEnabled, rig.block.ActMode) == (True, 0x80A0, False, 0)
    rig.clear()
    assert rig.wait(lambda: rig.block.Status == 0x8401, 10.0), "the drive reports the loss"
    rig.set(EnableAxis=False, AckError=True)
    rig.set(AckError=False)
    enable(rig)


def test_a_warning_of_the_drive_is_shown_with_its_number(rig):
    rig.set(ConfigEPos=0x0000000B)
    rig.inject("limit-switch", side="positive")
    rig.set(0.1)
    assert (rig.block.AxisWarn, rig.block.ActWarn) == (True, 57)
    assert rig.block.EPosZSW1 & 0x0200


def test_a_program_beside_the_block_derives_from_it_as_the_page_has_it(tmp_path):
    page = (PROGRAMS.parents[1] / "docs" / "plc-programs.md").read_text()
    example = page[page.index("    # my_plc.py\n    from sina_pos") :].partition("\n\n| Status")[0]
    (tmp_path / "my_plc.py").write_text(textwrap.dedent(example))
    (tmp_path / "sina_pos.py").write_text((PROGRAMS / "sina_pos.py").read_text())
    with BlockRig(str(tmp_path / "my_plc.py"), telegram=111) as rig:
        assert arrives(rig, 10 * TURN)


def test_the_farm_files_program_moves_to_and_fro_and_comes_back_behind_a_fault():
    with BlockRig("sina_pos.py", telegram=111) as rig:
        for _ in range(2):
            assert rig.wait(lambda: arrives(rig, 10 * TURN), 10.0)
            assert rig.wait(lambda: arrives(rig, 0), 10.0)
        rig.line.farm.injections.inject(
            {"kind": "drive-fault", "on": "axis", "params": {"fault": "16"}, "count": 1}, rig.world.now
        )
        assert rig.wait(lambda: rig.block.AxisError)
        assert rig.wait(lambda: rig.block.AxisEnabled)
