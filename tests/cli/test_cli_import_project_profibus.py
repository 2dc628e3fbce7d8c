"""``pnfarm import`` of a project's CAx data: PROFIBUS stations by their makers' GSD files."""

import shutil
import zipfile

import pytest
from aml_project import at_system, attribute, element, module, plc, project, slave, tag
from farm_file import CONFIGS
from hypothesis import given, settings
from hypothesis import strategies as st
from imported import check_found, comments, importing

from pnfarm.buses.profibus.project.stations import of_project
from pnfarm.buses.projects.caex import parse_caex
from pnfarm.buses.projects.description_folders import DescriptionFolders
from pnfarm.drives.catalogue import model
from pnfarm.farm.file.reading import load_farm
from pnfarm.testing import Line

GSD = CONFIGS / "gsd" / "EXMP1D01.gsd"
NAME = "EXMP1D01.GSD"
INPUTS, OUTPUTS, ANALOG = ("Input", 20, 16), ("Output", 5, 8), ("Input", 100, 64)


def part(slot, number, *areas, name=""):
    return module(slot, f"GSD:{NAME}/M/{number}", *areas, name=name or f"module {number}")


@pytest.fixture
def imported(pnfarm, tmp_path):
    shutil.copy(GSD, tmp_path)
    return importing(pnfarm, tmp_path / "line.aml", project)


def test_a_slave_of_a_project_is_played_with_its_modules_and_exchanges_data(imported):
    tags = [tag("Present", "%I20.3"), tag("Count", "%IW102", "Int"), tag("Valve", "%Q5.0")]
    island = slave("Island_1", 5, NAME, part(1, 1, INPUTS), part(2, 2, OUTPUTS), part(3, 3, ANALOG))
    result, out = imported(plc(tags=tags), island, links=[at_system("Island_1-if")])
    assert (result.code, result.err) == (0, "")
    assert "0 drives, 1 device, 1 other station in comments" in result.out
    (group,) = load_farm(out).devices
    assert (group.name, group.address) == ("island-1", 5)
    assert [one.item.name for one in group.described.plugged.modules] == ["16DI", "8DO", "4AI"]
    assert {name: (one.text, one.value_type.name) for name, one in group.signals.items()} == {
        "Present": ("1.1.0.3", "bool"), "Count": ("3.1.2", "int16"), "Valve": ("2.1.0.0", "bool"),
    }  # fmt: skip
    text = out.read_text()
    assert "link: {kind: serial, pty: auto}" in text
    out.write_text(
        text.replace("link: {kind: serial, pty: auto}", "link: {kind: memory}") + "controller: {name: plc}\n"
    )
    with Line.from_file(out) as line:
        line.wait_connected(5)
        assert line.core.device("island-1").device.connection().exchanging


def test_a_drive_s_ident_number_says_which_model_it_is(imported, tmp_path, pnfarm):
    written = pnfarm("gsd", "moog-msd-dp", "-o", tmp_path)
    assert written.code == 0
    (file,) = [one for one in tmp_path.iterdir() if one.suffix.lower().startswith(".gs") and one.name != GSD.name]
    result, out = imported(slave("Axis", 7, file.name.upper()))
    assert (result.code, result.err) == (0, "")
    (group,) = load_farm(out).drives
    assert (group.name, group.model, group.address) == ("axis", model("moog-msd-dp").name, 7)


def test_a_slave_without_its_file_is_in_the_list_of_what_is_missing(imported):
    result, out = imported(slave("One", 5, "NONE1234.GSD"), slave("Two", 6, "NONE1234.GSD"))
    assert (result.code, "missing: NONE1234.GSD, for One Two\n" in result.err) == (0, True)
    assert "devices:" not in out.read_text()


def test_a_module_that_the_file_has_not_is_left_out_and_the_others_stay(imported):
    _, out = imported(slave("Island", 5, NAME, part(1, 99, INPUTS), part(2, 2, OUTPUTS)))
    (group,) = load_farm(out).devices
    assert [one.item.name for one in group.described.plugged.modules] == ["8DO"]
    assert "slot 1: the file has no module '99', which the project plugs: left out" in comments(out)


def test_a_module_of_a_file_without_numbers_is_found_by_its_name_or_place(imported, tmp_path):
    text = GSD.read_text()
    for number in range(1, 6):
        text = text.replace(f"\n{number}\n", "\n", 1)
    assert "SlotDefinition" not in text
    (tmp_path / GSD.name).write_text(text)
    by_name = part(1, 77, INPUTS).replace("</InternalElement>", "</InternalElement>" + attribute("TypeName", "16DI"), 1)
    _, out = imported(slave("Island", 5, NAME, by_name, part(2, 2, OUTPUTS)))
    (group,) = load_farm(out).devices
    assert [one.item.name for one in group.described.plugged.modules] == ["16DI", "8DO"]


def test_a_file_in_a_zip_file_is_written_beside_the_farm(imported, tmp_path, tmp_path_factory):
    (tmp_path / GSD.name).unlink()
    library = tmp_path_factory.mktemp("library")
    with zipfile.ZipFile(library / "gsd.zip", "w") as archive:
        archive.write(GSD, f"old/{GSD.name}")
    result, out = imported(slave("Island", 5, NAME, part(1, 1)), options=("--gsdml", library))
    assert "1 description file out of a zip file" in result.out
    assert (tmp_path / GSD.name).read_bytes() == GSD.read_bytes()
    assert load_farm(out).devices[0].gsd == GSD.name


def test_two_slaves_with_one_address_are_not_both_in_the_farm(imported):
    result, out = imported(slave("One", 5, NAME, part(1, 1)), slave("Two", 5, NAME, part(1, 1)))
    assert result.code == 0
    assert "address" in result.err
    assert load_farm(out).devices


def test_a_station_by_order_number_is_listed_with_its_address(imported):
    inside = element("N1", role="Node", Type="Profibus", NetworkAddress="9")
    head = element("IM", inside, role="DeviceItem", TypeIdentifier="OrderNumber:6ES7 151-1AA05-0AB0", PositionNumber=0)
    result, out = imported(
        slave("One", 5, NAME, part(1, 1)), element("ET", head, role="Device", TypeIdentifier="System:Device.ET200S")
    )
    assert result.code == 0
    assert "ET: address 9; slot 0: IM (OrderNumber:6ES7 151-1AA05-0AB0)" in comments(out)


_WORDS = st.sampled_from(["5", "126", "200", "-1", "", "x", "Island", "a b", NAME, "NONE.GSD"])
_PARTS = st.tuples(
    st.integers(-1, 10) | st.just(70000),
    st.sampled_from([1, 2, 3, 4, 5, 6, "x", ""]),
    st.lists(st.tuples(st.sampled_from(["Input", "Output"]), st.integers(0, 40), st.integers(0, 70)), max_size=3),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(_WORDS, _WORDS, _WORDS, st.lists(_PARTS, max_size=4)), max_size=4))
def test_whatever_slaves_a_project_has_the_farm_file_can_be_read(tmp_path_factory, slaves):
    folder = tmp_path_factory.getbasetemp()
    shutil.copy(GSD, folder)
    stations = [
        slave(name, address, file or NAME, *(part(slot, number, *areas) for slot, number, areas in parts))
        for name, address, file, parts in slaves
    ]
    text = project(plc(tags=[tag("A", "%I20.0")]), *stations)
    check_found(of_project(parse_caex(text.encode()), DescriptionFolders([], folder), folder), folder)
