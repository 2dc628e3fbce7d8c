"""The general state machine as a controller sees it: STW1 in, ZSW1 out."""

from itertools import product

import pytest
from bench_axis import MS, BenchAxis
from from_python import called

from pnfarm.firmware.state_machine import PRIORITY, RELEASED, TRANSITIONS, advance, conditions
from pnfarm.table.axis_codes import (
    CMD_ACKNOWLEDGE,
    CMD_HOLD_FAULT,
    CMD_POWER_ON,
    CMD_RAISE_FAULT,
    CMD_RELEASE_FAULT,
    REACTION_QUICK_STOP,
)
from pnfarm.table.image import LOST_CLOSED, LOST_EXPIRED, LOST_STOP


def state_bits(zsw1: int) -> tuple[int, int, int, int]:
    return zsw1 & 1, zsw1 >> 1 & 1, zsw1 >> 2 & 1, zsw1 >> 6 & 1


def test_akd_5_9_control_words_walk_from_s1_to_s4():
    drive = BenchAxis()
    assert state_bits(drive.write(0x0470)) == (0, 0, 0, 1)
    assert state_bits(drive.write(0x0476)) == (1, 0, 0, 0)
    assert state_bits(drive.write(0x0477)) == (1, 1, 0, 0)
    assert state_bits(drive.write(0x047F)) == (1, 1, 1, 0)


def test_akd_7_1_4_sample_words_0x047f_gives_0x0237_while_the_axis_speeds_up():
    drive = BenchAxis()
    drive.enable()
    assert drive.write(0x047F, 0x00A3 * 0.366, run=2) == 0x0237


def test_switching_on_inhibit_is_left_only_with_bit_0_withdrawn():
    drive = BenchAxis()
    drive.write(0x0477, run=20)
    assert drive.axis.drive.state == 1
    drive.write(0x0476)
    assert drive.axis.drive.state == 2


@pytest.mark.parametrize("state_word", [0x0476, 0x0477, 0x047F])
@pytest.mark.parametrize("stop_word", [0x0474, 0x0475, 0x047D])
def test_coast_stop_leads_to_s1_from_everywhere(state_word, stop_word):
    drive = BenchAxis()
    for word in (0x0470, 0x0476, 0x0477, 0x047F):
        drive.write(word)
        if word == state_word:
            break
    drive.write(stop_word, run=2)
    assert drive.axis.drive.state == 1


def test_off_in_operation_ramps_down_with_the_deceleration_then_s2():
    drive = BenchAxis()
    drive.enable(1000.0)
    drive.run(300)
    drive.write(0x047E, 1000.0)
    assert drive.axis.drive.state == 5
    assert state_bits(drive.zsw1) == (1, 1, 0, 0)
    drive.run(98)
    assert drive.axis.motor.velocity == pytest.approx(1000 - 5000 * 0.099, rel=0.03)
    drive.run(120)
    assert drive.axis.drive.state == 2


def test_on_again_during_the_ramp_stop_returns_to_operation():
    drive = BenchAxis()
    drive.enable(1000.0)
    drive.run(300)
    drive.write(0x047E, 1000.0, run=50)
    drive.write(0x047F, 1000.0)
    assert drive.axis.drive.state == 4


def test_quick_stop_uses_its_own_ramp_and_ends_in_s1():
    drive = BenchAxis()
    drive.enable(1000.0)
    drive.run(300)
    drive.write(0x047B, 1000.0)
    assert drive.axis.drive.state == 5
    assert drive.zsw1 & 0x0020 == 0
    drive.run(60)
    assert drive.axis.drive.state == 1
    assert drive.axis.motor.velocity == pytest.approx(0.0, abs=0.5)


def test_quick_stop_overrides_a_ramp_stop():
    drive = BenchAxis()
    drive.enable(2000.0)
    drive.run(400)
    drive.write(0x047E, run=10)
    assert drive.axis.drive.stop == 1
    drive.write(0x047A, run=2)
    assert drive.axis.drive.stop == 2


def test_disable_operation_takes_the_power_stage_off_and_the_axis_coasts():
    drive = BenchAxis()
    drive.enable(1000.0)
    drive.run(300)
    drive.write(0x0477, 1000.0, run=2)
    assert drive.axis.drive.state == 3
    assert drive.axis.motor.current == 0.0
    assert drive.axis.motor.velocity > 900.0


