"""Scenarios in virtual time against the built-in controller: green, red, and what the verdict rests on."""

from __future__ import annotations

import asyncio
import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from pnfarm.cli.commands.run import bound
from pnfarm.cli.main import main
from pnfarm.errors import ConfigError
from pnfarm.scenario.definition.file import load_scenario, parse_scenario
from pnfarm.scenario.virtual import run_virtual

LIBRARY = Path(__file__).resolve().parents[2] / "configs" / "scenarios"


def run(name: str, overrides: dict[str, Any] | None = None) -> dict[str, Any]:
    scenario = load_scenario(LIBRARY / name)
    scenario.overrides = {**scenario.overrides, **(overrides or {})}
    record, _ = asyncio.run(run_virtual(*bound(scenario)))
    return record


def run_steps(steps: str, overrides: dict[str, Any] | None = None) -> dict[str, Any]:
    text = f"scenario: test\nfarm: {LIBRARY / 'line.pnfarm.yml'}\nsteps:\n{steps}"
    scenario = parse_scenario(text)
    scenario.overrides = {"drives[0].count": 2, **(overrides or {})}
    record, _ = asyncio.run(run_virtual(*bound(scenario)))
    return record


def told(record: dict[str, Any]) -> list[tuple[str, str]]:
    return [(case["verdict"], case["message"]) for case in record["cases"]]


UP = "  - wait: {until: state == S4, within: 20s}\n"


def test_an_expectation_measures_when_it_came_true_and_a_failure_says_what_was_there() -> None:
    record = run_steps(
        UP
        + "  - fault: {kind: f702, on: axis-01, as: trip}\n"
        + "  - expect: {drive: axis-0*, that: fault == 702, within: 100ms}\n"
        + "  - expect: {drive: axis-01, that: fault == 702, within: 100ms}\n"
    )
    assert record["verdict"] == "failed"
    (red, green) = record["cases"]
    assert red["verdict"] == "failed"
    assert red["message"] == "not true within 100ms on axis-02"
    assert red["values"]["axis-02"] == {"fault": "0"}
    assert red["ended_seconds"] - red["began_seconds"] == pytest.approx(0.1)
    assert 0 < red["held_after_seconds"]["axis-01"] < 0.02
    assert green["verdict"] == "passed"
    assert green["held_after_seconds"] == {"axis-01": 0.0}


def test_a_state_that_lasts_less_than_a_look_is_seen() -> None:
    # on its way up the drive is in S2 and S3 for a cycle each
    record = run_steps("  - expect: {drive: all, that: state == S3, within: 10s}\n" + UP)
    assert record["verdict"] == "passed", told(record)


def test_a_drive_that_was_just_switched_off_and_on_shows_nothing_of_before() -> None:
    record = run_steps(
        UP
        + "  - power: {cycle: all}\n"
        + "  - expect: {drive: all, that: state == boot and not in_operation and not zsw1.operation_enabled}\n"
        + "  - expect: {drive: all, that: zsw1 == 0 and state != S4}\n"
        + "  - expect: {drive: all, that: state == S4, within: 30s}\n"
    )
    assert record["verdict"] == "passed", told(record)
    assert min(record["cases"][-1]["held_after_seconds"].values()) > 0.1


def test_what_a_step_switches_off_during_a_power_cycle_stays_off() -> None:
    record = run_steps(
        "  - fault: {kind: power-cycle, on: axis-01, params: {off: 1s}}\n"
        "  - wait: 500ms\n"
        "  - power: {off: axis-01}\n"
        "  - expect: {drive: axis-01, that: state == off, for: 2s}\n"
    )
    assert record["verdict"] == "passed", told(record)


def test_for_fails_at_the_moment_it_is_broken() -> None:
    record = run_steps(
        UP
        + "  - parallel:\n"
        + "      - expect: {drive: axis-01, that: state == S4, for: 2s}\n"
        + "      - [wait: 500ms, fault: {kind: f702, on: axis-01}]\n"
    )
    ((verdict, message),) = told(record)
    assert verdict == "failed"
    assert message.startswith("true, but no longer after 50")
    assert record["seconds"] < 5


def test_a_wait_that_fails_ends_the_run_and_the_rest_is_not_run() -> None:
    record = run_steps("  - wait: {until: state == S5, within: 1s}\n  - expect: {drive: all, that: connected}\n")
    assert [verdict for verdict, _ in told(record)] == ["failed", "not run"]
    assert record["verdict"] == "failed"
    assert "not true within 1s" in record["ended_early"]


def test_a_wait_that_fails_names_the_drives_of_which_it_never_came_true() -> None:
    record = run_steps(
        "  - fault: {kind: f702, on: axis-01}\n  - wait: {until: fault == 702, drive: all, within: 1s}\n"
    )
    assert told(record) == [("failed", "not true within 1s on axis-02")]


