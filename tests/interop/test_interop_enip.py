"""Drives on EtherNet/IP with peers from PyPI and with the kernel's own stack, 64 in one subnet, on real interfaces."""

import itertools
import statistics
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from ipaddress import IPv4Address
from pathlib import Path

import pytest
from interop_rig import Capture, running, tshark_tree
from tools import needed

pytest.importorskip("ethernetip", reason="needs the package ethernetip")
pytest.importorskip("pycomm3", reason="needs the package pycomm3")
pytest.importorskip("cpppo", reason="needs the package cpppo")

COUNT = 64
FIRST = IPv4Address("10.77.0.11")
ADDRESSES = [str(FIRST + n) for n in range(COUNT)]
DRIVES = [f"{{name: 'axis-{{n:02}}', count: {COUNT}, model: akd-ethernetip, ip: {FIRST}/22}}"]
BROADCAST = "10.77.3.255"
PRODUCT, VENDOR = "AKD", 452
ENABLED = 0x80
#: Numbers of a Forward_Open's timeout multiplier: 4 times 2 to the power of it; 2.56 s and 640 ms.
PATIENT, RESOLUTE = 6, 4
#: AIN.CUTOFF, thousandths of a hertz.
INSTANCE = 1
SCANNERS = ["peer_ethernetip.py", "peer_cm_ethernetip.py"]
#: PF_EXPERT severity of Wireshark.
WARNING = 0x600000


@pytest.fixture(scope="module")
def farm(lab, tmp_path_factory):
    """64 drives whose addresses are in use."""
    if not (Path(sys.prefix) / "apart").is_dir():
        pytest.skip("needs the package cm-ethernetip in the environment's folder `apart`")
    with running(lab, tmp_path_factory.mktemp("farm"), DRIVES) as worker:
        # each looks for a second whether its address is free
        worker.until(lambda _: ADDRESSES[-1] in lab.run("farm", "ip", "-o", "address").stdout, "process")
        yield worker


@pytest.fixture(scope="module")
def drives(farm):
    """What the farm knows of each drive, by its address; before any peer came."""
    return {known["ip"].split("/")[0]: known | {"name": name} for name, known in farm.ask("cips").items()}


@pytest.fixture(scope="module")
def seen(lab, farm, drives, tmp_path_factory):
    """What each peer said, and a capture of all of them; every scanner with one drive."""
    needed("tshark", "dumpcap", "ping")
    with Capture(lab, tmp_path_factory.mktemp("seen") / "all.pcapng") as capture:
        said = {
            "arp": lab.peer_json("peer_enip_raw.py", "arp", FIRST, COUNT),
            "ping": lab.run("peer", "ping", "-c", 3, "-i", 0.05, "-s", 1400, "-W", 5, ADDRESSES[63]).stdout,
            "long ping": lab.run("peer", "ping", "-c", 1, "-s", 4000, "-W", 5, ADDRESSES[62]).stdout,
            "refused": lab.peer_json("peer_enip_raw.py", "refused", ADDRESSES[3]),
            "peer_pycomm3.py": lab.peer_json("peer_pycomm3.py", ADDRESSES[2], INSTANCE),
            "peer_cpppo.py": lab.peer_json("peer_cpppo.py", ADDRESSES[2], INSTANCE, BROADCAST),
        }
        for script, address in zip(SCANNERS, ADDRESSES, strict=False):
            said[script] = lab.peer_json(script, 1.5, PATIENT, address)[address]
            said[script, "drive"] = farm.until(
                lambda drive: not drive["connections"], "cip", name=drives[address]["name"]
            )
    return said, capture


def of(macs):
    return "(" + " || ".join(f"eth.src=={mac}" for mac in sorted(macs)) + ")"


# -- cyclic data -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("script", SCANNERS)
def test_a_scanner_exchanges_data_with_a_drive(seen, script):
    said, _ = seen
    assert said[script]["name"] == PRODUCT
    # 150 in the time that was asked for, on a machine that may be busy
    assert said[script]["sent"] > 50
    assert bytes.fromhex(said[script]["inputs"])[0] & ENABLED
    assert said[script, "drive"]["connects"] == 1
    assert not said[script, "drive"]["losses"]


@pytest.mark.parametrize("script", SCANNERS)
def test_a_scanner_exchanges_data_with_32_drives(lab, farm, drives, script):
    wanted = ADDRESSES[:32]
    before = farm.ask("cips")
    found = lab.peer_json(script, 2, PATIENT, *wanted)
    after = farm.until(lambda every: not any(one["connections"] for one in every.values()), "cips")
    assert list(found) == wanted
    for address, said in found.items():
        name = drives[address]["name"]
        assert said["name"] == PRODUCT
        assert bytes.fromhex(said["inputs"])[0] & ENABLED, name
        assert after[name]["connects"] == before[name]["connects"] + 1
        assert after[name]["losses"] == before[name]["losses"], name


