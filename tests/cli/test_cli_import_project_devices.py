"""``pnfarm import`` of a project's CAx data: devices by their makers' GSDML files, and signals by the PLC's tags."""

import shutil
import zipfile

import pytest
from aml_project import ISLAND, at_system, element, module, plc, project, station, tag
from cell_file import GSDML
from hypothesis import given, settings
from hypothesis import strategies as st
from imported import check_found, comments, groups, importing

from pnfarm.buses.profinet.project.stations import of_project
from pnfarm.buses.projects import description_folders
from pnfarm.buses.projects.caex import parse_caex
from pnfarm.buses.projects.description_folders import DescriptionFolders
from pnfarm.farm.file.reading import load_farm
from pnfarm.protocols.profinet.gsdml.safe_xml import MAX_OCTETS
from pnfarm.testing import Line

DI16, DO8, AI4 = (f"GSD:{ISLAND}/M/{name}" for name in ("DI16", "DO8", "AI4"))
INPUTS, OUTPUTS, ANALOG = ("Input", 20, 16), ("Output", 5, 8), ("Input", 100, 64)


def island(name="island-1", ip="10.7.0.41", *modules, dap="DAP 1"):
    plugged = modules or (module(1, DI16, INPUTS), module(2, DO8, OUTPUTS), module(3, AI4, ANALOG))
    return station(name, ip, f"GSD:{ISLAND}/DAP/{dap}", *plugged, kind=f"GSD:{ISLAND}/D")


def ordered(slot, number, *areas, version="V1.0"):
    return module(slot, f"OrderNumber:{number}", *areas, version=version)


def head(name, number, *modules, version="V1.4", ip="10.7.0.42"):
    return station(name, ip, f"OrderNumber:{number}", *modules, kind="System:Device.ET200SP", version=version)


@pytest.fixture
def folder(tmp_path):
    shutil.copy(GSDML, tmp_path)
    return tmp_path


@pytest.fixture
def imported(pnfarm, folder):
    return importing(pnfarm, folder / "line.aml", project)


def test_a_device_of_a_project_is_played_with_its_modules_and_exchanges_data(imported):
    result, out = imported(plc(), island(), links=[at_system("island-1-if")])
    assert (result.code, result.err) == (0, "")
    assert "0 drives, 1 device, 1 other station in comments" in result.out
    out.write_text(out.read_text().replace("link: {kind: macvlan, parent: eth1}", "link: {kind: memory}"))
    with out.open("a") as file:
        file.write("controller: {name: plc, ip: 10.7.0.1/24}\n")
    with Line.from_file(out) as line:
        line.wait_connected(5)
        modules = line.core.device("island-1").description.modules
        (group,) = load_farm(out).devices
        own = {one.slot: (one.id, one.ident) for one in group.described.plugged.modules}
        assert {slot: name for slot, (name, _) in own.items()} == {0: "DAP 1", 1: "DI16", 2: "DO8", 3: "AI4"}
        assert {one.slot: one.ident for one in modules} == {slot: ident for slot, (_, ident) in own.items()}
        assert line.core.device("island-1").device.connection().exchanging


def test_tags_of_the_plc_name_the_signals_at_their_addresses(imported):
    tags = [
        tag("PartPresent", "%I20.3"), tag("Second name", "%I20.3"), tag("Klappe öffnen", "%Q5.0"),
        tag("1st_lamp", "%Q5.1"), tag("Druck", "%IW102", "Int"), tag("Temp", "%ED104", "Real"),
        tag("Elsewhere", "%I0.0"), tag("Marker", "%M20.3"), tag("Word", "%IW20", "Word"),
    ]  # fmt: skip
    result, out = imported(plc(tags=tags), island(), links=[at_system("island-1-if")])
    assert (result.code, result.err) == (0, "")
    signals = {name: (one.text, one.value_type.name) for name, one in groups(out)["island-1"].signals.items()}
    assert signals == {
        "PartPresent": ("1.1.0.3", "bool"), "Second_name": ("1.1.0.3", "bool"), "Word": ("1.1.0", "uint16"),
        "Klappe_oeffnen": ("2.1.0.0", "bool"), "_1st_lamp": ("2.1.0.1", "bool"),
        "Druck": ("3.1.2", "int16"), "Temp": ("3.1.4", "float32"),
    }  # fmt: skip
    assert "the signal Klappe_oeffnen is the tag 'Klappe öffnen'" in comments(out)


