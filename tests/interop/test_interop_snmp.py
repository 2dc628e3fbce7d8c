"""net-snmp's tools against drives: the whole tree in every way to walk it, errors, sets that outlast a power cycle."""

import itertools
import re

import pytest
from interop_rig import Capture, running
from tools import needed

DRIVES = ["{name: 'axis-{n:02}', count: 2, model: akd-profinet, ip: 10.77.0.11/22, limits: lax}"]
DRIVE, OTHER = "10.77.0.11", "10.77.0.12"
SYSTEM = ".1.3.6.1.2.1.1"
INTERFACES = ".1.3.6.1.2.1.2"
LLDP = ".1.0.8802.1.1.2.1"
#: PF_EXPERT severity of Wireshark: warning.
WARNING = 0x600000
#: What walks of version 1 and 2c say behind the last object.
ENDS = ("End of MIB", "No more variables left in this MIB View (It is past the end of the MIB tree)")
LINE = re.compile(r"^(\.[0-9.]+) = (?:([A-Za-z0-9-]+): ?)?(.*)$")


class Manager:
    """net-snmp's tools in the peer's namespace, without any MIB file: names are numbers."""

    def __init__(self, lab, folder):
        self._lab = lab
        self._folder = folder
        (folder / "cert_indexes").mkdir()  # or the tools say that they made it

    def __call__(self, tool, *arguments, version="2c", community="public", drive=DRIVE, check=True):
        needed(tool)
        done = self._lab.run(
            "peer", "env", f"SNMP_PERSISTENT_DIR={self._folder}", f"MIBDIRS={self._folder}", tool,
            "-v", version, "-c", community, "-m", "", "-On", "-Oe", "-r", 1, "-t", 1, *arguments[:-1], drive,
            *arguments[-1],
            check=False,
        )  # fmt: skip
        if check:
            assert (done.returncode, done.stderr) == (0, ""), (done.stdout, done.stderr)
        return done

    def objects(self, tool, *arguments, **options):
        """What a walk lists: (name, type, text) for each object."""
        lines = self(tool, *arguments, **options).stdout.splitlines()
        if lines and lines[-1].endswith(ENDS):
            del lines[-1]
        # a text may hold line ends; none of ours does
        found = [LINE.match(line) for line in lines]
        assert all(found), lines
        return [match.groups() for match in found]

    def get(self, name, **options):
        ((_, _, text),) = self.objects("snmpget", [name], **options)
        return text.strip('"')


@pytest.fixture(scope="module")
def farm(lab, tmp_path_factory):
    with running(lab, tmp_path_factory.mktemp("snmp"), DRIVES) as worker:
        yield worker


@pytest.fixture
def manager(lab, tmp_path):
    return Manager(lab, tmp_path)


def arcs(name):
    return tuple(int(arc) for arc in name[1:].split("."))


def test_every_way_to_walk_gives_the_same_objects_in_their_order(manager, farm):
    walked = manager.objects("snmpwalk", [".1"])
    names = [name for name, _, _ in walked]
    assert len(names) > 150
    assert all(arcs(a) < arcs(b) for a, b in itertools.pairwise(names))
    assert not [line for line in walked if "No " in line[2]]
    for repetitions in (1, 10, 50, 2000):
        bulk = manager.objects("snmpbulkwalk", f"-Cr{repetitions}", [".1"])
        assert [line[:2] for line in bulk] == [line[:2] for line in walked]
    version_1 = manager.objects("snmpwalk", [".1"], version="1")
    assert [line[:2] for line in version_1] == [line[:2] for line in walked if line[1] != "Counter64"]
    assert {line[1] for line in walked} >= {
        "INTEGER",
        "STRING",
        "OID",
        "Timeticks",
        "Counter32",
        "Gauge32",
        "Counter64",
    }


