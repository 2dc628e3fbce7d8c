"""The example cell: a stuck sensor shows which PLC program waits for ever."""

import asyncio
from pathlib import Path

import pytest

from pnfarm.cli.commands.run import bound
from pnfarm.scenario.definition.file import load_scenario
from pnfarm.scenario.virtual import run_virtual

FOLDER = Path(__file__).resolve().parents[2] / "configs" / "cell"


@pytest.mark.parametrize(
    ("program", "red"),
    [
        ("feeds.py", []),
        ("waits_forever.py", ["the feeder stops when no part is reported", "the lamp says so"]),
    ],
)
def test_a_stuck_sensor_is_green_with_a_program_that_stops_and_red_with_one_that_waits(program, red):
    scenario = load_scenario(FOLDER / "stuck-sensor.scenario.yml", {"program": f"cell/{program}"})
    record, _ = asyncio.run(run_virtual(*bound(scenario)))
    assert [case["name"] for case in record["cases"] if case["verdict"] == "failed"] == red
    assert record["verdict"] == ("failed" if red else "passed")
    (fault,) = record["faults"]
    assert fault["evidence"]["confirmation"] != "contradicted"
