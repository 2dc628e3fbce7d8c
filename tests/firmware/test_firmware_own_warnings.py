"""The I2t warning that the drive shows by itself (HIWIN E1 manual 3.16)."""

from __future__ import annotations

import pytest
from bench_axis import BenchAxis

from pnfarm.table.axis_codes import CMD_CLEAR_WARNING, CMD_RAISE_WARNING, WARNING_SLOTS
from pnfarm.table.signals import MELDW, WARN_CODE

OVERLOAD, I2T = 0x910, 0x911


@pytest.fixture
def drive() -> BenchAxis:
    bench = BenchAxis()
    bench.axis.warnings.settings.thermal[:] = (OVERLOAD, I2T)
    bench.axis.warnings.settings.thermal_level = 0.8
    return bench


def shown(drive: BenchAxis, heat: float) -> int:
    drive.axis.motor.thermal_load = heat
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


def test_3_16_both_bits_of_meldw_show_their_warnings_while_both_are_active(drive):
    drive.command(CMD_RAISE_WARNING, OVERLOAD)
    assert shown(drive, 0.9) == OVERLOAD
    assert not drive.image.sent[MELDW] & 0x00C0
    drive.command(CMD_CLEAR_WARNING, OVERLOAD)
    assert shown(drive, 0.9) == I2T
    assert drive.image.sent[MELDW] & 0x00C0 == 0x0040
    assert shown(drive, 0.5) == 0
    assert drive.image.sent[MELDW] & 0x00C0 == 0x00C0


def test_of_more_warnings_than_there_is_room_for_the_oldest_goes(drive):
    for number in range(1, WARNING_SLOTS + 3):
        drive.command(CMD_RAISE_WARNING, number)
    assert shown(drive, 0.9) == WARNING_SLOTS + 2
    assert list(drive.axis.warnings.active) == list(range(WARNING_SLOTS + 2, 2, -1))
    drive.command(CMD_RAISE_WARNING, 5)
    drive.command(CMD_CLEAR_WARNING, WARNING_SLOTS + 2)
    assert shown(drive, 0.9) == 5
    assert list(drive.axis.warnings.active) == [5, *(n for n in range(WARNING_SLOTS + 1, 2, -1) if n != 5), I2T]


@pytest.mark.parametrize(("threshold", "number"), [(0.0, I2T), (0.8, 0)])
def test_a_drive_without_threshold_or_without_such_a_warning_shows_none(drive, threshold, number):
    drive.axis.warnings.settings.thermal_level, drive.axis.warnings.settings.thermal[1] = threshold, number
    assert shown(drive, 0.95) == 0
