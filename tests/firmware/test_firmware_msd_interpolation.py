"""Positions of each cycle of the Moog MSD (10.6) where they are not as regular as they should be, on the bench."""

from __future__ import annotations

from math import cos, pi

import pytest
from msd_bench import MS, TASKS, MsdBench

from pnfarm.table.signals import XSOLL_A

START = 0x0040
REV = 65536
CYCLE = 4


def follower(**params: int) -> MsdBench:
    bench = MsdBench(8, **params)
    bench.enable(TASKS)
    bench.send(CYCLE, STW1=TASKS | START, XSOLL_A=0)
    return bench


def cycle(bench: MsdBench, number: int, *, lost: bool = False) -> list[float]:
    """One cycle of the controller, whose frame may get lost; the speed of each millisecond."""
    speeds = []
    for millisecond in range(CYCLE):
        if millisecond == 0 and not lost:
            bench.send(1, XSOLL_A=number)
        else:
            bench.run(1, frames=False)
        speeds.append(bench.speed)
    return speeds


def test_10_6_a_frame_that_is_lost_at_a_steady_speed_is_not_felt() -> None:
    """The curve behind the gap takes one cycle, as every other does."""
    bench = follower()
    speeds: list[float] = []
    for count in range(200):
        speeds += cycle(bench, round(count * 0.04 * REV), lost=count % 10 == 7 and count > 50)
    assert min(speeds[200:]) > 595
    assert max(speeds[200:]) < 605


def test_10_6_a_sine_with_lost_frames_is_followed_as_well_as_one_without() -> None:
    worst = []
    for lost in (False, True):
        bench, most = follower(), 0.0
        for count in range(500):
            wanted = 1.0 - cos(2.0 * pi * count / 250)
            # the axis is where the last set point was
            most = max(most, abs(bench.place - (1.0 - cos(2.0 * pi * max(count - 1, 0) / 250))))
            cycle(bench, round(wanted * REV), lost=lost and count % 7 == 3)
        worst.append(most)
    assert worst[1] < worst[0] + 0.003, worst


def test_10_6_a_controller_that_becomes_slower_is_followed_smoothly_again() -> None:
    """A pause that comes twice is no loss but the cycle."""
    bench = follower()
    for count in range(200):
        bench.send(1, XSOLL_A=round(count * 0.01 * REV))
    speeds: list[float] = []
    for count in range(50, 150):
        speeds += cycle(bench, round(count * 0.04 * REV))
    assert min(speeds[100:]) > 595
    assert max(speeds[100:]) < 605


@pytest.mark.parametrize("lost", [False, True])
def test_10_6_frames_that_come_early_and_late_do_not_shake_the_axis(lost: bool) -> None:
    """The connection says its cycle: positions are that far apart, whenever they come."""
    bench = follower()
    bench.axis.interpolation.settings.cycle_ns = CYCLE * MS
    speeds: list[float] = []
    early_and_late = (0, 1, -1, 1, 0, -1, -1, 0, 1)
    due = [CYCLE * (count + 1) + early_and_late[count % 9] for count in range(300)]
    count = 0
    for millisecond in range(CYCLE * 300):
        while count < len(due) and due[count] <= millisecond:
            if not lost or count % 20 != 19:
                bench.image.received[XSOLL_A] = round(count * 0.04 * REV)
                bench.image.frames += 1
            count += 1
        bench.run(1, frames=False)
        speeds.append(bench.speed)
    assert min(speeds[200:]) > 560
    assert max(speeds[200:]) < 640


@pytest.mark.parametrize("sign", [1, -1])
def test_table_8_1_xsoll_a_counts_round_at_its_32_bits_as_xist_a_does(sign: int) -> None:
    """P-0272 makes a revolution of 2^30 units, so that two of them are beyond the range."""
    bench = follower(P_0272=1 << 30)
    for count in range(1000):
        number = sign * count * (1 << 30) // 200
        cycle(bench, (number + (1 << 31)) % (1 << 32) - (1 << 31))
    cycle(bench, (number + (1 << 31)) % (1 << 32) - (1 << 31))
    bench.run(50, frames=False)
    assert bench.place == pytest.approx(sign * 999 / 200, abs=0.01)
    # the controller takes over where XIST_A says that the axis is: nothing moves
    bench.send(20, STW1=TASKS)
    bench.send(1, XSOLL_A=bench.see("XIST_A"))
    bench.send(50, STW1=TASKS | START)
    assert bench.place == pytest.approx(sign * 999 / 200, abs=0.01)
