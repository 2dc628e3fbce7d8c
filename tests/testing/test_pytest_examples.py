"""The tests that a tester copies (configs/pytest), as pytest runs them; the rig's with the farm file beside them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "configs" / "pytest"


@pytest.mark.parametrize(
    ("files", "options", "found"),
    [
        (("test_program.py", "test_every_fault.py", "test_async.py"), (), "19 passed"),
        (("test_rig.py",), ("--pnfarm-rig", "line.pnfarm.yml"), "3 passed"),
    ],
)
def test_the_examples_pass(tmp_path, files, options, found):
    folder = shutil.copytree(EXAMPLES, tmp_path / "mine")
    (folder / "pytest.ini").write_text("[pytest]\n")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "pnfarm.pytest_plugin", *options, *files]
    known = {key: value for key, value in os.environ.items() if not key.startswith("PNFARM_R")}
    # by its name alone, also where the project is not installed
    known |= {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder, env=known)
    assert done.returncode == 0, done.stdout + done.stderr
    assert found in done.stdout
