"""The step `find`: which values it tries, what it finds, and what of it stands in the record, JUnit and the report."""

from __future__ import annotations

import asyncio
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from pnfarm.cli.commands.run import bound
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.scenario.definition.steps import read_bound
from pnfarm.scenario.find import Search
from pnfarm.scenario.report.junit import write_junit
from pnfarm.scenario.report.page import report_html
from pnfarm.scenario.virtual import run_virtual
from pnfarm.vocabulary.issues import FarmFileError

LINE = Path(__file__).resolve().parents[2] / "configs" / "scenarios" / "line.pnfarm.yml"
UP = "  - wait: {until: state == S4, within: 20s}\n"
SILENCE = """
  - find:
      name: frames that may be missing
      for: {n: {from: 1, to: 5}}
      by: %s
      is: %s
      measure: {metric: pnfarm_watchdog_expirations_total, of: increases}
      steps:
        - fault: {kind: loss, on: axis-01, direction: in, params: {frames: cyclic}, cycles: $n}
        - expect: {drive: axis-01, that: connected and fault == 0, for: 500ms}
      then:
        - wait: {until: connected and state == S4 and fault == 0, within: 10s}
        - expect: {drive: axis-01, that: connected and state == S4, for: 300ms, name: back again}
"""


def run_steps(steps: str, variables: dict[str, Any] | None = None, head: str = "") -> dict[str, Any]:
    text = f"scenario: test\nfarm: {LINE}\n{head}steps:\n{steps}"
    scenario = parse_scenario(text, variables=variables)
    scenario.overrides = {"drives[0].count": 2}
    record, _ = asyncio.run(run_virtual(*bound(scenario)))
    return record


def searched(by: str, limit: float, values: list[int] | None = None) -> tuple[Search, list[int]]:
    search = Search(values or list(range(1, 17)), by)
    tried = []
    while (place := search.next()) is not None:
        value = search.values[place]
        tried.append(value)
        search.note(place, held=value <= limit, message="", measured=None, at_seconds=0.0)
    return search, tried


@pytest.mark.parametrize("by", ["first", "bisect", "all"])
@pytest.mark.parametrize("limit", [0, 1, 7, 15, 16])
def test_every_way_finds_the_last_value_that_holds(by: str, limit: int) -> None:
    search, tried = searched(by, limit)
    assert search.found == (limit or None)
    assert search.beyond == (limit + 1 if limit < 16 else None)
    assert len(tried) == len(set(tried))
    assert len(tried) == {"all": 16, "first": min(limit + 1, 16), "bisect": len(tried)}[by]
    assert by != "bisect" or len(tried) <= 5


def test_a_value_that_holds_beyond_the_limit_is_not_what_is_found() -> None:
    search = Search([1, 2, 3], "all")
    for place, held in enumerate((True, False, True)):
        search.note(place, held=held, message="", measured=None, at_seconds=0.0)
    assert (search.found, search.beyond) == (1, 2)


@pytest.mark.parametrize(
    ("limit", "bound", "holds", "sentence"),
    [
        (3, ">= 3", True, "holds at 3, not at 4; wanted >= 3"),
        (3, "4", False, "holds at 3, not at 4; wanted 4"),
        (0, None, False, "does not hold at 1, the first value"),
        (16, None, True, "holds at 16, the last value: the limit lies beyond"),
        (16, "<= 8", False, "holds at 16, the last value: the limit lies beyond; wanted <= 8"),
    ],
)
def test_the_bound_decides_and_the_sentence_says_where_the_limit_is(limit, bound, holds, sentence) -> None:
    search, _ = searched("first", limit)
    assert search.verdict(read_bound(bound) if bound else None) == (holds, sentence)


def test_a_find_reports_the_limit_as_a_case_and_what_follows_each_trial_as_cases(tmp_path) -> None:
    record = run_steps(UP + SILENCE % ("bisect", "'>= 1'"))
    assert record["verdict"] == "passed", record["cases"]
    (found,) = record["finds"]
    assert (found["found"], found["beyond"]) == (2, 3)
    assert {item["value"]: item["held"] for item in found["tries"]} == {3: False, 1: True, 2: True}
    assert [item["measured"] for item in found["tries"]] == [1.0, 0.0, 0.0]
    names = [case["name"] for case in record["cases"]]
    assert names == ["frames that may be missing", "back again [n=1]", "back again [n=2]", "back again [n=3]"]
    assert record["cases"][0]["value"] == 2
    write_junit(record, tmp_path / "junit.xml")
    suite = ET.parse(tmp_path / "junit.xml").getroot().find("testsuite")
    assert suite is not None
    properties = {item.get("name"): item.get("value") for item in suite.findall("properties/property")}
    assert properties["find: frames that may be missing"] == "2"
    assert properties["beyond: frames that may be missing"] == "3"
    page = report_html(record)
    plot = page[page.index('aria-label="frames that may be missing"') :]
    assert plot[: plot.index("</svg>")].count("<circle") == 3
    assert "the limit</title>" in plot


def test_a_limit_that_is_not_as_wanted_fails_and_what_was_not_tried_is_no_case() -> None:
    record = run_steps(UP + SILENCE % ("first", "'>= 3'"))
    assert record["verdict"] == "failed"
    red = [case for case in record["cases"] if case["verdict"] != "passed"]
    assert [case["message"] for case in red] == ["holds at 2, not at 3; wanted >= 3"]
    assert len(record["cases"]) == 4


def test_the_faults_of_a_trial_end_with_it() -> None:
    record = run_steps(
        UP
        + "  - find:\n      for: {n: [1]}\n      steps:\n"
        + "        - fault: {kind: not-ready, on: axis-01}\n"
        + "        - expect: {drive: axis-01, that: state == S4, for: 100ms}\n"
        + "      then:\n        - expect: {drive: axis-01, that: state == S4, within: 5s, name: ready again}\n"
    )
    assert [case["verdict"] for case in record["cases"]] == ["failed", "passed"]


def test_a_find_that_is_not_reached_is_not_run() -> None:
    record = run_steps("  - wait: {until: state == S5, within: 100ms}\n" + SILENCE.lstrip("\n") % ("first", "1"))
    assert [case["verdict"] for case in record["cases"]] == ["failed", "not run"]


def test_values_of_variables_replace_those_of_the_file() -> None:
    head = "variables: {pause: 1h}\n"
    record = run_steps("  - wait: $pause\n  - expect: {drive: all, that: powered}\n", {"pause": "10ms"}, head)
    assert record["seconds"] == pytest.approx(0.01)
    with pytest.raises(FarmFileError, match="has no 'paus' to set, did you mean pause"):
        run_steps("  - wait: $pause\n", {"paus": "10ms"}, head)


def test_load_brings_the_drives_that_are_on_to_a_total() -> None:
    record = run_steps(
        "  - load: {total: 1}\n  - expect: {drive: axis-02, that: not powered}\n"
        "  - load: {total: 1}\n  - load: {total: 2}\n  - expect: {drive: all, that: powered}\n"
        "  - load: {total: 0}\n  - expect: {drive: all, that: not powered}\n"
    )
    assert record["verdict"] == "passed", record["cases"]
