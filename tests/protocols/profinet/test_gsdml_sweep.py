"""Every GSDML file at hand, with every access point, every module and every submodule: what is plugged is what another
reader finds there.

``PNFARM_GSDML_FILES`` names a folder with more files, such as ``python -m tests.public_gsdml`` fetches.
"""

import os
from pathlib import Path

import pytest
from gsdml_examples import ISLAND, SCANNER
from gsdml_kit import MINIATURE
from gsdml_models import NAMES
from gsdml_versions import VERSIONS, file_name, gsdml_of

from pnfarm.buses.profinet.model_gsdml import describe_model
from pnfarm.drives.catalogue import model
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml

pytest.importorskip("profinet", reason="needs the package profinet-py")
from gsdml_sweep import Sweep

FOLDER = os.environ.get("PNFARM_GSDML_FILES")
MORE = sorted(Path(FOLDER).rglob("*.xml")) if FOLDER else []


@pytest.mark.parametrize("name", NAMES)
def test_a_models_file_is_plugged_with_every_module(name, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(emit_gsdml(describe_model(model(name))), encoding="utf-8")
    found = Sweep(path)
    assert found.findings == []
    assert found.counts["modules"] >= 1


@pytest.mark.parametrize("version", VERSIONS)
def test_the_file_of_each_version_is_plugged_with_every_module(version, tmp_path):
    path = tmp_path / file_name(version)
    path.write_text(gsdml_of(version), encoding="utf-8")
    found = Sweep(path)
    assert found.findings == []
    assert found.counts["modules"] >= 3


@pytest.mark.parametrize(("path", "modules"), [(ISLAND, 20), (SCANNER, 2)])
def test_the_examples_are_plugged_with_every_module(path, modules):
    found = Sweep(path)
    assert found.findings == []
    assert found.counts["modules"] == modules
    assert found.gsdml.remarks == ()


def test_the_sweep_finds_what_is_wrong(tmp_path):
    """So that the tests above can fail."""
    path = tmp_path / "wrong.xml"
    path.write_text(MINIATURE.replace('AllowedInSlots="2 3"', 'AllowedInSlots="7"'), encoding="utf-8")
    assert any("slot 7 takes no module 'AX'" in finding for finding in Sweep(path).findings)


if MORE:

    @pytest.mark.parametrize("path", MORE, ids=[path.name for path in MORE])
    def test_another_makers_file_is_plugged_with_every_module(path):
        assert Sweep(path).findings == []
