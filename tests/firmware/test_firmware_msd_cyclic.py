"""Position control of the Moog MSD on the bench: tasks, driving sets, cyclic positions, servo control, homing."""

from __future__ import annotations

from math import cos, pi, sin

import pytest
from msd_bench import READY, TASKS, MsdBench

from pnfarm.table.axis_codes import CMD_HOLD_FAULT
from pnfarm.table.image import LOST_EXPIRED

START = 0x0040
FEED = 0x0020
KEEP = 0x0010
HOME = 0x0800
RELATIVE, AT_ONCE, ENDLESS = 0x1000, 0x2000, 0x4000
REACHED, HOMED, CONFIRMED, STATIONARY = 0x0400, 0x0800, 0x1000, 0x2000
REV = 65536


def positioner(telegram: int = 9, **params: int) -> MsdBench:
    bench = MsdBench(telegram, P_1278=100, P_1279=100, **params)
    bench.enable(TASKS, VELOCITY_A=600)
    return bench


def move(bench: MsdBench, target: float, word: int = TASKS, run: int = 1, **signals: int) -> None:
    """Toggle STW1.6 with a new target."""
    bench.bit = START - getattr(bench, "bit", 0)  # type: ignore[attr-defined]
    bench.send(run, STW1=word | bench.bit, TARPOS_A=round(target * REV), **signals)  # type: ignore[attr-defined]


def arrive(bench: MsdBench) -> int:
    return bench.until(lambda: bench.zsw1 & (REACHED | STATIONARY) == REACHED | STATIONARY)


# 10.5, figure 10.5


def test_every_edge_of_bit_6_starts_a_task_and_toggles_bit_12() -> None:
    """Table 10.4 bit 6, table 10.8 bit 12."""
    bench = positioner()
    confirmed = []
    for target in (1.0, 2.0, 0.5):
        move(bench, target)
        confirmed.append(bool(bench.zsw1 & CONFIRMED))
        arrive(bench)
        assert bench.place == pytest.approx(target, abs=0.002)
    assert confirmed == [True, False, True]


def test_p_1267_bit_6_takes_the_rising_edge_alone() -> None:
    """Table 10.6."""
    bench = positioner(P_1267=0x40)
    move(bench, 1.0)
    arrive(bench)
    move(bench, 2.0, run=200)
    assert bench.place == pytest.approx(1.0, abs=0.002)
    move(bench, 2.0)
    arrive(bench)
    assert bench.place == pytest.approx(2.0, abs=0.002)


def test_bit_13_takes_new_targets_velocities_and_ramps_over_without_an_edge() -> None:
    bench = positioner()
    word = TASKS | AT_ONCE
    bench.send(1, STW1=word, TARPOS_A=10 * REV)
    bench.run(400)
    assert bench.speed == pytest.approx(600, abs=2)
    bench.send(300, VELOCITY_A=300)
    assert bench.speed == pytest.approx(300, abs=2)
    bench.send(1, TARPOS_A=4 * REV)
    arrive(bench)
    assert bench.place == pytest.approx(4.0, abs=0.002)


def test_bit_13_a_target_that_cannot_begin_yet_waits_for_its_velocity_and_for_bit_4() -> None:
    bench = positioner()
    bench.send(5, STW1=(TASKS | AT_ONCE) & ~KEEP, VELOCITY_A=0)
    bench.send(5, TARPOS_A=3 * REV)
    bench.send(5, STW1=TASKS | AT_ONCE)
    assert not bench.zsw1 & CONFIRMED
    bench.send(150, VELOCITY_A=600)
    assert bench.speed == pytest.approx(600, abs=2)
    # a velocity of 0 is one, too
    bench.send(150, VELOCITY_A=0)
    assert round(bench.speed) == 0
    bench.send(1, VELOCITY_A=600)
    arrive(bench)
    assert bench.place == pytest.approx(3.0, abs=0.002)


