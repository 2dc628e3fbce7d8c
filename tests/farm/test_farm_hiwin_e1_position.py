"""A PLC program for the HIWIN E1 in position mode, telegrams 9 and 111, bit by bit (manual 3.3.2 to 3.16, 6)."""

import pytest
from e1_plc import (
    BOTH_TELEGRAMS,
    COUNTS,
    FOLLOWS,
    HOME,
    HOMED,
    JOG_BACKWARDS,
    JOG_FORWARDS,
    REACHED,
    RUN,
    START,
    STOPPED,
    TAKEN,
    WHOLE,
    E1Plc,
)
from hand_plc import HandPlc

# -- status and control word ----------------------------------------------------------------------------------------


@BOTH_TELEGRAMS
def test_table_3_5_2_1_the_status_word_of_each_step_of_the_start_up(telegram):
    """Following error in tolerance, control requested, motor stopped; no target, no home position, no task."""
    plc = HandPlc("hiwin-e1", telegram)
    found = [plc["ZSW1"]] + [plc.put(STW1=word) for word in (0x0406, 0x0407, 0x040F, RUN)]
    assert found == [0x2340, 0x2331, 0x2333, 0x2337, 0x2337]
    assert plc["ZSW2"] & 0x0FFF == 0x0800, "table 3.6.2.1: pulses enabled"
    plc.put(STW1=0x0407)
    assert plc["ZSW2"] & 0x0FFF == 0


@BOTH_TELEGRAMS
def test_3_3_2_reserved_bits_do_nothing(telegram):
    plc = E1Plc(telegram)
    for bit in (12, 13, 14, 15):
        assert plc.put(STW1=RUN | 1 << bit, wait=20) == 0x2337
    assert plc["ZSW1"] & 0xC000 == 0


@BOTH_TELEGRAMS
def test_without_control_by_the_plc_neither_task_nor_jog_nor_homing_begins(telegram):
    plc = E1Plc(telegram)
    plc.task(3.0)
    plc.put(STW1=(RUN | START | JOG_FORWARDS | HOME) & ~0x0400, wait=100)
    assert plc.bit(0x2337)
    assert plc.rpm == pytest.approx(0.0, abs=0.1)


def test_without_control_by_the_plc_a_running_task_keeps_its_data():
    plc = E1Plc(111)
    plc.task(10.0)
    assert plc.go()
    plc.wait(300)
    plc.put(STW1=0x0000, OVERRIDE=0, POS_STW1=0, POS_STW2=0x0002, MDI_TARPOS=0, wait=100)
    assert plc.rpm == pytest.approx(600.0, abs=1.0)
    assert plc["POS_ZSW1"] == 0x8000
    assert not plc.bit(HOMED)


# -- MDI (3.9 to 3.12, 6.6) ------------------------------------------------------------------------------------------


@BOTH_TELEGRAMS
def test_6_6_1_an_absolute_task_runs_with_its_units_and_shows_each_step(telegram):
    """Table of 6.6.1: 1 is one control unit; 1 is 1000 control units a minute; 0x4000 is 100 % of Pt534 and Pt537."""
    plc = E1Plc(telegram)
    plc.task(10.0)
    assert plc.put(STW1=RUN | START) & (TAKEN | REACHED) == TAKEN
    assert plc.put(STW1=RUN) & TAKEN == 0, "the acknowledgement falls with the bit"
    plc.wait(40)
    assert plc.axis.profile.velocity == pytest.approx(6000 * 0.047, abs=30), "600 rpm in the 100 ms of Pt534"
    plc.wait(300)
    assert plc.rpm == pytest.approx(600.0, abs=1.0)
    assert plc["ZSW1"] & (FOLLOWS | REACHED | STOPPED) == FOLLOWS
    took = 348 + plc.arrive()
    assert 1100 <= took < 1200, "the way at 600 rpm, one ramp more, and settling"
    plc.wait(50)
    assert plc.rev == pytest.approx(10.0, abs=0.001)


@BOTH_TELEGRAMS
def test_3_11_and_3_12_a_relative_task_counts_from_where_the_axis_is_to_be(telegram):
    plc = E1Plc(telegram)
    for target in (2.0, 4.0, 6.0):
        plc.task(2.0, relative=True)
        assert plc.go()
        plc.arrive()
        plc.wait(50)
        assert plc.rev == pytest.approx(target, abs=0.001)


@BOTH_TELEGRAMS
def test_a_negative_target_runs_backwards_and_a_new_edge_takes_a_new_target_in_the_run(telegram):
    plc = E1Plc(telegram)
    plc.task(-10.0)
    assert plc.go()
    plc.wait(300)
    assert plc.rpm == pytest.approx(-600.0, abs=1.0)
    plc.task(2.0, 300.0)
    plc.wait(100)
    assert plc.rpm == pytest.approx(-600.0, abs=1.0), "data without an edge change nothing"
    assert plc.go()
    plc.arrive()
    plc.wait(50)
    assert plc.rev == pytest.approx(2.0, abs=0.001)