def test_a_tag_that_is_no_number_or_longer_than_the_data_is_no_signal_and_reported(imported):
    tags = [tag("State", "%IB20", '"UDT_State"'), tag("Long", "%ID20", "DWord"), tag("Odd", "%IW20", "Real")]
    _, out = imported(plc(tags=tags), island(), links=[at_system("island-1-if")])
    assert groups(out)["island-1"].signals == {}
    for name, why in (
        ("State", "its type is no"),
        ("Long", "it is longer than the module's"),
        ("Odd", "its type is no"),
    ):
        assert f"no signal for the tag '{name}': {why}" in comments(out)


def test_tags_whose_names_become_alike_are_numbered(imported):
    tags = [tag("a b", "%I20.0"), tag("a-b", "%I20.1"), tag("a_b", "%I20.2")]
    _, out = imported(plc(tags=tags), island(), links=[at_system("island-1-if")])
    assert {name: one.text for name, one in groups(out)["island-1"].signals.items()} == {
        "a_b": "1.1.0.0", "a_b_2": "1.1.0.1", "a_b_3": "1.1.0.2",
    }  # fmt: skip


def test_a_device_has_the_tags_of_its_own_plc(imported):
    first = plc(tags=[tag("Of_one", "%I20.0")])
    second = plc("PLC_2", "10.7.0.2", tags=[tag("Of_two", "%I20.0")], system="other")
    links = [at_system("island-1-if"), at_system("island-2-if", "other")]
    _, out = imported(first, second, island(), island("island-2", "10.7.0.43"), links=links)
    found = groups(out)
    assert [list(found[name].signals) for name in ("island-1", "island-2")] == [["Of_one"], ["Of_two"]]


def test_without_links_the_tags_of_the_only_plc_count_and_of_several_none(imported):
    _, out = imported(plc(tags=[tag("One", "%I20.0")]), island())
    assert list(groups(out)["island-1"].signals) == ["One"]
    both = plc(tags=[tag("One", "%I20.0")]), plc("PLC_2", "10.7.0.2", tags=[tag("Two", "%I20.0")], system="other")
    _, out = imported(*both, island())
    assert groups(out)["island-1"].signals == {}


def test_addresses_that_are_not_as_long_as_the_file_s_data_name_no_signal(imported):
    plugged = module(1, DI16, ("Input", 20, 32)), module(2, DO8, OUTPUTS)
    tags = [tag("In", "%I20.0"), tag("Out", "%Q5.0")]
    _, out = imported(plc(tags=tags), island("island-1", "10.7.0.41", *plugged), links=[at_system("island-1-if")])
    assert list(groups(out)["island-1"].signals) == ["Out"]
    assert "slot 1: inputs are 4 octets in 1 parts, by the file 2 in 1: no signals of its tags" in comments(out)


def test_submodules_of_a_module_are_plugged(imported):
    parts = "".join(
        element(f"part {place}", role="DeviceItem", TypeIdentifier=f"GSD:{ISLAND}/SM/{name}", PositionNumber=place - 1)
        for place, name in ((3, "PLUG_OUT4"), (4, "PLUG_IN2"), (5, "PLUG_IO8"))
    )
    carrier = module(4, f"GSD:{ISLAND}/M/CARRIER", inside=parts)
    _, out = imported(plc(), island("island-1", "10.7.0.41", carrier, module(5, f"GSD:{ISLAND}/M/CARRIER")))
    plugged = groups(out)["island-1"].described.plugged
    found = {(slot, one.subslot): one.id for slot in (4, 5) for one in plugged.module(slot).submodules}
    # where the project names submodules, the file's own choice (PLUG_IN2 in subslot 2) does not count
    assert found == {
        (4, 1): "CARRIER_1",
        (4, 3): "PLUG_OUT4",
        (4, 4): "PLUG_IN2",
        (5, 1): "CARRIER_1",
        (5, 2): "PLUG_IN2",
    }
    assert "left out: slot 4, subslot 5 takes no submodule 'PLUG_IO8'" in comments(out)


