"""``pnfarm import`` of a project's CAx data: the drives that TIA Portal was told of."""

import zipfile
from xml.sax.saxutils import escape

import pytest
from aml_project import HIWIN, drive, element, module, plc, project, station
from drive_object_gsdml import drive_object_gsdml
from hypothesis import given, settings
from hypothesis import strategies as st
from imported import check_found

from pnfarm.buses.profinet.model_gsdml import describe_model
from pnfarm.buses.profinet.project.stations import of_project
from pnfarm.buses.projects.caex import MAX_DEPTH, NotCaexError, parse_caex
from pnfarm.buses.projects.description_folders import DescriptionFolders
from pnfarm.drives.catalogue import model
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.reading import expand, load_farm, parse_farm
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml
from pnfarm.testing import Line


@pytest.fixture
def folder(tmp_path):
    (tmp_path / HIWIN.lower()).write_text(emit_gsdml(describe_model(model("hiwin-e1"))))
    return tmp_path


@pytest.mark.parametrize("schema", ["2.15", "3.0"])
def test_drives_of_a_project_have_its_names_addresses_and_files(pnfarm, folder, schema):
    file = folder / "line.aml"
    file.write_text(
        project(plc(), drive("axis-1", "10.7.0.11"), drive("axis-2", "10.7.0.12", router="10.7.0.254"), schema=schema)
    )
    out = folder / "line.pnfarm.yml"
    found = pnfarm("import", file, "-o", out)
    assert (found.code, found.err) == (0, "")
    assert "2 drives, 1 other station in comments" in found.out
    first, second = expand(load_farm(out))
    assert (first.name, str(first.ip), first.model) == ("axis-1", "10.7.0.11/24", "hiwin-e1")
    assert (second.name, str(second.gateway)) == ("axis-2", "10.7.0.254")
    assert model_of(first).profidrive.identity.device_id == model("hiwin-e1").profidrive.identity.device_id
    text = out.read_text()
    assert f"identity: {{gsdml: {HIWIN.lower()}}}" in text
    assert "# slot 1: Telegram 111" in text
    assert "plc-1: IP 10.7.0.1" in text


@pytest.mark.parametrize("name", ["20261127", "1e5", "null"])
def test_a_file_whose_name_is_a_number_or_a_word_of_yaml_is_a_farm_of_that_name(pnfarm, folder, name):
    file, out = folder / f"{name}.aml", folder / "line.pnfarm.yml"
    file.write_text(project(plc(), drive("axis-1", "10.7.0.11")))
    assert pnfarm("import", file, "-o", out).code == 0
    assert load_farm(out).farm == name
    assert pnfarm("import", file, "-o", out, "--update").code == 0


def module_id(number):
    """Of a telegram, in the file that the folder has."""
    document = describe_model(model("hiwin-e1"))
    wanted = model("hiwin-e1").profidrive.telegrams[number].module.ident
    return next(module.id for module in document.modules if module.ident == wanted)


@pytest.mark.parametrize("number", [3, 9, 111])
def test_a_drive_has_the_telegram_that_the_project_plugs(pnfarm, folder, number):
    file = folder / "line.aml"
    file.write_text(project(drive("axis-1", "10.7.0.11", module=("Position", module_id(number)))))
    out = folder / "line.pnfarm.yml"
    assert pnfarm("import", file, "-o", out).code == 0
    (made,) = expand(load_farm(out))
    assert made.telegram == number
    assert f"    telegram: {number}\n" in out.read_text()


def test_a_module_that_the_maker_s_file_has_not_is_told(pnfarm, folder):
    file = folder / "line.aml"
    file.write_text(project(drive("axis-1", "10.7.0.11", module=("Telegram 5", "ID_NONE"))))
    text = pnfarm("import", file).out
    assert "has no module 'ID_NONE', which the project plugs" in " ".join(text.replace("#", " ").split())
    assert expand(parse_farm(text))[0].telegram is None


