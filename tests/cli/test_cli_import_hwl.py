"""``pnfarm import`` and ``plc --project`` of hardware of SIMATIC AX, and what is said of projects of other tools."""

import shutil

import pytest
from cell_file import GSDML
from hwl_project import DEVICES, ISLAND, TEMPLATES
from hypothesis import example, given, settings
from hypothesis import strategies as st
from imported import check_found, groups
from project_line import running

from pnfarm.buses.profinet.project.stations import of_project
from pnfarm.buses.projects import hwl
from pnfarm.buses.projects.description_folders import DescriptionFolders
from pnfarm.buses.projects.hwl import MAX_TEMPLATES, NotHwlError, parse_hwl
from pnfarm.cli.farm_file import read
from pnfarm.cli.projects.check import examine_project


@pytest.fixture
def folder(tmp_path):
    """A project in several folders, with the makers' files in one of them."""
    for name, text in {"library/templates.hwl.yaml": TEMPLATES, "line/devices.hwl.yml": DEVICES}.items():
        (tmp_path / "hwc" / name).parent.mkdir(parents=True)
        (tmp_path / "hwc" / name).write_text(text)
    (tmp_path / "hwc" / "gsd").mkdir()
    shutil.copy(GSDML, tmp_path / "hwc" / "gsd")
    return tmp_path / "hwc"


def test_devices_of_a_folder_are_those_of_its_templates_and_exchange_data(pnfarm, folder, tmp_path):
    out = tmp_path / "line.pnfarm.yml"
    result = pnfarm("import", folder, "-o", out)
    assert (result.code, result.err) == (0, "")
    found = {
        name: (str(one.ip), {slot: module and module.module for slot, module in one.slots.items()})
        for name, one in groups(out).items()
    }
    assert found == {
        "islandxb140bf": ("10.7.0.41/24", {1: "DI16", 2: "DO8"}),
        "island-2": ("10.7.0.42/24", {2: "DO8"}),
        "island-3": ("10.7.0.43/24", {4: "CARRIER"}),
    }
    plugged = groups(out)["island-3"].described.plugged.module(4).submodules
    assert {one.subslot: one.id for one in plugged} == {1: "CARRIER_1", 3: "PLUG_IO8", 5: "PLUG_OUT4"}
    with running(folder, out, []) as (controllers, project, _):
        assert project.remarks == []
        assert {row["name"]: (row["state"], row["unusable"]) for row in controllers.snapshot()} == dict.fromkeys(
            found, ("DATA", [])
        )
        (section,) = project.config.controllers
        assert (section.name, str(section.ip)) == ("plcxb1d0ed", "10.7.0.1/24")
        assert [one.watchdog_factor for one in section.devices] == [7, None, None]


def test_doctor_holds_a_folder_against_a_farm_file_and_an_update_takes_what_changed_in_it(pnfarm, folder, tmp_path):
    out = tmp_path / "line.pnfarm.yml"
    assert pnfarm("import", folder, "-o", out).code == 0
    findings = {one.name: (one.ok, one.detail.partition(":")[0]) for one in examine_project(read(out), folder, [])}
    assert findings == dict.fromkeys(("islandxb140bf", "island-2", "island-3"), (True, "will be green"))
    file = folder / "line" / "devices.hwl.yml"
    file.write_text(file.read_text().replace("10.7.0.42", "10.7.0.52"))
    updated = pnfarm("import", folder, "-o", out, "--update")
    assert (updated.code, updated.out.splitlines()) == (0, ["island-2: changed: ip", f"{out}: updated"])


def test_a_json_file_may_have_comments(pnfarm, folder, tmp_path):
    file = tmp_path / "own.hwl.json"
    file.write_text(
        '{"Devices": [ // one\n {"Name": "a", "Modules": [{"Name": "a", "TypeIdentifier": '
        f'{{"FileName": "{ISLAND}", "GsdId": "DAP 1"}}, // "http://no"\n"Interfaces": [{{"Name": "x", "Addresses": '
        '{"Configured": [{"IPv4": "10.7.0.9/24"}]}}]}, ]}]}'
    )
    text = pnfarm("import", file, "--gsdml", folder).out
    assert "  - name: a\n" in text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Devices: [{Apply: none}]", "the template 'none' is in none of its files: name the folder that has all"),
        ("Devices: [", "is not valid YAML here"),
        ("a: 1", "there are neither Devices nor Templates in it"),
        ("- 1", "there are neither Devices nor Templates in it"),
        (
            "Templates: {Devices: [{Name: a, Content: {Apply: a}}]}\nDevices: [{Apply: a}]",
            f"templates are deeper than {MAX_TEMPLATES}",
        ),
        ("Devices: &a [*a]", "line 1"),
    ],
)
def test_a_file_that_is_none_or_refers_to_itself_is_refused(pnfarm, tmp_path, text, words):
    file = tmp_path / "x.hwl.yml"
    file.write_text(text)
    found = pnfarm("import", file)
    assert (found.code, words in found.err, "\n" in found.err.strip()) == (2, True, False)


