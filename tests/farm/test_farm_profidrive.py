"""A PLC program for the drive that is the PROFIdrive profile alone, telegram by telegram."""

from __future__ import annotations

import pytest
from hand_plc import HandPlc
from profidrive_plc import ACKNOWLEDGED, FULL, MOVE, REACHED, RUN, TASK, running
from virtual_line import VirtualLine

from pnfarm.drives.catalogue import model
from pnfarm.table.signals import ACTUAL_SLOTS

PROFILE = model("profidrive").profidrive


def test_a_drive_walks_through_the_states_of_the_profile():
    plc = HandPlc("profidrive", 1)
    found = [plc["ZSW1"]] + [plc.put(STW1=word) for word in (0x0470, 0x0476, 0x0477, RUN)]
    assert [word & 0x004F for word in found] == [0x0040, 0x0040, 0x0001, 0x0003, 0x0007]


@pytest.mark.parametrize(("signal", "full"), [("NSOLL_A", FULL), ("NSOLL_B", FULL << 16)])
def test_a_speed_is_a_share_of_the_reference_speed_of_pnu_2000(signal: str, full: int):
    plc = running(1 if signal == "NSOLL_A" else 2, **{signal: full // 2})
    assert plc.axis.motor.velocity == pytest.approx(1500.0, abs=2.0)
    plc.store.set("p2000", 0x44BB8000)  # 1500.0
    plc.wait(300)
    assert plc.axis.motor.velocity == pytest.approx(750.0, abs=2.0)


def test_the_ramp_is_the_drives_in_application_class_1_and_the_controllers_in_class_4():
    class_1, class_4 = running(2), running(3)
    for plc in (class_1, class_4):
        plc.put(NSOLL_B=FULL << 16, wait=20)
    assert class_1.axis.motor.velocity < 900.0 < class_4.axis.motor.velocity
    assert [plc.store.read(930)[0] for plc in (class_1, class_4)] == [1, 3]


def test_dynamic_servo_control_turns_the_axis_by_the_position_error_of_the_controller():
    plc = running(5)
    plc.put(XERR=0, KPC=100_000, wait=20)
    begun = plc["G1_XIST1"]
    for _ in range(400):
        plc.put(XERR=begun + 1_000_000 - plc["G1_XIST1"], wait=1)
    assert plc["G1_XIST1"] - begun == pytest.approx(1_000_000, abs=5_000)


@pytest.mark.parametrize("telegram", [9, 111])
def test_a_task_of_mdi_brings_the_axis_to_its_target_in_length_units(telegram: int):
    plc = HandPlc("profidrive", telegram)
    plc.put(MDI_TARPOS=50_000, MDI_VELOCITY=20_000, MDI_ACC=FULL, MDI_DEC=FULL, MDI_MOD=1, SATZANW=0x8000)
    plc.put(POS_STW1=0x8100, OVERRIDE=FULL)
    plc.switch_on(operation=TASK)
    plc.put(STW1=MOVE)
    plc.wait_for(lambda: bool(plc["ZSW1"] & ACKNOWLEDGED))
    plc.put(STW1=TASK)
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    assert plc["XIST_A"] == pytest.approx(50_000, abs=20)
    assert plc.axis.motor.position - plc.axis.homing.origin == pytest.approx(5.0, abs=0.002)


def test_telegram_7_runs_a_traversing_block_of_the_farm_file():
    plc = HandPlc(
        "profidrive", 7,
        tasks="[{number: 3, position: 2.0, velocity: 600, acceleration: 6000, deceleration: 6000}]",
    )  # fmt: skip
    plc.put(SATZANW=3)
    plc.switch_on(operation=TASK)
    plc.put(STW1=MOVE)
    plc.wait_for(lambda: plc["AKTSATZ"] == 3)
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    assert plc.axis.motor.position - plc.axis.homing.origin == pytest.approx(2.0, abs=0.002)


@pytest.mark.parametrize("telegram", sorted(PROFILE.telegrams))
def test_every_telegram_connects_and_sends_as_many_octets_as_its_words(telegram: int):
    line = VirtualLine(model="profidrive", telegram=telegram)
    line.connect()
    line.run(0.2)
    words = PROFILE.telegrams[telegram]
    submodule = next(s for s in words.module.submodules if s.subslot == 2)
    assert (submodule.output_bytes, submodule.input_bytes) == (2 * len(words.output), 2 * len(words.input))
    assert line.plc.columns.image[0].valid
    if "ZSW1" in {signal.name for signal in words.input if signal}:
        assert line.plc.columns.image[0].received[ACTUAL_SLOTS["ZSW1"]] & 0x0200, "the drive asks for control"


def test_every_word_has_its_source_and_one_of_a_single_source_says_so():
    for telegram in PROFILE.telegrams.values():
        assert ";" in telegram.source or telegram.source == "assumed", telegram.number
        assert telegram.source != "assumed" or telegram.note, telegram.number
    for signal in PROFILE.signals.values():
        assert ";" in signal.source or (signal.source == "assumed" and signal.note), signal.name
