"""The reports of a run: HTML as a browser shows it, JUnit by its schema, the capture as tshark reads it."""

from __future__ import annotations

import asyncio
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
from browser import PROGRAM, Browser
from junitparser import JUnitXml
from virtual_line import VirtualLine
from wireshark import tshark_fields

from pnfarm.cli.commands.run import bound
from pnfarm.cli.main import main
from pnfarm.scenario.definition.file import parse_scenario
from pnfarm.scenario.report.capture_slices import Window, failure_windows
from pnfarm.scenario.report.junit import write_junit
from pnfarm.scenario.report.page import report_html
from pnfarm.scenario.report.trace_excerpts import TraceExcerpts
from pnfarm.scenario.virtual import run_virtual

LINE = Path(__file__).resolve().parents[2] / "configs" / "scenarios" / "line.pnfarm.yml"
HOSTILE = "</title><script>alert(1)</script><img src=x onerror=alert(1)>"
STEPS = f"""
  - wait: {{until: state == S4, within: 20s}}
  - wait: 1s
  - fault: {{kind: f702, on: axis-01, as: trip}}
  - expect: {{drive: axis-01, that: stw1.enable_operation == 0, within: 1s, name: stops}}
  - expect: {{drive: axis-02, that: fault == 702, within: 100ms, name: "{HOSTILE}"}}
  - clear: trip
  - wait: 3s
  - expect:
      metric: 'pnfarm_watchdog_expirations_total{{drive="axis-02"}}'
      increases: '> 1'
      for: 100ms
      name: "a ]]> & b"
"""
#: What is drawn is not in the document: its texts are noted as they are drawn.
NOTE_WRITTEN = """
const written = [], write = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function(text, ...rest) {
  written.push(text);
  return write.call(this, text, ...rest);
};
"""
#: What the schema junit-10.xsd of Jenkins' xUnit plugin allows.
CHILDREN = {
    "testsuites": {"testsuite"},
    "testsuite": {"properties", "testcase", "system-out", "system-err"},
    "properties": {"property"},
    "testcase": {"skipped", "error", "failure", "system-out", "system-err"},
}
ATTRIBUTES = {
    "testsuites": {"name", "time", "tests", "failures", "errors"},
    "testsuite": {"name", "tests", "failures", "errors", "skipped", "time", "timestamp", "hostname"},
    "testcase": {"name", "classname", "time"},
    "property": {"name", "value"},
    "failure": {"message", "type"},
    "error": {"message", "type"},
    "skipped": {"message", "type"},
}


def run(steps: str, **more: Any) -> dict[str, Any]:
    scenario = parse_scenario(f'scenario: report\nfarm: {LINE}\ndescription: "{HOSTILE}"\nsteps:{steps}')
    scenario.overrides = {"drives[0].count": 2}
    record, _ = asyncio.run(run_virtual(*bound(scenario), **more))
    return record


@pytest.fixture(scope="module")
def record() -> dict[str, Any]:
    return run(STEPS, traced=True)


def test_traces_show_the_fault_and_the_failures_with_the_bits_that_changed(record: dict[str, Any]) -> None:
    (around_fault, around_metric) = record["traces"]
    assert around_fault["marks"][0] == {"text": "fault f702 on axis-01", "seconds": 0.0, "failure": False}
    assert around_fault["marks"][1]["failure"]
    assert around_fault["drives"] == ["axis-01", "axis-02"]
    trace = around_fault["trace"]
    assert trace["time"][0] == pytest.approx(-0.5, abs=0.002)
    assert trace["time"][-1] == pytest.approx(1.0, abs=0.002)
    signals = {(column["drive"], column["signal"]): column["values"] for column in trace["columns"]}
    enabled = signals["axis-01", "stw1.enable_operation"]
    when = trace["time"][enabled.index(0)]
    (stops,) = (case for case in record["cases"] if case["name"] == "stops")
    assert when == pytest.approx(stops["held_after_seconds"]["axis-01"], abs=0.002)
    assert set(signals["axis-01", "state"]) > {1, 4}
    # the last failure is at the end of the run: what there is of it
    assert around_metric["drives"] == ["axis-02"]
    assert around_metric["trace"]["time"][-1] <= 0.001


def test_a_run_without_a_report_takes_no_traces() -> None:
    assert run("\n  - wait: 1ms\n")["traces"] == []


@pytest.mark.parametrize("harm", ["delete", "fire"])
@pytest.mark.parametrize("marked", [False, True])
def test_a_client_that_ends_the_traces_of_a_run_leaves_the_run_and_its_next_pictures(harm: str, marked: bool) -> None:
    line = VirtualLine(1)
    line.connect()
    traces, world = line.farm.traces, line.world
    moments = TraceExcerpts(line.farm, ["axis-01"], [], world.now)
    line.run(1.0)
    if marked:
        moments.mark("before", ["axis-01"], world.now, failure=False)
    for trace in traces.kept():
        getattr(traces, harm)(trace.id, world.now)
    line.run(2.0)
    moments.look(world.now)
    line.run(2.0)
    moments.mark("trip", ["axis-01"], world.now, failure=False)
    line.farm.axes[0].raise_fault(702, hold=False)
    line.run(2.0)
    (*_, trip) = moments.close(world.now)
    assert trip.marks == [{"text": "trip", "seconds": 0.0, "failure": False}]
    assert 0.0 <= (trip.trace.first("zsw1.fault_present", 1) or -1.0) < 0.1
    assert traces.kept() == []


