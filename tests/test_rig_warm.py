"""The engine can be compiled ahead, for an image: nothing is left for the first farm to compile."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from pnfarm.table.compiling.compiled import cache_directory

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


def test_a_farm_compiles_nothing_once_the_engine_is_warm(tmp_path):
    # most of the machine code is there, as after a change in one file
    python("-m", "pnfarm.engine.warm", NUMBA_DISABLE_JIT="0")
    shutil.copytree(cache_directory(), tmp_path, dirs_exist_ok=True)
    for place in tmp_path.glob("engine.columns-*"):
        shutil.rmtree(place)
    settings = {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    warming = python("-m", "pnfarm.engine.warm", "--progress", **settings)
    assert warming.returncode == 0
    # one line for each function that was compiled, then the sum
    told = [line.split(" of ") for line in warming.stdout.splitlines()[:-1]]
    assert told
    assert [int(done) for done, _ in told] == list(range(1, len(told) + 1))
    made = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb*")}
    assert list(tmp_path.glob("engine.columns-*/*.nbi"))
    run = python("-c", FARM, **settings)
    assert run.returncode == 0, run.stderr
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb*")} == made


CHANGED = """
import sys
sys.path.insert(0, sys.argv[1])
from pnfarm.table.compiling.compiled import compiled
from {name} import number
from numba.core import event

@compiled
def doubled(): return 2 * number()

with event.install_recorder("numba:compile") as recorder:
    print(doubled())
print(len(recorder.buffer) // 2)
"""


def test_a_change_in_a_file_compiles_what_depends_on_it_and_a_copy_elsewhere_nothing(tmp_path):
    settings = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0"}
    source = "from pnfarm.table.compiling.compiled import compiled\n\n@compiled\ndef number(): return {number}\n"
    places = [tmp_path / "one" / "place", tmp_path / "other" / "place"]
    for place in places:
        place.mkdir(parents=True)
        (place / "constants.py").write_text(source.format(number=21))
        (place / "program.py").write_text(CHANGED.format(name="constants"))

    def run(place: Path) -> list[str]:
        done = python(str(place / "program.py"), str(place), **settings)
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    assert run(places[0]) == ["42", "2"]
    assert run(places[0]) == ["42", "0"]
    assert run(places[1]) == ["42", "0"]
    (places[0] / "constants.py").write_text(source.format(number=4))
    assert run(places[0]) == ["8", "2"]
    assert run(places[1]) == ["42", "0"]
    (places[0] / "program.py").write_text(CHANGED.format(name="constants") + "\n")
    assert run(places[0]) == ["8", "1"]
