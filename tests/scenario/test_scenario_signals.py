"""Steps on signals of devices."""

from __future__ import annotations

import asyncio

import pytest
from cell_file import CELL

import pnfarm
from pnfarm.cli.commands.run import bound
from pnfarm.errors import ConfigError
from pnfarm.scenario.definition.file import load_scenario


@pytest.fixture(scope="module")
def farm():
    """A farm, and what runs a scenario of these steps on it."""
    farm = pnfarm.Farm.from_text(CELL, virtual=True)
    with asyncio.Runner() as runner:
        runner.run(farm.open())
        runner.run(farm.wait_connected())
        farm.runner = runner
        yield farm
        runner.run(farm.close())


@pytest.fixture
def carried_out(farm, tmp_path):
    def run(*steps):
        path = tmp_path / "signals.scenario.yml"
        path.write_text("scenario: signals\nsteps:\n" + "".join(f"  - {step}\n" for step in steps))
        return farm.runner.run(farm.run_scenario(path))

    return run


def test_signals_are_written_by_a_step(farm, carried_out):
    result = carried_out("set: {island-1.part_present: true, island-1.pressure: 6.5}", "wait: 10ms")
    assert result.passed
    signals = farm.device("island-1").signals
    assert (signals["part_present"], signals["pressure"]) == (True, 6.5)
    carried_out("repeat: {for: {bar: [1, 2.5]}, steps: [{set: {island-1.pressure: $bar}}]}")
    assert signals["pressure"] == 2.5


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("set: {island-2.part_present: true}", "there is no device 'island-2', did you mean island-1?"),
        ("set: {island-1.part_presnt: true}", "island-1 has no such signal, did you mean part_present?"),
        ("set: {island-1.valve: true}", "is an output: the controller alone writes it"),
        ("set: {island-1.pressure: 1000}", "is outside of int16 scaled by 0.01; allowed: -327.68 to 327.67 bar"),
        ("set: {part_present: true}", "'part_present' is not a signal; allowed: STATION.SIGNAL"),
        ("set: {island-1.part_present: [1]}", "island-1.part_present is a list"),
        ("set: 1", "is 1; allowed: a mapping of signals to values"),
    ],
)
def test_a_step_that_cannot_be_is_reported_before_the_scenario_begins(farm, carried_out, step, sentence):
    before = dict(farm.device("island-1").signals)
    with pytest.raises(ConfigError) as caught:
        carried_out("set: {island-1.part_present: false}", step)
    assert sentence in str(caught.value)
    assert dict(farm.device("island-1").signals) == before


@pytest.mark.parametrize(("step", "field"), [("island-1.part_present: true", None), ("island-1.valve: 1", "valve")])
def test_a_scenario_with_a_farm_of_its_own_is_checked_before_the_farm_starts(tmp_path, step, field):
    (tmp_path / "cell.pnfarm.yml").write_text(CELL)
    path = tmp_path / "signals.scenario.yml"
    path.write_text(f"scenario: signals\nfarm: cell.pnfarm.yml\nsteps:\n  - set: {{{step}}}\n")
    scenario = load_scenario(path)
    if field is None:
        binding, _ = bound(scenario)
        assert "slot2_output_7" in binding.devices["island-1"]
        return
    with pytest.raises(ConfigError, match="is an output"):
        bound(scenario)
