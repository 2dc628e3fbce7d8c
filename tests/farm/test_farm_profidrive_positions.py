"""Telegram 111 of the drive that is the profile alone: blocks, set-up mode, jogging, homing and limits by its words."""

from __future__ import annotations

import pytest
from hand_plc import HandPlc
from profidrive_plc import ACKNOWLEDGED, FULL, MOVE, REACHED, TASK

MDI, ABSOLUTE, SET_UP, CONTINUOUS = 0x8000, 0x0100, 0x4000, 0x1000
FORWARDS, BACKWARDS = 0x0200, 0x0400
INCREMENTAL, FLYING, HOME_BACKWARDS, PROBE_2, FALLING = 0x0020, 0x0100, 0x0200, 0x0400, 0x0800
SOFTWARE_LIMITS, SWITCHES = 0x4000, 0x8000
#: 30 rpm, of one revolution of 10000 length units.
SLOW = 300
HOMED = 0x0800
TURN = 10_000


def positioner(**options: str) -> HandPlc:
    """In operation, with an override of 100 % and full ramps; the encoder is absolute, and its zero the axis' place."""
    plc = HandPlc("profidrive", 111, **options)
    plc.put(OVERRIDE=FULL, MDI_VELOCITY=SLOW, MDI_ACC=FULL, MDI_DEC=FULL)
    plc.switch_on(operation=TASK)
    return plc


def start(plc: HandPlc, **words: int) -> bool:
    """Whether the task of the words begins: the handshake of STW1.6 and ZSW1.12."""
    plc.put(**words)
    acknowledged = bool(plc.put(STW1=MOVE) & ACKNOWLEDGED)
    plc.put(STW1=TASK)
    return acknowledged


def test_a_traversing_block_runs_by_its_number_and_the_status_word_shows_it():
    tasks = "[{number: 5, position: 1.0, velocity: 120, acceleration: 6000}]"
    plc = positioner(tasks=tasks)
    assert start(plc, POS_STW1=5)
    assert plc["POS_ZSW1"] == 0x2005
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    assert plc["XIST_A"] == pytest.approx(TURN, abs=20)
    assert plc["POS_ZSW1"] == 0
    assert not start(plc, POS_STW1=6), "there is no block 6"


@pytest.mark.parametrize(("way", "rpm"), [(FORWARDS, 30.0), (BACKWARDS, -30.0)])
def test_set_up_mode_holds_a_speed_in_the_direction_of_its_bits_until_it_is_rejected(way: int, rpm: float):
    plc = positioner()
    assert start(plc, POS_STW1=MDI | ABSOLUTE | SET_UP | way)
    plc.wait(1000)
    assert plc["POS_ZSW1"] == 0xC000
    assert plc.axis.motor.velocity == pytest.approx(rpm, abs=1.0)
    plc.put(STW1=TASK & ~0x0010, wait=500)
    assert plc.axis.motor.velocity == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("ways", [0, FORWARDS | BACKWARDS])
def test_set_up_mode_does_not_begin_without_one_direction(ways: int):
    assert not start(positioner(), POS_STW1=MDI | SET_UP | ways)


