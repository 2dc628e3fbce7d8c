"""The I2t warning that the drive shows by itself (HIWIN E1 manual 3.16)."""

from __future__ import annotations

import pytest
from bench_axis import BenchAxis

from pnfarm.table.axis import CMD_CLEAR_WARNING, CMD_RAISE_WARNING
from pnfarm.table.signals import WARN_CODE

OVERLOAD, I2T = 0x910, 0x911


@pytest.fixture
def drive() -> BenchAxis:
    bench = BenchAxis()
    bench.axis.message_warnings[:] = (OVERLOAD, I2T)
    bench.axis.thermal_warning = 0.8
    return bench


def shown(drive: BenchAxis, heat: float) -> int:
    drive.axis.thermal_load = heat
    drive.run(1)
    return int(drive.image.sent[WARN_CODE])


def test_it_shows_above_its_threshold_and_goes_below(drive):
    assert [shown(drive, heat) for heat in (0.5, 0.79, 0.81, 0.9, 0.79, 0.85)] == [0, 0, I2T, I2T, 0, I2T]


def test_a_warning_by_command_stays_in_front_and_is_not_cleared_by_cooling(drive):
    assert shown(drive, 0.9) == I2T
    drive.command(CMD_RAISE_WARNING, OVERLOAD)
    assert [shown(drive, heat) for heat in (0.9, 0.5, 0.9)] == [OVERLOAD] * 3
    drive.command(CMD_CLEAR_WARNING, OVERLOAD)
    assert [shown(drive, heat) for heat in (0.9, 0.5)] == [I2T, 0]


@pytest.mark.parametrize(("threshold", "number"), [(0.0, I2T), (0.8, 0)])
def test_a_drive_without_threshold_or_without_such_a_warning_shows_none(drive, threshold, number):
    drive.axis.thermal_warning, drive.axis.message_warnings[1] = threshold, number
    assert shown(drive, 0.95) == 0
