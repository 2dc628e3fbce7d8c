"""A PLC program for the HIWIN E1 in speed mode, telegram 3, bit by bit (manual 3.3.1, 3.5.1, 3.6.1, 6.1 to 6.5)."""

from __future__ import annotations

import pytest
from hand_plc import HandPlc

FULL = 0x40000000
RUN = 0x040F
SPEED_OK, REACHED = 0x0100, 0x0400


@pytest.fixture
def plc() -> HandPlc:
    return HandPlc("hiwin-e1", 3)


def rpm(plc: HandPlc) -> float:
    return plc["NIST_B"] / FULL * 3000.0


def running(plc: HandPlc, speed: float) -> None:
    plc.switch_on(operation=RUN)
    plc.put(NSOLL_B=round(speed / 3000.0 * FULL))
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED) and abs(rpm(plc) - speed) < 10.0)
    plc.wait(30)


def test_table_3_5_1_1_the_status_word_of_each_step_of_the_start_up(plc):
    """Inhibited, ready to switch on, ready to operate, operation; speed error and speed are in order at rest."""
    found = [plc["ZSW1"]] + [plc.put(STW1=word) for word in (0x0400, 0x0406, 0x0407, RUN)]
    assert found == [0x0740, 0x0740, 0x0731, 0x0733, 0x0737]
    assert plc["ZSW2"] & 0x0FFF == 0, "table 3.6.1.1: nothing but the sign of life"


def test_table_3_3_1_1_stop_bits_are_shown_one_by_one_at_standstill(plc):
    assert plc.put(STW1=0x0402) & 0x0030 == 0x0010, "no coast stop, quick stop"
    assert plc.put(STW1=0x0404) & 0x0030 == 0x0020, "coast stop, no quick stop"
    assert plc.put(STW1=0x0406) & 0x0071 == 0x0031


def test_switching_on_needs_bit_0_withdrawn_first(plc):
    assert plc.put(STW1=0x0407) & 0x0041 == 0x0040
    assert plc.put(STW1=RUN) & 0x0041 == 0x0040
    plc.switch_on(operation=RUN)


def test_3_3_1_reserved_bits_do_nothing(plc):
    """Bits 4 to 6, 8, 9 and 11 to 15 of STW1 and 0 to 11 of STW2."""
    running(plc, 600.0)
    for bit in (4, 5, 6, 8, 9, 11, 12, 13, 14, 15):
        assert plc.put(STW1=RUN | 1 << bit, wait=20) == 0x0737
        assert rpm(plc) == pytest.approx(600.0, abs=1.0)
    assert plc["ZSW1"] & 0xF800 == 0
    plc.stw2 = 0x0FFF
    plc.wait(50)
    assert plc["ZSW1"] == 0x0737
    assert plc["ZSW2"] & 0x0FFF == 0
    assert plc.axis.life.errors == 0


