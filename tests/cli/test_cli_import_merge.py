"""``pnfarm import --merge``: a project and a capture of one plant as one farm file, and where they differ."""

import asyncio
import shutil
from ipaddress import IPv4Address

import pytest
import yaml
from aml_project import at_system, plc, project, slave, tag
from aml_project import drive as aml_drive
from aml_project import module as aml_module
from aml_project import station as aml_station
from captured_controller import CapturedController, differences
from cell_file import GSDML
from cip_tape import MACS, Tape, connect, forward_open
from hypothesis import given, settings
from hypothesis import strategies as st
from imported import check_found, comments
from l5x_project import connection, module
from l5x_project import project as l5x_project
from recorded import record, write_frames

from pnfarm.buses.imports import FoundDevice, FoundDrive, FoundStation, Said
from pnfarm.buses.merging import Source, merged
from pnfarm.buses.profinet.model_gsdml import describe_model
from pnfarm.buses.projects.description_folders import DescriptionFile
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.catalogue import model
from pnfarm.farm.file.reading import load_farm, parse_farm
from pnfarm.protocols.enip.wire.cpf import emit_items
from pnfarm.protocols.enip.wire.encapsulation import Command, EncapsulationPdu, emit_encapsulation
from pnfarm.protocols.enip.wire.identity import IdentityItem
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml
from pnfarm.wire.mac import format_mac

HIWIN = "GSDML-V2.35-HIWIN-E1-20240101.XML"
PLANT = """
farm: plant
link: {kind: memory}
drives:
  - {name: axis-1, model: hiwin-e1, ip: 10.7.0.12/24, mac: '02:00:00:00:01:01', limits: lax}
  - {name: spare, model: akd-profinet, ip: 10.7.0.13/24, mac: '02:00:00:00:01:02'}
devices:
  - name: island-1
    gsdml: ISLAND
    access_point: DAP 1
    ip: 10.7.0.41/24
    mac: '02:00:00:00:01:41'
    slots: {1: DI16, 2: DI16, 3: AI4, 4: DO8}
controller: {name: plc, ip: 10.7.0.1/24, cycle: 16ms}
"""
ISLAND = GSDML.name


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """The start of the real plant, in virtual time."""
    file = tmp_path_factory.mktemp("plant") / "start.pcapng"
    record(PLANT.replace("ISLAND", str(GSDML)), file, seconds=0.2, connected=True, epoch_ns=10**18)
    return file


@pytest.fixture
def folder(tmp_path):
    (tmp_path / HIWIN).write_text(emit_gsdml(describe_model(model("hiwin-e1"))))
    shutil.copy(GSDML, tmp_path)
    return tmp_path


def island(*modules, name="island-1", ip="10.7.0.41"):
    return aml_station(name, ip, f"GSD:{ISLAND}/DAP/DAP 1", *modules, kind=f"GSD:{ISLAND}/D")


def plugged(slot, name, *areas):
    return aml_module(slot, f"GSD:{ISLAND}/M/{name}", *areas)


def planned_project():
    """What engineering says of the plant: another address of the drive, another module in slot 2, no slot 4."""
    modules = plugged(1, "DI16", ("Input", 20, 16)), plugged(2, "DO8", ("Output", 5, 8)), plugged(3, "AI4")
    return project(
        plc(tags=[tag("PartPresent", "%I20.3")]),
        aml_drive("axis-1", "10.7.0.11"),
        island(*modules),
        aml_drive("axis-9", "10.7.0.19"),
        links=[at_system("island-1-if")],
    )


def joined(pnfarm, folder, *files, out="cell.pnfarm.yml"):
    result = pnfarm("import", *files, "-o", folder / out, "--force", "--name", "cell")
    assert result.code == 0, result.err
    return result, yaml.safe_load((folder / out).read_text()), folder / out


def by_name(groups):
    return {one["name"]: one for one in groups}


