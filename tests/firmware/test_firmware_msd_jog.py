"""Jogging of the Moog MSD: tables 10.10 and 10.11, row by row, on the bench."""

from __future__ import annotations

import pytest
from msd_bench import RUN, TASKS, MsdBench

ONE, TWO = 100, 250
JOG_1, JOG_2 = 0x0100, 0x0200
#: Operation enabled, STW1.4 to 6 = 0.
BARE = 0x040F


def jogger(config: int = 0, word: int = BARE, telegram: int = 1, **params: int) -> MsdBench:
    bench = MsdBench(telegram, P_1267=config, P_1268=ONE, P_1269=TWO, P_1278=1000, P_1279=1000, **params)
    bench.enable(word)
    return bench


def play(bench: MsdBench, word: int, *bits: int) -> list[int]:
    """The speed that each pair of bits leads to."""
    speeds = []
    for pair in bits:
        bench.send(80, STW1=word | pair)
        speeds.append(round(bench.speed))
    return speeds


BOTH = JOG_1 | JOG_2


@pytest.mark.parametrize("word", [BARE, RUN])
@pytest.mark.parametrize(
    ("bits", "speeds"),
    [
        # rows 1 to 4: bit 8 first
        ((0, JOG_1), (0, ONE)),
        ((JOG_1, BOTH), (ONE, TWO)),
        ((JOG_1, BOTH, JOG_1), (ONE, TWO, ONE)),
        ((JOG_1, BOTH, JOG_2), (ONE, TWO, TWO)),
        ((JOG_1, BOTH, JOG_2, 0), (ONE, TWO, TWO, 0)),
        # rows 5 to 8: bit 9 first
        ((JOG_2,), (-ONE,)),
        ((JOG_2, BOTH), (-ONE, -TWO)),
        ((JOG_2, BOTH, JOG_2), (-ONE, -TWO, -ONE)),
        ((JOG_2, BOTH, JOG_1), (-ONE, -TWO, -TWO)),
        ((JOG_2, BOTH, JOG_1, 0), (-ONE, -TWO, -TWO, 0)),
        # both at once from rest: no row
        ((BOTH,), (0,)),
    ],
)
def test_table_10_10_the_bit_that_comes_first_says_the_direction(
    word: int, bits: tuple[int, ...], speeds: tuple[int, ...]
) -> None:
    assert play(jogger(word=word), word, *bits) == list(speeds)


def test_table_10_10_row_6_negative_parameters_turn_the_direction_again() -> None:
    bench = jogger()
    bench.store.set("P-1269", -TWO)
    assert play(bench, BARE, JOG_2, BOTH) == [-ONE, TWO]


@pytest.mark.parametrize(
    ("bits", "speeds"),
    [
        ((JOG_1,), (ONE,)),
        ((JOG_2,), (TWO,)),
        ((JOG_1, BOTH), (ONE, ONE)),
        ((JOG_2, BOTH), (TWO, TWO)),
        ((JOG_1, BOTH, JOG_2), (ONE, ONE, TWO)),
        ((BOTH,), (0,)),
        ((JOG_2, 0), (TWO, 0)),
    ],
)
def test_table_10_11_each_bit_has_a_speed_of_its_own(bits: tuple[int, ...], speeds: tuple[int, ...]) -> None:
    assert play(jogger(0x0100), BARE, *bits) == list(speeds)


@pytest.mark.parametrize("bit", [0x0010, 0x0020, 0x0040])
def test_table_10_11_bits_4_to_6_must_be_zero(bit: int) -> None:
    bench = jogger(0x0100)
    assert play(bench, BARE | bit, JOG_1) == [0]
    assert play(bench, BARE, JOG_1) == [ONE]
    play(bench, BARE | bit, JOG_1)
    assert bench.axis.jog.sequence == 0


@pytest.mark.parametrize("config", [0, 0x0100])
def test_a_jog_begins_only_at_standstill(config: int) -> None:
    bench = jogger(config)
    bench.send(100, STW1=RUN, NSOLL_A=500)
    bench.send(3, STW1=BARE | JOG_1, NSOLL_A=0)
    assert bench.axis.jog.sequence == 0
    bench.send(100)
    assert round(bench.speed) == ONE


def test_10_3_3_jogging_takes_the_ramps_of_p_1278_and_p_1279() -> None:
    bench = jogger(0)
    bench.store.set("P-1278", 1)
    bench.store.set("P-1279", 2)
    bench.send(1000, STW1=BARE | JOG_1)
    # 1 rev/s2 is 60 rpm/s
    assert bench.axis.ramp.command == pytest.approx(60.0, abs=0.2)
    bench.run(1000)
    bench.send(500, STW1=BARE)
    assert bench.axis.ramp.command == pytest.approx(40.0, abs=0.3)


def test_10_3_3_ramps_that_the_telegram_brings_count_before_them() -> None:
    bench = MsdBench(105, P_0300=2, P_0301=0, P_1268=ONE)
    bench.store.write(915, 0, [967, 1270, 1270, 1278, 1279])
    bench.enable(BARE, DRV_ACC=2, DRV_DEC=2)
    bench.send(500, STW1=BARE | JOG_1)
    assert bench.axis.ramp.command == pytest.approx(60.0, abs=0.3)


def test_10_3_3_the_speeds_may_be_process_data() -> None:
    bench = MsdBench(105, P_0300=2, P_1268=ONE, P_1269=TWO, P_1278=1000, P_1279=1000)
    bench.store.write(915, 0, [967, 1268, 1268])
    bench.enable(BARE, JOG_SPEED_1=-60)
    assert play(bench, BARE, JOG_1, BOTH) == [-60, TWO]
    bench.send(80, STW1=BARE | JOG_1, JOG_SPEED_1=30)
    assert round(bench.speed) == 30
    # without access permission the last ones hold
    bench.send(80, STW1=(BARE | JOG_1) & ~0x0400, JOG_SPEED_1=90)
    assert round(bench.speed) == 30


def test_a_fault_or_a_stop_ends_the_jog_and_a_bit_that_stays_set_starts_it_again_at_standstill() -> None:
    bench = jogger(0)
    play(bench, BARE, JOG_1)
    bench.send(60, STW1=(BARE | JOG_1) & ~0x0004)
    assert (bench.state, bench.axis.jog.sequence) == (1, 0)


@pytest.mark.parametrize(("config", "second"), [(0, -ONE), (0x0100, TWO)])
def test_10_1_the_position_controller_jogs_as_well(config: int, second: int) -> None:
    word = BARE if config else TASKS
    bench = jogger(config, word, 9)
    assert play(bench, word, JOG_1, 0, JOG_2) == [ONE, 0, second]
    bench.send(300, STW1=word)
    before = bench.place
    bench.run(50)
    assert bench.place == pytest.approx(before, abs=1e-4)