def test_a_module_that_the_file_has_not_is_left_out_and_the_others_stay(imported):
    plugged = module(1, f"GSD:{ISLAND}/M/NONE", INPUTS), module(2, DO8, OUTPUTS)
    result, out = imported(plc(), island("island-1", "10.7.0.41", *plugged))
    assert result.code == 0
    assert {slot: one.module for slot, one in groups(out)["island-1"].slots.items()} == {2: "DO8"}
    assert "slot 1: the file has no module 'NONE' there, which the project plugs: left out" in comments(out)


def test_a_device_without_its_file_is_in_the_list_of_what_is_missing(imported, folder):
    (folder / GSDML.name).unlink()
    two = island(), island("island-2", "10.7.0.43")
    result, out = imported(plc(), *two, head("et", "6ES7 155-6AU00-0CN0", version="V3.3"), links=[at_system("et-if")])
    assert result.code == 0
    assert f"missing: {ISLAND}, of EXAMPLE, for island-1 island-2\n" in result.err
    assert "missing: a GSDML file with 6ES7 155-6AU00-0CN0 V3.3, of Siemens, for et\n" in result.err
    assert "devices:" not in out.read_text()


def test_a_device_by_order_numbers_has_the_modules_of_its_file(imported):
    plugged = ordered(1, "EX-DI-16", INPUTS), ordered(2, "EX-DO-8", OUTPUTS)
    et = head("et", "EX-ISL-100", *plugged)
    result, out = imported(plc(tags=[tag("Go", "%Q5.2")]), et, links=[at_system("et-if")])
    assert (result.code, result.err) == (0, "")
    group = groups(out)["et"]
    assert (group.access_point, {slot: one.module for slot, one in group.slots.items()}) == (
        "DAP 1", {1: "DI16", 2: "DO8"},
    )  # fmt: skip
    assert group.signals["Go"].text == "2.1.0.2"


def test_of_several_versions_of_a_file_the_project_s_counts_else_the_last_and_that_is_said(imported, folder):
    text = GSDML.read_text()
    for version, date in (("V1.4.2", 20250101), ("V1.5.0", 20250201), ("V2.0.1", 20250301)):
        (folder / f"GSDML-V2.35-Example-Island-{date}.xml").write_text(text.replace("V1.4.2", version))
    (folder / GSDML.name).unlink()
    for version, date in (("V1.5", 20250201), ("V2.0", 20250301), ("V9.9", 20250301)):
        et = head("et", "EX-ISL-100", ordered(1, "EX-DI-16"), version=version)
        _, out = imported(plc(), et, links=[at_system("et-if")])
        assert groups(out)["et"].gsdml == f"GSDML-V2.35-Example-Island-{date}.xml"
        assert ("has no version V9.9" in comments(out)) == (version == "V9.9")


