"""Every access point of a maker's file with every module and submodule, as a device under the controller.

``PNFARM_GSDML_FILES`` names a folder with more files, such as ``python -m tests.public_gsdml`` fetches.
"""

import os
from pathlib import Path

import pytest
from gsdml_examples import ISLAND, SCANNER

pytest.importorskip("profinet", reason="needs the package profinet-py")
from gsdml_sweep import Sweep

FOLDER = os.environ.get("PNFARM_GSDML_FILES")
MORE = sorted(Path(FOLDER).rglob("*.xml")) if FOLDER else []


@pytest.mark.parametrize("path", [ISLAND, SCANNER, *MORE], ids=lambda path: path.name)
def test_a_device_connects_with_every_module_of_its_file(path):
    found = Sweep(path)
    found.connect()
    assert found.findings == []
    assert found.counts["connected"] == found.counts["stations"] > 0


def test_the_sweep_finds_a_device_that_does_not_connect(tmp_path):
    """So that the test above can fail: no cycle is long enough for it."""
    path = tmp_path / "wrong.xml"
    text = ISLAND.read_text(encoding="utf-8")
    path.write_text(text.replace('MinDeviceInterval="32"', 'MinDeviceInterval="65535"'), encoding="utf-8")
    found = Sweep(path)
    found.connect()
    assert any("too fast for the device" in one for one in found.findings)
