"""A matrix: the whole scenario once for each combination of values, with a farm for each run."""

from __future__ import annotations

import json
import os
import signal
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from pnfarm.cli.main import main
from pnfarm.errors import ConfigError
from pnfarm.faults.catalogue import Catalogue
from pnfarm.scenario.definition.binding import bind_scenario
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.vocabulary.issues import FarmFileError

LINE = Path(__file__).resolve().parents[2] / "configs" / "scenarios" / "line.pnfarm.yml"
HEAD = f"""scenario: cycles
farm: {LINE}
with: {{"drives[0].count": 2, "drives[0].limits": lax, controller.cycle: $cycle}}
"""
MATRIX = "matrix: {cycle: [1ms, 4ms]}\n"
STEPS = """
steps:
  - wait: {until: state == S4, within: 20s}
  - expect: {metric: pnfarm_ar_cycle_seconds, value: "$sum", name: "cycle of $cycle"}
"""


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "cycles.scenario.yml"
    path.write_text(text)
    return path


def test_each_combination_is_a_run_with_its_own_farm_and_a_suite(tmp_path, capsys) -> None:
    # two drives: the values of the series are added up; 2 ms is right of the first run only
    path = write(tmp_path, HEAD + MATRIX + "variables: {sum: 2ms}" + STEPS)
    junit, result, page = tmp_path / "junit.xml", tmp_path / "run.json", tmp_path / "run.html"
    assert main(["run", str(path), "--virtual", f"--junit={junit}", f"--json={result}", f"--html={page}"]) == 1
    shown = capsys.readouterr().out
    assert "cycles: failed (2 runs: 1 passed, 1 failed)" in shown
    root = ET.parse(junit).getroot()
    assert [(suite.get("name"), suite.get("failures")) for suite in root] == [
        ("cycles [cycle=1ms]", "0"),
        ("cycles [cycle=4ms]", "1"),
    ]
    assert root.get("tests") == "2"
    assert {case.get("classname") for case in root.iter("testcase")} == {suite.get("name") for suite in root}
    record = json.loads(result.read_text())
    assert record["verdict"] == "failed"
    assert record["counts"]["passed"] == record["counts"]["failed"] == 1
    assert [run["matrix"] for run in record["runs"]] == [{"cycle": "1ms"}, {"cycle": "4ms"}]
    assert [run["cases"][0]["value"] for run in record["runs"]] == pytest.approx([0.002, 0.008])
    html = page.read_text()
    assert html.count("<html") == 1
    assert html.count("<section") == 2
    assert "cycles [cycle=4ms]" in html


def test_set_chooses_one_value_of_a_matrix(tmp_path, capsys) -> None:
    path = write(tmp_path, HEAD + MATRIX + "variables: {sum: 4ms}" + STEPS)
    assert main(["run", str(path), "--virtual", "--set", "cycle=2ms"]) == 0
    assert "cycles [cycle=2ms]: passed" in capsys.readouterr().out


def test_variables_reach_the_keys_of_the_farm_file(tmp_path, capsys) -> None:
    path = write(tmp_path, HEAD + "variables: {sum: 8ms, cycle: 1ms}" + STEPS)
    assert main(["run", str(path), "--virtual", "--set", "cycle=4ms"]) == 0
    assert "1 passed" in capsys.readouterr().out


def test_every_combination_is_checked_before_the_first_run_starts(tmp_path, capsys) -> None:
    text = HEAD + "matrix: {cycle: [1ms, 3 apples]}\nvariables: {sum: 2ms}" + STEPS
    for command in (["run", str(write(tmp_path, text)), "--virtual"], ["validate", str(write(tmp_path, text))]):
        assert main(command) == 2
        found = capsys.readouterr()
        assert "controller.cycle" in found.err
        assert "3 apples" in found.err
        assert "wait until" not in found.out


@pytest.mark.parametrize(
    ("matrix", "told"),
    [
        ("{}", "matrix: is empty"),
        ("[1ms, 4ms]", "matrix: is "),
        ("{cycle: 1ms}", "matrix.cycle: is '1ms'"),
        ("{cycle: []}", "matrix.cycle: is "),
        ("{cycle: [1ms, 1ms]}", "matrix.cycle: has a value twice"),
        ("{cycle: [1ms], sum: [1ms]}", "matrix.sum: is also in `variables`"),
        ("{cycle: [1ms], 2x: [1ms]}", "is not a name of a variable"),
        ("{cycle: [1ms], a: {from: 1, to: 11}, b: {from: 1, to: 11}}", "matrix: makes 121 runs"),
        ("{cylce: [1ms]}", "$cycle has no value, did you mean cylce?"),
    ],
)
def test_a_wrong_matrix_is_told_with_what_is_allowed(matrix: str, told: str) -> None:
    with pytest.raises(FarmFileError) as found:
        parse_scenario(HEAD + f"matrix: {matrix}\nvariables: {{sum: 2ms}}" + STEPS)
    assert told in str(found.value)


def test_a_running_farm_refuses_a_matrix_and_says_what_to_write(tmp_path, capsys) -> None:
    path = write(tmp_path, HEAD + MATRIX + "variables: {sum: 2ms}" + STEPS)
    assert main(["run", str(path), "--farm", "http://127.0.0.1:9"]) == 2
    assert "repeat" in capsys.readouterr().err
    with pytest.raises(ConfigError, match="repeat"):
        bind_scenario(parse_scenario(path.read_text()), {}, Catalogue([]))


def test_a_signal_while_the_first_run_starts_ends_the_program_at_once(tmp_path, monkeypatch) -> None:
    from pnfarm.cli.commands import run as command

    monkeypatch.setattr(command, "_local", lambda *_, **__: os.kill(os.getpid(), signal.SIGTERM) or ({}, None))
    path = write(tmp_path, HEAD + MATRIX + "variables: {sum: 2ms}" + STEPS)
    assert main(["run", str(path), "--virtual"]) == 130


def test_runs_behind_an_interruption_are_not_run(tmp_path, capsys, monkeypatch) -> None:
    from pnfarm.cli.commands import run as command

    asked = iter(["", "interrupted by SIGINT", "interrupted by SIGINT"])
    monkeypatch.setattr(command._Signals, "why", lambda self: next(asked, "interrupted by SIGINT"))
    path = write(tmp_path, HEAD + MATRIX + "variables: {sum: 2ms}" + STEPS)
    result = tmp_path / "run.json"
    assert main(["run", str(path), "--virtual", f"--json={result}"]) == 3
    record = json.loads(result.read_text())
    assert record["ended_early"] == "interrupted by SIGINT"
    assert [run["counts"]["not run"] for run in record["runs"]] == [1, 1]
