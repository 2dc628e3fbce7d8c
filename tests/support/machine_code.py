"""Machine code of this project for a cache elsewhere, so that it is not compiled a second time."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path


def copy_machine_code(place: Path) -> None:
    """Put the machine code that this interpreter runs into the cache directory ``place``; it is not marked complete."""
    with tempfile.TemporaryDirectory() as beside:
        done = subprocess.run(
            [sys.executable, "-m", "pnfarm.engine.warm", "--copy-to", beside],
            capture_output=True, text=True, check=False, timeout=900, env={**os.environ, "NUMBA_DISABLE_JIT": "0"},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        (code,) = Path(beside).iterdir()
        folders = [folder for folder in code.iterdir() if folder.is_dir()]
        assert folders
        for folder in folders:
            shutil.copytree(folder, place / folder.name)
