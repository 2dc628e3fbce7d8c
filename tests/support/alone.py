"""A program in a network namespace of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def run_alone(script: str, *arguments: str | Path) -> list[str]:
    """The lines that a Python script printed; it must end well within 120 s, and sees no interface of this machine."""
    if os.geteuid() != 0:
        # a veth pair is made in it, which an ordinary user may do nowhere
        pytest.skip("needs root to make a network namespace")
    run = subprocess.run(
        ["unshare", "-n", sys.executable, "-c", script, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        cwd=ROOT,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()
