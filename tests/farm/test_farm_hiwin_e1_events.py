"""The HIWIN E1 in position mode when something comes between: an enable that falls, a fault, a limit (3.3.2, 6)."""

from itertools import pairwise

import pytest
from e1_plc import (
    ACKNOWLEDGE,
    BOTH_TELEGRAMS,
    COUNTS,
    FOLLOWS,
    HOMED,
    JOG_BACKWARDS,
    JOG_FORWARDS,
    REACHED,
    RUN,
    START,
    STOPPED,
    TAKEN,
    E1Plc,
)

from pnfarm.engine.tick import tick

PULSES = 0x0800


@BOTH_TELEGRAMS
def test_table_3_3_2_1_bit_3_falls_in_a_task_the_pulses_go_off_and_the_task_is_gone(telegram):
    plc = E1Plc(telegram)
    plc.task(20.0)
    assert plc.go()
    plc.wait(300)
    assert plc["ZSW2"] & PULSES
    zsw1 = plc.put(STW1=RUN & ~0x0008)
    assert zsw1 & (0x0047 | STOPPED) == 0x0003
    assert not plc["ZSW2"] & PULSES
    assert plc.rpm > 300.0, "it coasts"
    plc.put(STW1=RUN)
    assert plc.bit(0x0007)
    plc.wait_for(lambda: plc.bit(STOPPED))
    place = plc.rev
    plc.wait(200)
    assert plc.rev == pytest.approx(place, abs=0.01)
    assert not plc.bit(REACHED)
    assert plc.go()
    plc.arrive()
    assert plc.rev == pytest.approx(20.0, abs=0.01)


@BOTH_TELEGRAMS
def test_table_3_3_2_1_bit_7_acknowledges_by_its_edge_and_a_later_fault_needs_another(telegram):
    plc = E1Plc(telegram)
    plc.inject("drive-fault", fault="AL.100")
    assert plc.put(STW1=RUN) & 0x004F == 0x0048
    assert plc.put(STW1=RUN | ACKNOWLEDGE) & 0x004F == 0x0040, "S1: bit 0 stands"
    plc.inject("drive-fault", fault="AL.400")
    plc.put(STW1=RUN | ACKNOWLEDGE, wait=20)
    assert plc["ZSW1"] & 0x0008, "a bit that stands is no edge"
    plc.put(STW1=RUN)
    assert not plc.put(STW1=RUN | ACKNOWLEDGE) & 0x0008
    plc.switch_on(operation=RUN)


@BOTH_TELEGRAMS
@pytest.mark.parametrize(("bit", "sign"), [(JOG_FORWARDS, 1), (JOG_BACKWARDS, -1)])
def test_6_8_and_6_2_a_jog_keeps_to_the_velocity_limit_and_the_axis_follows_it(telegram, bit, sign):
    """Pt533 may be 10000 rpm, Pt316 less."""
    plc = E1Plc(telegram, params="{Pt316: 900, Pt533: 10000}")
    plc.put(STW1=RUN | bit, wait=1000)
    assert plc.rpm == pytest.approx(sign * 900.0, abs=5.0)
    assert plc.bit(FOLLOWS)
    assert not plc["ZSW1"] & 0x0008, "no position deviation overflow"
    plc.put(STW1=RUN)
    plc.wait_for(lambda: plc.bit(STOPPED))


@BOTH_TELEGRAMS
def test_table_3_3_2_1_bits_0_to_6_at_once_enable_the_drive_and_start_nothing(telegram):
    plc = E1Plc(telegram)
    plc.task(3.0)
    plc.put(STW1=0x0406, wait=20)
    plc.put(STW1=RUN | 0x0040, wait=100)
    assert plc.bit(0x0007 | STOPPED)
    assert not plc["ZSW1"] & TAKEN
    assert plc.rev == pytest.approx(0.0, abs=0.01)


class FastPlc(E1Plc):
    """At the shortest send clock of table 2.2.1."""

    FRAME = 0.0005


@BOTH_TELEGRAMS
def test_table_2_2_1_at_500_us_the_drive_takes_an_edge_of_one_frame_and_moves_on_in_each(telegram):
    plc = FastPlc(telegram, cycle="500us")
    for target, frames in ((50.0, 7), (60.0, 7), (70.0, 401)):
        plc.task(target)
        assert plc.put(wait=1, STW1=RUN | START) & TAKEN
        assert not plc.put(wait=frames, STW1=RUN) & TAKEN
    places = []
    for _ in range(10):
        plc.wait(1)
        places.append(plc["XIST_A"])
    ways = [after - before for before, after in pairwise(places)]
    assert ways == pytest.approx([COUNTS * 10 / 2000] * 9, rel=0.01), "600 rpm"
    assert plc.axis.life.errors == 0


def test_a_tick_that_is_less_late_than_the_one_before_is_a_step_of_the_drive_all_the_same():
    """A timer wakes the engine some ten microseconds after the time, now more and now less."""
    plc = E1Plc(9)
    for milliseconds, late in ((1, 80_000), (2, 20_000)):
        now = plc.world.now + milliseconds * 1_000_000 + late
        tick(plc.farm.columns, 0, now)
        assert plc.axis.last_ns == now


def test_table_3_13_1_a_bit_that_is_held_over_a_power_cycle_sets_the_reference_point_again():
    """The drive forgot the home position, and that it saw the bit."""
    plc = E1Plc(111)
    plc.put(STW1=RUN | JOG_FORWARDS, wait=200)
    plc.put(STW1=RUN, POS_STW2=0x0002, wait=300)
    plc.inject("power-cycle", off="200ms")
    plc.run(0.5)
    plc.connect()
    plc.wait_for(lambda: plc.axis.drive.state == 1)
    plc.put(STW1=0x0400)
    assert plc.bit(HOMED)
    assert plc.rev == pytest.approx(0.0, abs=1e-6)
