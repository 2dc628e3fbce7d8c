"""How motions of the Moog MSD end when something comes between (8.3.1, 10.2, 10.3), on the bench."""

from __future__ import annotations

import pytest
from msd_bench import RUN, TASKS, MsdBench

from pnfarm.table.axis_codes import CMD_POWER_ON

JOG_1 = 0x0100
START, RELATIVE, ENDLESS = 0x0040, 0x1000, 0x4000
QUICK_STOP = 0x0004


@pytest.mark.parametrize("code", [5, 6, 7])
def test_table_10_3_a_quick_stop_that_is_taken_back_leaves_the_axis_where_it_came_to_rest(code: int) -> None:
    """Codes 5 to 7 in position control; with a tenth of the torque the axis cannot follow any ramp."""
    bench = MsdBench(9, P_1278=1000, P_1279=1000, P_2218=code, P_1286=100)
    bench.enable(TASKS)
    bench.send(2000, STW1=TASKS | ENDLESS | START, VELOCITY_A=2000)
    assert bench.speed == pytest.approx(2000, abs=20)
    stopped = (TASKS | ENDLESS | START) & ~QUICK_STOP
    bench.send(1, STW1=stopped)
    bench.until(lambda: abs(bench.speed) < 0.1)
    place = bench.place
    bench.send(500, STW1=stopped | QUICK_STOP)
    assert bench.state == 4
    assert bench.place == pytest.approx(place, abs=0.01)


@pytest.mark.parametrize("telegram", [8, 9])
def test_10_3_a_jog_in_position_control_is_held_at_the_maximum_speed(telegram: int) -> None:
    """P-1268 may be any number; the axis comes to rest when the bit goes, and not where it could not be."""
    bench = MsdBench(telegram, P_1268=10_000, P_1278=1000, P_1279=1000)
    bench.enable(TASKS)
    bench.send(1000, STW1=TASKS | JOG_1)
    assert bench.speed == pytest.approx(float(bench.axis.motor.settings.max_velocity), rel=0.01)
    assert abs(float(bench.axis.positioning.following_error)) < 0.2
    bench.send(200, STW1=TASKS)
    assert round(bench.speed) == 0


@pytest.mark.parametrize(("config", "first", "last"), [(0, 0x041F, 0x041F), (0x100, 0x040F, 0x041F)])
def test_10_3_a_frozen_ramp_generator_does_not_keep_the_speed_of_a_jog_that_is_over(
    config: int, first: int, last: int
) -> None:
    """STW1.4 = 1 and STW1.5 = 0; tables 10.10 and 10.11."""
    bench = MsdBench(1, P_1267=config, P_1268=200, P_1269=100, P_1278=1000, P_1279=1000)
    bench.enable(first)
    bench.send(200, STW1=first | JOG_1)
    assert bench.speed == pytest.approx(200, abs=1)
    bench.send(200, STW1=last)
    assert round(bench.speed) == 0


def test_8_3_1_p_1283_counts_from_the_last_telegram() -> None:
    """Data that are still held, because the connection waits longer, are no telegrams."""
    bench = MsdBench(1, P_1283=20)
    bench.enable(RUN)
    bench.run(200)
    assert bench.faults() == []
    bench.run(18, frames=False)
    assert bench.faults() == []
    bench.run(3, frames=False)
    assert bench.faults() == ["32-1"]


def test_table_10_8_bit_10_goes_when_the_shaft_is_turned_out_of_the_target() -> None:
    """A load drags the axis away while the drive coasts."""
    bench = MsdBench(9, P_1278=1000, P_1279=1000)
    bench.enable(TASKS)
    bench.send(1, STW1=TASKS | START, TARPOS_A=65536, VELOCITY_A=600)
    bench.until(lambda: bench.zsw1 & 0x2400 == 0x2400)
    bench.axis.load.settings.added_torque = 1.0
    bench.send(200, STW1=0x043D | START)
    assert abs(bench.place - 1.0) > 1.0
    assert not bench.zsw1 & 0x0400


def test_table_10_4_a_relative_task_behind_the_speed_mode_of_bit_14_counts_from_the_axis() -> None:
    """The speed mode leads to no target, whatever P-1275 was when it began."""
    bench = MsdBench(9, P_1278=1000, P_1279=1000)
    bench.enable(TASKS)
    bench.send(500, STW1=TASKS | ENDLESS | START, TARPOS_A=3 * 65536, VELOCITY_A=600)
    place = bench.place
    bench.send(2000, STW1=TASKS | RELATIVE)
    assert bench.place == pytest.approx(place + 3.0, abs=0.05)


def test_table_8_6_the_actual_driving_set_is_none_behind_a_power_cycle() -> None:
    bench = MsdBench(7, P_1277=600, P_1278=1000, P_1279=1000)
    bench.enable(TASKS)
    bench.send(1, STW1=TASKS, SATZANW=5)
    bench.send(1000, STW1=TASKS | START)
    assert bench.see("AKTSATZ") == 5
    bench.store.handle.push_command(CMD_POWER_ON)
    bench.send(200, STW1=0x0400)
    assert bench.see("AKTSATZ") == 0
