"""The fault history outlives the farm in the drives' non-volatile memory."""

import pytest
from virtual_line import VirtualLine

from pnfarm.drives.parameters.memory import VolatileMemory
from pnfarm.drives.profiles.profidrive.fault_buffer import fault_situations


def history(line):
    return fault_situations(line.farm.axes[0].handle.axis)


@pytest.fixture
def memory():
    return VolatileMemory()


def start(memory, **options):
    line = VirtualLine(memory=memory, **options)
    line.enable()
    return line


def trip(line, fault):
    line.farm.axes[0].raise_fault(fault, hold=False)
    line.run(1.0)
    line.enable()


def test_5_14_what_was_acknowledged_is_there_after_the_farm_started_again(memory):
    line = start(memory)
    trip(line, "502")
    trip(line, "702")
    before = line.farm.axes[0].store.read(947, 0, 64)
    assert [before[8], before[16]] == [702, 502]
    again = start(memory)
    assert again.farm.axes[0].store.read(947, 0, 64) == before
    assert again.farm.axes[0].store.read(944, 0, 1) == [0]


def test_a_drive_whose_farm_file_says_that_its_history_is_lost_starts_with_an_empty_one(memory):
    line = start(memory, behaviour="{fault-history: lost}")
    trip(line, "502")
    assert line.farm.axes[0].store.read(947, 8, 1) == [502], "it has one until then"
    again = start(memory, behaviour="{fault-history: lost}")
    assert again.farm.axes[0].store.read(947, 0, 64) == [0] * 64


def test_a_fault_that_was_active_then_is_history_after_the_start(memory):
    line = start(memory, program="{kind: constant, speed_rpm: 60}")
    line.farm.axes[0].raise_fault("502", hold=True)
    line.run(0.5)
    assert line.farm.axes[0].store.read(947, 0, 1) == [502]
    again = start(memory)
    assert again.farm.axes[0].store.read(947, 0, 9) == [0] * 8 + [502]


def test_10_9_the_moogs_error_memory_is_kept_too(memory):
    line = start(memory, model="moog-msd", cycle="1ms")
    trip(line, "3-1")
    trip(line, "21-1")
    kept = history(line)
    assert kept[:3] == [[21 | 1 << 16], [3 | 1 << 16], []]
    assert history(start(memory, model="moog-msd", cycle="1ms")) == kept


def test_what_was_cleared_stays_cleared(memory):
    line = start(memory, model="hiwin-e1", cycle="1ms", telegram=3)
    trip(line, "AL.400")
    assert any(history(line))
    line.farm.axes[0].store.write(952, 0, (0,))
    line.farm.axes[0].station.pump(line.world.now)
    line.run(0.1)
    assert not any(history(start(memory, model="hiwin-e1", cycle="1ms", telegram=3)))


def test_10_9_the_moogs_latest_error_stays_the_latest_whether_it_was_acknowledged_or_not(memory):
    line = start(memory, model="moog-msd", cycle="1ms", program="{kind: constant, speed_rpm: 60}")
    line.farm.axes[0].raise_fault("21-1", hold=True)
    line.run(0.5)
    assert history(line)[:2] == [[21 | 1 << 16], []]
    line = start(memory, model="moog-msd", cycle="1ms")
    assert history(line)[:2] == [[21 | 1 << 16], []]
    trip(line, "3-1")
    assert history(line)[:3] == [[3 | 1 << 16], [21 | 1 << 16], []]
    store = line.farm.axes[0].store
    store.set("P-0952", 0)
    line.run(0.01)
    assert store.read(949, 0, 20) == [0] * 20


def test_5_14_every_fault_of_a_situation_is_logged_counted_and_kept(memory):
    line = start(memory, program="{kind: constant, speed_rpm: 60}")
    (station,) = line.farm.axes
    for fault in ("502", "702"):
        station.raise_fault(fault, hold=True)
        line.run(0.1)
    assert [e.data["number"] for e in line.log.entries("axis-01") if e.event == "fault"] == [502, 702]
    assert station.fault_counts == {502: 1, 702: 1}
    # the farm ends without a word
    assert history(start(memory))[1] == [502, 702]


def test_deleting_the_history_keeps_the_active_situation_over_a_restart(memory):
    line = start(memory, model="hiwin-e1", telegram=3, cycle="1ms")
    trip(line, "18")
    line.farm.axes[0].raise_fault("25", hold=True)
    line.run(0.1)
    line.farm.axes[0].store.set("952", 0)
    line.farm.settle(line.farm.axes[0].station, line.world.now)
    line.run(0.1)
    assert history(line)[:3] == [[25], [], []]
    assert history(start(memory, model="hiwin-e1", telegram=3, cycle="1ms"))[:3] == [[], [25], []]


def test_952_goes_on_from_the_situations_that_the_e1_kept(memory):
    settings = {"model": "hiwin-e1", "cycle": "2ms", "telegram": 3}
    line = start(memory, **settings)
    trip(line, "15")
    trip(line, "18")
    line = start(memory, **settings)
    station = line.farm.axes[0]
    assert (station.store.read(944), station.store.read(952)) == ([0], [2])
    trip(line, "19")
    assert station.store.read(952) == [3]
    station.station.power_cycle(line.world.now)
    line.run(0.01)
    assert (station.store.read(944), station.store.read(952)) == ([0], [3])
    station.store.write(952, 0, [0])
    line.run(0.01)
    assert station.store.read(952) == [0]
