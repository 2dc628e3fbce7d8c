"""`pnfarm import --check`: what users see of a plant beside a farm file; in memory, and at a farm that runs."""

import json
import re
from dataclasses import replace

import pytest
from device_cell import CONFIGS, ISLAND
from own_interfaces import own_interfaces

from pnfarm.buses.checking import CheckAnswer, StationFacts
from pnfarm.buses.ethernetip.bus import EthernetIp
from pnfarm.buses.profinet.bus import Profinet
from pnfarm.cli import station_check
from pnfarm.cli.farm_file import read
from pnfarm.cli.file_stations import foreign_stations

FILE = """\
farm: line
link: {kind: veth}
api: off
drives:
  - {name: 'axis-{n}', count: 3, model: akd-profinet, ip: 10.77.0.11/24}
controller: {name: plc, ip: 10.77.0.1/24}
"""


SLAVE = "  - {name: slave, model: moog-msd-dp, address: 5}\n"


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setattr(station_check.socket, "if_nameindex", lambda: [(8, "eth8"), (9, "eth9")])
    path = tmp_path / "line.pnfarm.yml"
    path.write_text(FILE)
    return path


def plant(monkeypatch, *stations, remarks=(), bus=Profinet):
    async def read_stations(_bus, question):
        by_name = {one.name: one for one in question.expected}
        return CheckAnswer([by_name[one] if isinstance(one, str) else one for one in stations], remarks)

    monkeypatch.setattr(bus, "read_stations", read_stations)


def test_a_plant_as_in_the_file_ends_with_0(file, pnfarm, monkeypatch):
    plant(monkeypatch, "axis-3", "axis-1", "axis-2", StationFacts("plc", "10.77.0.1"))
    done = pnfarm("import", "--check", "eth9", file)
    assert done.code == 0
    assert f"The plant is as {file} says: 3 stations." in done.out


def test_differences_are_listed_and_the_program_ends_with_1(file, pnfarm, monkeypatch):
    other = StationFacts("axis-2", "10.77.0.19", {"vendor": "0x1234"}, {"firmware": "V9.9.9"}, {"0": ("0x1",)})
    plant(monkeypatch, "axis-1", other, StationFacts("new", "10.77.0.77"), remarks=("a remark",))
    done = pnfarm("import", file, "--check", "eth9")
    assert done.code == 1
    lines = done.out.splitlines()
    assert [line.split()[:4] for line in lines if line.startswith("profinet")] == [
        ["profinet", "axis-1", "10.77.0.11", "equal"],
        ["profinet", "axis-2", "10.77.0.12", "differs"],
        ["profinet", "axis-3", "10.77.0.13", "missing"],
        ["profinet", "new", "10.77.0.77", "not"],
    ]
    assert re.search(r"firmware: file V[\d.]+, plant V9", done.out)
    assert "note: a remark" in done.out
    assert f"3 of 4 stations are not as {file} says." in done.out
    told = json.loads(pnfarm("import", file, "--check", "eth9", "--format", "json").out)
    assert (told["equal"], told["remarks"]) == (False, ["a remark"])
    states = {one["name"]: one["state"] for one in told["stations"]}
    assert states == {"axis-1": "equal", "axis-2": "differs", "axis-3": "missing", "new": "extra"}
    differing = {one["what"]: one["plant"] for one in told["stations"][1]["differences"]}
    assert differing["address"] == "10.77.0.19"


def test_devices_of_a_controller_for_a_real_plant_are_compared_with_its_plan(file, pnfarm, monkeypatch):
    island = CONFIGS / ISLAND
    file.write_text(
        "controller:\n  name: plc\n  interface: eth0\n  ip: 10.77.0.1/24\n  devices:\n"
        f"    - {{name: left, gsdml: {island}, dap: DAP 1, modules: {{1: 16DI}}, ip: 10.77.0.41/24}}\n"
        f"    - {{name: right, gsdml: {island}, dap: DAP 1, modules: {{1: 16DI}}}}\n"
    )
    plant(monkeypatch, "left", "right")
    assert pnfarm("import", "--check", "eth9", file).code == 0
    config = read(file)
    left, right = (one.facts for one in foreign_stations(config))
    assert (left.address, right.address) == ("10.77.0.41", "")
    moved = replace(right, address="10.1.1.1"), replace(left, modules={**left.modules, "1": ("0x00000099",)})
    plant(monkeypatch, *moved)
    done = pnfarm("import", "--check", "eth9", file)
    assert done.code == 1
    assert re.search(r"left +10.77.0.41 +differs +slot 1: file 0x[0-9A-F]+, plant 0x00000099", done.out)
    assert re.search(r"right +10.1.1.1 +equal", done.out)


