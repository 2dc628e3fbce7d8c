"""SINA_SPEED as a PLC program (`configs/programs/sina_speed.py`) against telegram 1 of `model: profidrive`."""

from __future__ import annotations

import pytest
from block_rig import BlockRig


@pytest.fixture
def rig():
    with BlockRig("sina_speed.py", "SinaSpeed", telegram=1) as opened:
        enable(opened)
        yield opened


def enable(rig: BlockRig) -> None:
    assert rig.wait(lambda: rig.block.Status == 0x7002)
    rig.set(EnableAxis=True)
    assert rig.wait(lambda: rig.block.AxisEnabled)


@pytest.mark.parametrize("rpm", [1500.0, -1500.0, 0.0])
def test_the_axis_turns_at_the_set_point(rig, rpm):
    rig.set(1.0, SpeedSp=rpm)
    assert rig.rpm == pytest.approx(rpm, abs=2.0)
    assert rig.block.ActVelocity == pytest.approx(rpm, abs=2.0)
    assert (rig.block.Error, rig.block.Status, rig.block.DiagId) == (False, 0x7002, 0)


def test_a_wrong_reference_speed_makes_another_speed(rig):
    rig.set(1.0, SpeedSp=1500.0, RefSpeed=6000.0)
    assert rig.rpm == pytest.approx(750.0, abs=2.0)
    rig.set(1.0, RefSpeed=0.0)
    assert rig.rpm == pytest.approx(0.0, abs=2.0)


def test_the_inversion_of_config_axis_turns_the_direction_round_while_it_runs(rig):
    rig.set(1.0, SpeedSp=600.0)
    rig.set(1.0, ConfigAxis=0x007F)
    assert rig.rpm == pytest.approx(-600.0, abs=2.0)
    assert rig.block.ActVelocity == pytest.approx(-600.0, abs=2.0)


@pytest.mark.parametrize("bit", [3, 5], ids=["ramp generator", "set point"])
def test_without_a_ramp_bit_of_config_axis_the_axis_stands_in_operation(rig, bit):
    rig.set(1.0, SpeedSp=600.0)
    rig.set(1.0, ConfigAxis=0x003F & ~(1 << bit))
    assert rig.rpm == pytest.approx(0.0, abs=2.0)
    assert rig.block.AxisEnabled


def test_without_enable_operation_the_axis_coasts_and_is_not_enabled(rig):
    rig.set(1.0, SpeedSp=600.0)
    rig.set(0.1, ConfigAxis=0x003F & ~0x0004)
    assert (rig.block.AxisEnabled, rig.block.Status) == (False, 0x7002)
    rig.set(0.5, ConfigAxis=0x003F)
    assert rig.block.AxisEnabled


@pytest.mark.parametrize("bit", [0, 1], ids=["OFF2", "OFF3"])
def test_off2_and_off3_end_in_the_inhibit_which_is_8402(rig, bit):
    rig.set(1.0, SpeedSp=600.0)
    rig.set(1.0, ConfigAxis=0x003F & ~(1 << bit))
    assert (rig.block.Lockout, rig.block.Error, rig.block.Status) == (True, True, 0x8402)
    rig.set(ConfigAxis=0x003F)
    assert rig.block.Lockout, "the enable has to go first"
    rig.set(EnableAxis=False)
    enable(rig)


def test_a_fault_is_8401_until_an_edge_acknowledges_it(rig):
    rig.set(1.0, SpeedSp=600.0)
    rig.inject("drive-fault", fault="16")
    assert rig.wait(lambda: rig.block.Status == 0x8401)
    assert (rig.block.Error, rig.block.DiagId) == (True, 0)
    rig.clear()
    rig.set(EnableAxis=False)
    rig.set(AckError=True)
    assert rig.block.Status == 0x7002
    rig.set(AckError=False)
    enable(rig)


def test_a_lost_connection_is_8600_with_the_reason_in_diag_id(rig):
    rig.inject("link-down")
    assert rig.wait(lambda: rig.block.Status == 0x8600)
    assert (rig.block.Error, rig.block.DiagId, rig.block.ActVelocity) == (True, 0x80A0, 0.0)


def test_the_farm_files_program_turns_to_and_fro_and_comes_back_behind_a_fault():
    with BlockRig("sina_speed.py", telegram=1) as rig:
        assert rig.wait(lambda: abs(rig.rpm - 600.0) < 2.0)
        assert rig.wait(lambda: abs(rig.rpm + 600.0) < 2.0)
        fields = {"kind": "drive-fault", "on": "axis", "params": {"fault": "16"}, "count": 1}
        rig.line.farm.injections.inject(fields, rig.world.now)
        assert rig.wait(lambda: rig.block.Error)
        assert rig.wait(lambda: rig.block.AxisEnabled)
