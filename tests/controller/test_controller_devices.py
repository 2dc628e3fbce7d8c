"""PLC programs of one's own and the devices of the farm: inputs and outputs by the names of their signals."""

from __future__ import annotations

import asyncio

import pytest
from cell_file import CELL, GSDML
from device_cell import CONFIGS, DRIVES, ONE, Cell

from pnfarm.controller.line import VirtualLine
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm

RIGHT = CONFIGS / "programs" / "right.py"

HEAD = "from pnfarm import AxisProgram\n\n\nclass Mine(AxisProgram):\n    def cycle(self, inputs, outputs, now):\n"
OTHERS = """  - name: weigher
    eds: eds/Example-Weigher-20261128.eds
    ip: 10.77.0.61/24
    signals:
      target: {at: 101.1.4, type: int32, unit: kg, scale: 0.001}
      status: {at: 102.1.0, type: uint16}
  - name: slave
    gsd: gsd/EXMP1D01.gsd
    address: 5
    slots: {1: 16DI, 2: 8DO}
    signals: {part_present: 1.1.0.3, clamp: 2.1.0.0}
"""
SIGNALS = "      clamp: 2.1.0.0\n      lamp: 2.1.0.1\n"


@pytest.fixture
def cell(tmp_path):
    def make(*lines: str) -> Cell:
        path = tmp_path / "mine.py"
        path.write_text(HEAD + "".join(f"        {line}\n" for line in lines))
        made = Cell(DRIVES + ONE + SIGNALS, f", program: {{python: '{path}'}}")
        made.connect()
        return made

    return make


@pytest.fixture(scope="module")
def line():
    """What a program's ``self.line`` is, where nothing runs."""
    made = Cell(DRIVES + ONE + SIGNALS, f", program: {{python: '{RIGHT}'}}")
    return made.line.programs.line


def test_a_program_sees_inputs_of_a_device_and_sets_its_outputs_by_name(cell):
    made = cell(
        'island = self.line.device("island")',
        "island.outputs.clamp = island.inputs.part_present",
        "island.outputs.lamp = island.inputs.pressure > 6.0",
    )
    assert (made.signals().get("clamp"), made.signals().get("lamp")) == (False, False)
    made.signals().set({"part_present": True, "pressure": 6.5})
    made.world.run(0.2)
    assert (made.signals().get("clamp"), made.signals().get("lamp")) == (True, True)
    made.signals().set({"part_present": False})
    made.world.run(0.2)
    assert (made.signals().get("clamp"), made.signals().get("lamp")) == (False, True)


def test_outputs_stay_until_they_are_changed_and_can_be_read(cell):
    made = cell(
        'outputs = self.line.device("island").outputs',
        'outputs["lamp"] = outputs.clamp',
        "outputs.clamp = True",
    )
    made.world.run(0.2)
    assert (made.signals().get("clamp"), made.signals().get("lamp")) == (True, True)


def test_the_axes_of_one_cycle_see_the_same_inputs_and_what_they_write_is_sent_together(cell):
    made = cell(
        'island = self.line.device("island")',
        "if self.name == 'axis-1': island.outputs.clamp = island.inputs.part_present",
        "else: island.outputs.lamp = island.inputs.part_present",
    )
    made.signals().set({"part_present": True})
    seen = []
    for _ in range(100):
        made.world.run(0.001)
        seen.append((made.signals().get("clamp"), made.signals().get("lamp")))
    assert set(seen) <= {(False, False), (True, True)}
    assert seen[-1] == (True, True)


def test_a_program_knows_whether_a_device_is_connected_and_its_data_are_good(cell):
    made = cell(
        'island = self.line.device("island")',
        'island.outputs.lamp = island.connected and island.inputs.good("pressure")',
        "self.seen = (island.connected, island.inputs.good('pressure'))",
    )
    program = made.line.programs.program("axis-1")
    made.world.run(0.1)
    assert program.seen == (True, True)
    made.farm.injections.inject({"kind": "iops-bad", "on": "island"}, made.world.now)
    made.world.run(0.2)
    assert program.seen[1] is False
    made.farm.injections.inject({"kind": "silence", "on": "island"}, made.world.now)
    made.world.run(1.0)
    assert program.seen[0] is False


