"""The benchmark ``first-start``: the first farm after an installation of a wheel with machine code."""

from __future__ import annotations

import compileall
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.bench.loops import interpreter_loop
from pnfarm.bench.result import Result, Windows
from pnfarm.errors import InternalError

if TYPE_CHECKING:
    from pnfarm.bench.load import Load

__all__ = ["first_start"]

STARTS = 3
#: A start that compiles takes up to two minutes.
LIMIT_SECONDS = 300.0
FILE = """
farm: first-start
link: {kind: memory}
drives: [{name: akd-01, model: akd-profinet, ip: 10.0.0.11/24}]
controller: {name: plc, ip: 10.0.0.100/24}
"""
CONNECTED = '"event": "connected"'


def _installed(place: Path) -> None:
    """Put the package there as the wheel has it, with byte code as pip makes it."""
    package = Path(__file__).resolve().parents[1]
    shutil.copytree(package, place / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    code = place / package.name / "machine_code"
    if not code.exists():
        warm = [sys.executable, "-m", "pnfarm.engine.warm", "--copy-to", str(code)]
        subprocess.run(warm, check=True, stdout=subprocess.DEVNULL)
    compileall.compile_dir(place, quiet=2)


def _start(site: Path, cache: Path, file: Path) -> float:
    """Seconds until the drive of ``file`` is connected."""
    settings = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    settings |= {"PYTHONPATH": str(site), "XDG_CACHE_HOME": str(cache)}
    command = [sys.executable, "-m", "pnfarm", "--log-format", "json", "up", str(file)]
    begin = time.monotonic()
    with subprocess.Popen(
        command, cwd=site, env=settings, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as farm:
        assert farm.stdout is not None
        try:
            for line in farm.stdout:
                took = time.monotonic() - begin
                if CONNECTED in line:
                    return took
                if took > LIMIT_SECONDS:
                    break
        finally:
            farm.terminate()
    raise InternalError("a farm of one drive was not connected at its first start")


def first_start(seconds: float, load: Load) -> list[Result]:
    """Time from the command to data exchange of one drive, for a user who never started a farm."""
    del seconds
    first, again, loops = [], [], []
    with tempfile.TemporaryDirectory(prefix="pnfarm-bench-") as folder:
        place = Path(folder)
        _installed(place / "site")
        file = place / "one.pnfarm.yml"
        file.write_text(FILE)
        with load:
            for number in range(STARTS):
                loops.append(interpreter_loop(3))
                cache = place / f"cache-{number}"
                first.append(_start(place / "site", cache, file))
                again.append(_start(place / "site", cache, file))
    loop, once = Windows(loops), Windows(first)
    return [
        once.row("first-start", "s", once.median * 1e3 / loop.median, "<= 4", once.median <= 4),
        Windows(again).row("first-start-again", "s for the next start"),
        loop.row("first-start-interpreter", "ms for a fixed loop in Python", 1.0),
    ]