def test_devices_of_a_controller_by_eds_and_gsd_files_are_known_by_address_and_identity(tmp_path):
    path = tmp_path / "plc.pnfarm.yml"
    path.write_text(
        "farm: l\nlink: {kind: veth, lines: {profibus: {pty: auto}}}\ncontroller:\n  name: plc\n"
        "  ethernetip:\n    ip: 10.77.0.1/24\n    devices: "
        f"[{{name: weigher, eds: {CONFIGS}/eds/Example-Weigher-20261128.eds, ip: 10.77.0.61/24, "
        "configuration: '000000'}]\n"
        f"  profibus: {{devices: [{{name: valve, gsd: {CONFIGS}/gsd/EXMP1D02.gsd, address: 9}}]}}\n"
        "drives:\n  - {name: cip, model: akd-ethernetip, ip: 10.77.0.31/24}\n" + SLAVE
    )
    weigher, valve = (one.facts for one in foreign_stations(read(path)))
    assert (weigher.name, weigher.address) == ("weigher", "10.77.0.61")
    assert weigher.identity.keys() == {"vendor", "device type", "product code", "major revision"}
    assert (valve.name, valve.address) == ("valve", "9")
    assert valve.identity["ident"].startswith("0x")


def test_several_places_are_one_plant_and_a_bus_that_was_not_asked_is_told(file, pnfarm, monkeypatch):
    cip = "  - {name: cip, model: akd-ethernetip, ip: 10.77.0.31/24}\n"
    file.write_text(FILE[: FILE.index("controller")] + cip)
    plant(monkeypatch, "axis-1", "axis-2", "axis-3")
    plant(monkeypatch, "cip", bus=EthernetIp)
    done = pnfarm("import", "--check", "eth9", "--check", "eth8", file)
    assert done.code == 0
    # each station answers at both
    assert [line.split()[0] for line in done.out.splitlines() if " equal" in line] == ["profinet"] * 3 + ["ethernetip"]
    file.write_text(FILE.replace("veth", "veth, lines: {profibus: {pty: auto}}").partition("controller")[0] + SLAVE)
    done = pnfarm("import", "--check", "eth9", file)
    assert (done.code, "the PROFIBUS stations of the file were not read: give --check LINE" in done.out) == (1, True)


@pytest.mark.parametrize(
    ("where", "sentence"),
    [
        ("eth7", "--check 'eth7' is no interface of this machine"),
        ("../eth9", "is no interface"),
        ("10.0.0.1:99999", "no station that could be on a serial line"),
        ("rfc2217://somewhere:1", "no station that could be on a serial line"),
    ],
)
def test_a_place_that_is_none_is_refused_with_a_sentence(file, pnfarm, where, sentence):
    done = pnfarm("import", "--check", where, file)
    assert (done.code, done.out) == (2, "")
    assert sentence in done.err


@pytest.mark.parametrize("option", [("--update",), ("--dry-run",), ("--merge", "p.aml"), ("-o", "new.pnfarm.yml")])
def test_a_check_writes_no_farm_file_and_joins_nothing(file, pnfarm, option):
    done = pnfarm("import", "--check", "eth1", file, *option)
    assert (done.code, done.out) == (2, "")
    assert "--check compares with one farm file, and writes none" in done.err


def test_a_line_with_a_rate_or_place_that_is_none_is_refused(file, pnfarm):
    file.write_text("farm: l\nlink: {kind: memory}\ndrives: [{name: a, model: moog-msd-dp, address: 5}]\n")
    done = pnfarm("import", "--check", "host:99999", file)
    assert (done.code, "--check 'host:99999' is not like HOST:PORT" in done.err) == (2, True)
    done = pnfarm("import", "--check", "host:1234", "--baud", "1234", file)
    assert (done.code, "--baud 1234 is none of the line's rates" in done.err) == (2, True)
    done = pnfarm("import", "--check", "host:1234", "--own-address", "5", file)
    assert "choose another one" in done.err
    assert done.code == 2


# -- a farm that runs


REAL = """\
farm: checktest
link: {kind: veth}
api: off
drives:
  - {name: 'cip-{n}', count: 2, model: akd-ethernetip, ip: 10.77.0.11/24}
  - {name: 'pn-{n}', count: 2, model: akd-profinet, ip: 10.77.0.21/24}
"""


def test_a_farm_that_runs_is_compared_with_its_own_file_and_with_another_one(network, background, process, tmp_path):
    path, other = tmp_path / "own.pnfarm.yml", tmp_path / "other.pnfarm.yml"
    path.write_text(REAL)
    other.write_text(REAL.replace("name: 'pn-{n}', count: 2", "name: 'pn-{n}', count: 3, start: 2"))
    farm = background("--log-format", "console", "up", path)
    farm.wait_for("farm started")
    (bridge,) = [name for name in own_interfaces(network, "checktest") if name.endswith("-br")]
    network("link", "add", "check0", "type", "veth", "peer", "name", "check1")
    network("link", "set", "check1", "master", bridge)
    for end in ("check0", "check1"):
        network("link", "set", end, "up")
    network("address", "add", "10.77.0.200/24", "dev", "check0")
    try:
        done = process("import", "--check", "check0", path, "--seconds", "1")
        assert (done.code, done.err) == (0, ""), done.out
        found = json.loads(process("import", "--check", "check0", other, "--seconds", "1", "--format", "json").out)
        states = [(one["bus"], one["name"], one["state"]) for one in found["stations"]]
        assert states == [
            ("profinet", "pn-2", "differs"),
            ("profinet", "pn-3", "missing"),
            ("profinet", "pn-4", "missing"),
            ("profinet", "pn-1", "extra"),
            ("ethernetip", "cip-1", "equal"),
            ("ethernetip", "cip-2", "equal"),
        ]
    finally:
        network("link", "del", "check0")
        assert farm.stop() == 0