def test_without_control_by_plc_the_other_bits_are_not_taken_over():
    drive = BenchAxis()
    drive.enable(500.0)
    drive.write(0x0000, run=20)
    assert drive.axis.drive.state == 4
    drive.write(0x0400, run=2)
    assert drive.axis.drive.state == 1


def test_a_fault_in_operation_sets_bit_3_and_ends_in_s1():
    drive = BenchAxis()
    drive.enable(500.0)
    drive.command(CMD_RAISE_FAULT, 529)
    drive.run(2)
    assert drive.axis.drive.state == 1
    assert drive.zsw1 & 0x0008


def test_a_fault_with_controlled_stop_brakes_first():
    drive = BenchAxis()
    drive.enable(1000.0)
    drive.run(200)
    drive.command(CMD_RAISE_FAULT, 702 | REACTION_QUICK_STOP << 24)
    drive.run(2)
    assert drive.axis.drive.state == 5
    assert drive.axis.motor.current < 0.0
    drive.run(60)
    assert drive.axis.drive.state == 1


def test_acknowledgement_needs_an_edge_of_bit_7():
    drive = BenchAxis()
    drive.write(0x04F6)
    drive.command(CMD_RAISE_FAULT, 529)
    drive.write(0x04F6, run=50)
    assert drive.zsw1 & 0x0008
    assert drive.write(0x0476) & 0x0008, "a falling edge acknowledges nothing"
    drive.write(0x04F6)
    assert not drive.zsw1 & 0x0008


def test_a_controller_that_holds_bit_0_through_a_fault_stays_in_s1():
    drive = BenchAxis()
    drive.enable()
    drive.command(CMD_RAISE_FAULT, 529)
    drive.run(5)
    drive.write(0x04FF)
    drive.write(0x047F, run=50)
    assert not drive.zsw1 & 0x0008
    assert drive.axis.drive.state == 1
    drive.write(0x0476)
    assert drive.axis.drive.state == 2


def test_a_fault_whose_cause_is_still_there_cannot_be_acknowledged():
    drive = BenchAxis()
    drive.command(CMD_HOLD_FAULT, 501)
    drive.write(0x0476)
    drive.write(0x04F6)
    assert drive.zsw1 & 0x0008
    drive.command(CMD_RELEASE_FAULT, 501)
    drive.write(0x0476)
    drive.write(0x04F6)
    assert not drive.zsw1 & 0x0008


def test_akd_5_14_acknowledging_shifts_the_fault_buffer_by_eight_and_each_situation_counts():
    drive = BenchAxis()
    for number in (501, 502):
        drive.command(CMD_RAISE_FAULT, number)
    drive.run(1)
    assert list(drive.axis.faults.buffer[:3]) == [501, 502, 0]
    assert drive.axis.faults.counter == 1
    drive.command(CMD_ACKNOWLEDGE)
    drive.run(1)
    assert list(drive.axis.faults.buffer[:3]) == [0, 0, 0]
    assert list(drive.axis.faults.buffer[8:11]) == [501, 502, 0]
    drive.command(CMD_RAISE_FAULT, 702)
    drive.run(1)
    assert drive.axis.faults.counter == 2
    assert drive.axis.faults.buffer[0] == 702
    assert list(drive.axis.faults.buffer[8:10]) == [501, 502]


def test_a_ninth_situation_pushes_the_oldest_out():
    drive = BenchAxis()
    for number in range(1, 11):
        drive.command(CMD_RAISE_FAULT, number)
        drive.command(CMD_ACKNOWLEDGE)
        drive.run(1)
    assert list(drive.axis.faults.buffer[0::8]) == [0, 10, 9, 8, 7, 6, 5, 4]


def test_the_same_fault_twice_is_one_entry():
    drive = BenchAxis()
    drive.command(CMD_RAISE_FAULT, 501)
    drive.command(CMD_RAISE_FAULT, 501 | REACTION_QUICK_STOP << 24)
    drive.run(1)
    assert list(drive.axis.faults.code[:2]) == [501, 0]


def test_loss_of_cyclic_data_raises_702_also_while_stw1_is_zero():
    drive = BenchAxis()
    assert not drive.write(0x0000) & 0x0008
    drive.lose(LOST_EXPIRED)
    assert drive.zsw1 & 0x0008
    assert drive.axis.faults.code[0] & 0xFFFFFF == 702


