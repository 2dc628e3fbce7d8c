"""The cell with a machine that moves (`configs/pick-and-place`): the right program, and six that are each wrong in one
thing, which a scenario names."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from pnfarm.cli.commands.run import bound
from pnfarm.scenario.definition.file import load_scenario
from pnfarm.scenario.virtual import run_virtual
from pnfarm.testing import Line

CONFIGS = Path(__file__).parents[2] / "configs"
FOLDER = CONFIGS / "pick-and-place"
WRONG = {
    "NoPartCheck": ("runs", "it never closes on nothing"),
    "NoEndPosition": ("slow-gripper", "the gripper closes on the part"),
    "TimeInsteadOfFeedback": ("slow-gripper", "the gripper closes on the part"),
    "IgnoresJam": ("jam", "the jam is reported"),
    "CarriesOpen": ("opens-on-the-way", "it does not carry on"),
    "LosesCount": ("reconnect", "the count goes on where it was"),
}


def _verdicts(name: str, kind: str = "") -> dict[str, bool]:
    """By expectation, whether it was passed."""
    chosen = {"file": "programs/pick_and_place_wrong.py", "class": kind} if kind else {}
    scenario = load_scenario(FOLDER / f"{name}.scenario.yml", chosen)
    record, _ = asyncio.run(run_virtual(*bound(scenario)))
    return {case["name"]: case["verdict"] == "passed" for case in record["cases"]}


@pytest.mark.parametrize("name", sorted({scenario for scenario, _ in WRONG.values()}))
def test_the_right_program_passes_each_scenario_of_the_cell(name: str):
    assert all(_verdicts(name).values())


@pytest.mark.parametrize("kind", WRONG)
def test_each_wrong_program_fails_a_scenario_that_names_its_mistake(kind: str):
    name, mistake = WRONG[kind]
    found = _verdicts(name, kind)
    assert not found[mistake]


@pytest.mark.slow
def test_a_hundred_parts_are_placed_and_none_is_lost():
    with Line.from_file(CONFIGS / "pick-and-place.pnfarm.yml") as line:
        line.run(212)
        handling = line.plant.handling
        assert handling.placed >= 100
        assert (handling.dropped, handling.empty, handling.collisions) == (0, 0, 0)
