"""Axis programs of the built-in scanner and drives of the farm, over the wire in virtual time."""

from __future__ import annotations

import pytest
from scanner_line import ScannerLine

from pnfarm.table import program

FAULT = {"kind": "drive-fault", "on": "axis-1", "params": {"fault": "encoder-error"}}


def speed(line: ScannerLine, name: str = "axis-1") -> float:
    return float(line.station(name).handle.axis.motor.velocity)


@pytest.mark.parametrize("kind", ["ramp", "sine"])
def test_a_speed_that_changes_is_followed_both_ways(kind):
    line = ScannerLine(program=f"{{kind: {kind}, speed_rpm: 300, period: 2s}}")
    line.enable()
    line.run(1.0)
    seen = []
    for _ in range(20):
        line.run(0.1)
        seen.append(speed(line))
    assert max(seen) == pytest.approx(300.0, abs=60.0)
    assert min(seen) == pytest.approx(-300.0, abs=60.0)
    assert line.row()["refused_commands"] == 0


def test_positions_are_reached_in_turn_after_homing():
    line = ScannerLine(program="{kind: positions, speed_rpm: 600, targets: [0, 2, 5], dwell: 50ms}")
    line.enable()
    line.run(5.0)
    row = line.row()
    assert row["moves"] >= 6
    assert (row["refused_commands"], row["faults"]) == (0, 0)
    axis = line.station().handle.axis
    assert line.world.run(3.0, until=lambda: int(line.plc.columns.program[0].leg) == program.LEG_DWELLING)
    place = float(axis.profile.position) - float(axis.homing.origin)
    assert min(abs(place - target) for target in (0.0, 2.0, 5.0)) < 0.01


def test_an_idle_program_exchanges_data_and_leaves_the_drive_disabled():
    line = ScannerLine(program="{kind: idle}")
    line.connect()
    line.run(0.5)
    assert line.row()["phase"] == "stopped"
    assert line.plc.all_running, "there is no axis to be enabled"
    assert not line.row()["zsw1"] & 0x80


def test_units_and_ramps_are_the_drive_s_own_parameters():
    line = ScannerLine(group=", params: {EIP.PROFUNIT: 1048576, EIP.POSUNIT: 1048576, DRV.ACC: 1000000}")
    line.enable()
    line.run(1.0)
    assert speed(line) == pytest.approx(60.0, abs=2.0)
    row = line.plc.columns.program[0]
    usual = ScannerLine(start=False).plc.columns.program[0]
    assert float(row.velocity_step) == pytest.approx(16 * float(usual.velocity_step))
    assert float(row.target_step) == pytest.approx(16 * float(usual.target_step))
    assert float(row.speed_up) != pytest.approx(float(usual.speed_up))


def test_a_fault_is_cleared_after_the_user_s_time_and_the_axis_runs_again():
    line = ScannerLine()
    line.enable()
    line.run(0.5)
    line.farm.injections.inject(
        {"kind": "drive-fault", "on": "axis-1", "params": {"fault": "encoder-error"}}, line.world.now
    )
    line.run(0.1)
    assert line.row()["phase"] == "faulted"
    line.farm.injections.clear(None, line.world.now)
    line.enable(within=3.0)
    line.run(1.0)
    row = line.row()
    assert row["faults"] == 1
    assert row["recovery_seconds"] > 0.2
    assert speed(line) == pytest.approx(60.0, abs=1.0)
    assert "axis faulted" in line.texts()
    assert "axis acknowledging" in line.texts()


def test_a_fault_stays_where_nobody_acknowledges_it():
    line = ScannerLine(program="{kind: constant, speed_rpm: 60}")
    line.enable()
    line.farm.injections.inject(
        {"kind": "drive-fault", "on": "axis-1", "params": {"fault": "encoder-error"}}, line.world.now
    )
    line.run(3.0)
    assert line.row()["phase"] == "faulted"
    assert not line.plc.all_running


def test_an_axis_that_could_not_be_homed_is_homed_when_it_can():
    program = "{kind: positions, speed_rpm: 600, targets: [0, 2], dwell: 50ms}"
    line = ScannerLine(program=program, group=", params: {HOME.MODE: 7}")
    for side in ("positive", "negative"):
        line.farm.injections.inject({"kind": "limit-switch", "on": "all", "params": {"side": side}}, line.world.now)
    line.enable()
    line.run(3.0)
    assert not line.station().handle.axis.homing.homed
    line.farm.injections.clear(None, line.world.now)
    assert line.world.run(20.0, until=lambda: line.row()["moves"] >= 2)