def test_6_1_the_set_point_is_a_share_of_the_reference_value_in_both_directions(plc):
    running(plc, 1500.0)
    assert plc.axis.motor.velocity == pytest.approx(1500.0, abs=1.0)
    plc.put(NSOLL_B=-FULL // 4, wait=300)
    assert plc.axis.motor.velocity == pytest.approx(-750.0, abs=1.0)
    assert rpm(plc) == pytest.approx(-750.0, abs=1.0)


def test_3_5_1_speed_error_and_speed_reached_fall_on_a_step_and_come_back(plc):
    running(plc, 600.0)
    plc.put(NSOLL_B=FULL // 2, wait=3)
    assert plc["ZSW1"] & (SPEED_OK | REACHED) == 0
    assert plc.wait_for(lambda: plc["ZSW1"] & (SPEED_OK | REACHED) == SPEED_OK | REACHED) > 2
    assert rpm(plc) == pytest.approx(1500.0, abs=10.0)


def test_off_brakes_and_ends_ready_to_switch_on(plc):
    plc.store.set("Pt30A", 1000)
    running(plc, 1500.0)
    assert plc.put(STW1=0x040E) & 0x0007 == 0x0003, "the pulses stay while it brakes"
    plc.wait(250)
    assert rpm(plc) == pytest.approx(750.0, abs=30.0)
    plc.wait_for(lambda: plc["ZSW1"] & 0x0043 == 0x0001)
    assert abs(rpm(plc)) < 5.0


def test_off_that_is_taken_back_while_braking_runs_on(plc):
    plc.store.set("Pt30A", 1000)
    running(plc, 1500.0)
    plc.put(STW1=0x040E, wait=100)
    assert plc.put(STW1=RUN, wait=200) & 0x0007 == 0x0007
    assert rpm(plc) == pytest.approx(1500.0, abs=10.0)


@pytest.mark.parametrize(("milliseconds", "after"), [(0, 0.0), (500, 900.0), (2000, 1350.0)])
def test_6_4_the_quick_stop_takes_the_time_of_pt30a_and_ends_inhibited(plc, milliseconds, after):
    """From the velocity reference value (assumed) to rest; 0 is at once, within the motor's torque."""
    plc.store.set("Pt30A", milliseconds)
    running(plc, 1500.0)
    plc.put(STW1=0x040B, wait=104)
    assert rpm(plc) == pytest.approx(after, abs=60.0)
    assert plc["ZSW1"] & 0x0020 == 0
    plc.wait_for(lambda: plc["ZSW1"] & 0x0047 == 0x0040)
    assert plc.put(STW1=RUN) & 0x0040, "inhibited until bit 0 was withdrawn"


def test_6_1_the_stop_time_follows_the_reference_value(plc):
    plc.store.set("Pt30A", 1000)
    assert plc.axis.ramp.settings.quick_stop_deceleration == pytest.approx(3000.0)
    plc.store.set("Pt317", 1500)
    assert plc.axis.ramp.settings.quick_stop_deceleration == pytest.approx(1500.0)


@pytest.mark.parametrize(("method", "fast"), [(0, True), (1, True), (2, False)])
def test_6_5_the_coast_stop_brakes_or_runs_free_by_pt001(method, fast):
    """t.xxx0 and t.xxx1 stop by the dynamic brake, t.xxx2 by friction alone."""
    plc = HandPlc("hiwin-e1", 3, params=f"{{Pt001: {method}}}")
    running(plc, 1500.0)
    assert plc.put(STW1=0x040D) & 0x0057 == 0x0040, "inhibited at once, the coast stop is shown"
    assert (plc.wait_for(lambda: abs(rpm(plc)) < 1.0, 3000) < 250) == fast


@pytest.mark.parametrize(("method", "held"), [(0, True), (1, False), (2, False)])
def test_6_5_after_the_stop_the_brake_stays_applied_or_is_released(method, held):
    """A torque on the shaft turns it against the brake slowly, and freely without."""
    plc = HandPlc("hiwin-e1", 3, params=f"{{Pt001: {method}}}")
    plc.axis.load.settings.torque = 0.06
    plc.wait(1000)
    assert (abs(rpm(plc)) < 12.0) == held


def test_disable_operation_takes_the_pulses_off_and_enable_catches_the_running_motor(plc):
    plc.store.set("Pt001", 2)
    plc.axis.motor.settings.coast_method = 2
    running(plc, 1500.0)
    assert plc.put(STW1=0x0407, wait=50) & 0x0007 == 0x0003
    assert rpm(plc) > 1000.0
    assert plc.put(STW1=RUN, wait=200) & 0x0007 == 0x0007
    assert rpm(plc) == pytest.approx(1500.0, abs=10.0)


def test_3_3_1_without_control_by_the_plc_the_last_words_stay(plc):
    running(plc, 600.0)
    assert plc.put(STW1=0x000B, NSOLL_B=FULL, wait=100) & 0x0237 == 0x0237
    assert rpm(plc) == pytest.approx(600.0, abs=1.0)
    plc.put(STW1=0x0000, wait=100)
    assert rpm(plc) == pytest.approx(600.0, abs=1.0)


def test_3_3_1_a_fault_is_acknowledged_by_the_rising_edge_of_bit_7_only(plc):
    running(plc, 600.0)
    plc.inject("drive-fault", fault=15)
    plc.wait(4)
    assert plc["ZSW1"] & 0x004F == 0x0048
    plc.put(STW1=0x0406)
    assert plc.put(STW1=0x0486) & 0x0008 == 0
    plc.inject("drive-fault", fault=15)
    plc.wait(4)
    assert plc.put(STW1=0x0486) & 0x0008, "a level is no edge"
    plc.put(STW1=0x0406)
    assert plc.put(STW1=0x0486) & 0x0008 == 0
    plc.switch_on(operation=RUN)


def test_5_1_a_fault_whose_cause_stays_cannot_be_acknowledged(plc):
    running(plc, 600.0)
    plc.inject("drive-fault", fault="AL.410 Undervoltage", hold=True)
    plc.wait(4)
    plc.put(STW1=0x0406)
    assert plc.put(STW1=0x0486) & 0x0008
    plc.clear()
    plc.put(STW1=0x0406)
    assert plc.put(STW1=0x0486) & 0x0008 == 0


@pytest.mark.parametrize(("speed", "limit"), [(3000.0, "Pt402"), (-3000.0, "Pt403")])
def test_6_3_the_torque_limit_of_each_direction_acts_at_once(plc, speed, limit):
    """50 % of the rated torque, 1.27 N m, on the inertia of motor and load: at once, and only forwards or backwards."""
    plc.axis.load.settings.inertia = 0.01
    plc.switch_on(operation=RUN)
    plc.store.set(limit, 50)
    plc.put(NSOLL_B=round(speed / 3000.0 * FULL), wait=103)
    assert abs(float(plc.axis.motor.torque)) == pytest.approx(0.635)
    assert abs(rpm(plc)) == pytest.approx((0.635 - 0.05) / 0.01 * 0.1 * 9.549, rel=0.06)
    plc.put(NSOLL_B=0, wait=8)
    assert abs(float(plc.axis.motor.torque)) > 3.0, "the other direction has its own limit"


@pytest.mark.parametrize("word", ["Pt402", "Pt403"])
def test_6_3_the_range_of_a_torque_limit(plc, word):
    for value, good in ((0, True), (800, True)):
        plc.store.set(word, value)
        assert (plc.store.get(word) == value) == good
    assert plc.axis.torque.settings.limit_positive == pytest.approx(8 * 1.27)


def test_encoder_words_count_with_the_shaft(plc):
    running(plc, 60.0)
    before = plc["G1_XIST1"]
    plc.wait(500)
    assert plc["G1_XIST1"] - before == pytest.approx(2**23 / 2, rel=0.01)


def test_6_7_and_6_8_homing_and_jogging_are_not_in_telegram_3(plc):
    plc.switch_on(operation=RUN)
    plc.put(STW1=RUN | 0x0900, wait=200)
    assert rpm(plc) == 0.0
    assert plc.axis.positioning.state == 0
    assert not plc.axis.homing.homed
