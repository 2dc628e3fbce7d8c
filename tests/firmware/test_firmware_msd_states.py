"""System states, transitions, control word and status words of the Moog MSD (chapter 10.2) on the bench."""

from __future__ import annotations

import pytest
from msd_bench import ON, READY, RUN, MsdBench

from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import (
    CMD_HOLD_FAULT,
    CMD_RAISE_FAULT,
    CMD_RAISE_WARNING,
    CMD_RELEASE_FAULT,
    LACKS_ENABLE,
    LACKS_SUPPLY,
)
from pnfarm.table.image import LOST_EXPIRED

SPEED = 1000


def ready() -> MsdBench:
    bench = MsdBench()
    bench.send(3, STW1=READY)
    return bench


def running(**params: int) -> MsdBench:
    """1000 rpm, P-1278 and P-1279 at 100 rev/s2."""
    bench = MsdBench(**params)
    bench.enable(NSOLL_A=SPEED)
    bench.run(300)
    assert bench.speed == pytest.approx(SPEED, abs=1)
    return bench


def push(bench: MsdBench, command: int, fault: str) -> None:
    bench.store.handle.push_command(command, bench.model.fault(fault).code)
    bench.run(1)


# table 10.2 and table 10.7, transition by transition


def test_transition_0_the_drive_boots_into_the_inhibit_and_shows_it() -> None:
    """Table 10.2, states 0 to 2; ZSW1.6, and bit 14 with ENPO and safe stop set."""
    bench = MsdBench()
    assert bench.state == 1
    assert bench.zsw1 & 0x004F == 0x0040
    assert bench.zsw1 & 0x4000


def test_transitions_1_and_8_a_dc_link_that_is_too_low_keeps_the_drive_from_state_3() -> None:
    bench = MsdBench()
    bench.axis.drive.settings.interlocks = LACKS_SUPPLY
    assert bench.send(3, STW1=READY) & 0x0041 == 0x0040
    bench.axis.drive.settings.interlocks = 0
    assert bench.send(3, STW1=READY) & 0x0041 == 0x0001
    other = running()
    other.axis.drive.settings.interlocks = LACKS_SUPPLY
    other.run(1)
    assert (other.state, other.faults()) == (1, [])
    assert other.zsw1 & 0x4000, "the DC link is neither ENPO nor safe stop"


@pytest.mark.parametrize("word", [0x0406, 0x0407])
def test_transition_2_needs_stw1_1_and_2_alone(word: int) -> None:
    bench = MsdBench()
    assert bench.send(1, STW1=word & ~0x0002) & 0x0001 == 0
    assert bench.send(1, STW1=word & ~0x0004) & 0x0001 == 0
    assert bench.send(1, STW1=word) & 0x0041 == 0x0001


def test_transitions_3_and_6_stw1_0_switches_the_power_stage() -> None:
    bench = ready()
    assert bench.send(2, STW1=ON) & 0x0007 == 0x0003
    assert bench.send(2, STW1=READY) & 0x0007 == 0x0001


def test_transitions_4_and_5_stw1_3_enables_and_disables() -> None:
    bench = ready()
    bench.send(2, STW1=ON)
    assert bench.send(2, STW1=RUN) & 0x0007 == 0x0007
    assert bench.send(2, STW1=ON) & 0x0007 == 0x0003
    assert bench.send(2, STW1=RUN) & 0x0007 == 0x0007


def test_p_0144_at_0_asks_for_the_edge_of_the_enable() -> None:
    """Table 10.7, *: edge triggered; after a fault bits that stay set do not start the drive."""
    bench = MsdBench()
    bench.send(10, STW1=RUN)
    assert bench.state == 3, "bits 0 and 3 stood before the drive was ready"
    bench.send(2, STW1=ON)
    bench.send(2, STW1=RUN)
    assert bench.state == 4
    push(bench, CMD_RAISE_FAULT, "4-1")
    assert bench.state == 1
    bench.send(10, STW1=RUN | 0x0080)
    assert (bench.faults(), bench.state) == ([], 3)


