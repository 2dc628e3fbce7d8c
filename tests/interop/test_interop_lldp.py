"""LLDP with other people's programs: lldpd at the far end of the cable, Wireshark in between."""

import json
import re
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import pytest
from interop_rig import Capture, tshark_tree
from tools import needed
from waiting import until

#: PF_EXPERT severities of Wireshark: warning 0x600000.
WARNING = 0x600000
INTERVAL = 5.0


class Lldpd:
    """The daemon at the peer's end, and what it says of its neighbours."""

    def __init__(self, lab, folder):
        self._lab = lab
        self._socket = folder / "lldpd.sock"
        self._log = (folder / "lldpd.log").open("w", encoding="utf-8")
        self._process = lab.start(
            "peer",
            # nothing of this machine's configuration, and everything that it makes lies in the test's folder
            "lldpd", "-d", "-I", "plc0", "-O", "/dev/null", "-u", self._socket, "-p", folder / "lldpd.pid",
            "-S", "a switch of somebody else", stdout=self._log, stderr=self._log,
        )  # fmt: skip

    def close(self):
        self._process.terminate()
        self._process.wait(10)
        self._log.close()

    def control(self, *words):
        return self._lab.run("peer", "lldpcli", "-u", self._socket, *words, check=False).stdout

    def neighbours(self):
        """By chassis id: chassis and port as lldpd prints them."""
        text = self.control("-f", "json0", "show", "neighbors", "details")
        found = json.loads(text)["lldp"][0].get("interface", []) if text.strip() else []
        return {entry["chassis"][0]["id"][0]["value"]: (entry["chassis"][0], entry["port"][0]) for entry in found}


@pytest.fixture(scope="module")
def lldpd(lab):
    needed("lldpd")
    with tempfile.TemporaryDirectory(prefix="pnfarm-lldpd-") as folder:
        Path(folder).chmod(0o711)  # the half of the daemon that gives its rights up must reach its socket
        daemon = Lldpd(lab, Path(folder))
        try:
            assert until(lambda: "plc0" in daemon.control("show", "interfaces"), 15)
            yield daemon
        finally:
            daemon.close()


def test_lldpd_reads_every_drive(lldpd, farm):
    seen = until(lambda: found if len(found := lldpd.neighbours()) == 3 else None, 3 * INTERVAL)
    assert sorted(seen) == ["axis-01", "axis-02", "axis-03"]
    chassis, port = seen["axis-02"]
    assert chassis["id"] == [{"type": "local", "value": "axis-02"}]
    assert chassis["name"] == [{"value": "axis-02"}]
    assert chassis["descr"][0]["value"].startswith("AKD ")
    assert chassis["mgmt-ip"] == [{"value": "10.77.0.12"}]
    assert {"type": "Station", "enabled": True} in chassis["capability"]
    assert port["id"] == [{"type": "local", "value": "port-001"}]
    assert port["ttl"] == [{"value": "20"}]
    assert port["auto-negotiation"][0]["current"][0]["value"].startswith("100BaseTXFD")


def test_every_drive_knows_lldpd(lldpd, farm):
    lldpd.control("update")
    for name in ("axis-01", "axis-02", "axis-03"):
        drive = farm.until(lambda answer: answer["neighbours"], "drive", name=name, seconds=15)
        (neighbour,) = drive["neighbours"]
        assert neighbour["port"] == "port-001"
        assert re.fullmatch(r"([0-9A-F]{2}-){5}[0-9A-F]{2}", neighbour["chassis"])
        assert neighbour["system_name"]
        assert neighbour["ip"] == "10.77.3.200"
        assert re.fullmatch(r"([0-9a-f]{2}:){5}[0-9a-f]{2}", neighbour["mac"])


def test_siblings_on_one_nic_do_not_hear_each_other(lldpd, farm):
    time.sleep(INTERVAL + 0.5)
    for drive in farm.ask("drives"):
        assert {neighbour["ip"] for neighbour in drive["neighbours"]} == {"10.77.3.200"}
        assert not [reason for reason in drive["discards"] if reason in {"own-frame", "too-many-neighbours"}]