def test_pictures_are_bounded_and_room_is_left_for_failures() -> None:
    rounds = "\n  - repeat:\n      times: 30\n      steps:\n"
    rounds += "        - fault: {kind: drive-warning, on: all, params: {warning: 107}, for: 10ms}\n        - wait: 2s\n"
    found = run(rounds + "  - expect: {drive: all, that: state == S3}\n", traced=True)
    assert [picture["marks"][0]["failure"] for picture in found["traces"]] == [False] * 8 + [True]
    assert "first 8 only" in found["traces_note"]


@pytest.mark.skipif(PROGRAM is None, reason="chromium is not installed (apt-get install chromium)")
def test_the_report_opens_in_a_browser_without_a_request_an_error_or_a_foreign_script(
    record: dict[str, Any], tmp_path: Path
) -> None:
    page = tmp_path / "report.html"
    page.write_text(report_html(record).replace("<script>", f"<script>{NOTE_WRITTEN}", 1), "utf-8")
    with Browser(tmp_path / "profile", width=1200, height=1000) as browser:
        browser.open(page.as_uri())
        browser.until("document.readyState == 'complete'")
        assert browser.ask("performance.getEntriesByType('resource').length") == 0
        assert browser.ask("document.images.length + document.links.length") == 0
        assert browser.ask("[...document.scripts].every(one => !one.src)")
        assert HOSTILE in str(browser.ask("document.body.innerText"))
        assert browser.ask("document.querySelectorAll('figure svg polyline').length > 10")
        # charts take the place of a drawing that its reader comes to
        browser.ask("document.querySelector('.picture').scrollIntoView()")
        browser.until("document.querySelectorAll('.charts canvas').length > 1")
        assert browser.ask("document.querySelector('.picture').hidden")
        lanes = [one["signal"] for one in record["traces"][0]["trace"]["columns"] if one["form"] == "bit"]
        assert len(lanes) > 5
        browser.until(f"{json.dumps(lanes)}.every(lane => written.some(text => text.endsWith(lane)))")
        browser.ask("scrollTo(0, 0)")
        assert browser.ask("document.querySelectorAll('svg.timeline rect.fault').length") == 1
        # nothing is wider than the window, and no name of a lane reaches into the plot
        assert browser.ask("document.documentElement.scrollWidth <= innerWidth")
        assert browser.ask(
            "[...document.querySelectorAll('svg.timeline text[x=\"0\"]')].every(t => t.getBBox().width < 140)"
        )
        for theme, ink in (("light", "28, 39, 51"), ("dark", "227, 232, 236")):
            browser._call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": theme}])
            assert ink in str(browser.ask("getComputedStyle(document.body).color"))
            assert ink in str(browser.ask("getComputedStyle(document.querySelector('figure svg text')).fill"))


@pytest.mark.skipif(PROGRAM is None, reason="chromium is not installed (apt-get install chromium)")
def test_the_report_of_thousands_of_steps_and_long_names_stays_readable_and_small(tmp_path: Path) -> None:
    drive = "W" * 60
    case = {
        "number": 0, "name": "x" * 200, "line": 1, "loop": {}, "verdict": "failed", "drives": [drive],
        "allowed": "at once", "measured": "", "message": "m" * 300, "began_seconds": 0.0, "ended_seconds": 1.0,
        "farm_late_seconds": 0.1, "value": None, "held_after_seconds": {}, "values": {drive: {"state": "S4"}},
        "shown": {drive: {"state": "S4"}},
    }  # fmt: skip
    base = run("\n  - wait: 1ms\n")
    cases = [{**case, "number": n, "began_seconds": n / 10, "ended_seconds": n / 10 + 0.1} for n in range(10_000)]
    timeline = [
        {"seconds": n / 20, "what": "event", "drive": drive, "text": "state changed", "state": f"S{1 + n % 4}"}
        for n in range(20_000)
    ]
    big = {
        **base,
        "cases": cases,
        "drives": [drive, "axis"],
        "seconds": 1000.0,
        "timeline": timeline,
        "verdict": "failed",
    }
    page = tmp_path / "big.html"
    page.write_text(report_html(big), "utf-8")
    assert page.stat().st_size < 8_000_000
    with Browser(tmp_path / "profile", width=1200, height=1000) as browser:
        browser.open(page.as_uri())
        browser.until("document.readyState == 'complete'")
        assert browser.ask("document.documentElement.scrollWidth <= innerWidth")
        assert "5000 are left out" in str(browser.ask("document.body.innerText"))
        # no row lies upon the next one
        assert browser.ask(
            "(rows => rows.every((r, n) => !n || rows[n-1].getBoundingClientRect().bottom"
            " <= r.getBoundingClientRect().top + 1))([...document.querySelectorAll('table tr')].slice(0, 300))"
        )


