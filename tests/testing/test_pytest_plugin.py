"""The pytest plugin in a session of its own."""

import os
import subprocess
import sys

import pytest

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
FAILS = """
def test_it_stops(pnfarm_farm):
    line = pnfarm_farm("axis-01", "axis-02")
    line.wait_running()
    line["axis-02"].inject("drive-fault", fault=702, count=1)
    line.run(0.05)
    assert not line["axis-02"].fault
"""


def _session(folder, text, *options, **environment):
    file = folder / "test_mine.py"
    file.write_text(text)
    command = [sys.executable, "-m", "pytest", "-q", "-rs", "-p", "no:cacheprovider", "--rootdir", str(folder)]
    # the plugin by its name alone: also where the project is not installed, or a plugin of others would load the engine
    command += ["-p", "pnfarm.pytest_plugin", *options, str(file)]
    known = {key: value for key, value in os.environ.items() if not key.startswith("PNFARM_RE") and key != "PNFARM_RIG"}
    known["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    return subprocess.run(command, capture_output=True, text=True, check=False, env=known | environment)


def test_the_fixture_makes_a_line(tmp_path):
    done = _session(tmp_path, USES)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_session_that_does_not_use_it_loads_no_engine(tmp_path):
    done = _session(tmp_path, UNUSED)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_failed_test_shows_the_drives_and_their_last_events(tmp_path):
    done = _session(tmp_path, FAILS)
    assert done.returncode == 1
    assert "- pnfarm -" in done.stdout
    assert "<Drive axis-01 S4, connected, 60.0 rpm" in done.stdout
    assert ", connected, fault 702 (" in done.stdout
    assert " s axis-02: fault (number 702" in done.stdout


def test_a_failed_test_of_a_line_and_a_rig_shows_the_drives_of_both(tmp_path):
    rig = tmp_path / "rig.pnfarm.yml"
    rig.write_text(
        "farm: rig\nlink: {kind: memory}\napi: off\ncontroller: {ip: 10.77.0.1/24}\n"
        "drives: [{name: real, model: akd-profinet, ip: 10.77.0.11/24}]\n"
    )
    text = 'def test_it(pnfarm_farm, pnfarm_rig):\n    pnfarm_farm("virtual")\n    assert False\n'
    done = _session(tmp_path, text, "--pnfarm-rig", str(rig))
    assert "<Drive virtual " in done.stdout
    assert "<Drive real " in done.stdout


def test_without_the_option_a_test_of_a_rig_is_skipped_with_the_reason_or_fails_where_all_is_required(tmp_path):
    text = "def test_it(pnfarm_rig):\n    pass\n"
    done = _session(tmp_path, text)
    assert done.returncode == 0
    assert "needs a rig: --pnfarm-rig FILE" in done.stdout
    done = _session(tmp_path, text, PNFARM_REQUIRE_ALL="1")
    assert done.returncode == 1
    assert "PNFARM_REQUIRE_ALL is set" in done.stdout


@pytest.mark.parametrize(
    ("where", "sentence"),
    [("no-such.pnfarm.yml", "cannot be read"), ("http://127.0.0.1:9", "no farm answers at http://127.0.0.1:9")],
)
def test_a_rig_that_cannot_be_had_fails_with_one_sentence(tmp_path, where, sentence):
    done = _session(tmp_path, "def test_it(pnfarm_rig):\n    pass\n", "--pnfarm-rig", where)
    assert done.returncode == 1
    assert f"--pnfarm-rig {where}: " in done.stdout
    assert sentence in done.stdout