def test_wireshark_finds_nothing_wrong_with_our_frames(lab, farm, tmp_path):
    needed("tshark", "dumpcap")
    macs = {drive["mac"] for drive in farm.ask("drives")}
    with Capture(lab, tmp_path / "lldp.pcapng") as capture:
        time.sleep(2 * INTERVAL + 0.5)
    ours = "lldp && (" + " || ".join(f"eth.src=={mac}" for mac in sorted(macs)) + ")"
    rows = capture.fields("frame.number", "eth.src", "_ws.malformed", "_ws.expert.severity", where=ours)
    bad = [row for row in rows if row[2] or any(int(s) >= WARNING for s in row[3].split(",") if s)]
    assert not bad, tshark_tree(capture.path, bad[0][0])
    # each drive once in an interval, and not all together
    counts = Counter(row[1] for row in rows)
    assert set(counts) == macs
    assert set(counts.values()) <= {2, 3}
    fields = (
        "lldp.chassis.id", "lldp.port.id", "lldp.time_to_live", "lldp.profinet.cm_mac_add",
        "lldp.profinet.rtc2_port_status", "lldp.ieee.802_3.pmd_mau_type", "lldp.mgn.addr.ip4", "lldp.tlv.system.name",
    )  # fmt: skip
    (seen, *_) = capture.fields("eth.src", *fields, where=f"{ours} && lldp.tlv.system.name==axis-03")
    mac, chassis, port, ttl, chassis_mac, rtc2, mau, address, name = seen
    assert bytes.fromhex(chassis.replace(":", "")) == b"axis-03" or chassis == "axis-03"
    assert bytes.fromhex(port.replace(":", "")) == b"port-001" if ":" in port else port == "port-001"
    assert (ttl, chassis_mac, address, name) == ("20", mac, "10.77.0.13", "axis-03")
    assert int(rtc2, 0) == 0
    assert int(mau, 0) == 0x10


def test_a_frame_of_the_peer_reaches_every_drive_once(lab, farm):
    """Sent by scapy, with a name of its own; nothing of it comes back."""
    script = (
        "from scapy.all import Ether, sendp, conf; from scapy.contrib.lldp import *; conf.verb = 0;"
        "sendp(Ether(dst='01:80:c2:00:00:0e', src='02:5c:a9:00:00:01')"
        "/ LLDPDUChassisID(subtype=7, id=b'hall-switch') / LLDPDUPortID(subtype=7, id=b'port-007')"
        "/ LLDPDUTimeToLive(ttl=3) / LLDPDUEndOfLLDPDU(), iface='plc0')"
    )
    lab.run("peer", sys.executable, "-c", script)
    for name in ("axis-01", "axis-02", "axis-03"):
        drive = farm.ask("drive", name=name)
        assert [n["port_id"] for n in drive["neighbours"] if n["station"] == "hall-switch"] == ["port-007"]
    noted = [e for e in farm.ask("events", name="axis-01") if e.get("neighbour") == "hall-switch"]
    assert [e["event"] for e in noted] == ["neighbour appeared"]
    # its time to live passes
    drive = farm.until(
        lambda answer: not [n for n in answer["neighbours"] if n["station"] == "hall-switch"],
        "drive", name="axis-01", seconds=6,
    )  # fmt: skip
    assert drive["name"] == "axis-01"


def test_lldpd_forgets_drives_that_say_good_bye(lab, lldpd, tmp_path):
    from interop_rig import running

    drives = ["{name: 'guest-{n}', count: 2, model: akd-profinet, limits: lax}"]
    with running(lab, tmp_path, drives, name="guests"):
        assert until(lambda: len([c for c in lldpd.neighbours() if c.startswith("guest-")]) == 2, 3 * INTERVAL)
    assert until(lambda: not [c for c in lldpd.neighbours() if c.startswith("guest-")], 3)