def test_the_project_gives_names_modules_signals_and_files_and_the_capture_what_only_it_shows(pnfarm, folder, capture):
    file = folder / "line.aml"
    file.write_text(planned_project())
    result, farm, out = joined(pnfarm, folder, file, "--merge", capture)
    drives, devices = by_name(farm["drives"]), by_name(farm["devices"])
    assert drives["axis-1"]["ip"] == "10.7.0.11/24"
    assert (drives["axis-1"]["mac"], drives["axis-1"]["limits"]) == ("02:00:00:00:01:01", "lax")
    assert drives["axis-1"]["identity"]["gsdml"] == HIWIN
    assert drives["spare"]["model"] == "akd-profinet"
    own = devices["island-1"]
    assert (own["gsdml"], own["mac"], own["cycle"]) == (ISLAND, "02:00:00:00:01:41", "16ms")
    assert own["slots"][2] == "DO8"
    assert list(own["signals"]) == ["PartPresent"]
    assert "connected by plc: cycle 16 ms, watchdog 3 cycles" in comments(out)
    assert "axis-9" in drives
    assert "start.pcapng does not show it" in comments(out)
    assert "line.aml does not have it" in comments(out)
    planned, real = "0x00000020 (0 in, 1 out)", "0x00000010 (2 in, 0 out)"
    sentences = {
        "axis-1": "IP address: line.aml says 10.7.0.11, start.pcapng says 10.7.0.12; 10.7.0.11 is used",
        "island-1": f"slot 2: line.aml says {planned}, start.pcapng says {real}; {planned} is used",
    }
    for name, sentence in sentences.items():
        assert f"{name}: {sentence}" in result.err.splitlines()
        assert sentence in comments(out)
    assert pnfarm("validate", out).code == 0


def test_the_order_of_project_and_capture_does_not_matter(pnfarm, folder, capture):
    file = folder / "line.aml"
    file.write_text(planned_project())
    first, one, _ = joined(pnfarm, folder, file, "--merge", capture)
    second, other, _ = joined(pnfarm, folder, capture, "--merge", file, out="other.pnfarm.yml")
    assert one == other
    assert first.err == second.err


def test_what_only_the_capture_has_in_a_slot_is_plugged_and_the_captured_controller_starts_the_device(
    pnfarm, folder, capture
):
    file = folder / "line.aml"
    file.write_text(project(island(plugged(1, "DI16"), plugged(2, "DI16"), plugged(3, "AI4"))))
    result, _, out = joined(pnfarm, folder, file, "--merge", capture)
    assert result.err == ""
    assert "only start.pcapng has slot 4" in comments(out)
    text = out.read_text().replace("{kind: macvlan, parent: eth1}", "{kind: memory}").replace("api: 127.0.0.1:8702", "")
    line = asyncio.run(VirtualLine.create(parse_farm(text, out)))
    answer, statuses = CapturedController(line, capture, line.farm.station("island-1")).start()
    assert differences(answer) == []
    assert all(status.ok for status in statuses)


def test_a_station_whose_file_is_missing_is_played_as_captured_under_the_project_s_name(pnfarm, folder, capture):
    (folder / ISLAND).unlink()
    file = folder / "line.aml"
    # the station was renamed in the project after the capture
    file.write_text(project(island(name="valves")))
    result, farm, out = joined(pnfarm, folder, file, "--merge", capture)
    (own,) = farm["devices"]
    assert (own["name"], own["ip"]) == ("valves", "10.7.0.41/24")
    assert own["gsdml"].startswith("GSDML-V2.35-pnfarm-valves-")
    assert f"with {ISLAND}, of Example, it would be as in line.aml" in comments(out)
    assert "valves: name: line.aml says valves, start.pcapng says island-1; valves is used" in result.err
    assert pnfarm("validate", out).code == 0


def test_of_two_projects_the_first_counts(pnfarm, folder):
    first, second = folder / "a.aml", folder / "b.aml"
    first.write_text(project(aml_drive("axis-1", "10.7.0.11")))
    second.write_text(project(aml_drive("axis-1", "10.7.0.21"), aml_drive("axis-2", "10.7.0.12")))
    result, farm, _ = joined(pnfarm, folder, first, "--merge", second)
    assert {one["name"]: one["ip"] for one in farm["drives"]} == {"axis-1": "10.7.0.11/24", "axis-2": "10.7.0.12/24"}
    assert "axis-1: IP address: a.aml says 10.7.0.11, b.aml says 10.7.0.21; 10.7.0.11 is used" in result.err
    _, farm, _ = joined(pnfarm, folder, second, "--merge", first)
    assert {one["name"]: one["ip"] for one in farm["drives"]}["axis-1"] == "10.7.0.21/24"


