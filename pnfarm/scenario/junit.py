"""JUnit XML of a run: each expectation a test case, with its measured value.

An inconclusive case is skipped, with a message that begins with ``inconclusive`` and the property ``verdict``: the PLC
is not to blame for the farm's own lateness.  The exit code of ``pnfarm run`` is 3 then.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from junitparser import Error, Failure, JUnitXml, Properties, Property, Skipped, TestCase, TestSuite

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["write_junit"]


def write_junit(record: Mapping[str, Any], path: Path) -> None:
    """``record`` is :meth:`.Record.as_dict`."""
    suite = TestSuite(_text(record["scenario"]))
    suite.add_property("farm", _text(record["farm"]))
    suite.add_property("verdict", _text(record["verdict"] or ""))
    for case in record["cases"]:
        suite.add_testcase(_case(record, case))
    suite.time = record["seconds"]
    xml = JUnitXml("pnfarm")
    xml.add_testsuite(suite)
    xml.update_statistics()  # type: ignore[no-untyped-call]  # junitparser types its constructors only
    xml.write(str(path), pretty=True)


def _case(record: Mapping[str, Any], case: Mapping[str, Any]) -> TestCase:
    took = (case["ended_seconds"] or 0.0) - (case["began_seconds"] or 0.0)
    found = TestCase(_text(case["name"]), classname=_text(record["scenario"]), time=took)
    properties = {"verdict": case["verdict"], "line": str(case["line"]), "measured": case["message"]}
    if case["value"] is not None:
        properties["value"] = repr(case["value"])
    for drive, seconds in case["held_after_seconds"].items():
        properties[f"{drive}.held_after_seconds"] = repr(seconds)
    held = Properties()  # type: ignore[no-untyped-call]  # likewise
    for name, value in properties.items():
        held.add_property(Property(_text(name), _text(value)))
    found.append(held)  # type: ignore[no-untyped-call]  # likewise
    message = _text(case["message"])
    match case["verdict"]:
        case "failed":
            failure = Failure(message, "expectation")
            failure.text = _text(_values(case))
            found.result = [failure]
        case "error":
            found.result = [Error(message, "error")]
        case "inconclusive":
            found.result = [Skipped(f"inconclusive: {message}")]
        case "not run":
            found.result = [Skipped(f"not run: {message}")]
        case _:
            pass
    found.system_out = _text(f"{case['message']}\n{_values(case)}")
    return found


def _values(case: Mapping[str, Any]) -> str:
    return "\n".join(
        f"{drive}: " + ", ".join(f"{name} = {value}" for name, value in values.items())
        for drive, values in case["values"].items()
    )


def _text(value: object) -> str:
    """Without the control characters that XML 1.0 does not allow."""
    return "".join(
        c for c in str(value) if c in "\t\n\r" or (c >= " " and not "\ud800" <= c <= "\udfff" and c < "\ufffe")
    )