def test_p_0144_at_0_an_edge_while_bit_10_is_0_does_not_start_the_drive_when_bit_10_returns() -> None:
    bench = ready()
    bench.send(3, STW1=RUN & ~0x0400)
    bench.send(20, STW1=RUN)
    assert bench.state == 3, "STW1.0 is taken over, the edge of the enable was none"
    bench.send(2, STW1=ON)
    bench.send(2, STW1=RUN)
    assert bench.state == 4


def test_p_0144_at_0_takes_the_edge_of_stw1_0_alone_too() -> None:
    """8.2.1, note: technology objects that leave bit 3 set start the drive with 0x047E and 0x047F."""
    bench = MsdBench(3)
    bench.send(3, STW1=0x047E)
    bench.send(3, STW1=0x047F)
    assert bench.state == 4
    push(bench, CMD_RAISE_FAULT, "4-1")
    bench.send(3, STW1=0x04FE)
    bench.send(3, STW1=0x047E)
    bench.send(3, STW1=0x047F)
    assert (bench.faults(), bench.state) == ([], 4)


def test_p_0144_at_1_looks_at_the_state_of_the_enable() -> None:
    bench = MsdBench(P_0144=1)
    bench.send(10, STW1=RUN)
    assert bench.state == 4
    push(bench, CMD_RAISE_FAULT, "4-1")
    bench.send(10, STW1=RUN | 0x0080)
    assert bench.state == 4


@pytest.mark.parametrize("word", [ON & ~0x0002, ON & ~0x0004])
@pytest.mark.parametrize("start", [READY, ON])
def test_transition_7_coast_or_quick_stop_leads_back_to_the_inhibit(start: int, word: int) -> None:
    bench = ready()
    bench.send(2, STW1=start)
    assert bench.send(2, STW1=word) & 0x0041 == 0x0040


def test_transition_9_and_12_a_quick_stop_ends_in_the_inhibit_at_standstill() -> None:
    """With P-2218 = 2, the default: along the quick stop ramp."""
    bench = running()
    assert bench.send(1, STW1=RUN & ~0x0004) & 0x0027 == 0x0003
    assert bench.state == 5
    assert bench.until(lambda: bench.state == 1) < 60
    assert abs(bench.speed) < 1.0


def test_transition_11_coast_stop_switches_off_at_once() -> None:
    bench = running()
    bench.send(1, STW1=RUN & ~0x0002)
    assert (bench.state, bench.zsw1 & 0x0010) == (1, 0)
    assert bench.speed > 900


def test_transitions_13_and_14_a_fault_with_a_stop_reacts_and_then_the_drive_is_in_fault() -> None:
    """States 7 and 8: set points are ignored."""
    bench = running()
    push(bench, CMD_RAISE_FAULT, "11-1")
    assert bench.state == 5
    assert bench.zsw1 & 0x0008
    bench.send(1, NSOLL_A=3000)
    bench.until(lambda: bench.state == 1)
    assert abs(bench.speed) < 1.0
    assert bench.zsw1 & 0x0048 == 0x0048


def test_transition_15_the_edge_of_stw1_7_acknowledges() -> None:
    bench = ready()
    push(bench, CMD_RAISE_FAULT, "4-1")
    bench.send(1, STW1=READY | 0x0080)
    assert bench.faults() == []
    push(bench, CMD_RAISE_FAULT, "4-1")
    bench.send(5, STW1=READY | 0x0080)
    assert bench.faults() == ["4-1"], "the bit stood"


def test_transition_15_the_rising_edge_of_enpo_acknowledges_too() -> None:
    bench = ready()
    push(bench, CMD_RAISE_FAULT, "4-1")
    bench.axis.drive.settings.interlocks = LACKS_ENABLE
    bench.run(2)
    assert bench.faults() == ["4-1"]
    bench.axis.drive.settings.interlocks = 0
    bench.run(2)
    assert bench.faults() == []
    push(bench, CMD_HOLD_FAULT, "4-1")
    bench.axis.drive.settings.interlocks = LACKS_ENABLE
    bench.run(1)
    bench.axis.drive.settings.interlocks = 0
    bench.run(1)
    assert bench.faults() == ["4-1"], "its cause is there"


