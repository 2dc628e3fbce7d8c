"""The cyclic parameter channel from the master's words to the drive's parameters and back, over real frames.

Sections are those of the Moog MSD manual.
"""

from __future__ import annotations

import pytest
from alone import run_alone
from virtual_line import VirtualLine

from pnfarm.drives.profiles.profidrive.pkw import NO_TASK, Pkw
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.errors import RtaError
from pnfarm.table.signals import PKW_HEAD, PKW_VALUE, STW1, XIST_A, ZSW1

CYCLE = 0.002


def line_of(telegram: int = 102, **options) -> VirtualLine:
    line = VirtualLine(model="moog-msd", telegram=telegram, cycle="2ms", **options)
    line.connect()
    return line


def ask(line: VirtualLine, task: Pkw, cycles: int = 3) -> Pkw:
    line.plc.put_parameter_task("axis-01", task)
    line.run(cycles * CYCLE)
    return line.plc.parameter_answer("axis-01")


def saves(line: VirtualLine) -> int:
    return line.events("axis-01").count("parameters saved")


@pytest.mark.parametrize("telegram", [101, 102, 105, 107, 109, 112, 114, 116, 118, 120])
def test_every_telegram_with_a_parameter_channel_reads_and_writes(telegram):
    """8.2.3, table 8.10: the telegrams with a PKW channel."""
    line = line_of(telegram)
    assert line.plc.parameter_answer("axis-01") == NO_TASK
    assert ask(line, Pkw(1, 918)) == Pkw(1, 918, value=126)
    assert ask(line, Pkw(2, 918, value=7)) == Pkw(1, 918, value=7)
    assert ask(line, NO_TASK) == NO_TASK
    assert line.farm.axes[0].store.get("P-0918") == 7


def test_the_channel_maps_the_words_behind_it_while_they_are_exchanged():
    """8.2.3: P-0916 by tasks 7, element by element; what it names is in the next telegrams."""
    line = line_of(102)
    line.plc.columns.program[0].enable = 0
    (station,) = line.farm.axes
    line.run(0.1)
    assert ask(line, Pkw(7, 916, 2, value=967)) == Pkw(4, 916, 2, value=967)
    assert ask(line, Pkw(7, 916, 3, value=1276)) == Pkw(4, 916, 3, value=1276)
    assert station.store.read(916, 0, 4) == [968, 967, 1276, 0]
    line.run(0.01)
    data = station.device.channels.io_data(1, 2, False).data
    image = station.handle.image
    assert [int.from_bytes(data[n : n + 2], "big") for n in (8, 10, 12)] == [
        int(image.sent[ZSW1]) & 0xFFFF,
        int(image.received[STW1]) & 0xFFFF,
        0,  # half of a double word
    ]
    assert int(image.received[STW1]) & 0x0400
    station.handle.axis.homing.origin = -5.0
    assert ask(line, Pkw(7, 916, 4, value=1276)) == Pkw(4, 916, 4, value=1276)
    line.run(0.01)
    data = station.device.channels.io_data(1, 2, False).data
    assert int.from_bytes(data[12:16], "big") == int(image.sent[XIST_A]) == 5 * 65536


def test_task_0_takes_the_identifier_away_and_leaves_the_value_of_a_write_until_it_is_answered():
    """A telegram that is filled while task 0 is put never writes its value 0."""
    line = line_of()
    assert ask(line, Pkw(2, 918, value=9)) == Pkw(1, 918, value=9)
    image = line.plc.columns.image[0]
    line.plc.put_parameter_task("axis-01", NO_TASK)
    assert int(image.sent[PKW_HEAD]) >> 16 == 0
    assert int(image.sent[PKW_VALUE]) == 9
    assert ask(line, NO_TASK) == NO_TASK
    assert line.farm.axes[0].store.get("P-0918") == 9


def test_a_telegram_without_the_channel_takes_no_task():
    line = line_of(103)
    with pytest.raises(ConfigError, match="no parameter channel"):
        line.plc.put_parameter_task("axis-01", NO_TASK)
    with pytest.raises(ConfigError, match="no parameter channel"):
        line.plc.parameter_answer("axis-01")
    with pytest.raises(ConfigError, match="no drive"):
        line.plc.put_parameter_task("axis-77", NO_TASK)


def test_a_write_that_is_repeated_is_carried_out_once_and_again_after_task_0():
    """8.2.4: a task stays in the telegrams until its answer was seen, through many cycles."""
    line = line_of()
    store = Pkw(2, 971, value=1)
    assert ask(line, store) == Pkw(1, 971, value=1)
    line.run(1.0)
    assert saves(line) == 1
    ask(line, NO_TASK)
    ask(line, store)
    assert saves(line) == 2
    # another value is another task, without a task 0 in between
    ask(line, Pkw(2, 971, value=2))
    line.run(1.0)
    assert saves(line) == 3