def test_bit_13_a_way_that_began_takes_another_velocity_and_keeps_its_end() -> None:
    bench = positioner()
    bench.send(120, STW1=TASKS | AT_ONCE | RELATIVE, TARPOS_A=2 * REV)
    confirmed = bench.zsw1 & CONFIRMED
    bench.send(100, VELOCITY_A=300)
    assert bench.speed == pytest.approx(300, abs=2)
    arrive(bench)
    assert bench.place == pytest.approx(2.0, abs=0.002)
    assert bench.zsw1 & CONFIRMED == confirmed


def test_bit_13_what_has_begun_begins_no_second_time() -> None:
    bench = positioner()
    bench.send(50, STW1=TASKS | AT_ONCE, TARPOS_A=1 * REV)
    bench.send(150, STW1=(TASKS | AT_ONCE) & ~KEEP)
    place = bench.place
    bench.send(50, STW1=TASKS | AT_ONCE)
    assert bench.place == pytest.approx(place, abs=1e-4)


def test_bit_13_makes_the_feed_enable_mean_nothing() -> None:
    bench = positioner()
    word = (TASKS | AT_ONCE) & ~FEED
    bench.send(200, STW1=word, TARPOS_A=1 * REV)
    arrive(bench)
    assert bench.place == pytest.approx(1.0, abs=0.002)


def test_bit_12_makes_the_target_a_way() -> None:
    bench = positioner()
    for place in (1.5, 3.0):
        move(bench, 1.5, TASKS | RELATIVE)
        arrive(bench)
        assert bench.place == pytest.approx(place, abs=0.002)


def test_bit_14_runs_at_the_velocity_until_it_is_ended() -> None:
    """Table 10.4: speed mode; the velocity's sign is its direction."""
    bench = positioner()
    move(bench, 0.0, TASKS | ENDLESS, run=500, VELOCITY_A=-900)
    assert bench.speed == pytest.approx(-900, abs=2)
    assert not bench.zsw1 & REACHED
    # the feed enable pauses it
    bench.send(300, STW1=int(bench.axis.profidrive.stw1) & ~FEED)
    assert round(bench.speed) == 0
    bench.send(300, STW1=int(bench.axis.profidrive.stw1) | FEED)
    assert bench.speed == pytest.approx(-900, abs=2)
    # and the next task takes over
    move(bench, 0.0, VELOCITY_A=900)
    arrive(bench)
    assert bench.place == pytest.approx(0.0, abs=0.002)


def test_bit_14_is_set_at_a_velocity_of_0() -> None:
    bench = positioner()
    move(bench, 0.0, TASKS | ENDLESS, run=150)
    assert bench.speed == pytest.approx(600, abs=2)
    move(bench, 0.0, TASKS | ENDLESS, run=150, VELOCITY_A=0)
    assert round(bench.speed) == 0
    assert not bench.zsw1 & CONFIRMED


def test_bits_13_and_14_follow_the_velocity_alone() -> None:
    bench = positioner()
    bench.send(150, STW1=TASKS | AT_ONCE | ENDLESS)
    assert bench.speed == pytest.approx(600, abs=2)
    for speed in (0, -600, 0):
        bench.send(150, VELOCITY_A=speed)
        assert bench.speed == pytest.approx(speed, abs=2)


def test_without_feed_enable_a_task_waits_and_without_bit_4_it_is_gone() -> None:
    bench = positioner()
    move(bench, 10.0, run=300)
    bench.send(300, STW1=int(bench.axis.profidrive.stw1) & ~FEED)
    place = bench.place
    bench.run(100)
    assert bench.place == pytest.approx(place, abs=1e-4)
    bench.send(300, STW1=int(bench.axis.profidrive.stw1) | FEED)
    assert bench.place > place + 1.0
    bench.send(300, STW1=int(bench.axis.profidrive.stw1) & ~KEEP)
    assert (round(bench.speed), bench.state) == (0, 4)
    place = bench.place
    bench.send(300, STW1=int(bench.axis.profidrive.stw1) | KEEP)
    assert bench.place == pytest.approx(place, abs=1e-4)


# telegram 7: table 8.6