def test_transition_16_without_enpo_the_drive_coasts_from_any_state() -> None:
    for word in (READY, ON, RUN):
        bench = ready()
        for step in (READY, ON, RUN):
            if step <= word:
                bench.send(3, STW1=step, NSOLL_A=SPEED)
        before = bench.state
        bench.axis.drive.settings.interlocks = LACKS_ENABLE
        bench.run(2)
        assert (bench.state, bench.faults()) == (1, []), before
        assert bench.zsw1 & 0x4040 == 0x0040
        bench.axis.drive.settings.interlocks = 0
        bench.run(3)
        # STW1.0 to 3 are still set: they must rise again
        assert bench.state == (2 if word == READY else 3)


def test_enpo_that_goes_in_a_quick_stop_or_a_fault_reaction_ends_it() -> None:
    for how in ("quick stop", "fault"):
        bench = running()
        if how == "fault":
            push(bench, CMD_RAISE_FAULT, "11-1")
        else:
            bench.send(1, STW1=RUN & ~0x0004)
        assert bench.state == 5
        bench.axis.drive.settings.interlocks = LACKS_ENABLE
        bench.run(2)
        assert bench.state == 1
        assert bench.speed > 500


def test_an_encoder_that_is_parked_keeps_the_drive_from_operation() -> None:
    bench = MsdBench(3)
    bench.send(3, STW1=READY, G1_STW=0x4000)
    assert bench.see("G1_ZSW") & 0x4000
    assert bench.state == 1
    bench.send(3, G1_STW=0)
    assert bench.state == 2


# quick stop option codes: table 10.3


def quick(code: int) -> MsdBench:
    bench = running(P_2218=code, P_1279=50)
    bench.send(1, STW1=RUN & ~0x0004)
    return bench


def test_code_0_switches_off_and_lets_the_drive_coast() -> None:
    bench = quick(0)
    assert bench.state == 1
    assert bench.speed > 900


@pytest.mark.parametrize(
    ("code", "shortest", "longest"), [(1, 320, 345), (2, 16, 30), (3, 3, 15), (5, 320, 345), (6, 16, 30), (7, 3, 15)]
)
def test_codes_1_to_3_and_5_to_7_stop_along_their_ramps(code: int, shortest: int, longest: int) -> None:
    """P-1279 of 50 rev/s2 takes 333 ms from 1000 rpm, the quick stop ramp 17 ms, the current limit less."""
    bench = quick(code)
    assert bench.state == 5
    assert shortest <= bench.until(lambda: abs(bench.speed) < 20.0) <= longest
    bench.run(80)
    assert bench.state == (1 if code < 4 else 5)


@pytest.mark.parametrize("code", [5, 6, 7])
def test_codes_5_to_7_stay_in_quick_stop_until_it_is_taken_back(code: int) -> None:
    """Transition 10, and the note *: taking STW1.3 or 0 back is without effect before that."""
    bench = quick(code)
    bench.until(lambda: abs(bench.speed) < 1.0)
    for word in (RUN & ~0x0008, RUN & ~0x0001):
        bench.send(20, STW1=word & ~0x0004)
        assert bench.zsw1 & 0x0023 == 0x0003
        assert bench.state == 5
    bench.send(3, STW1=RUN)
    assert bench.state == 4
    bench.run(300)
    assert bench.speed == pytest.approx(SPEED, abs=1)
    bench.send(2, STW1=RUN & ~0x0004)
    bench.send(2, STW1=READY)
    assert bench.state in {2, 3, 5}, "quick stop taken back with STW1.3 = 0: out of operation"
    bench.until(lambda: bench.state == 2)


@pytest.mark.parametrize("code", [1, 2, 3])
def test_codes_1_to_3_are_not_interrupted(code: int) -> None:
    bench = quick(code)
    bench.send(1, STW1=RUN)
    assert bench.state == 5
    bench.until(lambda: bench.state != 5)


