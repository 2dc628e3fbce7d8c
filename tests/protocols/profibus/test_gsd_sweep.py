"""Every GSD file at hand, with every module.

``PNFARM_GSD_FILES`` names a folder with more files, such as ``python -m tests.public_gsd`` fetches.
"""

import os
from pathlib import Path

import pytest
from gsd_sweep import Sweep, gsd_files

from pnfarm.buses.profibus.description.sheet import describe_model
from pnfarm.drives.catalogue import model
from pnfarm.protocols.profibus.gsd.writer import emit_gsd

FOLDER = os.environ.get("PNFARM_GSD_FILES")
MORE = gsd_files(Path(FOLDER)) if FOLDER else []
EXAMPLES = gsd_files(Path(__file__).parents[3] / "configs" / "gsd")


def test_the_file_of_a_model_is_plugged_with_every_telegram(tmp_path):
    path = tmp_path / "model.gsd"
    path.write_bytes(emit_gsd(describe_model(model("moog-msd-dp"))))
    found = Sweep(path)
    assert found.findings == []
    assert found.counts["modules"] == len(model("moog-msd-dp").profidrive.telegrams)


@pytest.mark.parametrize(("path", "modules"), [*zip(EXAMPLES, (5, 1), strict=True)])
def test_the_examples_are_plugged_with_every_module(path, modules):
    found = Sweep(path)
    assert (found.findings, found.counts["modules"], found.counts["warnings"]) == ([], modules, 0)


def test_the_sweep_finds_what_is_wrong(tmp_path):
    """So that the tests above can fail."""
    path = tmp_path / "wrong.gsd"
    path.write_bytes(EXAMPLES[0].read_bytes().replace(b"Max_Input_Len   = 64", b"Max_Input_Len = 7"))
    assert Sweep(path).findings == ["4AI: 8 octets of inputs, the station has room for 7"]


if MORE:

    @pytest.mark.parametrize("path", MORE, ids=[path.name for path in MORE])
    def test_another_makers_file_is_plugged_with_every_module(path):
        assert Sweep(path).findings == []