def test_telegram_7_goes_to_the_driving_set_that_satzanw_names() -> None:
    bench = positioner(7)
    bench.store.write(202, 0, [n * REV for n in range(16)])
    bench.store.set("P-1277", 1200)
    bit = START
    for number in (3, 15, 0):
        bench.send(1, STW1=TASKS | bit, SATZANW=number)
        assert bench.see("AKTSATZ") == number
        arrive(bench)
        assert bench.place == pytest.approx(number, abs=0.002)
        bit ^= START


def test_a_driving_set_that_is_not_there_starts_nothing() -> None:
    """8.2.1: there are 16."""
    bench = positioner(7)
    bench.store.write(202, 0, [REV] * 16)
    bench.store.set("P-1277", 1200)
    bench.send(300, STW1=TASKS | START, SATZANW=16)
    assert (bench.speed, bench.see("AKTSATZ")) == (0.0, 0)


@pytest.mark.parametrize("velocity", [1200, -1200])
def test_telegram_7_with_bit_14_runs_at_the_velocity_until_it_is_ended(velocity: int) -> None:
    """Table 10.4: speed mode, in which the driving set has no target."""
    bench = positioner(7)
    bench.store.write(202, 0, [n * REV for n in range(16)])
    bench.store.set("P-1277", 1200)
    bench.send(1, STW1=TASKS | START, SATZANW=3)
    arrive(bench)
    bench.store.set("P-1277", velocity)
    bench.send(2000, STW1=TASKS | ENDLESS, SATZANW=5)
    assert bench.speed == pytest.approx(velocity, abs=2)
    # and the next set takes over
    bench.store.set("P-1277", 1200)
    bench.send(1, STW1=TASKS | START, SATZANW=1)
    arrive(bench)
    assert bench.place == pytest.approx(1.0, abs=0.002)


def test_driving_sets_are_kept_and_their_number_is_seen_while_the_axis_rests() -> None:
    bench = positioner(7)
    bench.store.write(202, 5, [2 * REV])
    bench.store.set("P-1277", 1200)
    bench.send(1, STW1=TASKS | START, SATZANW=5)
    arrive(bench)
    bench.run(100)
    assert bench.see("AKTSATZ") == 5
    bench.store.set("P-0971", 1)
    bench.store.power_on()
    assert bench.store.read(202, 5, 1) == [2 * REV]


# 12.1


def test_homing_begins_with_the_edge_of_bit_11_and_bit_11_of_zsw1_shows_its_end() -> None:
    bench = positioner()
    bench.axis.motor.position += 0.3
    bench.axis.profile.position += 0.3
    bench.send(1, STW1=TASKS | HOME)
    assert not bench.zsw1 & HOMED
    bench.until(lambda: bench.zsw1 & HOMED, 3000)
    assert bench.axis.motor.position == pytest.approx(1.0, abs=0.002)
    assert bench.see("XIST_A") == pytest.approx(0, abs=100)


def test_a_falling_bit_11_ends_homing_that_is_not_complete() -> None:
    bench = positioner()
    bench.send(200, STW1=TASKS | HOME)
    bench.send(200, STW1=TASKS)
    place = bench.place
    bench.run(500)
    assert bench.place == pytest.approx(place, abs=1e-4)
    assert not bench.zsw1 & HOMED


def test_a_fault_ends_homing() -> None:
    bench = positioner()
    bench.send(200, STW1=TASKS | HOME)
    bench.store.handle.push_command(CMD_HOLD_FAULT, bench.model.fault("11-1").code)
    bench.until(lambda: bench.state == 1)
    assert not bench.zsw1 & HOMED


# 10.6, telegram 8: positions of each cycle


def follower() -> MsdBench:
    """Interpolation is enabled at the present position."""
    bench = positioner(8)
    bench.send(5, STW1=TASKS | START, XSOLL_A=0)
    return bench


def test_the_axis_follows_xsoll_of_each_cycle() -> None:
    bench = follower()
    worst = 0.0
    for cycle in range(2000):
        wanted = 2.0 * (1.0 - cos(2.0 * pi * cycle / 2000))
        bench.send(1, XSOLL_A=round(wanted * REV))
        worst = max(worst, abs(bench.place - wanted))
    # one cycle of delay at 6.3 rev/s, and the loops
    assert worst < 0.02
    assert bench.speed == pytest.approx(0.0, abs=20)


