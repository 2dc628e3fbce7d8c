"""profinet-py (PyPI) as controller and engineering tool: finds, names and reads drives, runs them at 2 and 8 ms."""

from __future__ import annotations

import pytest

pytest.importorskip("profinet", reason="needs the package profinet-py")

#: Positive answer: five words; manufacturer 0x0105, drive unit type 1, version 1.17, year 2017, day and month.
PNU_964 = "0101000142050105000100750 7e1006e".replace(" ", "")
ORDER = "AKD-P00306-NBPN-0000"


@pytest.fixture
def peer(lab, farm):
    return lambda *arguments: lab.peer_json("peer_profinet_py.py", *arguments)


def mac_of(farm, name):
    return farm.ask("drive", name=name)["mac"]


def test_it_discovers_every_drive_with_its_identity(peer, farm):
    found = {device["name"]: device for device in peer("discover")}
    for name in ("axis-01", "axis-02"):
        drive = farm.ask("drive", name=name)
        assert found[name]["mac"] == drive["mac"]
        assert found[name]["ip"] == drive["ip"].split("/")[0]
        assert (found[name]["vendor"], found[name]["device"], found[name]["roles"]) == (0x0105, 0x0001, ["IO-Device"])


@pytest.mark.parametrize(
    ("station", "factor", "ratio", "hertz"), [("axis-01", 64, 1, 500.0), ("axis-02", 32, 8, 125.0)], ids=["2ms", "8ms"]
)
def test_it_takes_a_drive_to_operation_and_exchanges_data(peer, farm, station, factor, ratio, hertz):
    before = farm.ask("drive", name=station)
    found = peer("run", station, factor, ratio, 3)
    assert [zsw1 & 0x47 for zsw1 in found["states"]] == [0x40, 0x01, 0x03, 0x07], "S1, S2, S3, S4"
    assert found["followed"], "NIST_A did not reach NSOLL_A"
    assert found["actual"] == pytest.approx(found["wanted"], rel=0.02)
    assert found["received_per_second"] == pytest.approx(hertz, rel=0.1)
    assert (found["duplicates"], found["out_of_order"], found["invalid"]) == (0, 0, 0)
    assert found["stopped"], "no way back to S2"
    # records beside the cyclic data
    assert found["im0"]["order"] == ORDER
    assert found["parameters"] == {"47": PNU_964, str(0xB02E): PNU_964}
    after = farm.ask("drive", name=station)
    assert after["connects"] == before["connects"] + 1
    assert after["watchdog_expirations"] == before["watchdog_expirations"], "the data hold timer ran out"
    assert after["aborts"] == before["aborts"], "the connection did not end by its release"
    assert after["ars"] == 0


def test_it_reads_records_without_cyclic_data(peer, farm):
    found = peer("acyclic", "axis-01")
    assert found["im0"] == {"order": ORDER, "vendor": 0x0105, "serial": found["im0"]["serial"]}
    # block header of six octets, then the manufacturer's id
    assert bytes.fromhex(found["implicit_im0"])[8:28].decode() == ORDER
    assert found["slots"] == [[0, 1], [0, 0x8000], [0, 0x8001]], "RealIdentificationData of API 0"
    assert farm.ask("drive", name="axis-01")["ars"] == 0


def test_it_names_addresses_signals_and_resets_a_drive(peer, farm):
    mac = mac_of(farm, "axis-03")
    found = peer("rename", mac, "spindle-7", "10.77.2.77")
    assert found["name_set"]
    assert found["ip_set"]
    assert found["name"] == "spindle-7"
    assert found["found"] == "10.77.2.77"
    assert found["signalled"]
    drive = farm.ask("drive", name="axis-03")
    assert (drive["name"], drive["ip"], drive["signalled"]) == ("spindle-7", "10.77.2.77/22", True)
    # its names of the modes are not the standard's (BlockQualifier: 2 application data, 4 communication): so by number
    assert peer("reset", mac, "0002")
    drive = farm.ask("drive", name="axis-03")
    assert (drive["name"], drive["ip"]) == ("spindle-7", "10.77.2.77/22")
    assert peer("reset", mac, "0004")
    drive = farm.ask("drive", name="axis-03")
    assert (drive["name"], drive["ip"]) == ("", "")