def test_a_drive_says_who_it_is_and_what_its_port_is(manager, farm):
    drive = farm.ask("drive", name="axis-01")
    mac = drive["mac"].replace(":", " ").upper()
    serial = "PNF" + drive["mac"].replace(":", "").upper()
    description = manager.get(f"{SYSTEM}.1.0")
    assert re.fullmatch(rf"AKD {{23}}AKD-P00306-NBPN-0000 {serial} {{6}}1 V  1 17  0", description), description
    assert manager.get(f"{SYSTEM}.2.0") == ".1.3.6.1.4.1.24686"
    assert manager.get(f"{SYSTEM}.5.0") == "axis-01"
    assert manager.get(f"{SYSTEM}.7.0") == "78"
    assert manager.get(f"{INTERFACES}.1.0") == "2"
    port = {name: text.strip('" ') for name, _, text in manager.objects("snmpwalk", [f"{INTERFACES}.2.1"])}
    assert port[f"{INTERFACES}.2.1.2.1"] == "Port X11"
    assert [port[f"{INTERFACES}.2.1.{arc}.1"] for arc in (3, 4, 5, 6, 7, 8)] == [
        "6",
        "1500",
        "100000000",
        mac,
        "1",
        "1",
    ]
    assert manager.get(f"{LLDP}.3.2.0") == "axis-01"
    assert manager.get(f"{LLDP}.3.7.1.3.1") == "port-001"
    assert manager.get(f"{LLDP}.3.8.1.5.1.4.{DRIVE}") == "2"
    assert manager.get(f"{LLDP}.5.3791.1.2.1.1.6.1") == "axis-01"
    assert manager.get(f"{LLDP}.5.4623.1.2.1.1.4.1") == "16"
    assert manager.get(f"{SYSTEM}.5.0", drive=OTHER) == "axis-02"


def test_counters_grow_by_what_the_drive_hears_and_says(lab, manager, farm):
    needed("ping")
    names = [f"{INTERFACES}.2.1.{arc}.1" for arc in (10, 11, 16, 17)]

    def read():
        return [int(text) for _, _, text in manager.objects("snmpget", names)]

    before = read()
    lab.run("peer", "ping", "-c", 10, "-i", 0.02, "-W", 2, "-s", 1000, DRIVE)
    in_octets, in_frames, out_octets, out_frames = (b - a for a, b in zip(before, read(), strict=True))
    # ten echo requests and one of the two SNMP messages; ARP may come and go beside them
    frame = 14 + 20 + 8 + 1000 + 4
    assert 10 * frame < in_octets < 11 * frame + 1000
    assert 10 * frame < out_octets < 11 * frame + 1000
    assert 11 <= in_frames <= 14
    assert 11 <= out_frames <= 14


def test_uptime_starts_anew_with_the_power(manager, farm):
    def ticks():
        return int(re.search(r"\((\d+)\)", manager.get(f"{SYSTEM}.3.0", drive=OTHER))[1])

    first = ticks()
    assert ticks() >= first
    farm.ask("power", name="axis-02", on=False)
    assert manager("snmpget", [f"{SYSTEM}.3.0"], drive=OTHER, check=False).returncode == 1
    farm.ask("power", name="axis-02", on=True)
    assert ticks() < 500


def test_what_is_not_there_is_told_in_the_words_of_each_version(manager, farm):
    missing, instance = f"{SYSTEM}.99.0", f"{SYSTEM}.1.5"
    done = manager("snmpget", [f"{SYSTEM}.7.0", missing, instance])
    assert re.findall(r"No Such \w+", done.stdout) == ["No Such Object", "No Such Instance"]
    assert "INTEGER: 78" in done.stdout
    for name in (missing, instance):
        done = manager("snmpget", "-Cf", [f"{SYSTEM}.7.0", name], version="1", check=False)
        assert done.returncode == 2
        assert "(noSuchName)" in done.stderr
        assert f"Failed object: {name}" in done.stderr