@BOTH_TELEGRAMS
@pytest.mark.parametrize(
    "word",
    [{"MDI_VELOCITY": 0}, {"MDI_VELOCITY": -5_000_000}, {"MDI_ACC": 0}, {"MDI_DEC": 0}, {"MDI_ACC": 0x8000},
     {"MDI_DEC": 0xC000}],
)  # fmt: skip
def test_3_1_and_6_6_1_a_task_without_velocity_or_ramp_or_with_a_negative_one_is_not_taken(telegram, word):
    """Table 3.1.1: Int32 and Int16; that these start nothing is assumed."""
    plc = E1Plc(telegram)
    plc.task(1.0, **word)
    assert not plc.go()
    plc.wait(50)
    assert plc.rpm == pytest.approx(0.0, abs=0.1)


@BOTH_TELEGRAMS
def test_3_2_note_2_without_mdi_nothing_starts_and_the_status_words_show_it(telegram):
    """The drive keeps no position blocks: only the MDI submode works."""
    plc = E1Plc(telegram)
    active = (lambda: plc["AKTSATZ"]) if telegram == 9 else (lambda: plc["POS_ZSW1"])
    assert active() == 0x8000
    plc.task(1.0, mdi=False)
    assert active() == 0
    assert not plc.go()
    plc.task(1.0, mdi=False, **({"SATZANW": 0x0001} if telegram == 9 else {}))
    assert not plc.go()
    plc.wait(100)
    assert plc.rpm == pytest.approx(0.0, abs=0.1)


@BOTH_TELEGRAMS
def test_3_3_2_a_level_of_bit_6_is_no_edge_and_a_task_needs_bits_4_and_5(telegram):
    plc = E1Plc(telegram)
    plc.task(1.0)
    for stw1 in (RUN & ~0x0010, RUN & ~0x0020):
        assert not plc.go(stw1)
        assert plc.put(STW1=RUN) & TAKEN == 0
    assert plc.go()
    plc.put(STW1=RUN | START)
    plc.arrive()
    plc.task(3.0)
    plc.wait(200)
    assert plc.rev == pytest.approx(1.0, abs=0.001)


@BOTH_TELEGRAMS
def test_3_3_2_bit_5_stops_on_the_way_and_goes_on(telegram):
    plc = E1Plc(telegram)
    plc.task(5.0)
    assert plc.go()
    plc.wait(250)
    plc.put(STW1=RUN & ~0x0020, wait=200)
    assert plc.bit(STOPPED)
    assert not plc.bit(REACHED)
    assert 0.5 < plc.rev < 4.5
    plc.put(STW1=RUN)
    plc.arrive()
    assert plc.rev == pytest.approx(5.0, abs=0.01)


@BOTH_TELEGRAMS
def test_3_3_2_bit_4_rejects_the_task(telegram):
    plc = E1Plc(telegram)
    plc.task(5.0)
    assert plc.go()
    plc.wait(250)
    plc.put(STW1=RUN & ~0x0010, wait=200)
    place = plc.rev
    assert plc.bit(STOPPED)
    plc.put(STW1=RUN, wait=300)
    assert plc.rev == pytest.approx(place, abs=0.01)
    assert not plc.bit(REACHED)
    assert plc.go()
    plc.arrive()
    assert plc.rev == pytest.approx(5.0, abs=0.01)