@pytest.mark.parametrize("place", range(2))
def test_a_drive_produces_every_10_ms_by_the_capture(seen, drives, place):
    _, capture = seen
    mac = drives[ADDRESSES[place]]["mac"]
    rows = capture.fields("frame.time_epoch", "cip.seq", "enip.cpf.sai.seq", where=f"eth.src=={mac} && cipio")
    # Wireshark knows the connection once it has seen the answer, which comes by another way
    rows = list(itertools.dropwhile(lambda row: not row[1], rows))
    assert len(rows) > 100
    assert {(int(b[2]) - int(a[2])) & 0xFFFFFFFF for a, b in itertools.pairwise(rows)} == {1}
    assert {(int(b[1]) - int(a[1])) & 0xFFFF for a, b in itertools.pairwise(rows)} == {1}
    times = [float(row[0]) for row in rows]
    # a stall of the machine is no drift: the drive sends at the ticks of 10 ms again afterwards
    assert statistics.median(b - a for a, b in itertools.pairwise(times)) == pytest.approx(0.01, rel=0.05)


# -- a hostile client --------------------------------------------------------------------------------------------------


def test_no_drive_loses_its_controller_over_a_hostile_client(lab, farm, drives):
    """Hundreds of bad connections, garbage, half messages, floods of requests for connections and of datagrams."""
    attacked = ADDRESSES[40:44]
    names = [drives[address]["name"] for address in attacked]
    before, process = farm.ask("cips"), farm.ask("process")
    with ThreadPoolExecutor(1) as pool:
        honest = pool.submit(lab.peer_json, SCANNERS[1], 5, RESOLUTE, *attacked)
        for name in names:
            farm.until(lambda drive, old=before[name]: drive["connects"] > old["connects"], "cip", 20, name=name)
        bad = lab.peer_json("peer_enip_raw.py", "hostile", 3, *attacked)
        after, busy = farm.ask("cips"), farm.ask("process")
        said = honest.result()
    assert bad["floods"] > 10
    assert bad["connects"] > 100
    assert bad["datagrams"] > 500
    for address, name in zip(attacked, names, strict=True):
        assert after[name]["connects"] == before[name]["connects"] + 1
        assert not after[name]["losses"]
        # it was enabled all the time, and asked for its name in the end
        assert bytes.fromhex(said[address]["inputs"])[0] & ENABLED
        assert said[address]["name"] == PRODUCT
        assert said[address]["received"] > 200
        # connections beyond the drive's number, messages beyond its size, and what is no message
        assert {"streams", "long", "bad-length"} <= {
            reason for reason, count in after[name]["discards"].items() if count
        }
    assert busy["rss"] - process["rss"] < 20_000_000
    # each drive has 16 streams, and one more that it refuses
    assert busy["files"] - process["files"] <= 17 * len(attacked)
    # the socket by which the farm asks for a stranger's MAC address may be new, and stays
    farm.until(lambda now: now["files"] <= process["files"] + 1, "process")
    assert farm.ask("process")["rss"] - process["rss"] < 20_000_000


# -- explicit messages -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("how", "position", "parameter"), [("unconnected", 12345, 20000), ("connected", -54321, 30000)]
)
def test_pycomm3_reads_and_writes(seen, how, position, parameter):
    said = seen[0]["peer_pycomm3.py"][how]
    assert said == {
        "name": PRODUCT, "vendor": VENDOR, "fault": 0,
        "position": position, "position set": True, "parameter": parameter, "parameter set": True,
        "no such attribute": "Attribute not supported", "not settable": "Attribute not settable",
        "too short": "Insufficient command data", "no such object": "Object does not exist",
    }  # fmt: skip


def test_pycomm3_lists_the_identity(seen, drives):
    identity = seen[0]["peer_pycomm3.py"]["identity"]
    assert identity["product_name"] == PRODUCT
    assert identity["vendor"] == "Kollmorgen"
    assert identity["ip_address"] == ADDRESSES[2]
    assert int(identity["serial"], 16) == int(drives[ADDRESSES[2]]["mac"].replace(":", "")[4:], 16)


def test_cpppo_finds_every_drive_by_broadcast(seen):
    assert seen[0]["peer_cpppo.py"]["listed"] == dict.fromkeys(ADDRESSES, PRODUCT)