def test_between_frames_of_a_slow_controller_the_axis_runs_smoothly() -> None:
    """P-0370: a cubic curve through the set points, with the velocity of both ends."""
    bench = follower()
    speeds = []
    for cycle in range(600):
        if cycle % 8 == 0:
            bench.send(1, XSOLL_A=round(cycle * 0.005 * REV))
        else:
            bench.run(1, frames=False)
        if cycle > 100:
            speeds.append(bench.speed)
    assert min(speeds) > 290
    assert max(speeds) < 310


def test_without_bits_4_5_or_6_interpolation_is_off_and_the_axis_brakes() -> None:
    for bit in (START, FEED, KEEP):
        bench = follower()
        for cycle in range(300):
            bench.send(1, XSOLL_A=round(cycle * 0.01 * REV))
        assert bench.speed == pytest.approx(600, abs=10)
        bench.send(300, STW1=(TASKS | START) & ~bit)
        assert round(bench.speed) == 0
        place = bench.place
        bench.send(50, XSOLL_A=100 * REV)
        assert bench.place == pytest.approx(place, abs=1e-4)


def test_frames_that_stay_away_let_the_axis_go_on_for_one_cycle() -> None:
    bench = follower()
    for cycle in range(300):
        bench.send(1, XSOLL_A=round(cycle * 0.01 * REV))
    place = float(bench.axis.profile.position)
    bench.run(50, frames=False)
    assert bench.axis.profile.position == pytest.approx(place + 0.01, abs=0.001)


