"""The AKD of manual edition M: foldback, DC link and direction by parameters, status word and telegram (5.6, 5.8)."""

from __future__ import annotations

import pytest
from drives_kit import Running

from pnfarm.drives.parameters.parameter import ParameterError, ParameterErrorNumber
from pnfarm.table.signals import ITIST_GLATT

NAME = "akd-profinet"
WARNING, FAULT = 0x0080, 0x0008


def enable(drive: Running, nsoll_a: int = 0) -> None:
    for stw1 in (0x0470, 0x0476, 0x0477, 0x047F):
        drive.send(stw1, nsoll_a)
    drive.send(0x047F, nsoll_a)


def stuck(drive: Running) -> None:
    """In operation against a shaft that is held: all the current that the drive may give."""
    drive.axis.load.settings.added_friction = 1000.0
    enable(drive, 0x1000)
    drive.send(0x047F, 0x1000, 500)


def test_5_6_foldback_reads_the_times_the_ratings_and_the_limits_of_motor_and_drive(running: Running) -> None:
    get = running.drive.store.get
    running.run(1)
    assert (get("DRV.ICONT"), get("DRV.IPEAK"), get("MOTOR.ICONT")) == (3000, 9000, 3000)
    assert (get("IL.MFOLDD"), get("IL.MFOLDT"), get("IL.MFOLDR")) == (10_000, 10_000, 40_000)
    # 9 A for 10 s and for 5 s, by the time constants of 10 s and 2.5 s
    assert (get("IL.MIFOLD"), get("IL.DIFOLD"), get("IL.IFOLD")) == (15_000, 21_000, 15_000)


def test_5_6_a_drive_that_gives_its_peak_current_for_too_long_has_the_fault_of_its_foldback(running: Running) -> None:
    store = running.drive.store
    stuck(running)
    assert store.get("IL.FB") == pytest.approx(9000, abs=10)
    before = store.get("IL.MIFOLD"), store.get("IL.DIFOLD")
    running.send(0x047F, 0x1000, 1000)
    # 6 A above the continuous current
    assert before[0] - store.get("IL.MIFOLD") == pytest.approx(600, abs=10)
    assert before[1] - store.get("IL.DIFOLD") == pytest.approx(2400, abs=20)
    assert not running.send(0x047F, 0x1000, 3000) & FAULT
    assert running.send(0x047F, 0x1000, 800) & FAULT
    assert store.get("DRV.FAULT1") == 524


def test_5_6_without_a_fault_level_the_current_folds_back_to_the_continuous_one(running: Running) -> None:
    store = running.drive.store
    store.set("IL.FOLDFTHRESHU", 0)
    assert store.get("IL.FOLDFTHRESH") == 0
    stuck(running)
    assert not running.send(0x047F, 0x1000, 30_000) & FAULT
    assert store.get("IL.FB") == store.get("IL.IFOLD") == pytest.approx(3000, abs=10)
    assert running.image.sent[ITIST_GLATT] == pytest.approx(0x4000 / 3, abs=20), "2^14 is DRV.IPEAK (5.12.4)"
    assert store.get("IL.MIFOLD") > store.get("IL.DIFOLD") == store.get("IL.IFOLD")


def test_5_6_il_foldfthresh_is_the_peak_current_at_most(running: Running) -> None:
    store = running.drive.store
    assert store.get("IL.FOLDFTHRESH") == 9000
    store.set("IL.FOLDFTHRESHU", 500_000)
    assert store.get("IL.FOLDFTHRESH") == 9000
    store.set("IL.FOLDFTHRESHU", 4000)
    assert store.get("IL.FOLDFTHRESH") == 4000


def test_5_6_il_foldwthresh_warns_by_zsw1_bit_7_and_drv_warning1(running: Running) -> None:
    store = running.drive.store
    store.set("IL.FOLDFTHRESHU", 2000)
    store.set("IL.FOLDWTHRESH", 8000)
    stuck(running)
    assert not running.send(0x047F, 0x1000, 3000) & WARNING
    assert running.send(0x047F, 0x1000, 3000) & (WARNING | FAULT) == WARNING
    assert store.get("IL.IFOLD") < 8000
    assert store.get("DRV.WARNING1") == 524
    assert not running.send(0x0470, 0, 5000) & WARNING, "it recovers without current"


def test_5_6_vbus_thresholds_warn_of_a_dc_link_that_is_too_low_or_too_high(running: Running) -> None:
    store = running.drive.store
    assert not running.send(0x0470) & WARNING
    store.set("VBUS.UVWTHRESH", 600)
    assert running.send(0x0470) & WARNING
    assert store.get("DRV.WARNING1") == 502
    store.set("VBUS.UVWTHRESH", 0)
    store.set("VBUS.OVWTHRESH", 600)
    assert not running.send(0x0470) & WARNING
    store.set("DRV.DEC", 500_000_000)
    running.axis.load.settings.added_inertia = 4e-3
    enable(running, 0x4000)
    running.send(0x047F, 0x4000, 3000)
    assert not running.send(0x047F, 0x4000) & WARNING
    assert running.send(0x047F, 0, 20) & WARNING
    assert store.get("VBUS.VALUE") > 600_000
    assert store.get("DRV.WARNING1") == 501


def test_5_6_vbus_uvmode_says_when_an_undervoltage_is_a_fault(running: Running) -> None:
    store = running.drive.store
    store.set("VBUS.UVFTHRESH", 600)
    assert not running.send(0x0470, milliseconds=50) & FAULT, "mode 1: not before the drive is enabled"
    enable(running)
    assert running.axis.drive.state < 4
    assert store.get("DRV.FAULT1") == 502
    store.set("VBUS.UVFTHRESH", 500)
    running.send(0x0470)
    assert not running.send(0x04F0, milliseconds=2) & FAULT
    store.set("VBUS.UVMODE", 0)
    assert not running.send(0x0470, milliseconds=50) & FAULT
    store.set("VBUS.UVFTHRESH", 600)
    assert running.send(0x0470) & FAULT, "mode 0: at any time"


def test_5_6_drv_dir_turns_the_axis_round_while_it_is_disabled(running: Running) -> None:
    store = running.drive.store
    running.axis.load.settings.torque = 0.5
    enable(running, 0x00A3)
    running.send(0x047F, 0x00A3, 1000)
    place, current = store.get("PL.FB"), store.get("IL.FB")
    assert min(place, current) > 0
    with pytest.raises(ParameterError) as caught:
        store.set("DRV.DIR", 1)
    assert caught.value.number == ParameterErrorNumber.OPERATING_STATE
    running.axis.load.settings.torque = 0.0
    running.send(0x0476, 0, 500)
    place = store.get("PL.FB")
    store.set("DRV.DIR", 1)
    running.send(0x0476)
    assert store.get("PL.FB") == pytest.approx(-place, abs=1)
    running.axis.load.settings.torque = 0.5
    enable(running, 0x00A3)
    running.send(0x047F, 0x00A3, 1000)
    assert running.axis.motor.velocity == pytest.approx(59.7, abs=0.5), "the set point keeps its sign"
    assert store.get("IL.FB") == pytest.approx(current - 2 * 1000, abs=20), "the load helps now"
