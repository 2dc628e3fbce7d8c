"""The engine can be compiled ahead, for an image: nothing is left for the first farm to compile."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SUPPORT = Path(__file__).resolve().parent / "support"
#: A farm with its controller in virtual time, and an engine's thread on a socket of no network.
FARM = """
import socket
from pnfarm.engine.realtime import RealTimeEngine
from virtual_line import VirtualLine
line = VirtualLine(2)
line.connect()
line.enable()
near, far = socket.socketpair()
engine = RealTimeEngine(line.farm.columns, near)
engine.start()
engine.close()
"""


def python(*arguments, **environment):
    return subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, check=False, timeout=900,
        env={**os.environ, "PYTHONPATH": str(SUPPORT), **environment},
    )  # fmt: skip


def test_warming_says_in_one_line_where_the_machine_code_lies(tmp_path):
    run = python("-m", "pnfarm.engine.warm", NUMBA_DISABLE_JIT="0")
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("\n") == 1
    assert " compiled functions in /" in run.stdout


def test_warming_says_that_compilation_is_switched_off():
    run = python("-m", "pnfarm.engine.warm", NUMBA_DISABLE_JIT="1")
    assert run.returncode == 1
    assert run.stdout == ""
    assert "NUMBA_DISABLE_JIT" in run.stderr


@pytest.mark.slow
def test_a_farm_compiles_nothing_once_the_engine_is_warm(tmp_path):
    settings = {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    warming = python("-m", "pnfarm.engine.warm", "--progress", **settings)
    assert warming.returncode == 0
    # one line for each function, then the sum
    told = [line.split(" of ") for line in warming.stdout.splitlines()[:-1]]
    assert [int(done) for done, _ in told] == list(range(1, len(told) + 1))
    assert {int(functions) for _, functions in told} == {len(told)}
    made = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb*")}
    assert made
    run = python("-c", FARM, **settings)
    assert run.returncode == 0, run.stderr
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb*")} == made