def test_a_running_task_takes_a_change_without_an_edge_only_with_continuous_transfer():
    plc = positioner()
    assert start(plc, POS_STW1=MDI | ABSOLUTE, MDI_TARPOS=2 * TURN)
    plc.put(MDI_TARPOS=TURN, wait=50)
    assert plc.axis.profile.target - plc.axis.homing.origin == pytest.approx(2.0)
    plc.put(POS_STW1=MDI | ABSOLUTE | CONTINUOUS)
    plc.put(MDI_TARPOS=TURN // 2, MDI_VELOCITY=2 * SLOW)
    plc.wait_for(lambda: bool(plc["ZSW1"] & REACHED))
    assert plc["XIST_A"] == pytest.approx(TURN // 2, abs=20)
    plc.put(MDI_TARPOS=0, wait=500)
    assert plc["XIST_A"] == pytest.approx(TURN // 2, abs=20), "once it is over, only an edge begins one"


def test_continuous_transfer_turns_set_up_mode_round():
    plc = positioner()
    assert start(plc, POS_STW1=MDI | SET_UP | CONTINUOUS | FORWARDS)
    plc.put(POS_STW1=MDI | SET_UP | CONTINUOUS | BACKWARDS, MDI_VELOCITY=2 * SLOW, wait=1000)
    assert plc.axis.motor.velocity == pytest.approx(-60.0, abs=1.0)


@pytest.mark.parametrize(("bit", "place"), [(0x0100, -1000), (0x0200, 1000)])
def test_jogging_by_a_distance_ends_there_and_goes_on_only_with_another_edge(bit: int, place: int):
    plc = positioner()
    plc.put(POS_STW2=INCREMENTAL)
    for times in (1, 2):
        plc.put(STW1=TASK | bit)
        assert plc["POS_ZSW1"] == 0x0400
        plc.wait(1000)
        assert plc["XIST_A"] == pytest.approx(times * place, abs=20)
        plc.put(STW1=TASK, wait=20)
    plc.put(POS_STW2=0)
    plc.put(STW1=TASK | bit, wait=1000)
    assert abs(plc["XIST_A"] - 2 * place) > 2 * abs(place), "without the bit the jog is one of speed"


@pytest.mark.parametrize(("word", "way"), [(0, 1), (HOME_BACKWARDS, -1)])
def test_homing_begins_in_the_direction_of_its_bit(word: int, way: int):
    plc = positioner()
    plc.put(STW1=TASK | 0x0800, POS_STW2=word, wait=100)
    assert plc["POS_ZSW1"] == 0x0800
    assert plc.axis.motor.velocity * way > 1.0
    plc.wait_for(lambda: bool(plc["ZSW1"] & HOMED and plc["ZSW1"] & REACHED))
    plc.put(STW1=TASK)


@pytest.mark.parametrize(("choice", "number", "falls"), [(0, 0, False), (PROBE_2, 1, False), (FALLING, 0, True)])
def test_homing_on_the_fly_takes_the_place_of_the_probes_edge_while_the_axis_moves(choice, number, falls):
    plc = positioner()
    plc.put(POS_STW2=FLYING | choice)
    assert start(plc, POS_STW1=MDI | SET_UP | FORWARDS)
    plc.put(STW1=TASK | 0x0800, wait=500)
    assert plc["POS_ZSW1"] == 0xD000
    before = plc["XIST_A"]
    plc.inject("digital-input", input=number)
    plc.wait(10)
    assert bool(plc["POS_ZSW1"] & 0x1000) == falls
    if falls:
        plc.clear()
        plc.wait(10)
    assert plc["POS_ZSW1"] == 0xC000
    assert 0 < plc["XIST_A"] < before, "it counts from the edge"
    assert plc["ZSW1"] & HOMED


def test_an_edge_without_control_by_the_plc_is_not_taken_behind_it_at_another_place():
    plc = positioner()
    plc.put(POS_STW2=FLYING)
    assert start(plc, POS_STW1=MDI | SET_UP | FORWARDS)
    plc.put(STW1=TASK | 0x0800, wait=100)
    plc.put(STW1=TASK & ~0x0400 | 0x0800, wait=20)
    before = plc["XIST_A"]
    plc.inject("digital-input", input=0)
    plc.wait(200)
    plc.put(STW1=TASK | 0x0800, wait=20)
    assert plc["XIST_A"] > before
    assert plc["POS_ZSW1"] & 0x1000, "it waits for the next edge"
    plc.clear()
    plc.wait(20)
    plc.inject("digital-input", input=0)
    plc.wait(10)
    assert 0 < plc["XIST_A"] < before


def test_homing_on_the_fly_is_not_armed_without_operation():
    plc = positioner()
    plc.put(STW1=0x0406, wait=50)
    plc.put(POS_STW2=FLYING, STW1=0x0C06, wait=50)
    assert not plc["POS_ZSW1"] & 0x1000


def test_software_limits_count_where_the_controller_switches_them_on():
    plc = positioner(params="{p2580: -10000, p2581: 10000}")
    plc.put(POS_STW2=0x0002)
    plc.put(POS_STW2=SOFTWARE_LIMITS)
    assert not start(plc, POS_STW1=MDI | ABSOLUTE, MDI_TARPOS=2 * TURN)
    assert start(plc, POS_STW1=MDI | SET_UP | FORWARDS, MDI_VELOCITY=10 * SLOW)
    plc.wait(2000)
    assert plc["XIST_A"] == pytest.approx(TURN, abs=20)
    assert plc["POS_ZSW2"] == 0x0080
    plc.put(POS_STW2=0)
    assert start(plc, POS_STW1=MDI | ABSOLUTE, MDI_TARPOS=2 * TURN)


def test_a_software_limit_that_is_switched_on_ahead_of_a_running_axis_stops_it_there():
    plc = positioner(params="{p2581: 20000}")
    plc.put(POS_STW2=0x0002)
    plc.put(POS_STW2=0)
    assert start(plc, POS_STW1=MDI | SET_UP | FORWARDS, MDI_VELOCITY=10 * SLOW)
    plc.put(POS_STW2=SOFTWARE_LIMITS, wait=1000)
    assert plc["XIST_A"] == pytest.approx(2 * TURN, abs=20)
    assert plc.axis.motor.velocity == pytest.approx(0.0, abs=1.0)


def test_limit_switches_count_where_the_controller_switches_them_on():
    plc = positioner()
    assert start(plc, POS_STW1=MDI | SET_UP | FORWARDS)
    plc.inject("limit-switch", side="positive")
    plc.wait(500)
    assert plc.axis.motor.velocity == pytest.approx(30.0, abs=1.0)
    assert plc["POS_ZSW1"] == 0xC000
    plc.put(POS_STW2=SWITCHES, wait=500)
    assert plc.axis.motor.velocity == pytest.approx(0.0, abs=1.0)
    assert plc["POS_ZSW1"] & 0x0300 == 0x0200
