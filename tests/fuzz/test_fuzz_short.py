"""A few inputs for every parser and machine; ``python -m tests.fuzz`` gives them a million."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def fuzz(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tests.fuzz", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=300)


def test_every_parser_and_machine_stands_some_thousand_inputs():
    done = fuzz("--count", "20000")
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"^(\d+) inputs in .*nothing but DecodeError$", done.stdout, re.MULTILINE)
    assert found, done.stdout
    assert int(found[1]) >= 20_000


def test_the_same_seed_makes_the_same_inputs():
    first, second, other = (fuzz("--count", "3000", "--target", "rpc.parse_*", "--seed", seed).stdout for seed in "778")

    def outcomes(text):
        # target, inputs, accepted, and the reasons behind the two columns of times
        return re.findall(r"^(rpc\.\S+ +\d+ +\d+) +[\d.]+ +\d+ +(.*)$", text, re.MULTILINE)

    assert len(outcomes(first)) > 5
    assert outcomes(first) == outcomes(second)
    assert outcomes(first) != outcomes(other)


def test_an_unknown_target_is_a_wrong_argument():
    done = fuzz("--target", "no-such-thing")
    assert done.returncode == 2
    assert "--list" in done.stderr