def test_loss_of_cyclic_data_raises_702_and_stops_the_axis_along_its_ramp():
    drive = BenchAxis()
    drive.enable(1000.0)
    drive.run(200)
    drive.lose(LOST_EXPIRED)
    assert drive.axis.faults.buffer[0] == 702
    assert drive.axis.drive.state == 5
    drive.run(60)
    assert drive.axis.drive.state == 1
    assert drive.axis.motor.velocity == pytest.approx(0.0, abs=0.5)


def test_an_orderly_release_coasts_without_a_fault():
    drive = BenchAxis()
    drive.enable(1000.0)
    drive.lose(LOST_CLOSED)
    drive.run(2)
    assert drive.axis.faults.code[0] == 0
    assert drive.axis.drive.state == 1


@pytest.mark.parametrize(("word", "coasts"), [(0x047D, True), (0x047B, False), (0x047E, False), (0x0477, False)])
def test_5_4_a_coast_stop_ends_the_controlled_stop_of_a_fault_and_nothing_softer_does(word, coasts):
    """AKD PROFINET manual 5.4, bit 1 = 0: the drive coasts; 5.3: from switching off, whatever brakes it."""
    drive = BenchAxis()
    drive.enable(1000.0)
    drive.run(300)
    drive.axis.ramp.settings.quick_stop_deceleration = 2_000.0
    drive.command(CMD_RAISE_FAULT, 301 | REACTION_QUICK_STOP << 24)
    drive.run(20)
    assert drive.axis.drive.state == 5
    drive.write(word, 1000.0, run=2)
    assert (drive.axis.drive.state == 1) == coasts
    assert (drive.axis.motor.current == 0.0) == coasts


def test_provider_stop_raises_702_only_where_fbus_param02_asks_for_it():
    drive = BenchAxis()
    drive.enable()
    drive.lose(LOST_STOP)
    assert drive.axis.faults.code[0] == 0
    drive.enable()
    drive.axis.faults.settings.stop_fault = 702
    drive.lose(LOST_STOP)
    assert drive.axis.faults.code[0] == 702


def test_power_on_boots_for_a_while_and_moves_the_open_situation_into_history():
    drive = BenchAxis()
    drive.command(CMD_RAISE_FAULT, 501)
    drive.run(1)
    drive.command(CMD_POWER_ON)
    drive.run(1)
    assert drive.axis.drive.state == 0
    drive.run(100)
    assert drive.axis.drive.state == 1
    assert not drive.zsw1 & 0x0008
    assert drive.axis.faults.buffer[8] == 501


def test_a_frame_from_before_a_power_cycle_does_not_start_the_drives_own_watchdog():
    drive = BenchAxis()
    drive.axis.faults.settings.loss_delay_ns = 100 * MS
    drive.write(0x047E)
    drive.run(1, frame=True)
    drive.image.frames += 1
    drive.off_and_on()
    drive.run(1000)
    assert drive.axis.faults.code[0] == 0
    drive.write(0x0400)
    drive.run(150)
    assert drive.axis.faults.code[0] & 0xFFFF == 702, "one that comes does"


@pytest.mark.parametrize("row", sorted(TRANSITIONS), ids=str)
def test_every_row_of_the_table_is_reachable_by_priority(row):
    """AKD PROFINET manual 5.3: some control word, fault and speed of the axis takes each transition, and none other."""
    assert {event for _, event in TRANSITIONS} == set(PRIORITY)
    state, event = row
    axis = BenchAxis().axis
    ways = 0
    for stw1, (faulty, reaction), standing in product(range(16), ((0, 0), (1, 0), (1, 1)), (0, 1)):
        # a quick stop that is taken back is an event of drives that stay in it only
        held = called(conditions)(stw1, faulty, reaction, standing, state == 0) | (event == RELEASED) << RELEASED
        if next((e for e in PRIORITY if held & 1 << e and (state, e) in TRANSITIONS), None) == event:
            axis.drive.state, axis.drive.stop = min(state, 5), max(state - 4, 0)
            advance(axis.drive, held)
            assert int(axis.drive.state) + max(int(axis.drive.stop) - 1, 0) == TRANSITIONS[row]
            ways += 1
    assert ways
