"""A device by an EDS file on a real interface, with scanners and explicit clients from PyPI."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from interop_rig import running

pytest.importorskip("ethernetip", reason="needs the package ethernetip")
pytest.importorskip("pycomm3", reason="needs the package pycomm3")

DRIVES = ["{name: axis, model: akd-ethernetip, ip: 10.77.0.11/22}"]
ADDRESS = "10.77.0.61"
#: The assemblies that the scanners ask for: 64 octets each way, the bit that they wait for in the inputs' first octet.
EDS = """
[Device] VendCode = 65534; ProdType = 43; ProdCode = 7; MajRev = 1; MinRev = 2; ProdName = "Sixty-four";
[Device Classification] Class1 = EtherNetIP;
[Params]
        Param1 = 0, , , 0, 0xC6, 1, "State", "", "", , , 128;
        Param2 = 0, , , 0, 0xC6, 1, "Order", "", "", , , 0;
[Assembly]
        Assem101 = "Outputs", "20 04 24 65 30 03", 64, , , , 8, Param2;
        Assem102 = "Inputs", "20 04 24 66 30 03", 64, , , , 8, Param1;
[Connection Manager]
        Connection1 = 0x04010002, 0x4464040F, , , Assem101, , , Assem102, , , , ,
                "Owner", "", "20 04 24 64 2C 65 2C 66";
"""
PATIENT = 6


@pytest.fixture(scope="module")
def farm(lab, tmp_path_factory):
    folder = tmp_path_factory.mktemp("farm")
    (folder / "device.eds").write_text(EDS)
    rest = f"devices:\n  - {{name: device, eds: device.eds, ip: {ADDRESS}/22}}\n"
    with running(lab, folder, DRIVES, rest=rest) as worker:
        # it looks for a second whether its address is free
        worker.until(lambda _: ADDRESS in lab.run("farm", "ip", "-o", "address").stdout, "process")
        yield worker


@pytest.mark.parametrize("script", ["peer_ethernetip.py", "peer_cm_ethernetip.py"])
def test_a_scanner_exchanges_data_with_a_device_by_its_eds_file(lab, farm, script):
    if not (Path(sys.prefix) / "apart").is_dir():
        pytest.skip("needs the package cm-ethernetip in the environment's folder `apart`")
    said = lab.peer_json(script, 1.0, PATIENT, ADDRESS)[ADDRESS]
    assert said["name"] == "Sixty-four"
    assert said["sent"] > 30
    assert bytes.fromhex(said["inputs"]) == b"\x80" + bytes(63)


def test_an_explicit_client_reads_identity_and_parameters(lab, farm):
    said = lab.peer_json("peer_pycomm3.py", ADDRESS, 1)
    assert said["identity"]["product_name"] == "Sixty-four"
    assert (said["unconnected"]["name"], said["connected"]["vendor"]) == ("Sixty-four", 65534)
