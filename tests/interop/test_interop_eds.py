"""A device by an EDS file on a real interface, with scanners and explicit clients from PyPI."""

import json
import sys
from pathlib import Path

import pytest
from interop_rig import running

pytest.importorskip("ethernetip", reason="needs the package ethernetip")
pytest.importorskip("pycomm3", reason="needs the package pycomm3")
pytest.importorskip("cpppo", reason="needs the package cpppo")

DRIVES = ["{name: axis, model: akd-ethernetip, ip: 10.77.0.11/22}"]
ADDRESS = "10.77.0.61"
#: Of a device that no scanner connects to: its outputs stay as they were at first.
UNCONNECTED = "10.77.0.62"
#: The assemblies that the scanners ask for: 64 octets each way, the bit that they wait for in the inputs' first octet.
EDS = """
[Device] VendCode = 65534; ProdType = 43; ProdCode = 7; MajRev = 1; MinRev = 2; ProdName = "Sixty-four";
[Device Classification] Class1 = EtherNetIP;
[Params]
        Param1 = 0, , , 0, 0xC6, 1, "State", "", "", , , 128;
        Param2 = 0, , , 0, 0xC6, 1, "Order", "", "", , , 0;
        Param3 = 0, 6, "20 64 24 01 30 05", 0, 0xC7, 2, "Window", "ms", "Mean", 1, 1000, 50;
        Param4 = 0, , , 0x14, 0xC3, 2, "Heat", "K", "", , , -5, 1, 10, 1, 0, , , , , 1;
[Assembly]
        Assem100 = "Settings", "20 04 24 67 30 03", 2, , , , 16, Param3;
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
    addresses = {"device": ADDRESS, "unconnected": UNCONNECTED}
    devices = [f"  - {{name: {name}, eds: device.eds, ip: {ip}/22}}" for name, ip in addresses.items()]
    rest = "\n".join(["devices:", *devices, ""])
    with running(lab, folder, DRIVES, rest=rest) as worker:
        # they look for a second whether their addresses are free
        for address in addresses.values():
            worker.until(lambda _, ip=address: ip in lab.run("farm", "ip", "-o", "address").stdout, "process")
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


@pytest.mark.parametrize("client", ["unconnected", "connected", "cpppo"])
def test_an_explicit_client_reads_and_writes_what_the_file_describes(lab, farm, client):
    """General statuses: 5 no such instance, 9 invalid value, 14 not settable, 19 too short, 20 no such attribute, 22
    no such class.
    """
    wanted = {
        "vendor": ([1, 1, 1], "feff"),
        "product": ([1, 1, 7], b"\nSixty-four".hex()),
        "inputs": ([4, 102, 3], "80" + 63 * "00"),
        "size of the inputs": ([4, 102, 4], "4000"),
        "outputs": ([4, 101, 3], 64 * "00"),
        "outputs are their owner's": ([4, 101, 3, 64 * "01"], 14),
        "settings": ([4, 103, 3, "4b00"], ""),
        "settings come back": ([4, 103, 3], "4b00"),
        "settings above the maximum": ([4, 103, 3, "e903"], 9),
        "parameters": ([0x0F, 0, 2], "0400"),
        "parameters have all attributes": ([0x0F, 0, 8], "0300"),
        "the written setting": ([0x0F, 3, 1], "4b00"),
        "a parameter": ([0x0F, 3, 1, "c800"], ""),
        "the written parameter": ([4, 103, 3], "c800"),
        "at its path": ([0x64, 1, 5], "c800"),
        "written there": ([0x64, 1, 5, "3200"], ""),
        "too low": ([0x0F, 3, 1, "0000"], 9),
        "too short": ([0x0F, 3, 1, "01"], 19),
        "read only": ([0x0F, 4, 1, "0000"], 14),
        "of cyclic data": ([0x0F, 1, 1], "80"),
        "path": ([0x0F, 3, 3], "206424013005"),
        "name": ([0x0F, 3, 7], b"\6Window".hex()),
        "unit": ([0x0F, 3, 8], b"\2ms".hex()),
        "minimum": ([0x0F, 3, 10], "0100"),
        "maximum": ([0x0F, 3, 11], "e803"),
        "default": ([0x0F, 4, 12], "fbff"),
        "divisor": ([0x0F, 4, 14], "0a00"),
        "decimals": ([0x0F, 4, 21], "01"),
        "no such parameter": ([0x0F, 5, 1], 5),
        "no such attribute": ([0x0F, 3, 22], 20),
        "no such assembly": ([4, 99, 3], 5),
        "no such object": ([0x99, 1, 1], 22),
    }
    said = lab.peer_json(
        "peer_explicit.py", client, UNCONNECTED, json.dumps({name: one for name, (one, _) in wanted.items()})
    )
    assert said == {name: answer for name, (_, answer) in wanted.items()}