def test_a_studio_5000_project_and_a_capture_are_joined_by_ip_address(pnfarm, folder):
    tape = Tape()
    item = IdentityItem(IPv4Address("10.77.0.11"), 452, 16, 1, (1, 14), 0x30, 1, b"AKD", 3)
    tape.udp(1, emit_encapsulation(EncapsulationPdu(Command.LIST_IDENTITY, emit_items((item,)))), (44818, 50_000))
    connect(tape, forward_open(o_to_t_rpi_us=20_000, t_to_o_rpi_us=20_000))
    write_frames(folder / "start.pcapng", zip(tape.frames, tape.times, strict=True))
    file = folder / "line.L5X"
    akd = {"CatalogNumber": "AKD", "Vendor": 452, "ProductType": 16, "ProductCode": 1, "Major": 1, "Minor": 13}
    file.write_text(l5x_project(module("Feeder", "10.77.0.11", connection(), **akd)))
    result, farm, _ = joined(pnfarm, folder, file, "--merge", folder / "start.pcapng")
    (own,) = farm["drives"]
    assert (own["name"], own["model"], own["mac"]) == ("feeder", "akd-ethernetip", format_mac(MACS[1]))
    # both say an interval: the project's is the one that its controller asks for
    assert own["rpi"] == "10ms"
    assert own["identity"] == {"revision": "1.14"}
    assert "Feeder: revision: line.L5X says 1.13, start.pcapng says 1.14; 1.14 is used" in result.err
    assert "Feeder: packet interval: line.L5X says 10ms, start.pcapng says 20ms; 10ms is used" in result.err


def test_slaves_are_joined_by_their_address(pnfarm, folder):
    first = FoundStation("Gripper", (), "profibus", "a.gsd", {"address": 7}, Said(name="Gripper"))
    second = FoundDrive("drive-7", "moog-msd-dp", {"address": 7}, line="profibus")
    found, remarks = merged(Source("a.aml", [first]), Source("b.pcap", [second]))
    (one,) = check_found(found).drives
    assert (one.name, one.model, remarks) == ("gripper", "moog-msd-dp", [])
    slaves = folder / "dp.aml"
    slaves.write_text(project(slave("Gripper", "7", "none.gsd")))
    assert pnfarm("import", slaves).code == 0


def test_an_address_that_several_stations_have_joins_none(pnfarm):
    twice = [FoundDrive(name, "hiwin-e1", {"ip": "10.0.0.1/24"}, said=Said(name=name)) for name in ("a", "b")]
    found, remarks = merged(Source("a.aml", twice), Source("b.pcap", [FoundStation("x", (), keys=twice[0].keys)]))
    assert len(found) == 3
    assert remarks == ["a b: several stations have this IP address, so that it joins none of them"]


_NAMES = st.sampled_from(["", "a", "A", "b", "island-1"])
_SAID = st.builds(
    Said,
    name=_NAMES,
    identity=st.dictionaries(st.sampled_from(["vendor", "order number"]), st.sampled_from("xy"), max_size=2),
    slots=st.dictionaries(st.integers(0, 3), st.sampled_from(["p", "q"]), max_size=3),
)
_KEYS = st.fixed_dictionaries(
    {},
    optional={
        "ip": st.sampled_from(["10.0.0.1/24", "10.0.0.2/16", "10.0.0.3/24", ""]),
        "gateway": st.sampled_from(["10.0.0.254", "10.0.0.1"]),
        "mac": st.sampled_from(["02:00:00:00:00:01", "02:00:00:00:00:02"]),
        "limits": st.just("lax"),
    },
)
_SHOWN = st.sampled_from(["a", "b", "island-1", "No name"])
_FILE = DescriptionFile("gsdml", "GSDML-V2.35-pnfarm-{name}-20260101.xml", GSDML.read_bytes())
_FOUND = st.one_of(
    st.builds(FoundStation, _SHOWN, st.just(("seen",)), keys=_KEYS, said=_SAID, missing=st.sampled_from(["", "f"])),
    st.builds(FoundDrive, _SHOWN, st.sampled_from(["hiwin-e1", "akd-profinet"]), _KEYS, said=_SAID),
    st.builds(
        FoundDevice,
        _SHOWN,
        st.just(_FILE),
        st.builds(
            lambda keys, slots: {"access_point": "DAP 1", **keys, **({"slots": slots} if slots else {})},
            _KEYS,
            st.dictionaries(st.integers(1, 3), st.sampled_from(["DI16", 0x20, None]), max_size=3),
        ),
        said=_SAID,
    ),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(_FOUND, max_size=4), st.lists(_FOUND, max_size=4))
