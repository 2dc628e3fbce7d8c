"""Faults on the signals of devices: what the controller gets of an input that is written."""

from __future__ import annotations

from itertools import pairwise

import pytest
from device_cell import DRIVES, ONE, Cell

from pnfarm.faults.errors import InjectionError


def connected():
    cell = Cell(ONE)
    cell.connect()
    return cell


def inject(cell, kind, on="island", **params):
    return cell.farm.injections.inject({"kind": kind, "on": [on], "params": params}, cell.world.now)


def clear(cell, injection):
    cell.farm.injections.clear(injection.id, cell.world.now)
    cell.world.run(0.1)


def write(cell, **values):
    cell.signals().set(values)
    cell.world.run(0.1)


def part(cell):
    """The bit part_present, as the controller has it."""
    return bool(cell.plc.plain["island"][1].read()[0] & 8)


def pressure(cell):
    return int.from_bytes(cell.plc.plain["island"][1].read()[2:4], "big", signed=True) / 100


def test_a_stuck_input_stays_as_it_is_and_what_was_written_arrives_when_it_ends():
    cell = connected()
    write(cell, part_present=True)
    stuck = inject(cell, "signal-stuck", signal="part_present")
    write(cell, part_present=False, slot1_input_0=True)
    assert part(cell)
    assert cell.signals().get("part_present") is True
    assert cell.plc.plain["island"][1].read()[0] & 1, "its neighbour changes"
    clear(cell, stuck)
    assert not part(cell)
    assert cell.farm.injections.get(stuck.id).as_dict()["evidence"]["confirmed"]


def test_an_input_is_forced_to_a_value_of_its_type():
    cell = connected()
    write(cell, pressure=1.25)
    forced = inject(cell, "signal-stuck", signal="pressure", value=7.5)
    cell.world.run(0.1)
    assert pressure(cell) == 7.5
    write(cell, pressure=2)
    assert pressure(cell) == 7.5
    clear(cell, forced)
    assert pressure(cell) == 2
    with pytest.raises(InjectionError, match=r"params\.value"):
        inject(cell, "signal-stuck", signal="pressure", value=900)


def test_an_inverted_bit_is_the_opposite_of_what_is_written():
    cell = connected()
    inverted = inject(cell, "signal-invert", signal="part_present")
    cell.world.run(0.1)
    assert part(cell)
    write(cell, part_present=True)
    assert not part(cell)
    clear(cell, inverted)
    assert part(cell)
    with pytest.raises(InjectionError, match="pressure is of type int16; allowed: a signal of type bool"):
        inject(cell, "signal-invert", signal="pressure")


def test_a_delayed_input_changes_so_much_later_and_loses_no_change():
    cell = connected()
    inject(cell, "signal-delay", signal="pressure", delay="300ms")
    write(cell, pressure=1)
    write(cell, pressure=2)
    assert pressure(cell) == 0
    cell.world.run(0.15)
    assert pressure(cell) == 1
    cell.world.run(0.1)
    assert pressure(cell) == 2
    with pytest.raises(InjectionError, match="above 1min"):
        inject(cell, "signal-delay", signal="pressure", delay="2min")


def test_a_delay_delays_what_an_earlier_fault_makes_of_the_input():
    cell = connected()
    inject(cell, "signal-invert", signal="part_present")
    cell.world.run(0.1)
    inject(cell, "signal-delay", signal="part_present", delay="200ms")
    cell.world.run(0.1)
    assert part(cell), "inverted, as before the delay"
    write(cell, part_present=True)
    assert part(cell)
    cell.world.run(0.2)
    assert not part(cell)


def test_a_flickering_input_changes_to_and_fro_around_what_is_written():
    cell = connected()
    flicker = inject(cell, "signal-flicker", signal="part_present", period="200ms")
    states = []
    for _ in range(20):
        cell.world.run(0.05)
        states.append(part(cell))
    changes = sum(one != other for one, other in pairwise(states))
    assert 8 <= changes <= 10
    assert cell.farm.injections.get(flicker.id).as_dict()["evidence"]["activations"] >= 5
    clear(cell, flicker)
    assert not part(cell)
    with pytest.raises(InjectionError, match="below 10ms"):
        inject(cell, "signal-flicker", signal="part_present", period="2ms")


def test_faults_on_one_input_build_on_each_other_and_end_in_any_order():
    cell = connected()
    inverted = inject(cell, "signal-invert", signal="part_present")
    stuck = inject(cell, "signal-stuck", signal="part_present")
    write(cell, part_present=True)
    assert part(cell), "stuck at the inverted value"
    clear(cell, inverted)
    assert part(cell)
    write(cell, part_present=False)
    assert part(cell)
    clear(cell, stuck)
    assert not part(cell)


def test_a_signal_that_cannot_be_hit_is_refused_with_the_reason():
    cell = connected()
    for signal, why in (
        ("part_presnt", "part_presnt is not a signal, did you mean part_present"),
        ("slot2_output_0", "slot2_output_0 is an output, which the controller writes"),
    ):
        with pytest.raises(InjectionError, match=why):
            inject(cell, "signal-stuck", signal=signal)
    with pytest.raises(InjectionError, match=r"params\.signal: is missing"):
        inject(cell, "signal-stuck")
    assert not cell.farm.injections.active()


def test_a_drive_has_no_signals_that_could_be_hit():
    cell = Cell(DRIVES + ONE)
    with pytest.raises(InjectionError, match="axis-1 has no signals, which signal-invert needs"):
        inject(cell, "signal-invert", on="axis-1", signal="part_present")