def test_templates_that_multiply_are_bounded(monkeypatch):
    monkeypatch.setattr(hwl, "MAX_PARTS", 1000)
    modules = ", ".join(["{Apply: m}"] * 100)
    text = f"Templates: {{Modules: [{{Name: m, Content: {{Name: m}}}}]}}\nDevices: [{{Name: d, Modules: [{modules}]}}]"
    assert len(list(parse_hwl({"a.hwl.yml": text.encode()}).root.walk())) == 102
    with pytest.raises(NotHwlError, match="more than 1000 devices and parts"):
        parse_hwl({f"{number}.hwl.yml": text.encode() for number in range(6)})


_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-2, 70_000) | st.text(max_size=20) | st.sampled_from(["${NAME}", "a"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
        st.sampled_from([
            "Name", "Apply", "Arguments", "TemplateName", "Modules", "Submodules", "Devices", "Templates", "Content",
            "Placeholders", "Value", "TypeIdentifier", "FileName", "GsdId", "OrderNumber", "Slot", "Interfaces",
            "Addresses", "Configured", "IPv4", "ProfinetDeviceName", "IoSystems", "ControllerInterfaces",
            "DeviceInterfaces", "Ref", "Parameters", "PnWatchdogFactor",
        ]),
        inner, max_size=4,
    ),
    max_leaves=30,
)  # fmt: skip


@settings(max_examples=200, deadline=None)
@given(st.dictionaries(st.sampled_from(["Devices", "Templates", "IoSystems"]), _VALUES, min_size=1))
@example({"Devices": [{"Name": "a", "Modules": [{"Slot": "-1", "Submodules": [{"Slot": "0"}]}]}]})
def test_whatever_is_in_the_files_the_farm_file_can_be_read(tmp_path_factory, values):
    import json

    folder = tmp_path_factory.getbasetemp()
    try:
        project = parse_hwl({"a.hwl.json": json.dumps(values).encode()})
    except NotHwlError:
        return
    check_found(of_project(project, DescriptionFolders([], folder), folder), folder)


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("cell.zap17", b"PK\x03\x04", "is a project of TIA Portal: export its CAx data (.aml)"),
        ("cell.ap19", b"x", "is a project of TIA Portal: export its CAx data (.aml)"),
        ("cell.acd", b"x", "is a project of Studio 5000: save it as L5X"),
        ("cell.project", b"PK\x03\x04", "is a project of CODESYS, which is not read"),
        ("tree.export", b"<ExportFile><StructuredView/></ExportFile>", "is an export of CODESYS, which is not read"),
        ("a.xml", b'<project xmlns="http://www.plcopen.org/xml/tc6_0200"/>', "is PLCopen XML, which has programs"),
        ("a.tsproj", b"<TcSmProject/>", "is a project of TwinCAT, which is not read"),
        ("b.xml", b"<TcSmItem/>", "is a part of a project of TwinCAT, which is not read"),
        ("ob1.xml", b'<Document><Engineering version="V17"/></Document>', "is XML of TIA Portal's blocks"),
    ],
)
def test_a_project_of_another_tool_is_refused_by_name_with_what_is_read(pnfarm, tmp_path, name, data, words):
    file = tmp_path / name
    file.write_bytes(data)
    for line in (("import", file), ("plc", "--project", file, "--interface", "eth9")):
        found = pnfarm(*line)
        assert (found.code, words in found.err) == (2, True)
        assert "supported are CAx data (.aml, .amlx), L5X, and SIMATIC AX (.hwl.yml)" in found.err


def test_a_folder_without_such_files_is_refused(pnfarm, tmp_path):
    found = pnfarm("import", tmp_path)
    assert (found.code, "there are neither Devices nor Templates in it" in found.err) == (2, True)