def test_metrics_are_measured_over_the_period() -> None:
    record = run_steps(
        UP
        + "  - parallel:\n"
        + "      - expect: {metric: pnfarm_watchdog_expirations_total, increases: '>= 1', for: 2s}\n"
        + "      - expect: {metric: 'pnfarm_watchdog_expirations_total{drive=\"axis-02\"}', increases: 0, for: 2s}\n"
        + "      - expect: {metric: pnfarm_controller_frame_interval_seconds, p50: < 30ms, for: 2s}\n"
        + "      - fault: {kind: loss, on: axis-01, direction: in, for: 1s}\n"
    )
    assert record["verdict"] == "passed", told(record)
    assert record["cases"][0]["value"] == 1


def test_a_time_beyond_the_last_bound_of_a_histogram_is_not_taken_for_that_bound() -> None:
    # the bounds of this metric end at 64 s
    record = run_steps(
        UP
        + "  - power: {off: axis-01}\n  - wait: 100s\n"
        + "  - parallel:\n"
        + "      - power: {on: axis-01}\n"
        + "      - expect: {metric: pnfarm_controller_reconnect_seconds, p99: < 90s, for: 20s}\n"
        + "      - expect: {metric: pnfarm_controller_reconnect_seconds, p50: '> 60s', for: 20s}\n"
    )
    assert told(record) == [
        ("failed", "p99 above the last bound of the histogram, wanted < 90 s"),
        ("passed", "p50 above the last bound of the histogram, wanted > 60 s"),
    ]
    assert record["cases"][0]["value"] is None
    json.dumps(record, allow_nan=False)