def test_coast_ends_a_quick_stop_that_stays() -> None:
    bench = quick(6)
    bench.send(1, STW1=RUN & ~0x0006)
    assert bench.state == 1


# table 10.4, bit 10, and where control comes from: P-0159 and P-0165


def test_without_access_permission_nothing_is_taken_over() -> None:
    bench = running()
    bench.send(50, STW1=0, NSOLL_A=0)
    assert bench.state == 4
    assert bench.speed == pytest.approx(SPEED, abs=1)


def test_with_another_control_location_the_control_word_is_ignored() -> None:
    """14.1.1: P-0159 = 7 is a prerequisite; ZSW1.9 shows the permission (table 10.8)."""
    bench = running()
    assert bench.zsw1 & 0x0200
    bench.store.set("P-0159", 1)
    bench.run(2)
    assert (bench.state, bench.zsw1 & 0x0200) == (1, 0)
    bench.send(5, STW1=READY)
    assert bench.state == 1
    bench.store.set("P-0159", 7)
    bench.enable()


def test_with_another_reference_source_the_set_point_does_not_count() -> None:
    bench = running()
    bench.store.set("P-0165", 0)
    bench.run(300)
    assert (bench.state, round(bench.speed)) == (4, 0)


def test_signals_that_end_make_every_output_zero() -> None:
    """Chapter 16."""
    bench = running()
    bench.image.valid, bench.image.lost = 0, LOST_EXPIRED
    bench.run(1)
    assert (bench.axis.profidrive.stw1, bench.axis.ramp.setpoint, bench.state) == (0, 0.0, 1)


# status word 1: table 10.8


def test_bits_4_and_5_follow_the_stops_and_13_the_shaft() -> None:
    bench = running()
    assert bench.zsw1 & 0x2030 == 0x0030
    bench.send(1, STW1=RUN & ~0x0006)
    assert bench.zsw1 & 0x0030 == 0
    bench.until(lambda: bench.speed == 0.0, 20_000)
    assert bench.zsw1 & 0x2000


def test_bit_10_is_the_speed_reached_or_exceeded() -> None:
    bench = MsdBench(1, 0x0001)
    bench.enable(NSOLL_A=SPEED)
    assert not bench.zsw1 & 0x0400
    bench.run(300)
    assert bench.zsw1 & 0x0400
    bench.send(2, NSOLL_A=500)
    assert bench.speed > 900
    assert bench.zsw1 & 0x0400, "exceeded"
    bench.send(2, NSOLL_A=-500 & 0xFFFF)
    assert not bench.zsw1 & 0x0400, "the other direction"


def test_bit_7_and_bit_3_show_warnings_and_faults() -> None:
    bench = ready()
    assert bench.zsw1 & 0x0088 == 0
    push(bench, CMD_RAISE_WARNING, "20-1")
    assert bench.zsw1 & 0x0088 == 0x0080
    push(bench, CMD_RAISE_FAULT, "4-1")
    assert bench.zsw1 & 0x0088 == 0x0088


def test_bit_14_goes_with_the_safe_stop() -> None:
    bench = ready()
    push(bench, CMD_HOLD_FAULT, "sto")
    assert not bench.zsw1 & 0x4000
    bench.store.handle.push_command(CMD_RELEASE_FAULT, bench.model.fault("sto").number)
    bench.run(1)
    assert bench.zsw1 & 0x4000


# status words in the profile's mode: tables 10.16 and 10.17