def test_cpppo_reads_and_writes(seen):
    said = seen[0]["peer_cpppo.py"]
    position, parameter = (list(value.to_bytes(4, "little")) for value in (4711, 40_000))
    values = [[0, position], [0, parameter], [0, [0]], [0, list(VENDOR.to_bytes(2, "little"))]]
    assert said["name"] == [PRODUCT]
    assert said["identity"][0] == VENDOR
    assert said["identity"][6] == PRODUCT
    assert said["written"] == [[0, True], [0, True]]
    # status 0x14: no such attribute
    assert said["one by one"] == [*values, [0x14, None]]
    assert said["many at once"] == values


def test_a_drive_says_what_it_refuses(seen):
    assert seen[0]["refused"] == {
        "command": [0x01], "session": [0x64], "items": [0x03], "long": [0x65], "registered": [0x01],
        "by datagram": [0x01], "service": [0, 0x08], "short": [0, 0x13],
        "size": [0, 0x01, 0x0127, 70], "point": [0, 0x01, 0x012F],
    }  # fmt: skip


# -- addresses ---------------------------------------------------------------------------------------------------------


def test_each_of_64_addresses_in_one_subnet_is_answered_by_its_own_drive_alone(seen, drives):
    assert seen[0]["arp"] == {address: [drives[address]["mac"]] for address in ADDRESSES}


def test_a_drive_answers_ping(seen):
    said, _ = seen
    assert "3 received, 0% packet loss" in said["ping"]
    assert "1 received, 0% packet loss" in said["long ping"]


def test_a_drive_uses_no_address_but_its_own(seen, drives):
    _, capture = seen
    by_mac = {drive["mac"]: address for address, drive in drives.items()}
    rows = capture.fields(
        "eth.src", "ip.src", "arp.src.hw_mac", "arp.src.proto_ipv4", where=f"{of(by_mac)} && (ip || arp)"
    )
    spoken = {(row[0], (row[1] or row[3]).split(",")[0]) for row in rows}
    assert all(row[2] in {"", row[0]} for row in rows)
    assert spoken == set(by_mac.items())


# -- in the eyes of Wireshark ------------------------------------------------------------------------------------------


def test_no_frame_of_a_drive_is_malformed_or_worth_a_warning(seen, drives):
    _, capture = seen
    rows = capture.fields(
        "frame.number", "_ws.malformed", "_ws.expert.severity", "_ws.expert.message", "_ws.col.Info", "udp.srcport",
        where=f"{of(drive['mac'] for drive in drives.values())} && (_ws.malformed || _ws.expert)",
    )  # fmt: skip
    bad = []
    for row in rows:
        found = zip(row[2].split(","), row[3].split(","), strict=False)
        said = {text.split(" [")[0] for severity, text in found if int(severity or 0) >= WARNING}
        # the kernel's: TCP's acknowledgements, and a datagram's checksum, which it leaves to a network card
        said -= {"D-SACK Sequence"} | ({"Bad checksum"} if row[5] == "44818" else set())
        if row[1] or said:
            bad.append(row)
    kinds = Counter((row[1], row[3], row[4].split(",")[0]) for row in bad)
    first = tshark_tree(capture.path, bad[0][0]) if bad else ""
    assert not bad, f"{len(bad)} frames, such as {kinds.most_common(8)}; the first:\n{first}"


def test_the_capture_holds_frames_of_every_kind(seen, drives):
    """What the tests above say is true of all of these."""
    _, capture = seen
    rows = capture.fields(
        "cipio", "udp", "enip.command", "cip.service", "cip.genstat", "arp.opcode", "icmp.type",
        where=of(drive["mac"] for drive in drives.values()),
    )  # fmt: skip
    found = {(*map(bool, row[:2]), *(int(v.split(",")[0], 0) if v else None for v in row[2:])) for row in rows}
    kinds = {
        "cyclic": lambda cyclic, *_: cyclic,
        "identities": lambda _, udp, command, *_more: udp and command == 0x63,
        "identities by TCP": lambda _, udp, command, *_more: not udp and command == 0x63,
        "sessions": lambda _, __, command, *_more: command == 0x65,
        "unconnected": lambda _, __, command, *_more: command == 0x6F,
        "connected": lambda _, __, command, *_more: command == 0x70,
        "arp": lambda *row: row[5] == 2,
        "ping": lambda *row: row[6] == 0,
    }
    services = {
        "opened": (0xD4, 0), "opened large": (0xDB, 0), "not opened": (0xD4, 1), "closed": (0xCE, 0),
        "read": (0x8E, 0), "written": (0x90, 0), "many at once": (0x8A, 0), "refused": (0xB3, 8),
    }  # fmt: skip
    missing = [name for name, holds in kinds.items() if not any(holds(*row) for row in found)]
    missing += [name for name, what in services.items() if what not in {row[3:5] for row in found}]
    assert not missing, sorted(found, key=str)
