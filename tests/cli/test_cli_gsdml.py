"""``pnfarm gsdml``: the file that engineering tools import."""

from __future__ import annotations

import pytest

from pnfarm.drives.catalogue import models
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml


@pytest.mark.parametrize("name", sorted(name for name, entry in models().items() if entry.bus == "profinet"))
def test_the_file_is_written_and_its_path_printed(pnfarm, tmp_path, name):
    done = pnfarm("gsdml", name, "-o", tmp_path)
    (path,) = tmp_path.iterdir()
    assert (done.code, done.out, done.err) == (0, f"{path}\n", "")
    assert path.name.startswith("GSDML-V2.35-pnfarm-")
    assert parse_gsdml(path.read_bytes()).daps[0].modules


def test_it_goes_to_the_folder_of_the_moment(pnfarm, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = pnfarm("gsdml", "akd")
    (path,) = tmp_path.iterdir()
    assert done.out == f"{path.name}\n"


def test_a_dash_prints_it(pnfarm, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = pnfarm("gsdml", "akd", "-o", "-")
    assert done.code == 0
    assert parse_gsdml(done.out.encode()).vendor_id == 0x0105
    assert not list(tmp_path.iterdir())


def test_an_unknown_model_and_a_folder_that_is_not_there_are_said(pnfarm, tmp_path):
    done = pnfarm("gsdml", "akd-profient")
    assert (done.code, done.out) == (2, "")
    assert "there is no drive model 'akd-profient'" in done.err
    assert "did you mean akd-profinet?" in done.err
    done = pnfarm("gsdml", "akd", "-o", tmp_path / "nowhere")
    assert (done.code, done.out) == (4, "")
    assert "cannot be written: no such file or directory" in done.err


def test_a_model_in_full_shows_what_only_its_file_says(pnfarm):
    shown = pnfarm("models", "akd").out
    assert "DESCRIPTION FILE" in shown
    assert "max cycle ns" in shown
    assert "alarms" in shown