@pytest.mark.parametrize("telegram", [2, 3, 5])
def test_bits_9_to_15_in_the_profiles_mode(telegram: int) -> None:
    bench = MsdBench(telegram)
    assert bench.send(1, STW1=0x0400) & 0xFE00 == 0x0200, "9 is always 1, 10 asks for a motor that turns"
    bench.enable(NSOLL_B=0x40000000 // 10)
    bench.run(100)
    assert bench.speed == pytest.approx(300, abs=1)
    assert bench.zsw1 & 0xFE00 == 0x0600
    bench.send(1, NSOLL_B=0x40000000 // 5)
    assert bench.zsw1 & 0x0400 == 0


def test_only_the_control_word_interface_of_p_1258_is_the_profiles_mode() -> None:
    bench = MsdBench(105)
    for mode, profiles in ((0, False), (1, True), (2, False), (3, True)):
        bench.store.set("P-1258", mode)
        bench.send(2, STW1=READY)
        assert (bench.zsw1 & 0x4000 == 0) is profiles


@pytest.mark.parametrize(
    ("choice", "bit"),
    [((4, 10), 0x0400), ((4, 8), 0x0100), ((4, 11), 0x0800), ((4, 7), 0), ((4, 12), 0), ((5, 10), 0)],
)
def test_pulse_enable_is_the_bit_that_p_0924_names(choice: tuple[int, int], bit: int) -> None:
    """10.7: between 8 and 11."""
    bench = MsdBench(3)
    bench.store.write(924, 0, list(choice))
    bench.send(3, STW1=READY)
    assert bench.zsw2 == 0
    bench.enable()
    assert bench.zsw2 == bit


# status word 2: table 10.9


def test_bits_0_and_1_are_what_the_profile_generator_does() -> None:
    bench = MsdBench(1, 0x0001, P_1278=10, P_1279=20)
    bench.enable()
    assert bench.zsw2 & 0x3 == 0
    bench.send(20, NSOLL_A=SPEED)
    assert bench.zsw2 & 0x3 == 1
    bench.run(3000)
    assert bench.zsw2 & 0x3 == 2
    bench.send(20, NSOLL_A=100)
    assert bench.zsw2 & 0x3 == 3
    bench.send(20, NSOLL_A=-2000 & 0xFFFF)
    assert bench.zsw2 & 0x3 == 3
    bench.until(lambda: bench.speed < -200)
    assert bench.zsw2 & 0x3 == 1
    bench.send(5000, NSOLL_A=0)
    assert bench.zsw2 & 0x3 == 0


def test_bits_2_and_3_are_the_torque_limits() -> None:
    bench = running()
    assert bench.zsw2 & 0xC == 0
    bench.send(5, NSOLL_A=2500)
    assert bench.zsw2 & 0xC == 0x4
    bench.send(5, NSOLL_A=-2500 & 0xFFFF)
    assert bench.zsw2 & 0xC == 0x8
    bench.send(1, STW1=RUN & ~0x0002)
    assert bench.zsw2 & 0xC == 0


def test_bits_4_to_7_are_the_inputs_isd00_to_isd03_and_all_are_in_p_0121() -> None:
    bench = ready()
    bench.axis.machine.settings.fault_inputs = 0x0065
    bench.run(1)
    assert bench.zsw2 == 0x0050
    assert bench.see("E_DIGITAL") == bench.store.get("P-0121") == 0x0065
    other = MsdBench(3)
    other.axis.machine.settings.fault_inputs = 0x000F
    other.run(1)
    assert other.zsw2 == 0, "table 10.17"


# 8.3.2


def test_the_sign_of_life_counts_without_control_by_the_plc_too() -> None:
    """The note behind figure 8.5: also if bit 10 of STW1 is not set."""
    bench = MsdBench(3, P_0925=4)
    count = 0
    for _ in range(20):
        count = 1 + count % 15
        bench.send(1, STW1=0, STW2=count << 12)
    assert bench.store.get("P-1296") == 0
    bench.run(3)
    assert (bench.store.get("P-1296"), bench.faults()) == (30, [])
    bench.run(2)
    assert bench.faults() == ["32-3"]


def test_table_10_5_bits_0_to_11_of_stw2_are_not_used() -> None:
    bench = MsdBench(2)
    bench.enable()
    before = {
        name: int(AXIS.read(bench.axis, name))
        for name in ("drive.state", "profidrive.stw1", "drive.stop", "positioning.state")
    }
    bench.send(20, STW2=0x0FFF)
    assert before == {name: int(AXIS.read(bench.axis, name)) for name in before}
    assert bench.zsw2 == 0x0400
