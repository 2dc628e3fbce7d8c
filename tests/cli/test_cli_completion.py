"""What a shell completes."""

import os
import subprocess
import sys
from pathlib import Path

import click
import pytest
import typer

from pnfarm.cli import completion
from pnfarm.cli.completion import complete_drive, complete_fault


def words(line):
    """The words that bash would offer behind ``line``, by the program itself."""
    typed = line.split(" ")
    asked = {"_PNFARM_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(typed) - 1)}
    environment = {**os.environ, **asked}
    program = [str(Path(sys.executable).with_name("pnfarm"))]
    found = subprocess.run(program, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert found.stderr == ""
    return found.stdout.split()


@pytest.mark.parametrize(
    ("line", "expected"),
    [("pnfarm fault kinds sign-", ["sign-of-life-freeze", "sign-of-life-loss", "sign-of-life-skip"]),
     ("pnfarm fault add f7", ["f702"]),
     ("pnfarm models moog", ["moog-msd", "moog-msd-dp"]),
     ("pnfarm bench profibus-32-c", ["profibus-32-cpu", "profibus-32-cycle"]),
     ("pnfarm fault kinds no-such", [])],
)  # fmt: skip
def test_installed_words_are_completed(line, expected):
    assert sorted(words(line)) == expected


def test_nothing_is_offered_of_a_farm_that_does_not_run():
    assert words("pnfarm inspect axis") == []


class Farm:
    """What a running farm answers."""

    def __init__(self, address, token, tls_ca):
        assert (address, token, tls_ca) == ("http://127.0.0.1:8702", None, None)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def get(self, path):
        drives = [{"name": f"axis-{number:02}", "model": "akd-profinet", "state": "S4"} for number in (1, 2, 3)]
        faults = [{"id": "slow", "kind": "slow-ramp", "state": "active"}]
        return {"drives": {"drives": drives}, "faults": {"faults": faults}}[path]


def test_drives_and_faults_of_the_running_farm_are_completed(monkeypatch):
    monkeypatch.setattr("pnfarm.terminal.client.FarmClient", Farm)
    context = typer.Context(click.Command("inspect"))
    assert [word for word, _ in complete_drive(context, "axis-0")] == ["axis-01", "axis-02", "axis-03"]
    assert complete_drive(context, "axis-03") == [("axis-03", "akd-profinet, S4")]
    assert complete_fault(context, "") == [("slow", "slow-ramp, active")]
    assert completion._shortened("x" * 100) == "x" * 69 + "…"