def test_junit_keeps_to_the_schema_and_is_read_by_junitparser(record: dict[str, Any], tmp_path: Path) -> None:
    inconclusive = {**record["cases"][1], "verdict": "inconclusive", "name": "a\x00b\ud800"}
    found = {**record, "cases": [*record["cases"], inconclusive, {**inconclusive, "verdict": "error"}]}
    file = tmp_path / "junit.xml"
    write_junit(found, file)
    for element in ET.parse(file).getroot().iter():
        assert set(element.attrib) <= ATTRIBUTES.get(element.tag, set()), element.tag
        assert {child.tag for child in element} <= CHILDREN.get(element.tag, set()), element.tag
        if element.tag in {"testsuites", "testsuite"}:
            assert re.fullmatch(r"[0-9]*(\.[0-9]{0,3})?", element.get("time", ""))
    (suite,) = JUnitXml.fromfile(str(file))
    assert (suite.tests, suite.failures, suite.errors, suite.skipped) == (5, 2, 1, 1)
    cases = list(suite)
    assert cases[1].name == HOSTILE
    assert "measured: axis-02: fault = 0" in cases[1].system_out
    assert "axis-01: held after 20 ms" in cases[0].system_out
    assert cases[3].result[0].message.startswith("inconclusive: ")
    assert cases[3].name == "ab"


def test_a_run_whose_farm_was_lost_is_an_error_in_junit_too(record: dict[str, Any], tmp_path: Path) -> None:
    passed, not_run = record["cases"][0], {**record["cases"][1], "verdict": "not run"}
    lost = {**record, "verdict": "error", "farm_ended": True, "ended_early": "the farm ended: no room"}
    write_junit({**lost, "cases": [passed, not_run]}, tmp_path / "junit.xml")
    (suite,) = JUnitXml.fromfile(str(tmp_path / "junit.xml"))
    assert (suite.tests, suite.failures, suite.errors, suite.skipped) == (3, 0, 1, 1)
    assert list(suite)[-1].result[0].message == "the farm ended: no room"


def test_the_capture_has_the_frames_of_the_failed_drives_around_the_failures(tmp_path: Path) -> None:
    file = tmp_path / "report.scenario.yml"
    file.write_text(f'scenario: report\nfarm: {LINE}\nwith: {{"drives[0].count": 3}}\nsteps:{STEPS}')
    pcap, as_json = tmp_path / "out.pcapng", tmp_path / "out.json"
    assert main(["run", str(file), "--virtual", "--pcap", str(pcap), "--json", str(as_json)]) == 1
    record = json.loads(as_json.read_text())
    fields = ["frame.time_epoch", "frame.interface_name", "_ws.malformed", "frame.comment"]
    frames = tshark_fields(pcap, *fields)
    assert len(frames) == record["pcap_packets"] > 100
    # axis-01 did what was expected, of axis-03 nothing was
    assert {name for _, name, *_ in frames} == {"axis-02"}
    assert not any(malformed for _, _, malformed, _ in frames)
    comments = [comment for *_, comment in frames if comment]
    assert [comment.split(" (line")[0] for comment in comments] == [f"failed: {HOSTILE}", "failed: a ]]> & b"]
    windows = failure_windows(record, 1_000_000_000_000)
    for stamp, *_ in frames:
        assert any(window.begin_ns <= round(float(stamp) * 1e9) + 1000 for window in windows)
        assert any(round(float(stamp) * 1e9) - 1000 <= window.end_ns for window in windows)


def test_a_window_of_a_failure_without_drives_is_about_all() -> None:
    case = {
        "began_seconds": 2.0,
        "ended_seconds": 3.0,
        "verdict": "error",
        "drives": [],
        "name": "x",
        "line": 7,
        "message": "m",
    }
    passed = {**case, "verdict": "passed"}
    assert failure_windows({"cases": [case, passed]}, 0) == [
        Window(1_000_000_000, 3_500_000_000, None, "error: x (line 7): m")
    ]


def test_measured_values_have_their_unit_and_few_digits_in_every_report(tmp_path: Path) -> None:
    failed = run("""
  - wait: {until: state == S4, within: 20s}
  - wait: 537ms
  - expect: {drive: axis-01, that: velocity > 100000 and position > 1e9, within: 10ms, name: too fast}
""")
    (case,) = [case for case in failed["cases"] if case["verdict"] == "failed"]
    assert re.fullmatch(r"axis-01: velocity = -?[\d.]{1,6} rpm, position = -?[\d.]{1,7} revolutions", case["measured"])
    told = case["shown"]["axis-01"]
    assert float(told["velocity"].split()[0]) == pytest.approx(case["values"]["axis-01"]["velocity"], rel=1e-3)
    write_junit(failed, tmp_path / "j.xml")
    for text in (report_html(failed), (tmp_path / "j.xml").read_text("utf-8")):
        assert f"velocity = {told['velocity']}, position = {told['position']}" in text