def test_files_in_folders_below_and_in_zip_files_are_found(imported, folder, tmp_path_factory):
    (folder / GSDML.name).unlink()
    library = tmp_path_factory.mktemp("library")
    (library / "maker" / "old").mkdir(parents=True)
    shutil.copy(GSDML, library / "maker" / "old" / ISLAND)
    _, out = imported(plc(), island(), options=("--gsdml", library))
    assert groups(out)["island-1"].gsdml == str(library / "maker" / "old" / ISLAND)
    (library / "maker" / "old" / ISLAND).unlink()
    with zipfile.ZipFile(library / "maker.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"../../outside/{ISLAND}", GSDML.read_bytes())
    result, out = imported(plc(), island(), options=("--gsdml", library))
    assert "1 description file out of a zip file" in result.out
    assert groups(out)["island-1"].gsdml == ISLAND
    assert (folder / ISLAND).read_bytes() == GSDML.read_bytes()


@pytest.mark.parametrize(
    ("damage", "words"), [("long", "is longer than"), ("broken", "cannot be read"), ("encrypted", "is encrypted")]
)
def test_a_zip_file_that_cannot_be_read_makes_a_device_missing(imported, folder, damage, words):
    (folder / GSDML.name).unlink()
    with zipfile.ZipFile(folder / "maker.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(ISLAND, b" " * (MAX_OCTETS + 1) if damage == "long" else GSDML.read_bytes())
    octets = bytearray((folder / "maker.zip").read_bytes())
    if damage == "broken":
        octets[200:260] = bytes(60)
    elif damage == "encrypted":
        octets[6] |= 1
        place = octets.index(b"PK\x01\x02")
        octets[place + 8] |= 1
    (folder / "maker.zip").write_bytes(octets)
    result, out = imported(plc(), island())
    assert (result.code, f"missing: {ISLAND}" in result.err) == (0, True)
    assert words in comments(out) + result.err
    assert "devices:" not in out.read_text()


def test_a_folder_with_too_many_files_is_refused(imported, folder, monkeypatch):
    monkeypatch.setattr(description_folders, "MOST_FILES", 3)
    (folder / "below").mkdir()
    for number in range(4):
        (folder / "below" / f"{number}.xml").write_text("")
    assert imported(plc(), island())[0].code == 0, "the project's own folder counts without those below"
    result, _ = imported(plc(), island(), options=("--gsdml", folder))
    assert (result.code, "more than 3" in result.err) == (2, True)


_WORDS = st.sampled_from(["island-1", "DAP 1", "DAP 2", "10.7.0.41", "V1.4", "EX-ISL-100", "", "0", "99999", "x" * 300])
_TYPES = st.sampled_from([DI16, DO8, AI4, f"GSD:{ISLAND}/M/CARRIER", f"GSD:{ISLAND}/M/NO", f"GSD:{ISLAND}/SM/PLUG_IN2",
                          "OrderNumber:EX-DI-16", "OrderNumber:EX-DI-16/V1", f"GSD:{ISLAND}/DAP/D#B", ""])  # fmt: skip
_NUMBERS = st.sampled_from([0, 1, 2, 3, 8, 9, 33, 70000, -1, 10**12]) | st.integers(0, 40)
_AREAS = st.lists(st.tuples(st.sampled_from(["Input", "Output", "Both"]), _NUMBERS, _NUMBERS), max_size=3)
_TAGS = st.builds(
    tag,
    st.sampled_from(["a", "A b", "ä", "", "1", "x" * 200, "日本"]),
    st.builds("%{}{}.{}".format, st.sampled_from("IQEAMD"), st.integers(0, 120), st.integers(0, 9)) | st.just("%IW20"),
    st.sampled_from(["Bool", "Int", "Real", "UDT", ""]),
)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(_WORDS, _WORDS, st.lists(st.tuples(_NUMBERS, _TYPES, _AREAS), max_size=5)), max_size=3),
    st.lists(_TAGS, max_size=6),
)
def test_whatever_devices_a_project_has_the_farm_file_can_be_read(tmp_path_factory, devices, tags):
    folder = tmp_path_factory.getbasetemp()
    shutil.copy(GSDML, folder / ISLAND)
    stations = [
        island(name, "10.7.0.41", *(module(slot, kind, *areas) for slot, kind, areas in modules), dap=dap)
        for name, dap, modules in devices
    ]
    text = project(plc(tags=tags), *stations, links=[at_system("island-1-if")])
    check_found(of_project(parse_caex(text.encode()), DescriptionFolders([], folder), folder), folder)


def test_the_topology_of_a_project_is_in_the_comments_with_what_a_plc_would_report(imported):
    ports = [
        module(4, "GSD:X.XML/M/P", inside=element(name, role="CommunicationPort")) for name in ("Port_1", "Port_2")
    ]
    first, second = (island(name, ip, port) for name, ip, port in (
        ("island-1", "10.7.0.41", ports[0]), ("island-2", "10.7.0.42", ports[1]),
    ))  # fmt: skip
    cable = (
        '<InternalLink Name="Link To Port_1" RefPartnerSideA="Port_1-id:CommunicationPortInterface" '
        'RefPartnerSideB="Port_2-id:CommunicationPortInterface"/>'
    )
    nowhere = cable.replace("Port_2-id", "gone")
    _, out = imported(plc(), first, second, links=[at_system("island-1-if"), at_system("island-2-if"), nowhere, cable])
    told = comments(out)
    assert "the project's topology connects Port_1 with Port_2 of island-2: a PLC that checks it reports" in told
    assert "the project's topology connects Port_2 with Port_1 of island-1: a PLC that checks it reports" in told
    assert told.count("a remote mismatch unless") == told.count("topology") == 2