def test_without_the_maker_s_file_a_module_s_name_tells_the_telegram(pnfarm, tmp_path):
    file = tmp_path / "line.aml"
    file.write_text(
        project(
            drive("axis-1", "10.7.0.11", module=("Standard Telegramm 9", "X")),
            drive("axis-2", "10.7.0.12", module=("Safety 902", "Y")),
        )
    )
    text = pnfarm("import", file).out
    assert [one.telegram for one in expand(parse_farm(text))] == [9, None]


def test_a_packed_project_is_read(pnfarm, folder):
    file = folder / "line.amlx"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", "<x/>")
        archive.writestr("line.aml", project(drive("axis-1", "10.7.0.11")))
    found = pnfarm("import", file)
    assert (found.code, "- name: axis-1" in found.out) == (0, True)


def test_files_of_another_folder_are_found(pnfarm, folder, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "line.aml"
    elsewhere.write_text(project(drive("axis-1", "10.7.0.11")))
    text = pnfarm("import", elsewhere, "--gsdml", folder).out
    assert "gsdml:" in text
    assert expand(parse_farm(text))[0].model == "hiwin-e1"
    missing = pnfarm("import", elsewhere, "--gsdml", folder / "nothing")
    assert (missing.code, "cannot be read" in missing.err) == (2, True)


def test_a_drive_whose_file_is_not_at_hand_is_told_by_its_maker_s_name(pnfarm, tmp_path):
    file = tmp_path / "line.aml"
    file.write_text(
        project(drive("axis-1", "10.7.0.11"), drive("valve", "10.7.0.12", file="GSDML-V2.3-FESTO-CPX-20200101.XML"))
    )
    text = pnfarm("import", file).out
    (made,) = expand(parse_farm(text))
    assert (made.name, made.model, dict(made.identity)) == ("axis-1", "hiwin-e1", {})
    assert "was not found" in text.replace("\n  #  ", "")
    assert "#   valve: GSDML-V2.3-FESTO-CPX-20200101.XML was not found; IP 10.7.0.12" in text


def test_names_that_a_farm_file_cannot_have_are_changed_and_told(pnfarm, tmp_path):
    file = tmp_path / "line.aml"
    file.write_text(project(drive("Axis#1", "10.7.0.11"), drive("axis-1", "10.7.0.12")))
    text = pnfarm("import", file).out
    assert [one.name for one in expand(parse_farm(text))] == ["axis-1", "axis-1-2"]
    assert "# its name was 'axis#1'" in text


def test_a_drive_has_the_name_that_the_plc_searches_for(pnfarm, tmp_path):
    file = tmp_path / "line.aml"
    file.write_text(project(drive("IO-Device_1", "10.7.0.11")))
    text = pnfarm("import", file).out
    assert [one.name for one in expand(parse_farm(text))] == ["io-devicexb15b32"]
    assert "# 'IO-Device_1' in the project, which TIA Portal writes as io-devicexb15b32" in text


@pytest.mark.parametrize(
    ("data", "words"),
    [(b"<html/>", "there is no CAEXFile"),
     (b"<CAEXFile><InstanceHierarchy>", "line 1"),
     (b'<!DOCTYPE x [<!ENTITY a "b">]><CAEXFile/>', "document type"),
     (b"<CAEXFile>" + b"<InternalElement>" * (MAX_DEPTH + 1), "deeper than"),
     (b'<?xml version="1.0" encoding="TF-8"?><CAEXFile/>', "unknown encoding"),
     (b"PK\x03\x04 but no archive", "container cannot be read")],
)  # fmt: skip
def test_a_file_that_is_no_project_is_refused(pnfarm, tmp_path, data, words):
    file = tmp_path / "line.aml"
    file.write_bytes(data)
    found = pnfarm("import", file)
    assert (found.code, words in found.err) == (2, True)
    assert "\n" not in found.err.strip()


def test_a_project_without_devices_is_refused(pnfarm, tmp_path):
    file = tmp_path / "line.aml"
    file.write_text(project())
    assert pnfarm("import", file).code == 2


@settings(max_examples=200)
@given(data=st.data())
def test_no_damage_of_a_project_has_another_outcome_than_a_decode_error(data):
    octets = bytearray(project(plc(), drive("axis-1", "10.7.0.11")).encode())
    for _ in range(data.draw(st.integers(1, 5))):
        place = data.draw(st.integers(0, len(octets) - 1))
        octets[place : place + data.draw(st.integers(0, 8))] = data.draw(st.binary(max_size=8))
    try:
        root = parse_caex(bytes(octets)).root
    except NotCaexError:
        return
    assert sum(1 for _ in root.walk()) >= 1


_WORDS = st.text(max_size=60) | st.sampled_from(
    ["axis-1", "AXIS 1", "x" * 300, "10.7.0.11", "10.7.0.255", "0.0.0.0", "255.255.0.255", "a\x85b", "{n}", "ID_T111"]
)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(_WORDS, _WORDS, _WORDS, _WORDS, st.tuples(_WORDS, _WORDS)), min_size=1, max_size=4))
def test_whatever_is_in_a_project_the_farm_file_can_be_read(tmp_path_factory, devices):
    folder = tmp_path_factory.getbasetemp()
    (folder / HIWIN.lower()).write_text(emit_gsdml(describe_model(model("hiwin-e1"))))
    # as an element holds it; what XML cannot hold no project has
    text = project(
        *(
            drive(
                *(quoted(one) for one in (name, ip)),
                dap=quoted(dap),
                router=quoted(router),
                module=tuple(map(quoted, module)),
            )
            for name, ip, dap, router, module in devices
        )
    )
    check_found(of_project(parse_caex(text.encode()), DescriptionFolders([folder], folder), folder), folder)


