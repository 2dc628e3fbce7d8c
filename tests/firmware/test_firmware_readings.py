"""Fields that readings of open points set, each on the bench; over the wire they are in ``tests/behaviour``."""

from __future__ import annotations

import pytest
from bench_axis import BenchAxis
from msd_bench import TASKS, MsdBench
from positioner import ACKNOWLEDGED, READY, STOPPED, Positioner

from pnfarm.firmware.axis import AXIS
from pnfarm.table import axis_readings as readings
from pnfarm.table.axis_codes import CMD_POWER_ON, CMD_RAISE_FAULT, TASK_FROM_COMMAND
from pnfarm.table.image import LOST_EXPIRED, LOST_STOP

RUN = 0x047F
JOGGING, JOG_1, JOG_2 = 0x040F, 0x0100, 0x0200
FAULT, IN_RANGE, CONTROL, REACHED = 0x0008, 0x0100, 0x0200, 0x0400
REV = 65536


def running(rpm: float = 1000.0, **fields: float) -> BenchAxis:
    bench = BenchAxis()
    for name, value in fields.items():
        AXIS.write(bench.axis, name.replace("__", "."), value)
    bench.enable(rpm)
    bench.run(400)
    assert bench.axis.motor.velocity == pytest.approx(rpm, abs=1.0)
    return bench


# words without STW1.10 and without a controller in RUN


@pytest.mark.parametrize(("reading", "state", "speed"), [(0, 4, 1000.0), (1, 1, None), (2, 2, 0.0)])
def test_a_word_without_bit_10_is_held_is_nothing_or_counts(reading, state, speed):
    bench = running(profidrive__without_control=reading)
    bench.write(RUN & ~0x0401, 0.0, run=500)
    assert bench.axis.drive.state == state
    if speed is not None:
        assert bench.axis.motor.velocity == pytest.approx(speed, abs=1.0)


def test_an_acknowledgement_needs_its_edge_together_with_bit_10():
    bench = BenchAxis()
    bench.command(CMD_RAISE_FAULT, 502)
    assert bench.write(0x0080) & FAULT
    assert bench.write(0x0480) & FAULT, "the edge was before"
    bench.write(0x0400)
    assert not bench.write(0x0480) & FAULT


@pytest.mark.parametrize(("reading", "state"), [(0, 1), (1, 5), (2, 4)])
def test_a_controller_in_stop_coasts_stops_or_holds_the_axis(reading, state):
    bench = running(profidrive__without_run=reading)
    bench.lose(LOST_STOP)
    assert bench.axis.drive.state == state
    bench.run(500)
    assert bench.axis.drive.state == {5: 2}.get(state, state)
    if reading == readings.WITHOUT_RUN_HOLD:
        assert bench.axis.motor.velocity == pytest.approx(1000.0, abs=1.0)


@pytest.mark.parametrize("reading", [0, 1, 2])
def test_a_lost_connection_holds_nothing_whatever_the_reading_of_stop(reading):
    bench = running(profidrive__without_run=reading, faults__loss_fault=0)
    bench.lose(LOST_EXPIRED)
    assert bench.axis.drive.state == 1


@pytest.mark.parametrize("reading", [readings.WITHOUT_RUN_OFF, readings.WITHOUT_RUN_HOLD])
def test_a_connection_that_is_lost_behind_a_stop_stops_the_axis_as_its_fault_says(reading):
    bench = running(profidrive__without_run=reading)
    bench.lose(LOST_STOP)
    bench.run(20)
    bench.lose(LOST_EXPIRED)
    assert bench.zsw1 & FAULT
    assert bench.axis.drive.state == 5, "not coasting: the fault has a controlled stop"
    bench.run(500)
    assert bench.axis.drive.state == 1


def test_a_drive_in_its_ramp_stop_takes_its_controller_up_again():
    bench = running(profidrive__without_run=readings.WITHOUT_RUN_OFF)
    bench.lose(LOST_STOP)
    bench.write(RUN, 1000.0, run=300)
    assert bench.axis.drive.state == 4
    assert bench.axis.motor.velocity == pytest.approx(1000.0, abs=1.0)


# states


def test_bit_3_leads_to_s3_as_bit_0_does_and_both_lead_to_s4():
    bench = BenchAxis()
    bench.axis.drive.settings.on_by_enable = 1
    walk = [bench.write(word, run=3) & 0x7 for word in (0x0406, 0x040E, 0x040F, 0x0407, 0x0406)]
    assert walk == [0x1, 0x3, 0x7, 0x3, 0x1]


