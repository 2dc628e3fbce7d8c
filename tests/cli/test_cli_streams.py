"""Standard output as programs find it: with a reader that goes, in another alphabet, closed."""

import contextlib
import io
import os
import signal
import subprocess
import sys
from pathlib import Path

import anyio
import pytest
from forks import clean_environment

from pnfarm.cli.main import main
from pnfarm.farm.farm import Farm
from pnfarm.hub import Hub

FARM = """\
farm: line
link: {kind: memory}
drives: [{name: a, model: akd-profinet, ip: 10.0.0.1/24}]
controller: {ip: 10.0.0.250/24}
"""
SCENARIO = """\
scenario: never
farm: line.pnfarm.yml
steps:
  - expect: {drive: a, that: velocity > 100000, within: 10ms}
"""


@pytest.fixture
def farm(tmp_path):
    path = tmp_path / "line.pnfarm.yml"
    path.write_text(FARM, "utf-8")
    return path


@contextlib.contextmanager
def unread():
    """Standard output is a pipe whose reader has gone.  Not a fixture, as pytest sets it before each test."""
    reading, writing = os.pipe()
    os.close(reading)
    before = sys.stdout
    with os.fdopen(writing, "w", encoding="utf-8") as sys.stdout:
        try:
            yield
        finally:
            sys.stdout = before


@pytest.mark.usefixtures("pnfarm")
def test_a_scenario_whose_output_nobody_reads_has_its_verdict_and_its_report(farm):
    scenario, junit = farm.with_name("never.scenario.yml"), farm.with_name("junit.xml")
    scenario.write_text(SCENARIO, "utf-8")
    with unread():
        assert main(["run", str(scenario), "--virtual", "--junit", str(junit)]) == 1
    assert 'failures="1"' in junit.read_text("utf-8")


@pytest.mark.usefixtures("pnfarm")
def test_a_comparison_whose_output_nobody_reads_ends_with_what_it_found(farm):
    farm.write_text(FARM.replace("kind: memory", "kind: tap, bridge: nobridge0"), "utf-8")
    with unread():
        assert main(["doctor", str(farm)]) == 4


@pytest.mark.usefixtures("pnfarm")
def test_what_the_terminals_alphabet_lacks_is_written_as_an_escape(farm, monkeypatch):
    octets = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(octets, "ascii"))
    assert main(["validate", str(farm.rename(farm.with_name("größe.pnfarm.yml")))]) == 0
    assert rb"gr\xf6\xdfe.pnfarm.yml: OK" in octets.getvalue()


@pytest.mark.parametrize("name", ["stdout", "stderr"])
@pytest.mark.usefixtures("pnfarm")
def test_a_closed_stream_changes_no_exit_code(name, farm, monkeypatch):
    monkeypatch.setattr(sys, name, None)
    assert main(["validate", str(farm)]) == 0
    assert main(["validate", str(farm.with_name("none.pnfarm.yml"))]) == 2
    getattr(sys, name).close()


def test_a_benchmark_says_before_it_runs_that_its_file_cannot_be_written(pnfarm, tmp_path):
    done = pnfarm("bench", "--json", tmp_path / "none" / "figures.json")
    assert done.code == 2
    assert "is not a folder" in done.err


async def stopped_by_a_signal(*_):
    os.kill(os.getpid(), signal.SIGTERM)
    await anyio.sleep_forever()


@pytest.mark.usefixtures("pnfarm")
def test_a_farm_whose_output_nobody_reads_runs_until_it_is_stopped(farm, monkeypatch):
    monkeypatch.setattr(Farm, "wait", stopped_by_a_signal)
    with unread():
        assert main(["--log-format", "console", "up", str(farm), "--api", "off"]) == 0


@pytest.mark.usefixtures("pnfarm")
def test_a_hub_whose_output_nobody_reads_runs_until_it_is_stopped(monkeypatch):
    monkeypatch.setattr(Hub, "record", lambda *_, **__: os.kill(os.getpid(), signal.SIGTERM))
    with unread():
        assert main(["--log-format", "console", "hub", "--shard", "127.0.0.1:9", "--api", "127.0.0.1:0"]) == 0


def test_an_error_on_a_full_disk_has_its_exit_code(process, farm):
    arguments = process.command("validate", farm.with_name("none.pnfarm.yml"))
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        assert subprocess.run(arguments, check=False, stderr=full, timeout=120, env=clean_environment()).returncode == 2


def test_output_for_which_the_disk_has_no_room_is_the_machines_fault(process, farm):
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        done = subprocess.run(
            process.command("validate", farm), check=False, stdout=full, stderr=subprocess.PIPE, text=True, timeout=120,
            env=clean_environment(),
        )  # fmt: skip
    assert (done.returncode, done.stderr.count("\n")) == (4, 1)
    assert "no room for what this command writes: no space left on device" in done.stderr
