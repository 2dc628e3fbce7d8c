"""``pnfarm plant``, and a plant behind drives on real interfaces."""

from __future__ import annotations

import asyncio
import json
import time
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import load_farm

CELL = Path(__file__).parents[2] / "configs" / "pick-and-place.pnfarm.yml"


def test_a_plant_is_listed_with_its_ports_and_wires(pnfarm):
    shown = pnfarm("plant", str(CELL))
    assert "gripper.extended -> island.gripper_closed" in shown.out
    assert any(line.split()[:2] == ["handling", "python"] for line in shown.out.splitlines())


def test_the_same_as_json_names_both_ends_of_each_wire(pnfarm):
    found = json.loads(pnfarm("plant", str(CELL), "--format", "json").out)
    assert {"x.place", "island.close", "handling.part_present"} <= {wire["source"] for wire in found["wires"]}
    assert [model["name"] for model in found["models"]] == ["gripper", "handling", "alarm"]


def test_a_plant_is_drawn_as_svg_with_every_model_station_and_wire(pnfarm, tmp_path):
    pnfarm("plant", str(CELL), "--svg", str(tmp_path / "cell.svg"))
    root = ET.fromstring((tmp_path / "cell.svg").read_text())
    texts = {text.text.strip() for text in root.iter() if text.text and text.text.strip()}
    assert {"gripper", "handling", "island", "x", "part_present"} <= texts
    assert sum(one.tag.endswith("path") for one in root.iter()) == 8


def test_the_built_in_models_are_listed(pnfarm):
    names = {one["name"] for one in json.loads(pnfarm("plant", "--kinds", "--format", "json").out)}
    assert {"cylinder", "conveyor", "elastic-coupling"} <= names
    lines = pnfarm("plant", "--kinds").out.splitlines()
    keys = {line.split()[0]: line for line in lines if "stiffness" in line or "ratio" in line}
    assert "  axis, stiffness" in keys["elastic-load"]
    assert "  axes, stiffness" in keys["elastic-coupling"]
    assert "  axes, ratio" in keys["rigid-coupling"]


@pytest.mark.parametrize(("arguments", "what"), [((), "give a farm file"), (("one",), "has no plant")])
def test_what_has_no_plant_is_refused_with_a_sentence(pnfarm, tmp_path, arguments, what):
    (tmp_path / "one").write_text(
        "farm: t\nlink: {kind: memory}\ndrives: [{name: x, model: akd-profinet, ip: 10.77.0.11/24}]\n"
    )
    refused = pnfarm("plant", *(str(tmp_path / one) for one in arguments))
    assert refused.code == 2
    assert what in refused.err


def test_a_plant_moves_beside_drives_on_real_interfaces(network, tmp_path):
    (tmp_path / "turns.py").write_text(
        "class Turns:\n"
        "    inputs = {'shaft': 'revolutions'}\n"
        "    outputs = {'past': bool}\n"
        "    def step(self, dt):\n"
        "        self.past = self.shaft > 1.0\n"
    )
    (tmp_path / "t.pnfarm.yml").write_text(
        "farm: turns\nlink: {kind: veth}\napi: off\n"
        "drives: [{name: x, model: akd-profinet, ip: 10.77.0.11/24, load: {friction: 0, damping: 0}}]\n"
        "plant:\n"
        "  models: [{name: turns, python: turns.py, step: 5ms}, {name: valve, kind: cylinder, time: 50ms}]\n"
        "  wires: [x.shaft_position -> turns.shaft, turns.past -> valve.extend, valve.extended -> x.limit_high]\n"
    )

    async def run() -> None:
        async with Farm(load_farm(tmp_path / "t.pnfarm.yml")) as farm:
            axis = farm.core.axes[0].handle.axis
            axis.load.settings.torque = -0.1
            until = time.monotonic() + 60.0
            while not int(axis.machine.limit_switch) & 0x2:
                assert time.monotonic() < until
                await asyncio.sleep(0.01)
            assert farm.core.plant is not None
            assert farm.core.plant.parts["turns"].signals.get("past")

    asyncio.run(run())