@pytest.mark.parametrize(
    ("metric", "sentence"),
    [
        (
            "{metric: pnfarm_watchdog_expiration_total, increases: 0, for: 1s}",
            "did you mean pnfarm_watchdog_expirations_total",
        ),
        ("{metric: pnfarm_watchdog_expirations, increases: 0, for: 1s}", "mean pnfarm_watchdog_expirations_total"),
        ("{metric: pnfarm_axis_state, p99: 1, for: 1s}", "is not a histogram"),
        ("{metric: pnfarm_controller_frame_interval_seconds, value: 1}", "is a histogram: ask for p50"),
        ("{metric: 'pnfarm_axis_state{drive=\"x\"}', value: 1}", "has no series"),
    ],
)
def test_a_metric_that_the_farm_lacks_is_refused_before_time_passes(metric: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        run_steps(f"  - wait: 1h\n  - expect: {metric}\n")


def test_what_a_scenario_did_is_undone_at_its_end_and_noted() -> None:
    record = run_steps(
        UP
        + "  - fault: {kind: silence, on: axis-01, as: mute}\n"
        + "  - power: {off: axis-02}\n"
        + "  - expect: {drive: axis-02, that: not powered and state == off}\n"
        + "  - wait: 200ms\n"
    )
    (fault,) = record["faults"]
    assert fault["name"] == "mute"
    assert fault["ended_seconds"] == record["seconds"]
    assert "power on" in [item["text"] for item in record["timeline"] if item.get("drive") == "axis-02"]


def test_a_scenario_with_more_faults_than_the_farm_remembers_ends_with_its_verdict(monkeypatch) -> None:
    monkeypatch.setattr("pnfarm.faults.manager.KEPT", 2)
    fault = "      - fault: {kind: silence, on: axis-01, for: 10ms, as: w$round}\n"
    record = run_steps(f"{UP}  - repeat:\n      times: 6\n      steps:\n  {fault}        - wait: 200ms\n")
    assert record["verdict"] == "passed", told(record)
    assert [fault["ended_seconds"] is not None for fault in record["faults"]] == [True] * 6


def test_load_switches_drives_on_over_time() -> None:
    record = run_steps(
        UP
        + "  - power: {off: all}\n  - wait: 1s\n  - load: {drives: +2, over: 4s}\n"
        + "  - expect: {drive: axis-01, that: state == S4}\n"
        + "  - expect: {drive: axis-02, that: state == S4, within: 10s}\n"
    )
    assert record["verdict"] == "passed", told(record)
    began = {item["drive"]: item["seconds"] for item in record["timeline"] if item["text"] == "power on"}
    assert began["axis-02"] - began["axis-01"] == pytest.approx(2.0)


def test_load_that_finds_too_few_drives_is_an_error_of_the_scenario() -> None:
    record = run_steps("  - load: +1\n")
    assert record["verdict"] == "error"
    assert "only 0 are off" in record["ended_early"]


def test_a_run_repeats_itself_to_the_nanosecond() -> None:
    assert run("f702-recovery.scenario.yml") | {"file": ""} == run("f702-recovery.scenario.yml") | {"file": ""}


def test_the_command_writes_its_reports_and_exits_with_the_verdict(tmp_path, capsys) -> None:
    text = (
        (LIBRARY / "f702-recovery.scenario.yml")
        .read_text()
        .replace("line.pnfarm.yml", str(LIBRARY / "line.pnfarm.yml"))
    )
    green = tmp_path / "green.scenario.yml"
    green.write_text(text)
    red = tmp_path / "red.scenario.yml"
    red.write_text(text + 'with: {controller.program: {kind: constant}, "drives[0].count": 3}\n')
    files = [f"--{kind}={tmp_path / kind}" for kind in ("junit", "json", "pcap")]
    assert main(["run", str(green), "--virtual", *files]) == 0
    assert "PASS  the PLC brings it back: true after" in capsys.readouterr().out
    assert main(["run", str(red), "--virtual", *files]) == 1
    assert "FAIL  the PLC acknowledges: not true within 5s on axis-03" in capsys.readouterr().out
    suite = ET.parse(tmp_path / "junit").getroot().find("testsuite")
    assert suite is not None
    assert suite.get("failures") == "2"
    assert suite.get("tests") == "7"
    record = json.loads((tmp_path / "json").read_text())
    assert record["verdict"] == "failed"
    assert record["pcap_packets"] > 0
    assert (tmp_path / "pcap").stat().st_size > 60 * record["pcap_packets"]


def test_bad_input_is_told_before_anything_starts(tmp_path, capsys) -> None:
    bad = tmp_path / "bad.scenario.yml"
    bad.write_text(
        f"scenario: bad\nfarm: {LIBRARY / 'line.pnfarm.yml'}\nsteps:\n  - expect: {{drive: x, that: connected}}\n"
    )
    for command in (["run", str(bad), "--virtual"], ["validate", str(bad)]):
        assert main(command) == 2
        assert f"{bad}:4: steps[0].expect.drive: no drive matches 'x'" in capsys.readouterr().err
    good = LIBRARY / "f702-recovery.scenario.yml"
    assert main(["run", str(good), "--pcap", str(tmp_path / "x.pcapng")]) == 2
    assert "add --virtual" in capsys.readouterr().err
    assert main(["run", str(good), "--virtual", "--junit", "/no/such/folder/x"]) == 2
    assert main(["run", str(tmp_path / "none.scenario.yml")]) == 2


def test_the_report_is_one_file_without_links_and_escapes_what_it_shows() -> None:
    from pnfarm.scenario.report.page import report_html

    record = run_steps(
        UP
        + "  - fault: {kind: f702, on: axis-01, for: 1s}\n"
        + "  - expect: {drive: axis-01, that: fault == 702, within: 1s}\n"
        + "  - expect: {drive: axis-01, that: state == S4, within: 5s, for: 1s, name: <script>alert(1)</script>}\n"
        + "  - expect: {drive: axis-01, that: fault == 702}\n"
    )
    page = report_html(record)
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert "http" not in page
    assert 'class="S4"' in page
    assert "acknowledged after" in page
    assert 'class="case-failed"' in page
    ET.fromstring(page[page.index("<svg") : page.index("</svg>") + 6])


def test_a_fault_of_a_step_waits_for_its_condition_and_the_reports_show_what_was_seen_of_it(tmp_path) -> None:
    record = run_steps(
        UP
        + "  - fault: {kind: f702, on: axis-01, as: trip, when: setpoint > 300}\n"
        + "  - fault: {kind: load, on: axis-02, as: never, when: velocity > 100000}\n"
        + "  - expect: {drive: axis-01, that: fault == 702, within: 20s}\n"
        + "  - wait: 100ms\n"
    )
    assert record["verdict"] == "passed", told(record)
    trip, never = record["faults"]
    assert trip["when"] == "setpoint > 300"
    assert trip["evidence"]["confirmation"] == "confirmed"
    assert trip["began_seconds"] is not None
    assert (never["began_seconds"], never["evidence"]["confirmation"]) == (None, "inconclusive")
    from pnfarm.scenario.report.junit import write_junit
    from pnfarm.scenario.report.page import report_html

    write_junit(record, tmp_path / "junit.xml")
    told_of = {p.get("name"): p.get("value") for p in ET.parse(tmp_path / "junit.xml").iter("property")}
    assert told_of["fault.trip"] == "f702 on axis-01: confirmed, checks 1, activations 1"
    assert "load on axis-02: inconclusive (there was nothing yet that it could act on)" in told_of["fault.never"]
    page = report_html(record)
    assert "<td>confirmed</td>" in page
    assert "<td>inconclusive: there was nothing yet that it could act on</td>" in page


def test_a_condition_that_a_model_does_not_understand_is_found_before_anything_starts() -> None:
    with pytest.raises(ConfigError, match=r"(?s)when.*did you mean velocity"):
        run_steps(UP + "  - fault: {kind: load, on: all, when: velocty > 3}\n")
    with pytest.raises(ConfigError, match=r"(?s)when.*ends where a name"):
        run_steps(UP + "  - fault: {kind: load, on: all, when: velocity >}\n")
