"""What a path leads to: the farm file itself, and files and folders that it names."""

import os

import pytest
from farm_file import GOOD, KNOWN, issues, parse

from pnfarm.buses.profinet.gsdml_file import load_gsdml
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import FarmFileError, load_farm


def test_a_file_is_read_from_disk_and_named_in_its_errors(tmp_path):
    path = tmp_path / "x.pnfarm.yml"
    path.write_text(GOOD)
    assert load_farm(path, KNOWN).path == path
    path.write_text(GOOD.replace("count: 8", "count: 0"))
    with pytest.raises(FarmFileError, match=r"x\.pnfarm\.yml:7: drives"):
        load_farm(path, KNOWN)


def test_a_missing_file_and_a_folder_are_the_users_error(tmp_path):
    for path in (tmp_path / "none.yml", tmp_path):
        with pytest.raises(FarmFileError, match="cannot be read") as caught:
            load_farm(path, KNOWN)
        assert str(caught.value).startswith(str(path))


@pytest.fixture
def pipe(tmp_path):
    path = tmp_path / "pipe.pnfarm.yml"
    os.mkfifo(path)
    return path


def test_a_pipe_is_refused_and_not_waited_for(pipe):
    with pytest.raises(FarmFileError, match=r"pipe\.pnfarm\.yml: cannot be read: it is a pipe, not a regular file"):
        load_farm(pipe)


@pytest.mark.parametrize(("path", "told"), [("/dev/zero", "it is a device"), ("/", "it is a folder")])
def test_what_is_no_regular_file_is_refused(path, told):
    with pytest.raises(FarmFileError, match=told):
        load_farm(path)


def test_a_gsdml_file_that_is_a_pipe_is_refused_and_not_waited_for(pipe):
    with pytest.raises(ConfigError, match="cannot be read: it is a pipe"):
        load_gsdml(pipe)


@pytest.mark.parametrize(
    "text",
    [
        "parameter_lists: {akd-profinet: ~nobody-here/list.csv}",
        "devices: [{name: island, gsdml: ~nobody-here/island.xml}]",
        "devices: [{name: scale, eds: ~nobody-here/scale.eds, ip: 10.77.0.90/24}]",
        "devices: [{name: valve, gsd: ~nobody-here/valve.gsd, address: 9}]",
    ],
)
def test_a_file_in_the_home_of_somebody_unknown_is_one_that_is_not_there(text):
    found = issues(f"{GOOD}{text}\n")
    assert any("cannot be read: no such file or directory" in issue.what for issue in found)


def test_a_state_folder_in_the_home_of_somebody_unknown_is_a_folder_of_that_name(tmp_path):
    farm = parse(GOOD.replace("./state", "~nobody-here/state"), tmp_path / "line.pnfarm.yml")
    assert farm.state_directory == tmp_path / "~nobody-here" / "state"


def test_a_nul_character_that_is_written_with_an_escape_is_refused_as_well(tmp_path):
    text = GOOD + 'devices: [{name: island, gsdml: "a\\0.xml"}]\n'
    assert [(issue.line, issue.what) for issue in issues(text)] == [(16, "holds a NUL character")]