def test_a_value_that_is_asked_for_stays_up_to_date():
    line = line_of()
    assert ask(line, Pkw(1, 918)).value == 126
    line.farm.axes[0].store.set("P-0918", 9)
    line.run(0.03)
    assert line.plc.parameter_answer("axis-01") == Pkw(1, 918, value=9)


def test_a_write_of_the_next_task_shows_the_answer_of_the_last_one_until_it_is_carried_out():
    """There is always one whole answer in the telegram: that of the last task, or that of the new one."""
    line = line_of()
    ask(line, Pkw(1, 1283))
    line.plc.put_parameter_task("axis-01", Pkw(2, 918, value=3))
    found = []
    for _ in range(12):
        line.run(CYCLE / 2)
        found.append(line.plc.parameter_answer("axis-01"))
    assert set(found) == {Pkw(2, 1283, value=5000), Pkw(1, 918, value=3)}
    assert found == sorted(found, key=found.index)


def test_bad_outputs_are_no_task_and_good_ones_start_it_again():
    """16: with IOPS BAD all output data are zero, so that the task that comes back is a new one."""
    line = line_of()
    store = Pkw(2, 971, value=1)
    ask(line, store)
    line.plc.columns.image[0].good = 0
    line.run(0.01)
    assert line.plc.parameter_answer("axis-01") == NO_TASK
    line.plc.columns.image[0].good = 1
    line.run(0.01)
    assert line.plc.parameter_answer("axis-01") == Pkw(1, 971, value=1)
    assert saves(line) == 2


def test_the_channel_is_dead_without_a_connection_and_forgets_its_cache():
    """8.2.4: strings wait in a cache; the next master does not find them."""
    line = line_of()
    ask(line, Pkw(11, 1293, 1, 255))
    assert ask(line, Pkw(12, 1293, 1, 255)).length == 5
    (station,) = line.farm.axes
    station.device.cm.abort_all(RtaError.DEVICE_DEACTIVATED, line.world.now)
    line.farm.settle(station.station, line.world.now)
    line.run(0.01)
    sent = station.handle.image.sent
    assert sent[PKW_HEAD] == 0
    line.plc.put_parameter_task("axis-01", Pkw(12, 1293, 1, 255))
    line.connect()
    line.run(0.02)
    assert line.plc.parameter_answer("axis-01") == Pkw(12, 0, 1, 0)


def test_a_power_cycle_leaves_a_channel_that_answers():
    line = line_of()
    ask(line, Pkw(2, 918, value=5))
    (station,) = line.farm.axes
    station.station.power_cycle(line.world.now)
    line.plc.put_parameter_task("axis-01", Pkw(1, 918))
    line.run(0.1)
    line.connect()
    line.run(0.02)
    # it was not saved
    assert line.plc.parameter_answer("axis-01") == Pkw(1, 918, value=126)


def test_a_standard_telegram_after_one_with_the_channel_answers_nothing():
    line = line_of()
    ask(line, Pkw(1, 918))
    (station,) = line.farm.axes
    station.store.plug_telegram(1)
    assert not station.handle.axis.profidrive.settings.parameter_channel
    station.store.plug_telegram(101)
    assert station.handle.axis.profidrive.settings.parameter_channel


def test_a_lost_event_of_a_task_is_repeated():
    """The engine's events are a ring; what a slow reader loses is not lost for ever."""
    line = line_of()
    image = line.farm.axes[0].handle.image
    ask(line, Pkw(1, 918))
    # as if the reader had never come to this answer
    image.parameter_answered = 0
    image.parameter_answer = 0
    line.run(0.03)
    assert line.plc.parameter_answer("axis-01") == Pkw(1, 918, value=126)


SCRIPT = """
import anyio, pnfarm, sys
from pnfarm.drives.profiles.profidrive.pkw import Pkw

async def main():
    async with pnfarm.Farm.from_file(sys.argv[1], api="off") as farm, pnfarm.Plc.from_file(sys.argv[1]) as plc:
        assert await plc.wait_connected(20)
        for task in (Pkw(1, 918), Pkw(2, 918, value=9), Pkw(1, 918), Pkw(1, 9)):
            answer = await plc.ask_parameter("axis-01", task)
            print(answer.identifier, answer.pnu, answer.value)

anyio.run(main)
"""
FILE = """
farm: words
link: {kind: veth}
drives:
  - {name: "axis-{n:02}", count: 1, model: moog-msd, ip: 10.77.0.11/24}
controller:
  ip: 10.77.0.1/24
  telegram: 101
  cycle: 2ms
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""


@pytest.mark.interop
@pytest.mark.exclusive
def test_tasks_are_answered_in_real_time(tmp_path):
    file = tmp_path / "words.pnfarm.yml"
    file.write_text(FILE)
    lines = run_alone(SCRIPT, file)
    answers = [line for line in lines if line.endswith((" 126", " 9", " 0"))]
    assert answers == ["1 918 126", "1 918 9", "1 918 9", "7 9 0"]
