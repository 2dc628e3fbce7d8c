"""Faults on the signals of devices: what the controller gets of an input that is written."""

from itertools import pairwise

import pytest
from device_cell import CONFIGS, DRIVES, HEAD, ISLAND, ONE, Cell

from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.farm.injection_fields import fields_of
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
    with pytest.raises(InjectionError, match="is '2min'; allowed: a duration up to 60s,"):
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
    with pytest.raises(InjectionError, match="is '2ms'; allowed: a duration from 10ms"):
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


def test_a_replayed_input_follows_the_values_and_keeps_the_last():
    cell = connected()
    write(cell, pressure=1)
    replay = inject(cell, "signal-replay", signal="pressure", values="0.5:2 700ms:3.25 0.9:-1")
    seen = []
    for _ in range(100):
        cell.world.run(0.01)
        seen.append(pressure(cell))
    assert [value for value, before in zip(seen, [None, *seen], strict=False) if value != before] == [1, 2, 3.25, -1]
    # a cycle of 16 ms until it is there
    assert 0.5 <= 0.01 * seen.index(2) <= 0.54
    assert 0.7 <= 0.01 * seen.index(3.25) <= 0.74
    write(cell, pressure=4)
    assert pressure(cell) == -1
    evidence = cell.farm.injections.get(replay.id).as_dict()["evidence"]
    assert (evidence["activations"], evidence["confirmed"]) == (3, True)
    clear(cell, replay)
    assert pressure(cell) == 4


def test_a_replay_begins_again():
    cell = connected()
    inject(cell, "signal-replay", signal="part_present", values="0:on 0.1:off", every="400ms")
    states = []
    for _ in range(24):
        cell.world.run(0.05)
        states.append(part(cell))
    assert sum(now and not before for before, now in pairwise([False, *states])) == 3


@pytest.mark.parametrize(
    ("params", "why"),
    [
        ({"values": "0:1 1:x"}, "params.values: sample 2: 'x' is not a number"),
        ({"values": "0:1 1:900"}, "params.values: sample 2: 900 is outside of int16 scaled by 0.01"),
        ({"values": "0:1 0:2"}, "params.values: sample 2, '0:2', is not later than the one before"),
        ({"values": "0:1", "every": "5ms"}, "params.every: is too short"),
        ({"values": "@pressure.csv"}, "params.values: names a file, which is read where the fault is written"),
        ({}, "params.values: is missing"),
    ],
)
def test_values_that_cannot_be_replayed_are_refused(params, why):
    cell = connected()
    with pytest.raises(InjectionError) as caught:
        inject(cell, "signal-replay", signal="pressure", **params)
    assert why in str(caught.value)
    assert not cell.farm.injections.active()


def test_a_farm_file_and_python_name_a_file_of_values(tmp_path):
    (tmp_path / "trace.csv").write_text(
        "time [s],axis-01 velocity [rpm],island pressure [bar]\n-0.1,5,1.5\n0.2,6,2.5\n"
    )
    text = ONE.replace("gsdml: ", f"gsdml: {CONFIGS}/") + (
        "    impair:\n      - {kind: signal-replay, params: {signal: pressure, values: '@trace.csv#2'}}\n"
    )
    (found,) = parse_farm(HEAD + text, tmp_path / "a.pnfarm.yml").devices
    assert found.impair[0].params["values"] == "0:1.5 0.3:2.5"
    fields = fields_of("signal-replay", "island", {"signal": "pressure", "values": f"@{tmp_path}/trace.csv"})
    assert fields["params"]["values"] == "0:5 0.3:6"
    with pytest.raises(FarmFileError, match=r"trace\.csv, line 1: there is no column 'island presure") as caught:
        parse_farm(HEAD + text.replace("#2", "#island presure [bar]"), tmp_path / "a.pnfarm.yml")
    assert "did you mean island pressure [bar]?" in str(caught.value)


def diagnoses(cell):
    return {(e.slot, e.channel, e.error_type) for e in cell.device().cm.diagnosis}


def test_a_broken_wire_reads_the_lowest_value_and_is_diagnosed_until_it_ends():
    cell = connected()
    write(cell, pressure=1, part_present=True)
    for signal, read, low, channel in (("pressure", pressure, -327.68, 0), ("part_present", part, False, 3)):
        broken = inject(cell, "wire-break", signal=signal)
        cell.world.run(0.2)
        assert read(cell) == low
        slot = cell.signals().signal(signal).slot
        assert diagnoses(cell) == {(slot, channel, 6)}
        assert cell.farm.injections.get(broken.id).as_dict()["evidence"]["confirmed"]
        clear(cell, broken)
        assert not diagnoses(cell)
    assert (pressure(cell), part(cell)) == (1, True)
    broken = inject(cell, "wire-break", signal="pressure", value=20, channel=7)
    cell.world.run(0.1)
    assert (pressure(cell), diagnoses(cell)) == (20, {(3, 7, 6)})
    cell.farm.station("island").power_off(cell.world.now)
    cell.farm.station("island").power_on(cell.world.now)
    cell.connect(30.0)
    assert diagnoses(cell) == {(3, 7, 6)}, "it outlasts the supply"
    clear(cell, broken)
    assert not diagnoses(cell)


def test_a_broken_wire_has_no_diagnosis_that_the_file_does_not_have(tmp_path):
    text = (CONFIGS / ISLAND).read_text()
    begin = text.index('<SystemDefinedChannelDiagItem ErrorType="6">')
    end = text.index("</SystemDefinedChannelDiagItem>", begin) + len("</SystemDefinedChannelDiagItem>")
    (tmp_path / ISLAND.removeprefix("gsdml/")).write_text(text[:begin] + text[end:])
    cell = Cell(ONE.replace(ISLAND, str(tmp_path / ISLAND.removeprefix("gsdml/"))))
    cell.connect()
    write(cell, part_present=True)
    inject(cell, "wire-break", signal="part_present")
    cell.world.run(0.2)
    assert not part(cell)
    assert not diagnoses(cell)
