"""profinet-py (PyPI) as controller, told what a drive is by nothing but its GSDML file."""

import pytest

from pnfarm.buses.profinet.model_gsdml import describe_model, file_name
from pnfarm.drives.catalogue import model
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml

pytest.importorskip("profinet", reason="needs the package profinet-py")


def test_a_foreign_controller_runs_a_drive_by_its_file(lab, farm, tmp_path):
    akd = model("akd-profinet")
    path = tmp_path / file_name(akd)
    path.write_text(emit_gsdml(describe_model(akd)), encoding="utf-8")
    found = lab.peer_json("peer_profinet_py.py", "run", "axis-02", 32, 16, 2, str(path))
    assert [zsw1 & 0x47 for zsw1 in found["states"]] == [0x40, 0x01, 0x03, 0x07], "S1, S2, S3, S4"
    assert found["followed"], "NIST_A did not reach NSOLL_A"
    assert found["invalid"] == 0
    assert farm.ask("drive", name="axis-02")["ars"] == 0