@pytest.mark.parametrize(
    ("act", "error", "sentence"),
    [
        (lambda line: line.device("iland"), KeyError, "the controller has no device 'iland', did you mean island?"),
        (lambda line: line.device("axis-1"), KeyError, "the controller has no device 'axis-1'"),
        (lambda line: line.device("island").inputs.presure, AttributeError, "no signal 'presure' in this direction"),
        (lambda line: line.device("island").inputs.clamp, AttributeError, "island has no signal 'clamp'"),
        (lambda line: line.device("island").inputs["x"], KeyError, "island has no signal 'x' in this direction"),
        (lambda line: setattr(line.device("island").outputs, "pressure", 1), AttributeError, "no signal 'pressure'"),
        (lambda line: setattr(line.device("island").inputs, "pressure", 1), AttributeError, "comes from the device"),
        (lambda line: setattr(line.device("island").outputs, "clamp", "maybe"), ValueError, "clamp: 'maybe' is not"),
        (lambda line: setattr(line.device("island").outputs, "clamp", 2), ValueError, "clamp: "),
    ],
)  # fmt: skip
def test_a_wrong_name_or_value_is_one_sentence(line, act, error, sentence):
    with pytest.raises(error) as raised:
        act(line)
    assert sentence in str(raised.value)


def test_a_wrong_name_stops_that_axis_with_the_line(cell):
    made = cell('self.line.device("island").outputs.clmp = True')
    failure = made.line.programs.snapshot("axis-1")["failure"]
    assert "mine.py:6: AttributeError: island has no signal 'clmp' in this direction, did you mean clamp?" in failure


def test_the_names_of_a_devices_signals_can_be_listed(line):
    island = line.device("island")
    assert "part_present" in island.inputs
    assert "clamp" not in island.inputs
    assert {"clamp", "lamp"} <= set(island.outputs)
    assert len(island.outputs) == len(list(island.outputs))
    assert "clamp=False" in repr(island.outputs)


def test_a_program_runs_devices_on_all_buses(tmp_path):
    path = tmp_path / "mine.py"
    lines = (
        'island, weigher, slave = (self.line.device(name) for name in ("island", "weigher", "slave"))',
        "island.outputs.clamp = slave.inputs.part_present",
        "slave.outputs.clamp = weigher.inputs.status > 0",
        "weigher.outputs.target = 2.5 if island.inputs.part_present else 0.0",
        "self.seen = [one.connected and all(one.inputs.good(name) for name in one.inputs) for one in (island, slave)]",
    )
    path.write_text(HEAD + "".join(f"        {line}\n" for line in lines))
    scanner = "ethernetip: {ip: 10.77.0.2/24, program: {kind: idle}}"
    made = Cell(DRIVES + ONE + SIGNALS + OTHERS, f", program: {{python: '{path}'}}, {scanner}")
    assert made.world.run(20, until=lambda: made.line.controllers.all_connected)
    made.signals().set({"part_present": True})
    made.signals("slave").set({"part_present": True})
    made.signals("weigher").set({"status": 1})
    made.world.run(0.5)
    assert made.line.programs.snapshot("axis-1")["failure"] == ""
    assert made.signals().get("clamp") is True
    assert made.signals("slave").get("clamp") is True
    assert made.signals("weigher").get("target") == 2.5
    assert made.line.programs.program("axis-1").seen == [True, True]


def test_a_device_whose_cycle_the_controllers_send_clock_cannot_make_is_named():
    with pytest.raises(ConfigError, match="device island: its cycle does not fit the controller's send clock: 1ms"):
        Cell(DRIVES + ONE + SIGNALS + "    cycle: 1ms\n", ", send_clock_factor: 128")


def test_a_device_of_the_farm_is_run_whatever_its_file_has_as_default(tmp_path):
    text = GSDML.read_text("utf-8")
    # a bit area may cross its octet, and a type may be one without a number
    known = '<Ref DataType="Bit" ByteOffset="1" BitOffset="0" DefaultValue="1"'
    assert text.count(known) == 1
    wide = '<Ref DataType="BitArea" ByteOffset="0" BitOffset="5" BitLength="9" DefaultValue="1"'
    (tmp_path / GSDML.name).write_text(text.replace(known, wide), "utf-8")

    async def states():
        line = await VirtualLine.create(parse_farm(CELL.replace(str(GSDML), str(tmp_path / GSDML.name))))
        try:
            running = line.world.run(5.0, until=lambda: line.controllers.all_running)
            return running, {row["name"]: row["state"] for row in line.controllers.snapshot()}
        finally:
            await line.close()

    assert asyncio.run(states()) == (True, {"axis-01": "DATA", "island-1": "DATA"})