@pytest.mark.parametrize(("reading", "state"), [(0, 5), (1, 2)])
def test_off_in_operation_stops_along_its_ramp_or_not(reading, state):
    bench = running(drive__off_at_once=reading)
    bench.write(RUN & ~0x0001, 1000.0, run=5)
    assert bench.axis.drive.state == state


@pytest.mark.parametrize(("reading", "left"), [(0, True), (1, False)])
def test_bit_7_that_is_held_acknowledges_what_comes_or_not(reading, left):
    bench = BenchAxis()
    bench.axis.profidrive.settings.acknowledges_by_level = reading
    bench.write(0x0480)
    bench.command(CMD_RAISE_FAULT, 502)
    assert bool(bench.write(0x0480, run=3) & FAULT) is left


def test_bit_9_shows_bit_10_or_that_the_drive_asks_for_control():
    bench = BenchAxis()
    assert bench.write(0x0006) & CONTROL
    bench.axis.profidrive.settings.control_shown = 1
    assert not bench.write(0x0006) & CONTROL
    assert bench.write(0x0406) & CONTROL
    bench.lose(LOST_EXPIRED)
    assert not bench.zsw1 & CONTROL


def test_history_and_home_position_go_or_stay_with_the_power():
    bench = Positioner()
    for kept in (0, 1):
        bench.axis.faults.settings.history_lost, bench.axis.homing.settings.stays = 1 - kept, kept
        bench.axis.homing.homed = 1
        bench.command(CMD_RAISE_FAULT, 502)
        bench.run(1)
        bench.command(CMD_POWER_ON)
        bench.run(1)
        assert bool(bench.axis.faults.buffer[8]) is bool(kept)
        assert bench.axis.homing.homed == kept


# speed control


@pytest.mark.parametrize(("reading", "frozen", "steady"), [(0, True, True), (1, False, True), (2, False, False)])
def test_zsw1_8_compares_with_the_ramp_with_the_set_point_or_with_nothing(reading, frozen, steady):
    bench = running(profidrive__speed_error_bit=reading)
    bench.write(RUN & ~0x0020, 1000.0)
    assert bool(bench.write(RUN & ~0x0020, 2000.0, run=50) & IN_RANGE) is frozen
    assert bool(bench.write(RUN, 2000.0, run=500) & IN_RANGE) is steady


@pytest.mark.parametrize(("reading", "beyond"), [(0, False), (1, True), (2, False)])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_zsw1_10_is_set_beyond_the_set_point_or_not(reading, beyond, way):
    bench = running(1000.0 * way, profidrive__speed_reached_bit=reading)
    assert bool(bench.zsw1 & REACHED) is (reading != readings.SPEED_BIT_ZERO)
    assert bool(bench.write(RUN, 500.0 * way, run=20) & REACHED) is beyond


@pytest.mark.parametrize(("reading", "speed"), [(0, 900.0), (1, 0.0)])
def test_without_bit_4_the_set_point_falls_along_the_ramp_or_at_once(reading, speed):
    bench = running(ramp__off_at_once=reading)
    bench.write(RUN & ~0x0010, 1000.0, run=20)
    assert bench.axis.ramp.command == pytest.approx(speed, abs=15.0)


# jogging


def jogging(**fields: float) -> BenchAxis:
    bench = BenchAxis()
    for name, value in fields.items():
        AXIS.write(bench.axis, name.replace("__", "."), value)
    bench.enable()
    bench.write(JOGGING, run=5)
    return bench


@pytest.mark.parametrize(
    ("reading", "behind_1", "behind_2", "from_rest"),
    [(0, 0.0, 0.0, 0.0), (1, 100.0, 100.0, 100.0), (2, 100.0, -50.0, 0.0)],
)
def test_both_jog_bits_stop_take_the_first_speed_or_keep_the_first_bit(reading, behind_1, behind_2, from_rest):
    bench = jogging(jog__both_bits=reading)
    for first, speed in ((JOG_1, behind_1), (JOG_2, behind_2), (0, from_rest)):
        bench.write(JOGGING | first, run=300)
        bench.write(JOGGING | JOG_1 | JOG_2, run=300)
        assert bench.axis.motor.velocity == pytest.approx(speed, abs=0.5)
        bench.write(JOGGING, run=300)


