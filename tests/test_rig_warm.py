"""The engine can be compiled ahead, for an image: nothing is left for the first farm to compile."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from llvmlite import binding
from machine_code import copy_machine_code
from numba.core.registry import cpu_target

from pnfarm.table.compiling import code_cache
from pnfarm.table.compiling.code_cache import is_cached, mark_cached, take_packaged
from pnfarm.table.compiling.compiled import IS_COMPILED
from pnfarm.table.compiling.processor import GENERIC, LEVEL, NEEDED, fitting

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


def test_code_that_came_with_the_package_is_taken_once_by_the_processor_that_it_is_for(tmp_path, monkeypatch):
    packaged, cache = tmp_path / "machine_code", tmp_path / "cache"
    monkeypatch.setattr(code_cache, "_PACKAGED", packaged)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(cache))
    cache.mkdir()
    monkeypatch.setattr(numba.config, "CPU_NAME", "x86-64-v3")
    name = "engine.tick-0123456789abcdef"
    place = packaged / "x86-64-v3"
    (place / name).mkdir(parents=True)
    (place / name / "tick-1.py311.nbi").write_bytes(b"index")
    mark_cached()
    shutil.move(next(cache.iterdir()), place)
    assert not is_cached()
    monkeypatch.setattr(numba.config, "CPU_NAME", "x86-64-v2")
    take_packaged()
    assert list(cache.iterdir()) == []
    monkeypatch.setattr(numba.config, "CPU_NAME", "x86-64-v3")
    take_packaged()
    assert is_cached()
    kept = cache / name / "tick-1.py311.nbi"
    assert kept.read_bytes() == b"index"
    # what is in the cache is in use, perhaps by another process
    kept.write_bytes(b"newer")
    take_packaged()
    assert kept.read_bytes() == b"newer"
    assert sorted(path.name for path in cache.iterdir()) == sorted([name, next(place.glob("complete-*")).name])


def test_code_of_other_sources_is_left_in_the_package(tmp_path, monkeypatch):
    place = tmp_path / "machine_code" / str(numba.config.CPU_NAME)
    (place / "engine.tick-0123456789abcdef").mkdir(parents=True)
    (place / "complete-0123456789abcdef").touch()
    monkeypatch.setattr(code_cache, "_PACKAGED", place.parent)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "cache").mkdir()
    take_packaged()
    assert list((tmp_path / "cache").iterdir()) == []


def test_a_cache_that_cannot_be_written_is_no_failure(tmp_path, monkeypatch):
    packaged = tmp_path / "machine_code"
    monkeypatch.setattr(code_cache, "_PACKAGED", packaged)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    mark_cached()
    place = packaged / str(numba.config.CPU_NAME)
    place.mkdir(parents=True)
    shutil.move(next(tmp_path.glob("complete-*")), place)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "missing"))
    take_packaged()
    assert not is_cached()


#: Compiles a function and loads another one where nothing can be written.
READ_ONLY = """
import sys
from pnfarm.table.compiling import code_cache

def refuse(self):
    raise OSError(30, "Read-only file system")

code_cache.DigestLocator.ensure_cache_path = refuse
from numba.core import event
with event.install_recorder("numba:compile") as recorder:
    import pnfarm.engine.tick
    from pnfarm.engine.columns import allocate
    print(pnfarm.engine.tick.next_due(allocate(images=1, axes=1, channels=1), 0) is not None, len(recorder.buffer))
from pnfarm.table.compiling.compiled import compiled

@compiled
def doubled(number): return 2 * number

print(doubled(21))
"""


def test_where_nothing_can_be_written_machine_code_is_loaded_and_the_rest_is_compiled(tmp_path):
    copy_machine_code(tmp_path)
    kept = sorted(tmp_path.rglob("*.nbi"))
    program = tmp_path / "program.py"
    program.write_text(READ_ONLY)
    run = python(str(program), NUMBA_CACHE_DIR=str(tmp_path), NUMBA_DISABLE_JIT="0")
    assert (run.returncode, run.stdout.split()) == (0, ["True", "0", "42"]), run.stderr
    assert sorted(tmp_path.rglob("*.nbi")) == kept


#: Loads the drive's step, and writes whether Numba's library of compiled functions was imported for it.
LOADS = """
import sys
from pnfarm.engine.columns import allocate
allocate(images=1, axes=1)
print("numba.np.linalg" in sys.modules)
"""


def test_a_start_with_kept_machine_code_does_not_load_the_compiler():
    # the first one compiles where nothing is kept
    for _ in range(2):
        run = python("-c", LOADS, NUMBA_DISABLE_JIT="0")
        assert run.returncode == 0, run.stderr
    assert run.stdout == "False\n"


ALL = dict.fromkeys(NEEDED, True)


@pytest.mark.parametrize(
    ("machine", "features", "processor"),
    [
        ("x86_64", ALL, LEVEL),
        ("x86_64", {**ALL, "avx512f": True}, LEVEL),
        ("x86_64", {**ALL, "sse4.2": False}, GENERIC),
        ("x86_64", {}, GENERIC),
        ("aarch64", {"neon": True}, GENERIC),
    ],
)
def test_a_processor_gets_the_level_if_it_has_all_of_its_instructions(machine, features, processor):
    assert fitting(machine, features) == processor


def test_the_compiler_uses_no_instruction_beyond_the_level():
    assert IS_COMPILED
    level = fitting(platform.machine(), dict(binding.get_host_cpu_features()))
    # what the code generator has, not what the settings say: it does not look at these again
    assert cpu_target.target_context.codegen().magic_tuple()[1:] == (level, "")

    # not kept, so that there is a text of it
    @numba.njit
    def add(values, more):
        for place in range(len(values)):
            values[place] += more[place]

    add(np.zeros(64), np.zeros(64))
    (code,) = add.inspect_asm().values()
    assert "addpd" in code, "two at a time, as every processor of the architecture can"
    assert not re.search("[yz]mm|vadd", code)


MADE = """
import numpy as np
from pnfarm.table.compiling.compiled import compiled

def made_for(factor):
    @compiled
    def scale(value):
        return value * factor

    @compiled
    def add(values):
        total = 0.0
        for place in range(len(values)):
            total += scale(values[place])
        return total

    return add

assert [made_for(factor)(np.ones(3)) for factor in (2.0, 3.0)] == [6.0, 9.0]
"""


def test_the_same_sources_make_the_same_octets_of_machine_code_in_any_folder(tmp_path):
    made = []
    for name in ("one", "other"):
        file = tmp_path / name / "beside" / "made.py"
        file.parent.mkdir(parents=True)
        file.write_text(MADE)
        cache = tmp_path / name / "cache"
        run = python(str(file), NUMBA_CACHE_DIR=str(cache), NUMBA_DISABLE_JIT="0", PYTHONHASHSEED="0")
        assert run.returncode == 0, run.stderr
        made.append({path.relative_to(cache): path.read_bytes() for path in sorted(cache.rglob("*.nb*"))})
    assert made[0] == made[1]
    assert len([path for path in made[0] if path.suffix == ".nbc"]) == 4, "each of the two has code for each factor"


def test_a_farm_compiles_nothing_once_the_engine_is_warm(tmp_path):
    # most of the machine code is there, as after a change in one file
    copy_machine_code(tmp_path)
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
