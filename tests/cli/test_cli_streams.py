"""Standard output as programs find it: with a reader that goes, in another alphabet, closed."""

from __future__ import annotations

import io
import os
import sys

import pytest

from pnfarm.cli.main import main

FARM = """\
farm: line
link: {kind: memory}
drives: [{name: a, model: akd-profinet, ip: 10.0.0.1/24}]
controller: {ip: 10.0.0.250/24}
"""
SCENARIO = """\
scenario: never
farm: line.pnfarm.yml
steps:
  - expect: {drive: a, that: velocity > 100000, within: 10ms}
"""


@pytest.fixture
def farm(tmp_path):
    path = tmp_path / "line.pnfarm.yml"
    path.write_text(FARM, "utf-8")
    return path


@pytest.fixture
def unread(monkeypatch):
    """Standard output is a pipe whose reader has gone."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w", encoding="utf-8") as stream:
        monkeypatch.setattr(sys, "stdout", stream)
        yield


@pytest.mark.usefixtures("pnfarm", "unread")
def test_a_scenario_whose_output_nobody_reads_has_its_verdict_and_its_report(farm):
    scenario, junit = farm.with_name("never.scenario.yml"), farm.with_name("junit.xml")
    scenario.write_text(SCENARIO, "utf-8")
    assert main(["run", str(scenario), "--virtual", "--junit", str(junit)]) == 1
    assert 'failures="1"' in junit.read_text("utf-8")


@pytest.mark.usefixtures("pnfarm", "unread")
def test_a_comparison_whose_output_nobody_reads_ends_with_what_it_found(farm):
    farm.write_text(FARM.replace("kind: memory", "kind: tap, bridge: nobridge0"), "utf-8")
    assert main(["doctor", str(farm)]) == 4


@pytest.mark.usefixtures("pnfarm")
def test_what_the_terminals_alphabet_lacks_is_written_as_an_escape(farm, monkeypatch):
    octets = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(octets, "ascii"))
    assert main(["validate", str(farm.rename(farm.with_name("größe.pnfarm.yml")))]) == 0
    assert rb"gr\xf6\xdfe.pnfarm.yml: OK" in octets.getvalue()


@pytest.mark.parametrize("name", ["stdout", "stderr"])
@pytest.mark.usefixtures("pnfarm")
def test_a_closed_stream_changes_no_exit_code(name, farm, monkeypatch):
    monkeypatch.setattr(sys, name, None)
    assert main(["validate", str(farm)]) == 0
    assert main(["validate", str(farm.with_name("none.pnfarm.yml"))]) == 2
    getattr(sys, name).close()


def test_a_benchmark_says_before_it_runs_that_its_file_cannot_be_written(pnfarm, tmp_path):
    done = pnfarm("bench", "--json", tmp_path / "none" / "figures.json")
    assert done.code == 2
    assert "is not a folder" in done.err
