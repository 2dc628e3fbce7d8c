"""What docs/plant.md says of faults on wires: a stuck sensor, a delayed feedback, a broken belt, a torn wire."""

import asyncio
import re

import pytest
from farm_file import CONFIGS

from pnfarm.cli.commands.run import bound
from pnfarm.errors import ConfigError
from pnfarm.scenario.definition.file import load_scenario
from pnfarm.scenario.virtual import run_virtual

FARM = """farm: cell
link: {kind: memory}
drives:
  - {name: feeder, model: profidrive, ip: 10.77.0.11/24}
devices:
  - name: island
    gsdml: GSDML
    access_point: DAP 1
    ip: 10.77.0.41/24
    slots: {1: 16DI, 2: 8DO}
    signals: {part_present: 1.1.0.0, gripper_closed: 1.1.0.1, home: 1.1.0.2}
controller: {ip: 10.77.0.1/24, program: {kind: constant, speed_rpm: 300}}
plant:
  step: 2ms
  models:
    - {name: belt, kind: conveyor, length: 1000, part: 50, sensor_1: 400}
    - {name: gripper, kind: cylinder, time: 100ms}
    - {name: cam, kind: position-sensor, from: 0, to: 0.5, period: 1}
  wires:
    - feeder.shaft_position * 40 mm -> belt.travel
    - feeder.shaft_position -> cam.position
    - belt.at_1 -> island.part_present
    - gripper.extended -> island.gripper_closed
    - cam.on -> island.home
""".replace("GSDML", str(CONFIGS / "gsdml" / "GSDML-V2.35-Example-Island-20261127.xml"))


@pytest.fixture
def carried_out(tmp_path):
    (tmp_path / "cell.pnfarm.yml").write_text(FARM)

    def run(*steps):
        path = tmp_path / "wires.scenario.yml"
        begin = ("wait: {until: all-connected, within: 10s}", "wait: {until: state == S4 and velocity > 290}")
        path.write_text(
            "scenario: wires\nfarm: cell.pnfarm.yml\nsteps:\n" + "".join(f"  - {step}\n" for step in (*begin, *steps))
        )
        record, _ = asyncio.run(run_virtual(*bound(load_scenario(path))))
        return record

    return run


# 300 rpm are 200 mm/s: a part is at the light barrier after 2 s
def test_a_stuck_sensor_is_a_fault_on_the_devices_input(carried_out):
    record = carried_out(
        "fault: {kind: signal-stuck, on: island, params: {signal: part_present, value: 'false'}, as: sensor}",
        "set: {belt.feed: true}",
        "expect: {that: belt.at_1, within: 3s}",
        "expect: {that: not island.part_present, for: 100ms}",
        "clear: sensor",
        "expect: {that: island.part_present, within: 10ms}",
    )
    assert record["verdict"] == "passed", record["cases"]


def test_a_delayed_feedback_is_a_fault_on_the_devices_input(carried_out):
    record = carried_out(
        "fault: {kind: signal-delay, on: island, params: {signal: gripper_closed, delay: 500ms}}",
        "set: {gripper.extend: true}",
        "expect: {that: gripper.extended, within: 110ms}",
        "expect: {that: not island.gripper_closed, for: 480ms}",
        "expect: {that: island.gripper_closed, within: 40ms}",
    )
    assert record["verdict"] == "passed", record["cases"]


def test_a_broken_belt_is_a_jam_while_the_axis_turns_on(carried_out):
    record = carried_out(
        "set: {belt.feed: true}",
        "wait: 1s",
        "force: {belt.jam: true}",
        "expect: {drive: feeder, that: velocity > 290 and not belt.at_1, for: 3s}",
        "release: belt",
        "expect: {that: belt.at_1, within: 1500ms}",
    )
    assert record["verdict"] == "passed", record["cases"]


def test_a_torn_wire_is_a_force_on_the_input_at_its_end(carried_out):
    record = carried_out(
        "expect: {that: island.home, within: 300ms}",
        "expect: {that: not island.home, within: 300ms}",
        "force: {cam.position: 0.75}",
        "expect: {drive: feeder, that: velocity > 290 and not island.home, for: 2s}",
        "release: [cam.position]",
        "expect: {that: island.home, within: 300ms}",
        "force: {cam.position: 0.25}",
        "expect: {that: island.home, for: 1s}",
    )
    assert record["verdict"] == "passed", record["cases"]


def test_an_input_with_a_wire_cannot_be_set_and_an_output_not_forced(carried_out):
    record = carried_out("set: {cam.position: 1}")
    assert re.search(r"has a wire, which writes it; allowed: an input without a wire, or a force", str(record["cases"]))
    with pytest.raises(ConfigError, match=r"cam\.on: is an output"):
        carried_out("force: {cam.on: true}")
