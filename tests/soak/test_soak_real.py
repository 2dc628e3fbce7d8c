"""The soak in real time, for seconds: the programs, the namespace, the verdict, and what Ctrl-C leaves."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 300.0


@pytest.fixture
def soak(tmp_path):
    """Starts a run; its report is in ``report.json``."""
    started = []

    def start(seconds: float, drives: int) -> subprocess.Popen[str]:
        report = tmp_path / "report.json"
        hours = ["--hours", str(seconds / 3600), "--drives", str(drives), "--rate", "5"]
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.soak", *hours, "--out", str(report)],
            cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            env={**os.environ, "TMPDIR": str(tmp_path)},
        )  # fmt: skip
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()


def skip_without_namespace(process, said):
    if process.returncode == 4:
        pytest.skip(said.strip())


def of_run(tmp_path) -> list[str]:
    """Command lines of processes that this run started."""
    found = []
    for place in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            command = place.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if "tests.soak.watched" in command and str(tmp_path) in command:
            found.append(command)
    return found


@pytest.mark.slow
def test_seconds_of_random_faults_over_real_programs_end_with_a_verdict(soak, tmp_path):
    process = soak(5.0, 8)
    said, _ = process.communicate(timeout=SECONDS)
    skip_without_namespace(process, said)
    assert process.returncode == 0, said
    report = json.loads((tmp_path / "report.json").read_text())
    verdicts = {check["name"]: check["ok"] for check in report["checks"]}
    assert set(verdicts.values()) == {True}
    for name in ("every drive in operation", "no fault left", "event stream complete", "interfaces gone"):
        assert verdicts[name] is True
        assert name in said
    assert report["events"]["fault injected"] > 0
    assert not of_run(tmp_path)


@pytest.mark.slow
def test_ctrl_c_ends_a_run_and_its_programs(soak, tmp_path):
    process = soak(600.0, 4)
    said = ""
    for line in process.stdout:
        said += line
        if "0.0 min" in line:
            break
    else:
        process.wait()
        skip_without_namespace(process, said)
    assert len(of_run(tmp_path)) == 2, said
    process.send_signal(signal.SIGINT)
    rest, _ = process.communicate(timeout=SECONDS)
    assert process.returncode == 130, said + rest
    assert "interrupted" in rest
    assert not of_run(tmp_path)
    assert json.loads((tmp_path / "report.json").read_text())["samples"]