def quoted(text):
    allowed = "".join(one for one in text if one.isprintable() or one in "\t\n\x85\u2028")
    return escape(allowed.encode("utf-8", "replace").decode(), {'"': "&quot;"})


PROFILE = "GSDML-V2.43-MAKER-DRIVES-20260101.XML"


def profile_station(*parts):
    """A drive of a maker without a model: a servo with these submodules (subslot, id) in each slot."""
    servos = (
        module(slot, f"GSD:{PROFILE}/M/SERVO", name=f"Axis {slot}", inside="".join(
            element(
                f"part {place}", role="DeviceItem", TypeIdentifier=f"GSD:{PROFILE}/SM/{own}", PositionNumber=place - 1
            )
            for place, own in inside
        ))
        for slot, inside in enumerate(parts, 1)
    )  # fmt: skip
    return station("cu-1", "10.7.0.21", f"GSD:{PROFILE}/DAP/FULL", *servos, kind=f"GSD:{PROFILE}/D")


@pytest.mark.parametrize("packed", [False, True])
def test_a_drive_without_a_model_that_has_telegrams_of_the_profile_is_a_profile_drive(pnfarm, tmp_path, packed):
    text = drive_object_gsdml()
    names = {one: f"S_T{one}" for one in (105, 111, 750)}
    assert all(f'"{one}"' in text for one in names.values())
    if packed:
        with zipfile.ZipFile(tmp_path / "maker.zip", "w") as archive:
            archive.writestr(PROFILE, text)
    else:
        (tmp_path / PROFILE).write_text(text)
    parts = [(3, names[105]), (4, names[750])], [(3, names[111])]
    for plugged, wanted in ((parts[:1], [(105, 750)]), (parts, [(105, 750), (111, None)])):
        file, out = tmp_path / "line.aml", tmp_path / "line.pnfarm.yml"
        text = project(plc(), profile_station(*plugged))
        dap = next(one for one in parse_gsdml(drive_object_gsdml().encode()).daps if one.info.name == "Full")
        file.write_text(text.replace("/DAP/FULL", f"/DAP/{dap.id}"))
        found = pnfarm("import", file, "-o", out, "--force")
        assert (found.code, found.err) == (0, "")
        out.write_text(out.read_text().replace("link: {kind: macvlan, parent: eth1}", "link: {kind: memory}"))
        with out.open("a") as end:
            end.write("controller: {name: plc, ip: 10.7.0.1/24}\n")
        (made,) = expand(load_farm(out))
        assert (made.name, made.model) == ("cu-1", "profidrive")
        assert [(axis.telegram, axis.supplementary) for axis in made.axes] == wanted
        with Line.from_file(out) as line:
            line.wait_connected(5)
            assert line.core.station("cu-1").device.connection().exchanging
