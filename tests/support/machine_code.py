"""Machine code of this project for a cache elsewhere, so that it is not compiled a second time."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

#: Compiles what is missing, and prints the folders that hold the machine code of these sources.
FOLDERS = """
from pathlib import Path
import pnfarm
from pnfarm.engine.warm import warm
from pnfarm.table.compiling.code_cache import DigestLocator
warm()
for room in ("table", "firmware", "engine"):
    for file in (Path(pnfarm.__file__).parent / room).rglob("*.py"):
        print(DigestLocator(warm, str(file)).get_cache_path())
"""


def copy_machine_code(place: Path) -> None:
    """Put the machine code that this interpreter runs into the cache directory ``place``."""
    done = subprocess.run(
        [sys.executable, "-c", FOLDERS], capture_output=True, text=True, check=False, timeout=900,
        env={**os.environ, "NUMBA_DISABLE_JIT": "0"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    folders = [folder for line in done.stdout.splitlines() if (folder := Path(line)).is_dir()]
    assert folders
    for folder in folders:
        shutil.copytree(folder, place / folder.name)
