"""JUnit XML of a run: each expectation a test case, with its measured value.

Valid by the schema of Jenkins' xUnit plugin (junit-10.xsd), which also pytest keeps to: a test case has no properties,
so that its measured value is in the message and in ``system-out``.  An inconclusive case is skipped, with a message
that begins with ``inconclusive``: the PLC is not to blame for the farm's own lateness.  The exit code of ``pnfarm run``
is 3 then.  Where the farm ended or was lost, one more case, `the farm`, is an error.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite

from pnfarm.scenario.definition.matrix import runs_of
from pnfarm.scenario.watch import as_text
from pnfarm.vocabulary.durations import format_measured

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["write_junit"]


def write_junit(record: Mapping[str, Any], path: Path) -> None:
    """``record`` is :meth:`.Record.as_dict`, or the runs of a matrix: a suite for each."""
    xml = JUnitXml("pnfarm")
    for one in runs_of(record):
        xml.add_testsuite(_suite(one))
    suites = list(xml)
    xml.tests, xml.failures, xml.errors = (
        sum(getattr(suite, what) for suite in suites) for what in ("tests", "failures", "errors")
    )
    xml.time = round(record["seconds"], 3)
    xml.write(str(path), pretty=True)


def _suite(record: Mapping[str, Any]) -> TestSuite:
    suite = TestSuite(_text(record["scenario"]))
    for name, value in {
        "farm": record["farm"],
        "file": record["file"],
        "verdict": record["verdict"] or "",
        "ended_early": record["ended_early"],
        **{f"matrix.{name}": value for name, value in record.get("matrix", {}).items()},
    }.items():
        suite.add_property(name, _text(value))
    for found in record.get("finds", ()):
        # "find: TITLE" is the value, its neighbour the first one that did not hold
        suite.add_property(_text(f"find: {found['name']}"), _text(found["found"]))
        suite.add_property(_text(f"beyond: {found['name']}"), _text(found["beyond"]))
    for number, sentence in enumerate(record.get("failed_code", ()), 1):
        suite.add_property(f"failed_code.{number}", _text(sentence))
    for fault in record["faults"]:
        suite.add_property(_text(f"fault.{fault['name']}"), _text(_fault(fault)))
    for case in record["cases"]:
        suite.add_testcase(_case(record, case))
    if record["farm_ended"]:
        # what did not run is skipped, and would leave the suite without an error
        lost = TestCase("the farm", classname=_text(record["scenario"]))
        lost.result = [Error(_text(record["ended_early"]), "error")]
        suite.add_testcase(lost)
    suite.update_statistics()  # type: ignore[no-untyped-call]  # junitparser types its constructors only
    # the run's, not the sum of cases that ran side by side
    suite.time = round(record["seconds"], 3)
    return suite


def _fault(fault: Mapping[str, Any]) -> str:
    """What was injected, and what the farm saw of it."""
    what = f"{fault['kind']} on {', '.join(fault['drives'])}"
    if (seen := fault.get("evidence")) is None:
        return f"{what}: not known"
    why = f" ({seen['reason']})" if seen["reason"] else ""
    return f"{what}: {seen['confirmation']}{why}, checks {seen['checks']}, activations {seen['activations']}"


def _case(record: Mapping[str, Any], case: Mapping[str, Any]) -> TestCase:
    took = (case["ended_seconds"] or 0.0) - (case["began_seconds"] or 0.0)
    found = TestCase(_text(case["name"]), classname=_text(record["scenario"]))
    found.time = round(took, 6)
    message = _text(case["message"])
    match case["verdict"]:
        case "failed":
            failure = Failure(message, "expectation")
            failure.text = _text(_told(case))
            found.result = [failure]
        case "error":
            found.result = [Error(message, "error")]
        case "inconclusive":
            found.result = [Skipped(f"inconclusive: {message}")]
        case "not run":
            found.result = [Skipped(f"not run: {message}")]
        case _:
            pass
    found.system_out = _text(_told(case))
    return found


def _told(case: Mapping[str, Any]) -> str:
    """What is known of a case, a line each: ``verdict: passed``."""
    late = case["farm_late_seconds"]
    facts = {
        "verdict": case["verdict"],
        "line": case["line"],
        "allowed": case["allowed"],
        "measured": case["measured"],
        "message": case["message"],
        "value": case["value"],
        "farm late": format_measured(late) if late is not None else None,
    }
    lines = [f"{name}: {value}" for name, value in facts.items() if value not in {None, ""}]
    lines += [
        f"{drive}: held after {format_measured(seconds)}" for drive, seconds in case["held_after_seconds"].items()
    ]
    lines += [f"{drive}: {as_text(texts)}" for drive, texts in case["shown"].items()]
    return "\n".join(lines)


def _text(value: object) -> str:
    """Without the control characters that XML 1.0 does not allow."""
    return "".join(
        c for c in str(value) if c in "\t\n\r" or (c >= " " and not "\ud800" <= c <= "\udfff" and c < "\ufffe")
    )
