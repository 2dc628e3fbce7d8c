"""The library of scenarios: green against the right controller, red at the right expectation against a wrong program.

Which scenario catches which program stands in the table of ``docs/scenarios.md``; the tests hold that table.
"""

from __future__ import annotations

import asyncio
import re
from pathlib import Path
from typing import Any

import pytest

from pnfarm.cli.commands.run import bound
from pnfarm.scenario.definition.file import load_scenario, parse_scenario
from pnfarm.scenario.virtual import run_virtual
from pnfarm.vocabulary.issues import FarmFileError

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "configs" / "scenarios"
SCENARIOS = sorted(path.name.removesuffix(".scenario.yml") for path in LIBRARY.glob("*.scenario.yml"))
#: The wrong ones; the others are right, blocks of a library, or those of a cell with scenarios of its own.
PROGRAMS = sorted(
    path.stem
    for path in (ROOT / "configs" / "programs").glob("*.py")
    if path.stem != "right" and not path.stem.startswith(("sina_", "pick_and_place"))
)
#: What keeps a run short: two drives, values of variables.
ONE = {"axis": "axis-01"}
TWO = {"axis": "axis-01", "others": "axis-02"}
SHORT: dict[str, dict[str, Any]] = {
    "cable-flap": TWO,
    "f702-ladder": {**ONE, "most": 3},
    "f702-recovery": TWO,
    "name-conflict": TWO,
    "sign-of-life-tolerance": {**ONE, "most": 24},
    "slow-application-ready": ONE,
    "soak-24h": {"duration": "2min", "faults": "60/h", "often": "120/h"},
    "watchdog-margin": {**ONE, "step": "8ms", "latest": "48ms", "most": 3},
    "wrong-module": ONE,
}
#: Keys of the farm file for the other models, with a cycle and a telegram of theirs.
MODELS = {
    "akd-profinet-2012": {"drives[0].model": "akd-profinet-2012"},
    "hiwin-e1": {
        "drives[0].model": "hiwin-e1",
        "drives[0].params": {},
        "drives[0].telegram": 3,
        "controller.cycle": "4ms",
    },
    "moog-msd": {
        "drives[0].model": "moog-msd",
        "drives[0].params": {},
        "drives[0].telegram": 2,
        "controller.cycle": "4ms",
    },
}


def run(name: str, overrides: dict[str, Any] | None = None) -> dict[str, Any]:
    scenario = load_scenario(LIBRARY / f"{name}.scenario.yml", SHORT.get(name))
    scenario.overrides = {"drives[0].count": 2, **scenario.overrides, **(overrides or {})}
    record, _ = asyncio.run(run_virtual(*bound(scenario)))
    return record


def with_program(name: str, program: str) -> dict[str, Any]:
    """The program in place of the scenario's, with the same time of a call."""
    given = load_scenario(LIBRARY / f"{name}.scenario.yml").overrides.get("controller.program", {})
    kept = {"call_time": given["call_time"]} if "call_time" in given else {}
    return run(name, {"controller.program": {"python": f"../programs/{program}.py", **kept}})


def red(record: dict[str, Any]) -> list[str]:
    """Names of the cases that failed, without loop values."""
    return [re.sub(r" \[.*\]$", "", case["name"]) for case in record["cases"] if case["verdict"] == "failed"]


def table() -> list[tuple[str, str, str]]:
    """(scenario, program, first failing case) of the documentation."""
    text = (ROOT / "docs" / "scenarios.md").read_text("utf-8")
    rows = re.findall(r"^\| `([a-z0-9-]+)` \| `([a-z_]+)` \| ([^|]+?) \|", text, re.MULTILINE)
    return [row for row in rows if row[0] in SCENARIOS]


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_library_is_green_against_the_built_in_controller(name: str) -> None:
    record = run(name)
    assert record["verdict"] == "passed", [(case["name"], case["message"]) for case in record["cases"]]
    assert record["cases"]
    # 0.4 ms for each axis in a cycle of 4 ms
    assert name != "load-ramp" or (record["finds"][0]["found"], record["finds"][0]["beyond"]) == (10, 11)
    assert all(fault["evidence"]["confirmation"] != "contradicted" for fault in record["faults"])


@pytest.mark.parametrize(("name", "program", "case"), table())
def test_a_wrong_program_fails_at_the_expectation_that_the_documentation_names(name, program, case) -> None:
    record = with_program(name, program)
    assert record["verdict"] == "failed"
    assert red(record)[:1] == [case], record["cases"]


def test_the_table_has_every_scenario_and_every_program() -> None:
    assert {name for name, _, _ in table()} == set(SCENARIOS)
    assert {program for _, program, _ in table()} == set(PROGRAMS)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", ["f702-recovery", "f702-ladder", "watchdog-margin", "wrong-module", "name-conflict"])
def test_the_library_holds_for_every_model(name: str, model: str) -> None:
    assert run(name, MODELS[model])["verdict"] == "passed"


def test_the_finders_find_the_limits_of_the_built_in_controller() -> None:
    found = {item["name"]: item["found"] for name in ("f702-ladder", "watchdog-margin") for item in run(name)["finds"]}
    # a watchdog factor of 3 at 16 ms: 48 ms without a frame
    assert found["cycles without a frame of the PLC that the drive rides through"] == 2
    assert found["frames of the drive that may be missing"] == 2
    assert found["time by which a frame of the drive may be late"] == "32ms"


def test_a_scenario_that_cannot_hold_for_a_model_says_so_before_it_starts() -> None:
    scenario = load_scenario(LIBRARY / "f702-recovery.scenario.yml")
    scenario.overrides = {"drives[0].model": "moog-msd", "drives[0].params": {}}
    bound(scenario)
    text = (LIBRARY / "f702-recovery.scenario.yml").read_text("utf-8").replace('"communication-loss"', "702")
    wrong = parse_scenario(text, LIBRARY / "x.scenario.yml")
    wrong.overrides = scenario.overrides
    with pytest.raises(FarmFileError, match="moog-msd has no fault '702'"):
        bound(wrong)
