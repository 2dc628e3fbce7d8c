"""Scenarios and programs of a user's own with drives on PROFIBUS and their master, as with any others."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from pnfarm.cli.commands.run import bound
from pnfarm.scenario.definition.file import load_scenario, parse_scenario
from pnfarm.scenario.virtual import run_virtual

CONFIGS = Path(__file__).resolve().parents[3] / "configs"
FARM = """
farm: dp
link: {{kind: memory}}
drives:
  - {{name: 'axis-{{n:02}}', count: 3, model: moog-msd-dp, address: 11}}
controller:
  name: plc
  cycle: 5ms
  watchdog: 50ms
  program: {program}
  reconnect: {{after: 300ms}}
"""
BUILT_IN = "{kind: constant, speed_rpm: 100, acknowledge_after: 500ms}"
SCENARIO = """
scenario: a-bad-line
farm: {farm}
steps:
  - wait: {{until: all-connected, within: 20s}}
  - wait: {{until: velocity > 90, within: 5s}}
  - parallel:
      - fault: {{kind: line-noise, on: axis-01, params: {{every: 50ms, octets: 9}}, for: 1s}}
      - expect: {{drive: all, that: state == S4, for: 2s, name: repetitions get through}}
  - fault: {{kind: wrong-ident, on: axis-02, as: other}}
  - fault: {{kind: link-down, on: axis-02, for: 200ms}}
  - expect: {{drive: axis-02, that: not connected, within: 200ms, name: the slave is lost}}
  - parallel:
      - expect: {{drive: [axis-01, axis-03], that: state == S4, for: 2s, name: the others run on}}
      - expect: {{drive: axis-02, that: not connected, for: 2s, name: the master refuses another slave}}
  - clear: other
  - expect: {{drive: axis-02, that: state == S4 and fault == 0, within: 5s, for: 1s, name: the right one is back}}
"""


def farm_file(tmp_path: Path, program: str) -> Path:
    file = tmp_path / "dp.pnfarm.yml"
    file.write_text(FARM.format(program=program), encoding="utf-8")
    return file


def verdicts(scenario) -> dict[str, str]:
    record, _ = asyncio.run(run_virtual(*bound(scenario)))
    return {case["name"]: case["verdict"] for case in record["cases"]}


def test_noise_and_a_slave_with_another_ident_number_have_their_verdict(tmp_path):
    seen = verdicts(parse_scenario(SCENARIO.format(farm=farm_file(tmp_path, BUILT_IN))))
    assert len(seen) == 5
    assert set(seen.values()) == {"passed"}, seen


@pytest.mark.parametrize(
    ("program", "failed"),
    [("right", set()), ("never_acknowledges", {"the PLC acknowledges", "the PLC brings it back"})],
)
def test_a_program_of_ones_own_moves_the_axes_and_is_judged(tmp_path, program, failed):
    scenario = load_scenario(
        CONFIGS / "scenarios" / "f702-recovery.scenario.yml", {"axis": "axis-01", "others": ["axis-02", "axis-03"]}
    )
    scenario.farm = str(farm_file(tmp_path, f"{{python: {CONFIGS}/programs/{program}.py}}"))
    seen = verdicts(scenario)
    assert {name for name, verdict in seen.items() if verdict == "failed"} == failed, seen
