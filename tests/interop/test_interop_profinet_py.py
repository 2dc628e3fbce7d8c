"""profinet-py (PyPI) as controller and engineering tool: finds, names and reads drives, runs them at 2 and 8 ms."""

import json
import subprocess
import sys

import pytest
from interop_rig import HERE

from pnfarm.buses.profinet.model_gsdml import describe_model, file_name
from pnfarm.drives.catalogue import model, models
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml

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


def test_it_writes_and_reads_identification_and_maintenance(peer, farm):
    found = peer("texts", "axis-01")
    # its own writer puts two octets between header and text, where the standard has none: a wrong length (0xB1)
    assert found["own writer"]["pnio"] == backwards("DF80B100")
    assert bytes.fromhex(found["im1"]["im_tag_function"]).decode() == "pump 3".ljust(32)
    assert bytes.fromhex(found["im1"]["im_tag_location"]).decode() == "hall 7".ljust(22)
    assert bytes.fromhex(found["im2"]["im_date"]).decode() == "2026-01-31 10:00"
    assert bytes.fromhex(found["im3"]["im_descriptor"]).decode() == "the third pump".ljust(54)
    assert bytes.fromhex(found["im4"]["im_signature"]).startswith(b"signed")
    assert found["im5"]["pnio"] == backwards("DE80B000"), "the drive has none: an invalid index"
    # IM_Supported: bits 1 to 4
    assert found["im0"]["im_supported"] == 0b11110
    assert found["all"] == ["im0", "im1", "im2", "im3", "im4"], "it stops where I&M0 says"
    assert farm.ask("drive", name="axis-01")["ars"] == 0


def backwards(code):
    """A PNIOStatus as this package shows it: it takes the number of a big-endian answer for a little-endian one."""
    return bytes.fromhex(code)[::-1].hex()


def test_it_sees_slots_ports_records_and_the_log_of_a_drive(peer, farm):
    found = peer("places", "axis-01")
    ip, mac = farm.ask("drive", name="axis-01")["ip"].split("/")[0], mac_of(farm, "axis-01")
    places = [[0, 1], [0, 0x8000], [0, 0x8001]]
    for name in ("discover_slots",):
        assert [[s["slot"], s["subslot"]] for s in found[name]] == places
    assert [s["submodule_ident"] for s in found["read_real_identification_data"]["slots"]] == [1, 2, 3]
    assert found["read_inm0filter"] == {"0": {"0": [1, {"1": 1}]}}, "what carries I&M data"
    assert found["read_module_diff"] == {"modules": []}
    assert found["read_logbook"], "no entry in the log"
    interface, (port,) = found["read_topology"]
    assert (interface["chassis_id"], interface["mac"], interface["ip"]) == ("axis-01", mac, ip)
    assert (port["subslot"], port["port_id"]) == (0x8001, "port-001")
    assert found["read_pd_real_data"]["interface"]["chassis_id"] == "axis-01"
    assert [p["port_id"] for p in found["read_pd_real_data"]["ports"]] == ["port-001"]
    assert found["port"]["port_id"] == "port-001"
    sizes = {int(index): size for index, size in found["records"].items()}
    assert {0xAFF0, 0xAFF1, 0xAFF2, 0xAFF3, 0xF000, 0xF820, 0xF821, 0xF830, 0xF840, 0xF841} <= set(sizes)
    assert sizes[0xAFF0] == 60
    named = {int(index): entry["status"] for index, entry in found["indices"].items()}
    assert [named[index] for index in (0xAFF0, 0xAFF4, 0xAFF5)] == ["readable", "readable", "error"]
    assert {place: kind["type"] for place, kind in found["scan"].items()} == {
        "(0, 1)": "DAP", "(0, 32768)": "Interface", "(0, 32769)": "Port1",
    }  # fmt: skip
    info = found["info"]
    assert (info["name"], info["mac"], info["vendor_name"]) == ("axis-01", mac, "Kollmorgen")


def test_wrong_places_indices_and_lengths_have_the_standards_codes(peer, farm):
    found = peer("refusals", "axis-01")
    implicit = found.pop("implicit")
    assert implicit["pnio"] == backwards("DE80B200")
    assert {what: answer["pnio"] for what, answer in found.items()} == {
        # IEC 61158-6-10, PNIORW: 0xB0 invalid index, 0xB2 invalid slot or subslot, 0xB4 invalid area (API),
        # 0xB5 state conflict, 0xB1 write length error, 0xB6 access denied
        "no such index": backwards("DE80B000"),
        "no such slot": backwards("DE80B200"),
        "no such subslot": backwards("DE80B200"),
        "no such api": backwards("DE80B400"),
        "nothing asked yet": backwards("DE80B500"),
        "too short": backwards("DF80B100"),
        "read only": backwards("DF80B600"),
        "no such index to write": backwards("DF80B000"),
    }
    assert farm.ask("drive", name="axis-01")["ars"] == 0


