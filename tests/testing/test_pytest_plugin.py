"""The pytest plugin in a session of its own."""

from __future__ import annotations

import subprocess
import sys

USES = """
def test_the_axis_runs(pnfarm_farm):
    line = pnfarm_farm("axis-01")
    line.wait_running()
    assert line["axis-01"].zsw1.operation_enabled
"""
UNUSED = """
import sys

def test_nothing_is_loaded():
    assert not {"numba", "numpy", "pnfarm.testing"} & set(sys.modules)
"""


def _session(folder, text):
    file = folder / "test_mine.py"
    file.write_text(text)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "pnfarm.pytest_plugin", "--rootdir", str(folder), str(file)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_fixture_makes_a_line(tmp_path):
    done = _session(tmp_path, USES)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_session_that_does_not_use_it_loads_no_engine(tmp_path):
    done = _session(tmp_path, UNUSED)
    assert done.returncode == 0, done.stdout + done.stderr
