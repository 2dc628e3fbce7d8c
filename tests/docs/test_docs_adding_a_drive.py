"""``docs/adding-a-drive.md``: its four files are a drive that runs, and mistakes are reported as it says."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from parameter_requests import read_request, results
from virtual_line import VirtualLine

from pnfarm.buses.profinet.model_gsdml import describe_model
from pnfarm.drives.catalogue import MODELS_VARIABLE, model, models
from pnfarm.drives.profiles.profidrive.base_mode import ParameterAddress, emit_request, parse_response
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml
from pnfarm.table.program import RUNNING

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "adding-a-drive.md").read_text(encoding="utf-8")
NAME = "example-servo"
FILES = dict(re.findall(r"^## `(\S+)`\n\n```\w+\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL))
#: File, its text, what is written instead, what the loader says.
MISTAKES = re.findall(r"^\| `([^`]+)` \| `([^`]+)` \| `([^`]+)` \| `([^`]+)` \|$", PAGE, re.MULTILINE)


@pytest.fixture
def drive_folder(tmp_path, monkeypatch):
    """The page's drive, as a reader puts it beside the program."""
    folder = tmp_path / "my-drives" / "example_servo"
    folder.mkdir(parents=True)
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    monkeypatch.setenv(MODELS_VARIABLE, str(folder.parent))
    return folder


def test_the_four_files_have_fewer_than_150_lines():
    assert FILES.keys() == {"model.toml", "parameters.csv", "faults.csv", "telegrams.toml"}
    assert sum(len(text.splitlines()) for text in FILES.values()) < 150


def test_the_drive_is_an_example_that_is_not_shipped():
    assert NAME not in models()
    with pytest.raises(ConfigError, match="there is no drive model"):
        model(NAME)


def test_the_drive_is_listed_beside_those_that_are_shipped(drive_folder):
    assert models()[NAME].folder == drive_folder
    assert len(models()) > 1
    assert tuple(model(NAME).profidrive.telegrams) == (1, 9)


@pytest.mark.parametrize(("name", "old", "new", "message"), MISTAKES, ids=[new for _, _, new, _ in MISTAKES])
def test_a_wrong_line_is_reported_as_the_page_says(drive_folder, name, old, new, message):
    path = drive_folder / name
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        model(NAME)
    assert message in str(caught.value)
    assert str(drive_folder) in str(caught.value)


def test_the_page_tries_a_mistake_in_every_file():
    assert {name for name, *_ in MISTAKES} == FILES.keys()


def test_the_description_file_names_both_telegrams(drive_folder):
    text = emit_gsdml(describe_model(model(NAME)))
    assert {module.ident for module in parse_gsdml(text).modules} == {0x0101, 0x0109}


@pytest.mark.slow
def test_the_tests_that_sweep_every_model_pass_with_it(drive_folder):
    """As the page has it, with the folders named that sweep."""
    folders = [
        "tests/drives",
        "tests/protocols/profinet/test_gsdml_device.py",
        "tests/protocols/profinet/test_gsdml_timing.py",
        "tests/cli/test_cli_gsdml.py",
    ]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", NAME, *folders],
        cwd=ROOT,
        env=os.environ | {"PNFARM_REQUIRE_ALL": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    passed = re.search(r"(\d+) passed", done.stdout)
    assert passed
    assert int(passed[1]) > 50


# in a farm, under the built-in controller


def axis_of(line):
    return line.farm.columns.axis[0]


def fails_and_comes_back(line):
    """A fault takes the axis out of operation; the controller acknowledges it and goes on."""
    line.farm.axes[0].raise_fault("overvoltage", hold=False)
    line.run(0.1)
    assert int(axis_of(line).faults.code[0]) == 2
    assert not line.plc.all_running
    assert line.world.run(5.0, until=lambda: int(line.plc.columns.program[0].phase) == RUNNING)
    assert int(axis_of(line).faults.code[0]) == 0
    assert int(line.plc.columns.program[0].faults) == 1


def test_it_runs_a_speed_by_telegram_1(drive_folder):
    line = VirtualLine(model=NAME, cycle="2ms", program="{kind: constant, speed_rpm: 600, acknowledge_after: 200ms}")
    line.enable()
    line.run(1.0)
    assert float(axis_of(line).motor.velocity) == pytest.approx(600.0, abs=0.2)
    fails_and_comes_back(line)
    line.run(1.0)
    assert float(axis_of(line).motor.velocity) == pytest.approx(600.0, abs=0.2)


def test_it_goes_to_positions_by_telegram_9(drive_folder):
    line = VirtualLine(
        model=NAME,
        cycle="2ms",
        telegram=9,
        program="{kind: positions, speed_rpm: 600, acceleration: 10000, targets: [3, -2.5], dwell: 50ms, "
        "acknowledge_after: 200ms}",
    )
    line.enable()

    def reaches(target):
        moves = int(line.plc.columns.program[0].moves)
        assert line.world.run(10.0, until=lambda: line.plc.columns.program[0].moves > moves, look_ns=1_000_000)
        line.run(0.04)
        assert float(axis_of(line).motor.position - axis_of(line).homing.origin) == pytest.approx(target, abs=0.01)

    reaches(3.0)
    reaches(-2.5)
    fails_and_comes_back(line)
    reaches(-2.5)  # the present target once more
    reaches(3.0)


def test_its_parameters_answer_over_the_network(drive_folder):
    line = VirtualLine(model=NAME, cycle="2ms", params="{1100: 1500}")
    line.connect()
    place, now = (0x3A00, 1, 1, 0xB02E), line.world.now
    request = read_request(1, [ParameterAddress(922), ParameterAddress(1100)])
    line.plc.write_record("axis-01", place, emit_request(request), now)
    job = line.plc.read_record("axis-01", place, now, length=240)
    assert line.world.run(2.0, until=lambda: job.done)
    assert [entry.values for entry in results(request, parse_response(job.data))] == [(1,), (1500,)]


def test_lost_cyclic_data_are_the_fault_of_its_data_sheet(drive_folder):
    line = VirtualLine(model=NAME, cycle="2ms")
    line.enable()
    line.plc.columns.ppm[line.plc.sessions[0].provider].active = 0
    line.run(0.1)
    assert int(axis_of(line).faults.code[0]) & 0xFFFFFF == 7
