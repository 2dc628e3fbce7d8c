"""Steps of models in Python and of the plant, as a scenario in virtual time sees them."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from pnfarm.cli.commands.run import bound
from pnfarm.scenario.definition.file import load_scenario
from pnfarm.scenario.virtual import run_virtual

FARM = """
farm: t
link: {kind: memory}
drives: [{name: x, model: profidrive, ip: 10.77.0.11/24}]
controller: {ip: 10.77.0.1/24}
plant:
  step: 2ms
  models:
    - {name: b, python: blink.py, step: 5ms}
    - {name: lamp, kind: lamp}
  wires: [b.on -> lamp.on]
"""

BLINK = """
class Blink:
    outputs = {"on": bool}
    count = 0

    def step(self, dt):
        self.count += 1
        self.on = self.count == 50
"""


def _took(folder: Path, condition: str) -> float:
    """Until the condition, seconds from the farm's start."""
    (folder / "blink.py").write_text(BLINK)
    (folder / "t.pnfarm.yml").write_text(FARM)
    file = folder / "t.scenario.yml"
    file.write_text(f"scenario: t\nfarm: t.pnfarm.yml\nsteps: [{{expect: {{that: {condition}, within: 1s}}}}]\n")
    record, _ = asyncio.run(run_virtual(*bound(load_scenario(file, {}))))
    (case,) = record["cases"]
    assert case["verdict"] == "passed", case
    return float(case["ended_seconds"])


@pytest.mark.parametrize("also", ["", " or lamp.lit", " and not lamp.on"])
def test_an_output_that_a_model_gives_for_one_step_is_seen_at_that_step(tmp_path: Path, also: str):
    assert _took(tmp_path, "b.on" + also) == pytest.approx(0.250, abs=1e-9)


def test_a_port_of_a_built_in_behaviour_is_seen_within_a_millisecond_of_the_plants_step(tmp_path: Path):
    assert _took(tmp_path, "lamp.lit") == pytest.approx(0.251, abs=2e-3)