@pytest.mark.parametrize("version", ["1", "2c"])
def test_texts_that_a_manager_sets_outlast_a_power_cycle(manager, farm, version):
    contact, name, location = (f"{SYSTEM}.{arc}.0" for arc in (4, 5, 6))
    wanted = {contact: f"hall {version}, phone 12", name: f"press-{version}", location: "L" * 255}
    pairs = [part for oid, text in wanted.items() for part in (oid, "s", text)]
    manager("snmpset", pairs, version=version, community="private")
    farm.ask("power", name="axis-01", on=False)
    farm.ask("power", name="axis-01", on=True)
    assert {oid: manager.get(oid) for oid in wanted} == wanted
    # sysName is not the name of the station, which only DCP sets
    assert farm.ask("drive", name="axis-01")["name"] == "axis-01"
    manager("snmpset", [contact, "s", "", name, "s", "axis-01", location, "s", ""], community="private")
    assert manager.get(contact) == ""


@pytest.mark.parametrize(
    ("pairs", "community", "error"),
    [
        ([f"{SYSTEM}.4.0", "s", "me"], "public", "noAccess"),
        ([f"{SYSTEM}.4.0", "i", "5"], "private", "wrongType"),
        ([f"{SYSTEM}.4.0", "s", "x" * 256], "private", "wrongLength"),
        ([f"{SYSTEM}.4.0", "x", "ff 41"], "private", "wrongValue"),
        ([f"{SYSTEM}.4.1", "s", "me"], "private", "noCreation"),
        ([f"{SYSTEM}.1.0", "s", "me"], "private", "notWritable"),
        ([f"{INTERFACES}.2.1.7.1", "i", "2"], "private", "notWritable"),
    ],
)
def test_a_set_that_cannot_be_changes_nothing(manager, farm, pairs, community, error):
    good = [f"{SYSTEM}.6.0", "s", "elsewhere"]
    before = manager.get(good[0])
    done = manager("snmpset", [*good, *pairs], community=community, check=False)
    assert done.returncode == 2
    assert f"({error}" in done.stderr or f"Reason: {error}" in done.stderr, done.stderr
    assert f"Failed object: {good[0] if community == 'public' else pairs[0]}" in done.stderr
    old = manager("snmpset", [*good, *pairs], community=community, version="1", check=False)
    assert old.returncode == 2
    assert ("badValue" if error.startswith("wrong") else "noSuchName") in old.stderr
    assert manager.get(good[0]) == before


def test_a_wrong_community_is_not_answered_and_counted(manager, farm):
    counter = ".1.3.6.1.2.1.11.4.0"
    before = int(manager.get(counter))
    done = manager("snmpget", [f"{SYSTEM}.1.0"], community="secret", check=False)
    assert done.returncode == 1
    assert "Timeout" in done.stderr
    assert int(manager.get(counter)) == before + 2  # asked again once
    assert farm.ask("drive", name="axis-01")["discards"]["bad-community"] >= 2


def test_wireshark_finds_nothing_malformed(lab, manager, farm, tmp_path):
    needed("tshark", "dumpcap")
    with Capture(lab, tmp_path / "snmp.pcapng") as capture:
        manager("snmpwalk", [f"{SYSTEM}"], version="1")
        manager("snmpbulkwalk", "-Cr50", [".1"])
        manager("snmpset", [f"{SYSTEM}.4.0", "s", "me"], community="private")
        manager("snmpset", [f"{SYSTEM}.1.0", "s", "me"], community="private", check=False)
        manager("snmpget", [f"{SYSTEM}.99.0"], version="1", check=False)
    rows = capture.fields(
        "snmp.data", "_ws.malformed", "_ws.expert.severity", "udp.length", where=f"ip.src=={DRIVE} && snmp"
    )
    assert len(rows) > 10
    assert {row[0] for row in rows} == {"2"}  # all are responses
    bad = [row for row in rows if row[1] or any(int(severity) >= WARNING for severity in row[2].split(",") if severity)]
    assert not bad, bad
    assert max(int(row[3]) for row in rows) <= 1480