def test_whatever_two_sources_say_every_station_is_in_the_farm_file_once(first, second):
    found, remarks = merged(Source("a.aml", first), Source("b.pcap", second))
    assert max(len(first), len(second)) <= len(found) <= len(first) + len(second)
    check_found(found)
    assert all("\n" not in line for line in remarks)


def test_a_merged_file_that_is_no_capture_or_project_is_refused(pnfarm, folder, capture):
    (folder / "notes.txt").write_text("none")
    refused = pnfarm("import", capture, "--merge", folder / "notes.txt")
    assert (refused.code, "notes.txt is not a capture" in refused.err) == (2, True)
    refused = pnfarm("import", capture, "--merge", folder / "gone.aml")
    assert (refused.code, "gone.aml cannot be read" in refused.err) == (2, True)


def test_a_second_import_of_project_and_captures_changes_what_they_say_and_keeps_edits(pnfarm, folder, capture):
    file, more, out = folder / "line.aml", folder / "again.pcapng", folder / "cell.pnfarm.yml"
    file.write_text(planned_project())
    shutil.copy(capture, more)
    _, _, out = joined(pnfarm, folder, file, "--merge", capture)
    edited = out.read_text().replace("  - name: spare\n", "  - name: spare   # mine\n    faults: []\n")
    edited = edited.replace("02:00:00:00:01:41", "02:00:00:00:01:77")
    out.write_text(edited)
    again = pnfarm("import", file, "--merge", capture, "-o", out, "--update")
    assert (again.code, again.out) == (0, f"{out}: nothing to change\n")
    assert out.read_text() == edited
    file.write_text(planned_project().replace("10.7.0.11", "10.7.0.21"))
    options = file, "--merge", capture, "--merge", more, "-o", out
    shown = pnfarm("import", *options, "--dry-run")
    assert "-    ip: 10.7.0.11/24\n+    ip: 10.7.0.21/24\n" in shown.out
    assert out.read_text() == edited
    updated = pnfarm("import", *options, "--update")
    assert (updated.code, updated.out.splitlines()) == (0, ["axis-1: changed: ip", f"{out}: updated"])
    text = out.read_text()
    assert "  - name: spare   # mine\n" in text
    drives, devices = (by_name(yaml.safe_load(text)[key]) for key in ("drives", "devices"))
    assert drives["axis-1"]["ip"] == "10.7.0.21/24"
    assert devices["island-1"]["mac"] == "02:00:00:00:01:77"
    assert "line.aml --merge start.pcapng --merge again.pcapng" in comments(out)
    assert "IP address: line.aml says 10.7.0.21, start.pcapng" in comments(out)


def test_the_joined_farm_runs(pnfarm, folder, capture):
    file = folder / "line.aml"
    file.write_text(project(aml_drive("axis-1", "10.7.0.12"), island(plugged(1, "DI16"), plugged(2, "DI16"))))
    _, _, out = joined(pnfarm, folder, file, "--merge", capture)
    text = out.read_text().replace("{kind: macvlan, parent: eth1}", "{kind: memory}").replace("api: 127.0.0.1:8702", "")
    out.write_text(text + "controller: {name: plc, ip: 10.7.0.1/24, cycle: 16ms}\n")
    line = asyncio.run(VirtualLine.create(load_farm(out)))
    assert line.world.run(5.0, until=lambda: line.plc.all_connected)
