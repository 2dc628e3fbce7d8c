"""What the words of further telegrams do: smoothed values, messages, torque, encoders, the parameter channel."""

from __future__ import annotations

import pytest
from hand_plc import HandPlc
from profidrive_plc import ACKNOWLEDGED, FULL, MOVE, REACHED, TASK, running

from pnfarm.table.signals import ACTUAL_SLOTS, SETPOINT_SLOTS

CONTROL, ABSOLUTE, PARK = 0x0400, 0x2000, 0x4000
FAULT = 0x0008


def signed(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word


@pytest.mark.parametrize("telegram", [20, 352, 354])
def test_process_control_sees_smoothed_values_in_shares_of_their_references(telegram: int):
    plc = running(telegram, NSOLL_A=FULL // 2)
    plc.axis.load.settings.torque = 2.0
    plc.wait(1500)
    torque = float(plc.axis.motor.torque)
    assert torque == pytest.approx(2.1, abs=0.1)
    assert plc["NIST_A_GLATT"] == pytest.approx(FULL // 2, abs=8)
    assert plc["MIST_GLATT"] == pytest.approx(torque / 4.5 * FULL, abs=30)
    assert plc["IAIST_GLATT"] == pytest.approx(torque / 0.5 / 9.0 * FULL, abs=30)
    if telegram == 20:
        assert plc["PIST_GLATT"] == pytest.approx(torque / 4.5 * FULL / 2, abs=30), "half the speed"


def test_a_smoothed_speed_comes_later_than_the_speed():
    plc = running(20)
    plc.put(NSOLL_A=FULL // 2, wait=100)
    assert signed(plc["NIST_A_GLATT"]) < 0.7 * FULL / 2
    plc.wait(1000)
    assert plc["NIST_A_GLATT"] == pytest.approx(FULL // 2, abs=8)


@pytest.mark.parametrize(("fault", "word"), [(4, 0x0005), (9, 0x0081), (16, 0x8001)])
def test_meld_namur_names_the_kind_of_a_fault(fault: int, word: int):
    plc = running(20)
    assert plc["MELD_NAMUR"] == 0
    plc.inject("drive-fault", fault=fault)
    plc.wait(20)
    assert plc["MELD_NAMUR"] == word


def test_meldw_reports_ramp_speed_thresholds_and_pulses():
    plc = HandPlc("profidrive", 102)
    assert plc["MELDW"] == 0x01CF | 0x0000, "at rest, switching on inhibited"
    plc = running(102)
    assert plc["MELDW"] == 0x39CF
    plc.put(NSOLL_B=FULL << 14, wait=300)  # 750 rpm
    assert plc["MELDW"] == 0x39CB
    plc.put(NSOLL_B=FULL << 15, wait=300)  # 1500 rpm
    assert plc["MELDW"] == 0x39C3


def test_momred_takes_torque_away():
    plc = running(102, MOMRED=FULL)
    plc.put(NSOLL_B=FULL << 15, wait=200)
    assert abs(plc.axis.motor.velocity) < 1.0, "no torque is left"
    plc.put(MOMRED=FULL - FULL // 10, wait=20)
    assert float(plc.axis.motor.torque) == pytest.approx(0.45, abs=0.01), "a tenth of the peak"
    assert not plc["MELDW"] & 0x0002
    plc.put(MOMRED=0, wait=300)
    assert plc.axis.motor.velocity == pytest.approx(1500.0, abs=2.0)


@pytest.mark.parametrize("telegram", [81, 82, 83])
def test_an_encoders_telegram_has_the_position_and_no_state_machine(telegram: int):
    plc = HandPlc("profidrive", telegram)
    plc.stw2 = CONTROL
    plc.put(G1_STW=ABSOLUTE, wait=20)
    assert plc["ZSW2_ENC"] & 0x0288 == 0x0200, "control requested"
    assert plc["ZSW2_ENC"] >> 12, "sign of life"
    assert (plc["G1_ZSW"], plc["G1_XIST2"]) == (ABSOLUTE, plc["G1_XIST1"])
    assert plc.axis.drive.state == 1
    plc.inject("drive-fault", fault=12)
    plc.wait(20)
    assert plc["ZSW2_ENC"] & FAULT
    plc.clear()
    plc.stw2 = CONTROL | 0x0080
    plc.wait(20)
    assert not plc["ZSW2_ENC"] & FAULT, "STW2_ENC.7 acknowledges"
    plc.stw2 = 0
    plc.put(G1_STW=0, wait=20)
    assert plc["G1_ZSW"] == ABSOLUTE, "without control by the PLC the last word stays"


def test_the_words_of_encoder_2_are_its_own():
    plc = HandPlc("profidrive", 4)
    plc.put(G2_STW=PARK, G1_STW=ABSOLUTE, wait=20)
    assert (plc["G1_ZSW"], plc["G2_ZSW"]) == (ABSOLUTE, PARK)
    plc.put(G2_STW=ABSOLUTE, wait=20)
    assert plc["G2_ZSW"] == ABSOLUTE
    plc.put(STW1=0x0476, NSOLL_B=FULL << 13)
    plc.switch_on(operation=0x047F)
    plc.wait(300)
    first, second = (int(plc.image.received[ACTUAL_SLOTS[name]]) for name in ("G1_XIST1", "G2_XIST1"))
    assert first == second != 0
    plc.put(G2_STW=ABSOLUTE | 0x0011, wait=200)
    assert (plc["G1_ZSW"], plc["G2_ZSW"] & 0x10) == (ABSOLUTE, 0x10), "encoder 2 alone found its mark"


def test_telegram_110_has_an_override_and_sets_the_reference_point():
    plc = HandPlc("profidrive", 110)
    plc.put(MDI_TARPOS=100_000, MDI_VELOCITY=20_000, MDI_ACC=FULL, MDI_DEC=FULL, MDI_MOD=1, SATZANW=0x8000)
    plc.put(OVERRIDE=FULL // 2)
    plc.switch_on(operation=TASK)
    plc.put(STW1=MOVE)
    plc.wait_for(lambda: bool(plc["ZSW1"] & ACKNOWLEDGED))
    plc.wait(300)
    assert plc.axis.motor.velocity == pytest.approx(1000.0, abs=5.0)
    plc.put(STW1=TASK)
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    plc.put(POS_STW=0x0002, wait=20)
    assert abs(plc["XIST_A"]) <= 10


def test_telegram_353_reads_and_writes_parameters_in_its_first_words():
    plc = HandPlc("profidrive", 353)
    head, value = SETPOINT_SLOTS["PKW_HEAD"], SETPOINT_SLOTS["PKW_VALUE"]
    plc.image.sent[head] = (0x1000 | 2000) << 16
    plc.wait(50)
    assert (plc.image.received[head] >> 16 & 0xFFFF, plc.image.received[value]) == (0x2000 | 2000, 0x453B8000)
    plc.image.sent[head], plc.image.sent[value] = 0x3000 << 16 | 2000 << 16, 0x44BB8000
    plc.wait(50)
    assert plc.store.read(2000)[0] == 0x44BB8000
    assert plc["ZSW1"] & 0x0040, "the drive's own words follow"


def test_the_message_of_a_fault_is_behind_that_of_a_warning_in_telegram_352():
    plc = running(352)
    plc.inject("drive-warning", warning=48)
    plc.wait(20)
    assert (plc["WARN_CODE"], plc["FAULT_CODE"]) == (48, 0)
    plc.inject("drive-fault", fault=28)
    plc.wait(20)
    assert (plc["WARN_CODE"], plc["FAULT_CODE"]) == (48, 28)
