"""Programs of the PLC and models of the plant that raise an error, in what a run prints and writes."""

from __future__ import annotations

import json

import pytest

from pnfarm.cli.main import main

FARM = """
farm: faulty
link: {{kind: memory}}
api: off
drives: [{{name: 'axis-{{n:02}}', count: 2, model: akd-profinet, ip: 10.77.0.11/24}}]
controller: {{ip: 10.77.0.1/24, cycle: 16ms, program: {{{program}}}}}
{plant}
"""
PROGRAM = """
from pnfarm import AxisProgram


class Plc(AxisProgram):
    def cycle(self, inputs, outputs, now):
        self.nothing.there = 1
"""
MODEL = """
class Gate:
    inputs = {"closed": bool}
    outputs = {"open": bool}

    def step(self, dt):
        raise ValueError("no hinge")
"""
SCENARIO = "scenario: faulty\nfarm: faulty.pnfarm.yml\nsteps:\n  - wait: 100ms\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "plc.py").write_text(PROGRAM, "utf-8")
    (tmp_path / "gate.py").write_text(MODEL, "utf-8")
    (tmp_path / "faulty.scenario.yml").write_text(SCENARIO, "utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("program", "plant", "sentence"),
    [
        ("python: plc.py", "", "the PLC program of axis-01 axis-02 failed after 0 s: plc.py:7: AttributeError: "),
        ("kind: idle", "plant: {models: [{name: gate, python: gate.py}]}", "the model gate failed after "),
    ],
    ids=["program", "model"],
)
def test_code_of_the_user_that_fails_is_on_the_terminal_and_in_every_report(folder, capsys, program, plant, sentence):
    (folder / "faulty.pnfarm.yml").write_text(FARM.format(program=program, plant=plant), "utf-8")
    reports = ["--json", "a.json", "--junit", "a.xml", "--html", "a.html"]
    assert main(["run", "faulty.scenario.yml", "--virtual", *reports]) == 0
    assert sentence in capsys.readouterr().out
    (found,) = json.loads((folder / "a.json").read_text("utf-8"))["failed_code"]
    assert found.startswith(sentence)
    assert all(sentence in (folder / name).read_text("utf-8") for name in ("a.xml", "a.html"))