@BOTH_TELEGRAMS
def test_6_6_1_pt534_and_pt537_are_the_ramps_and_mdi_acc_and_mdi_dec_their_share(telegram):
    plc = E1Plc(telegram)
    plc.store.set("Pt534", 200)
    plc.store.set("Pt537", 400)
    plc.task(5.0, MDI_ACC=WHOLE // 2, MDI_DEC=WHOLE // 4)
    plc.put(STW1=RUN | START)
    assert plc.axis.profile.acceleration == pytest.approx(600.0 / 0.2 / 2, rel=1e-3)
    assert plc.axis.profile.deceleration == pytest.approx(600.0 / 0.4 / 4, rel=1e-3)


@pytest.mark.parametrize(("words", "target"), [
    ({"SATZANW": 0xFFFF, "MDI_MOD": 0xFFFF}, 1.0), ({"SATZANW": 0x8001, "MDI_MOD": 0xFFFE}, 3.0),
])  # fmt: skip
def test_tables_3_9_1_to_3_11_1_reserved_bits_do_nothing(words, target):
    """Only SATZANW.15 selects the submode, and only MDI_MODE.0 distinguishes an absolute from a relative task."""
    plc = E1Plc(9)
    plc.task(2.0)
    assert plc.go()
    plc.arrive()
    plc.task(1.0, **words)
    assert plc["AKTSATZ"] == 0x8000
    assert plc.go()
    plc.arrive()
    plc.wait(50)
    assert plc.rev == pytest.approx(target, abs=0.001)


@BOTH_TELEGRAMS
def test_a_task_goes_on_when_mdi_is_deselected_on_the_way(telegram):
    """The submode counts with the edge that starts a task: assumed."""
    plc = E1Plc(telegram)
    plc.task(3.0)
    assert plc.go()
    plc.task(3.0, mdi=False)
    plc.arrive()
    assert plc.rev == pytest.approx(3.0, abs=0.01)


def test_override_slows_a_running_task_and_never_beyond_the_velocity_limit():
    """Table 3.1.1, OVERRIDE; that 0x4000 is 100 % is assumed by the other shares of 6.6.1."""
    plc = E1Plc(111, params="{Pt316: 900}")
    plc.task(200.0)
    assert plc.go()
    for share, rpm in ((0.5, 300.0), (0.0, 0.0), (1.0, 600.0), (1.5, 900.0), (3.9, 900.0)):
        plc.put(OVERRIDE=round(share * WHOLE), wait=400)
        assert plc.rpm == pytest.approx(rpm, abs=2.0)
    assert plc.bit(FOLLOWS), "no following error by a velocity that the limit cuts"


def test_6_2_the_velocity_limit_holds_a_task_back():
    plc = E1Plc(9, params="{Pt316: 300}")
    plc.task(10.0)
    assert plc.go()
    plc.wait(400)
    assert plc.rpm == pytest.approx(300.0, abs=1.0)
    plc.arrive()


# -- words of telegram 111 (3.12 to 3.16) ------------------------------------------------------------------------------


def test_tables_3_14_1_and_3_15_1_in_a_move_forwards_and_backwards():
    plc = E1Plc(111)
    assert (plc["POS_ZSW1"], plc["POS_ZSW2"]) == (0x8000, 0)
    for target, direction in ((10.0, 0x0010), (0.0, 0x0020)):
        plc.task(target)
        assert plc.go()
        plc.wait(300)
        assert (plc["POS_ZSW1"], plc["POS_ZSW2"]) == (0x8000, 0x8004 | direction)
        plc.arrive()
        plc.wait(100)
        assert plc["POS_ZSW2"] == 0


def test_3_12_and_3_13_reserved_bits_do_nothing():
    plc = E1Plc(111)
    plc.task(1.0, POS_STW1=0x8100 | 0x7EFF, POS_STW2=0xFFFD)
    assert plc.go()
    plc.arrive()
    assert plc.rev == pytest.approx(1.0, abs=0.01)
    assert not plc.bit(HOMED)


def test_table_3_13_1_the_position_becomes_the_reference_point_with_the_edge():
    plc = E1Plc(111)
    plc.task(2.5)
    assert plc.go()
    plc.arrive()
    plc.wait(50)
    plc.put(POS_STW2=0x0002)
    assert plc.bit(HOMED)
    assert plc.rev == pytest.approx(0.0, abs=0.001)
    plc.task(1.0)
    assert plc.go()
    plc.arrive()
    plc.wait(50)
    assert plc.rev == pytest.approx(1.0, abs=0.001), "a level sets nothing anew"


@pytest.mark.parametrize("pause", [False, True])
def test_table_3_13_1_a_task_ends_at_its_number_counted_from_a_new_reference_point(pause):
    """In the run, or in its intermediate stop: MDI_TARPOS counts from the reference point."""
    plc = E1Plc(111)
    plc.task(10.0)
    assert plc.go()
    plc.wait(300)
    if pause:
        plc.put(STW1=RUN & ~0x0020, wait=300)
    before = plc.rev
    assert 2.0 < before < 5.0
    plc.put(POS_STW2=0x0002)
    assert plc.bit(HOMED)
    plc.put(STW1=RUN)
    plc.arrive()
    plc.wait(50)
    assert plc.rev == pytest.approx(10.0, abs=0.001)
    assert float(plc.axis.motor.position) == pytest.approx(10.0 + before, abs=0.05)


def test_table_3_13_1_a_relative_task_keeps_its_distance_after_a_new_reference_point():
    plc = E1Plc(111)
    plc.task(4.0, relative=True)
    assert plc.go()
    plc.wait(200)
    plc.put(POS_STW2=0x0002)
    plc.arrive()
    assert float(plc.axis.motor.position) == pytest.approx(4.0, abs=0.001)


# -- numbers of 32 bits (3.1) ------------------------------------------------------------------------------------------


@BOTH_TELEGRAMS
def test_3_1_an_absolute_task_leads_to_where_xist_a_shows_its_number(telegram):
    """XIST_A is an Int32: of 2^23 increments it counts round after 256 revolutions."""
    plc = E1Plc(telegram)
    for _ in range(2):
        plc.task(200.0, 5000.0, relative=True)
        assert plc.go()
        plc.arrive()
    assert plc.rev == pytest.approx(-112.0, abs=0.001), "400 less 512"
    for target, place in ((-100.0, 412.0), (-150.0, 362.0), (0.0, 512.0)):
        plc.task(target, 5000.0)
        assert plc.go()
        plc.arrive()
        assert plc.rev == pytest.approx(target, abs=0.001)
        assert float(plc.axis.motor.position) == pytest.approx(place, abs=0.001)


def test_3_1_within_32_bits_a_target_far_behind_is_not_reached_by_counting_round():
    plc = E1Plc(9)
    plc.task(200.0, 5000.0)
    assert plc.go()
    plc.arrive()
    plc.task(-200.0, 5000.0)
    assert plc.go()
    plc.wait(500)
    assert plc.rpm < -1000.0
    plc.arrive(10_000)
    assert float(plc.axis.motor.position) == pytest.approx(-200.0, abs=0.001)


def test_table_3_16_1_enable_ready_and_pulses_follow_the_state():
    """Bits 11, 12, 13; 8 is always 1; 1, 6 and 7 without limit and warnings."""
    plc = HandPlc("hiwin-e1", 111)
    found = [plc["MELDW"]] + [(plc.put(STW1=word), plc["MELDW"])[1] for word in (0x0406, 0x0407, RUN, 0x0407)]
    assert found == [0x01C2, 0x11C2, 0x11C2, 0x39C2, 0x11C2]


def test_table_3_16_1_bit_1_falls_while_the_torque_is_limited():
    plc = E1Plc(111)
    plc.store.set("Pt402", 10)
    plc.task(5.0)
    assert plc.go()
    plc.wait_for(lambda: not plc["MELDW"] & 0x0002)
    assert plc.axis.motor.torque == pytest.approx(0.127)


@pytest.mark.parametrize(("warning", "bit"), [("motor-overload-warning", 6), ("i2t-warning", 7)])
def test_table_3_16_1_bits_6_and_7_fall_with_their_warning_and_the_axis_runs_on(warning, bit):
    plc = E1Plc(111)
    plc.task(50.0)
    assert plc.go()
    plc.wait(200)
    plc.inject("drive-warning", warning=warning)
    plc.wait(5)
    assert plc["MELDW"] == 0x39C2 & ~(1 << bit)
    assert plc["ZSW1"] & 0x008F == 0x0087, "a warning, no fault"
    assert plc["WARN_CODE"] == 0x910 + bit - 6
    assert plc["FAULT_CODE"] == 0
    assert plc.rpm == pytest.approx(600.0, abs=1.0)
    plc.clear()
    plc.wait(5)
    assert (plc["MELDW"], plc["WARN_CODE"], plc["ZSW1"] & 0x0080) == (0x39C2, 0, 0)


@pytest.mark.parametrize(("side", "bit", "way"), [("negative", 0x0100, -20.0), ("positive", 0x0200, 20.0)])
def test_table_3_14_1_an_overtravel_stops_the_axis_and_lets_it_back_only(side, bit, way):
    plc = E1Plc(111)
    plc.task(way)
    assert plc.go()
    plc.wait(400)
    plc.inject("limit-switch", side=side)
    plc.wait(5)
    assert plc["POS_ZSW1"] == 0x8000 | bit
    plc.wait(200)
    assert plc.bit(STOPPED)
    assert not plc.bit(REACHED)
    assert plc["ZSW1"] & 0x0088 == 0, "the manual names neither a fault nor a warning"
    assert not plc.go(), "no task goes further that way"
    plc.put(STW1=RUN | (JOG_FORWARDS if way > 0 else JOG_BACKWARDS), wait=100)
    assert plc.rpm == pytest.approx(0.0, abs=0.1)
    plc.put(STW1=RUN)
    plc.task(0.0)
    assert plc.go()
    plc.clear()
    plc.arrive()
    assert plc["POS_ZSW1"] == 0x8000


def test_xist_a_counts_control_units_from_the_machines_zero():
    plc = E1Plc(9)
    plc.task(1.0)
    assert plc.go()
    plc.arrive()
    plc.wait(100)
    assert plc["XIST_A"] == pytest.approx(COUNTS, abs=COUNTS // 1000)
