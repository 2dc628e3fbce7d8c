"""A drive system on one PROFINET connection: control unit, infeed and three axes of different telegrams."""

import pytest
from axes_line import AxesLine

from pnfarm.table.channel import OPEN
from pnfarm.table.signals import ACTUAL_SLOTS, SETPOINT_SLOTS

FILE = """
farm: system
link: {kind: memory}
drives:
  - name: s
    model: profidrive
    ip: 10.77.0.12/24
    axes:
      - {name: cu, telegram: 390, slot: 2}
      - {name: infeed, telegram: 370}
      - {name: x, telegram: 111, slot: 9}
      - {name: y, telegram: 105, slot: 7}
      - {name: z, telegram: 1}
controller:
  name: plc
  ip: 10.77.0.250/24
  cycle: 2ms
  program: {kind: constant, speed_rpm: 60, acknowledge_after: 200ms}
"""
NAMES = ["s.cu", "s.infeed", "s.x", "s.y", "s.z"]
SLOTS = [2, 3, 9, 7, 8]
#: A control unit has no states.
RUNNING = [1, 4, 4, 4, 4]


@pytest.fixture
def line():
    return AxesLine(FILE).connected()


def faulty(line):
    return [bool(axis.handle.axis.faults.code[0]) for axis in line.farm.axes]


def seen(line, axis, name):
    """An actual value as the controller received it."""
    return int(line.plc.columns.image[NAMES.index(axis)].received[ACTUAL_SLOTS[name]]) & 0xFFFF


def put(line, axis, **words):
    """Set points by hand, in place of the built-in program."""
    row = NAMES.index(axis)
    line.plc.columns.program[row].active = 0
    for name, value in words.items():
        line.plc.columns.image[row].sent[SETPOINT_SLOTS[name]] = value
    line.run(0.05)


def test_one_connection_carries_control_unit_infeed_and_axes_in_the_slots_of_the_file(line):
    assert [axis.configured_name for axis in line.farm.axes] == NAMES
    assert line.states() == RUNNING
    assert line.plc.all_running
    assert len([row for row in line.farm.columns.ppm if row.active == OPEN]) == 1
    plugged = line.farm.station("s").device.cm.plugged
    telegrams = [plugged.module(slot).module_ident & 0xFFF for slot in SLOTS]
    assert telegrams == [axis.store.telegram_number for axis in line.farm.axes] == [390, 370, 111, 105, 1]


@pytest.mark.parametrize("name", NAMES)
def test_a_fault_of_each_object_is_its_own_and_is_acknowledged_alone(line, name):
    line.axis(name).raise_fault(12, hold=False)
    line.run(0.1)
    assert faulty(line) == [each == name for each in NAMES]
    others = [state for each, state in zip(NAMES, line.states(), strict=True) if each not in {name, "s.cu"}]
    assert others == [4] * len(others)
    line.run(2.0)
    assert not any(faulty(line))
    assert line.states() == RUNNING
