"""A few inputs for every parser, machine and running farm; ``python -m tests.fuzz`` gives them a million."""

from __future__ import annotations

import argparse
import re
import subprocess
from pathlib import Path

import pytest
from forks import run_fork

ROOT = Path(__file__).resolve().parents[2]


def fuzz(*arguments: str) -> subprocess.CompletedProcess[str]:
    return run_fork(ROOT / "tests" / "fuzz" / "__main__.py", *arguments, timeout=300)


def test_every_parser_and_machine_survives_some_thousand_inputs():
    done = fuzz("--count", "5000")
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"^(\d+) inputs in .*nothing but DecodeError$", done.stdout, re.MULTILINE)
    assert found, done.stdout
    assert int(found[1]) >= 5_000


def test_the_same_seed_makes_the_same_inputs():
    first, second, other = (fuzz("--count", "3000", "--target", "tlvs.*", "--seed", seed).stdout for seed in "778")

    def outcomes(text):
        # target, inputs, accepted, and the reasons behind the two columns of times
        return re.findall(r"^(tlvs\.\S+ +\d+ +\d+) +[\d.]+ +\d+ +(.*)$", text, re.MULTILINE)

    assert len(outcomes(first)) > 5
    assert outcomes(first) == outcomes(second)
    assert outcomes(first) != outcomes(other)


@pytest.mark.parametrize(("mode", "ends"), [("stranger", False), ("impostor", True)])
def test_a_running_farm_survives_a_hostile_station_and_the_same_seed_makes_the_same_one(mode, ends):
    options = ("--running", "--mode", mode, "--episode", "1", "--shots", "2000", "--drives", "2", "--seed", "5")
    first, second = (fuzz(*options) for _ in range(2))
    assert first.returncode == 0, first.stdout + first.stderr
    told = [re.search(r"digest (\w+); (\d+) connections lost and back", done.stdout) for done in (first, second)]
    assert told[0].groups() == told[1].groups()
    assert (int(told[0][2]) > 0) == ends, "an impostor is to end some connections, a stranger none"


def test_a_storm_of_faults_ends_with_every_drive_back():
    done = fuzz("--storms", "--episode", "1", "--seed", "1")
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.fullmatch(r"episode 1: .*; every drive is back\n", done.stdout)


def test_a_finding_is_reported_with_its_shots_and_how_to_repeat_it(monkeypatch, capsys):
    """The bound of memory made absurd: the first look finds something."""
    monkeypatch.syspath_prepend(str(ROOT))
    monkeypatch.syspath_prepend(str(ROOT / "tests" / "support"))
    from tests.fuzz import running, watch

    monkeypatch.setattr(watch, "MOST_ENTRIES", 1)
    options = argparse.Namespace(seed=3, minutes=1, drives=1, mode="stranger", shots=300, episode=0)
    assert running.main(options) == 1
    said = capsys.readouterr().err
    assert "episode 0 failed at shot 250 (seed 3)" in said
    assert "axis-01 holds" in said
    assert "again: python -m tests.fuzz --running --seed 3 --drives 1 --mode stranger --episode 0" in said


def test_an_unknown_target_is_a_wrong_argument():
    done = fuzz("--target", "no-such-thing")
    assert done.returncode == 2
    assert "--list" in done.stderr


def test_what_guided_fuzzing_kept_is_read_or_refused(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT))
    from tests.fuzz import guided
    from tests.fuzz.targets import parsers

    targets = {parser.name: parser for parser in parsers({"block": []})}
    names = {file.stem for file in guided.KEPT.glob("*.txt")}
    assert names
    assert names <= targets.keys()
    for name in names:
        for octets in guided.kept_inputs(name):
            targets[name].feed(octets)


def test_guided_fuzzing_says_what_it_needs(monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(ROOT))
    from tests.fuzz import guided

    monkeypatch.setattr(guided.importlib.util, "find_spec", lambda name: None)
    assert guided.main(argparse.Namespace()) == 4
    assert "needs atheris" in capsys.readouterr().err