def test_without_access_permission_positions_and_deviations_stay_as_they_were() -> None:
    """Table 10.4, bit 10."""
    bench = follower()
    bench.send(50, XSOLL_A=REV // 10)
    bench.send(50, STW1=0, XSOLL_A=REV)
    assert bench.place == pytest.approx(0.1, abs=0.002)
    other = MsdBench(5)
    other.enable(KPC=GAIN)
    servo(other, 0.1)
    other.run(300, frames=False)
    other.send(100, STW1=0, XERR=2**20)
    assert other.axis.motor.position == pytest.approx(0.1, abs=0.01)


def test_p_1274_leads_the_axis_where_no_telegram_brings_it() -> None:
    """Table 10.14: reference position in the interpolating mode; table 15.1 has it and P-1275 the other way round."""
    bench = MsdBench(105, P_0300=3, P_0301=1)
    bench.enable(TASKS)
    bench.send(20, STW1=TASKS | START)
    for cycle in range(200):
        bench.store.set("P-1274", round(cycle * 0.005 * REV))
        bench.run(1)
    bench.run(50)
    assert bench.place == pytest.approx(0.995, abs=0.005)


def test_12_1_homing_is_done_by_the_profile_generator_in_the_interpolating_mode_too() -> None:
    bench = follower()
    bench.send(1, STW1=TASKS | START | HOME)
    bench.until(lambda: bench.zsw1 & HOMED, 3000)
    assert bench.axis.motor.position == pytest.approx(1.0, abs=0.002)
    # and positions lead the axis again, from the new zero
    bench.send(1, STW1=TASKS | START, XSOLL_A=0)
    for cycle in range(100):
        bench.send(1, XSOLL_A=round(cycle * 0.005 * REV))
    assert bench.place == pytest.approx(0.495, abs=0.02)


def test_12_1_p_0301_is_the_profile_generating_mode_while_homing_runs() -> None:
    bench = follower()
    assert bench.store.get("P-0301") == 1
    bench.send(1, STW1=TASKS | START | HOME)
    assert bench.store.get("P-0301") == 0
    bench.until(lambda: bench.zsw1 & HOMED, 3000)
    bench.run(5)
    assert bench.store.get("P-0301") == 1, "what was before: assumed"


def test_12_1_homing_that_is_ended_gives_the_interpolating_mode_back() -> None:
    bench = follower()
    bench.send(20, STW1=TASKS | START | HOME)
    assert bench.store.get("P-0301") == 0
    bench.send(5, STW1=TASKS | START)
    assert bench.store.get("P-0301") == 1


def test_12_1_homing_in_the_profile_generating_mode_changes_nothing() -> None:
    bench = positioner()
    assert bench.store.get("P-0301") == 0
    bench.send(5, STW1=TASKS | HOME)
    assert (bench.store.get("P-0301"), bench.axis.ramp.generator_left) == (0, 0)


def test_12_1_a_p_0301_that_is_written_counts_from_then_on() -> None:
    """With the reading that homing leaves the profile generating mode for good."""
    bench = follower()
    bench.axis.homing.settings.ends_interpolation = 1
    bench.send(1, STW1=TASKS | START | HOME)
    bench.until(lambda: bench.zsw1 & HOMED, 3000)
    bench.send(5, STW1=TASKS | START)
    assert bench.store.get("P-0301") == 0
    bench.store.set("P-0301", 1)
    assert bench.store.get("P-0301") == 1
    for cycle in range(100):
        bench.send(1, XSOLL_A=round(cycle * 0.005 * REV))
    assert bench.place == pytest.approx(0.495, abs=0.02)


# 10.8, telegram 5: dynamic servo control


GAIN = 30_000  # 1/1000 per second


def servo(bench: MsdBench, wanted: float, feed: float = 0.0, **signals: int) -> None:
    """What a controller sends: its deviation from the position of the last frame, and the feed-forward in rev/s."""
    deviation = round(wanted * 2**20) - bench.see("G1_XIST1")
    speed = round(feed * 60 / 3000 * 0x40000000)
    bench.send(1, XERR=deviation, KPC=GAIN, NSOLL_B=speed, **signals)


def test_xerr_and_kpc_close_the_position_loop_in_the_drive() -> None:
    bench = MsdBench(5)
    bench.enable(KPC=GAIN)
    worst = 0.0
    for cycle in range(2000):
        angle = 2.0 * pi * cycle / 2000
        servo(bench, 2.0 * (1.0 - cos(angle)), 2.0 * pi * sin(angle))
        worst = max(worst, abs(float(bench.axis.motor.position) - 2.0 * (1.0 - cos(angle))))
    assert worst < 0.03
    assert bench.axis.motor.position == pytest.approx(0.0, abs=0.01)


def test_the_drive_goes_on_towards_the_target_while_the_controller_is_silent() -> None:
    """The loop is the drive's: a deviation is worked off without new frames."""
    bench = MsdBench(5)
    bench.enable(KPC=GAIN)
    servo(bench, 0.1)
    bench.run(500, frames=False)
    assert bench.axis.motor.position == pytest.approx(0.1, abs=0.001)


def test_kpc_at_0_is_speed_control() -> None:
    bench = MsdBench(5)
    bench.enable(KPC=0, XERR=2**20, NSOLL_B=0x40000000 // 10)
    bench.run(200)
    assert bench.speed == pytest.approx(300, abs=1)


def test_bits_4_to_6_switch_the_set_points_of_servo_control() -> None:
    bench = MsdBench(5)
    bench.enable(KPC=0, NSOLL_B=0x40000000 // 10)
    bench.run(200)
    bench.send(300, STW1=0x043F)
    assert round(bench.speed) == 0
    bench.send(300, STW1=0x047F)
    bench.send(200, STW1=0x045F, NSOLL_B=0)
    assert bench.speed == pytest.approx(300, abs=1), "frozen"
    bench.send(300, STW1=0x046F)
    assert round(bench.speed) == 0


def test_without_valid_data_nothing_of_servo_control_is_left() -> None:
    bench = MsdBench(5)
    bench.enable(KPC=GAIN, XERR=2**20)
    bench.image.valid, bench.image.lost = 0, LOST_EXPIRED
    bench.run(2)
    assert (bench.state, float(bench.axis.interpolation.servo_gain)) == (1, 0.0)
    bench.image.received[23] = bench.image.received[24] = 0
    bench.enable(READY | 0x0009)
    bench.run(300)
    assert round(bench.speed) == 0