class Listener:
    """The package's controller with its listener for alarms, told what to do line by line."""

    def __init__(self, lab, station):
        self._process = lab.start(
            "peer", sys.executable, HERE / "peer_profinet_py.py", "listen", station,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip

    def __enter__(self):
        assert json.loads(self._process.stdout.readline()) == "up"
        return self

    def ask(self, *what):
        self._process.stdin.write(json.dumps(what) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def alarms(self, count):
        """Type, slot and subslot of all so far, once there are so many."""
        return [(a["alarm_type"], a["slot_number"], a["subslot_number"]) for a in self.ask("alarms", count)]

    def __exit__(self, *failed):
        try:
            said, _ = self._process.communicate(timeout=20)
        finally:
            self._process.kill()
            self._process.wait()
        if not any(failed):
            assert json.loads(said.strip().splitlines()[-1]) == "released"


DIAGNOSIS, PROCESS, PLUG, GONE, PORT, PULL = 0x01, 0x02, 0x04, 0x0C, 0x0E, 0x03
AXIS = [0x3A00, 1, 2]
CODINGS = (
    {"error_type": 0x10},
    {"usi": 0x8002, "channel": 1, "error_type": 0x8000, "ext_error_type": 0x8001, "ext_add_value": 7},
    {
        "usi": 0x8003, "channel": 2, "error_type": 0x11, "ext_error_type": 1, "maintenance": 3, "qualifier": 1 << 27,
    },
    {"usi": 0x1234, "data": "6d616b6572"},
)  # fmt: skip


def test_it_hears_and_acknowledges_alarms_of_both_priorities_and_keeps_its_connection(lab, farm):
    """It counts one sequence for both priorities: the drive goes on in the one that came first."""
    before = farm.ask("drive", name="axis-01")
    with Listener(lab, "axis-01") as listener:
        for fields in CODINGS:
            assert farm.ask("diagnosis", name="axis-01", appears=True, place=AXIS, **fields)
        heard = listener.ask("alarms", len(CODINGS))
        assert [a["alarm_type"] for a in heard] == [DIAGNOSIS, PORT, DIAGNOSIS, DIAGNOSIS]
        assert [a["alarm_sequence_number"] for a in heard] == [0, 1, 2, 3]
        codings = [a["items"][-1]["user_structure_id"] for a in heard]
        assert codings == [0x8000, 0x8002, 0x8003, 0x1234]
        assert heard[0]["items"][-1]["channel_error_type"] == 0x10
        assert heard[1]["items"][-1]["ext_channel_add_value"] == 7
        assert heard[2]["items"][-1]["qualified_channel_qualifier"] == 1 << 27
        assert all(a["ar_diagnosis_state"] and a["submodule_diagnosis_state"] for a in heard)
        # the first of the other priority is refused by its NACK, and comes again as a low one
        for high in (True, False, True):
            assert farm.ask("alarm", name="axis-01", kind=PROCESS, place=AXIS, high=high) == 1
        assert listener.alarms(7)[4:] == [(PROCESS, 1, 2)] * 3
        for fields in CODINGS:
            assert farm.ask("diagnosis", name="axis-01", appears=False, place=AXIS, **fields)
        gone = listener.ask("alarms", 11)[7:]
        assert [a["alarm_type"] for a in gone] == [GONE, PORT, GONE, GONE]
        assert not gone[-1]["ar_diagnosis_state"], "the drive is healthy again"
        drive = farm.until(lambda _: acknowledged(farm) >= 11, "drive", name="axis-01")
        assert drive["established"]
    after = farm.ask("drive", name="axis-01")
    assert (after["aborts"], after["ars"], after["connects"]) == (before["aborts"], 0, before["connects"] + 1)
    assert after["discards"].get("alarm-peer-counts-once", 0) == before["discards"].get("alarm-peer-counts-once", 0) + 1


def acknowledged(farm):
    events = farm.ask("events", name="axis-01")
    begun = max(i for i, e in enumerate(events) if e["event"] == "ar connected")
    return sum(e["event"] == "alarm acknowledged" for e in events[begun:])


def test_a_module_that_is_pulled_and_plugged_shows_in_its_alarms_data_and_differences(lab, farm):
    with Listener(lab, "axis-02") as listener:
        assert farm.until(lambda d: d["established"], "drive", name="axis-02")
        assert len(bytes.fromhex(listener.ask("input", 1, 2, True))) == 4
        farm.ask("pull", name="axis-02", slot=1)
        # its ARProperties do not allow the alarm type of a whole module: a submodule's, of subslot 0
        assert listener.alarms(1) == [(PULL, 1, 0)]
        (module,) = listener.ask("read_module_diff")["modules"]
        assert (module["api"], module["slot_number"], module["module_state"]) == (0x3A00, 1, 0)
        farm.ask("plug", name="axis-02", slot=1)
        assert sorted(listener.alarms(3)[1:]) == [(PLUG, 1, 1), (PLUG, 1, 2)]
        (module,) = listener.ask("read_module_diff")["modules"]
        assert module["module_state"] == 2
        # it never ends the parameters of a plugged submodule: "ApplicationReady pending" (ARInfo 1), no data
        assert {s["submodule_state"] >> 7 & 0xF for s in module["submodules"]} == {1}
        assert listener.ask("input", 1, 2, False) is None, "bad data were given out"
        # a PrmBegin without a list of submodules: state conflict or unknown blocks, and the connection stands
        assert listener.ask("prm_begin")["pnio"].endswith("81dd")
        assert farm.ask("drive", name="axis-02")["established"]
    assert farm.ask("drive", name="axis-02")["aborts"] == {}


@pytest.mark.parametrize("name", [name for name, entry in models().items() if entry.bus == "profinet"])
def test_its_gsdml_reader_finds_every_module_of_a_model(peer, tmp_path, name):
    drive = model(name)
    path = tmp_path / file_name(drive)
    path.write_text(emit_gsdml(describe_model(drive)), encoding="utf-8")
    found = peer("described", path)
    identity = drive.profidrive.identity
    assert (found["vendor_id"], found["device_id"]) == (identity.vendor_id, identity.device_id)
    idents = {module["module_ident"] for module in found["modules"].values()}
    assert idents >= {telegram.module.ident for telegram in drive.profidrive.telegrams.values()}