@pytest.mark.parametrize(("reading", "speed"), [(0, 0.0), (1, 100.0)])
def test_bits_4_to_6_end_a_jog_that_has_begun_or_not_and_never_let_one_begin(reading, speed):
    bench = jogging(jog__begun_lasts=reading)
    bench.write(JOGGING | JOG_1, run=300)
    bench.write(RUN | JOG_1, run=300)
    assert bench.axis.motor.velocity == pytest.approx(speed, abs=0.5)
    bench.write(RUN, run=300)
    bench.write(RUN | JOG_1, run=300)
    assert bench.axis.motor.velocity == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize(("reading", "speed"), [(0, 100.0), (1, 0.0)])
def test_a_sequence_outlives_the_bit_that_began_it_or_ends_until_both_bits_are_gone(reading, speed):
    bench = MsdBench(P_1268=100, P_1269=50)
    bench.axis.jog.settings.needs_its_bit = reading
    bench.enable(JOGGING)
    for word in (JOG_1, JOG_1 | JOG_2, JOG_1, JOG_2):
        bench.send(300, STW1=JOGGING | word)
    assert bench.speed == pytest.approx(speed, abs=0.5)
    bench.send(300, STW1=JOGGING)
    bench.send(300, STW1=JOGGING | JOG_2)
    assert bench.speed == pytest.approx(-100.0, abs=0.5), "the other direction, from rest"


# position mode


def test_zsw1_8_and_13_may_mean_the_contrary():
    bench = Positioner()
    assert bench.zsw1 & (IN_RANGE | STOPPED) == IN_RANGE | STOPPED
    bench.axis.profidrive.settings.following_error_bit = bench.axis.profidrive.settings.moving_bit = 1
    bench.run(1)
    assert bench.zsw1 & (IN_RANGE | STOPPED) == 0
    bench.move(5.0)
    bench.run(50)
    assert bench.zsw1 & STOPPED


@pytest.mark.parametrize(("base", "end"), [(0, 6.0), (TASK_FROM_COMMAND, None)])
def test_a_relative_task_counts_from_the_last_target_or_from_here(base, end):
    bench = Positioner()
    bench.axis.asked.settings.relative_base = base
    bench.move(5.0)
    bench.run(200)
    here = float(bench.axis.profile.position)
    bench.move(1.0, relative=True)
    bench.run(3000)
    assert bench.axis.motor.position == pytest.approx(here + 1.0 if end is None else end, abs=0.02)


@pytest.mark.parametrize(("reading", "taken"), [(0, True), (1, False)])
def test_an_edge_that_comes_with_bit_5_begins_its_task_or_is_lost(reading, taken):
    bench = Positioner()
    bench.axis.positioning.settings.resume_first = reading
    bench.move(5.0)
    bench.stw(READY & ~0x0020, 300)
    bench.data(2.0)
    assert bool(bench.stw(READY | 0x0040) & ACKNOWLEDGED) is taken
    bench.stw(READY, 3000)
    assert bench.axis.motor.position == pytest.approx(2.0 if taken else 5.0, abs=0.01)


@pytest.mark.parametrize(("reading", "runs"), [(0, True), (1, False)])
def test_positions_lead_an_axis_whose_bit_6_was_set_before_or_not(reading, runs):
    bench = MsdBench(telegram=8)
    bench.axis.positioning.settings.interpolation_by_edge = reading
    bench.enable(TASKS | 0x0040)
    for place in range(50):
        bench.send(1, XSOLL_A=round(place * 0.002 * REV))
    assert (bench.place > 0.05) is runs
    bench.send(2, STW1=TASKS)
    bench.send(2, STW1=TASKS | 0x0040)
    start = bench.place
    for place in range(50):
        bench.send(1, XSOLL_A=round((start + place * 0.002) * REV))
    assert bench.place > start + 0.05


@pytest.mark.parametrize(("reading", "failed"), [(0, True), (1, False)])
def test_a_controllers_sign_of_life_is_watched_or_the_drives_own_counts_alone(reading, failed):
    bench = MsdBench(telegram=3, P_0925=2)
    bench.axis.life.settings.isochronous = reading
    for count in range(40):
        bench.send(1, STW1=0x0400, STW2=(1 + count % 15) << 12)
    counted = int(bench.axis.life.sent)
    bench.send(40)
    assert bool(bench.faults()) is failed
    assert int(bench.axis.life.sent) == 1 + (counted + 40 - 1) % 15
