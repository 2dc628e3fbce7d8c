"""``pnfarm import`` of a Studio 5000 project: modules on EtherNet/IP."""

import re
import shutil

import pytest
from farm_file import CONFIGS
from hypothesis import given, settings
from hypothesis import strategies as st
from imported import check_found, comments, groups, importing
from l5x_project import alias, connection, module, project

from pnfarm.buses.ethernetip.project.stations import of_project
from pnfarm.buses.projects.description_folders import DescriptionFolders
from pnfarm.buses.projects.l5x import MAX_DEPTH, NotL5xError, parse_l5x
from pnfarm.drives.catalogue import model
from pnfarm.farm.file.reading import load_farm
from pnfarm.protocols.enip.eds.reader import parse_sheet
from pnfarm.testing import Line

EDS = sorted((CONFIGS / "eds").glob("*.eds"))


@pytest.fixture
def imported(pnfarm, tmp_path):
    return importing(pnfarm, tmp_path / "line.L5X", project)


def exchanging(out, names):
    """Whether the built-in scanner exchanges data with each device."""
    text = out.read_text().replace("link: {kind: macvlan, parent: eth1}", "link: {kind: memory}")
    out.write_text(text + "controller: {name: plc, ip: 192.168.1.250/24}\n")
    with Line.from_file(out) as line:
        line.wait_connected(5)
        return [line.core.device(name).device.connection().exchanging for name in names]


@pytest.mark.parametrize(
    ("inputs", "outputs", "kind"), [(10, 4, "Output"), (450, 8, "Output"), (64, 0, "Input"), (2, 2, "Output")]
)
def test_a_generic_module_is_played_with_its_assemblies_and_lengths(imported, inputs, outputs, kind):
    result, out = imported(module("Valves", "192.168.1.20", connection(inputs, outputs, kind=kind)))
    assert (result.code, result.err) == (0, "")
    (group,) = load_farm(out).devices
    assert (group.name, str(group.ip), group.rpi_ns) == ("valves", "192.168.1.20/24", 10_000_000)
    chosen = group.described.connection
    assert (chosen.points, chosen.inputs.size.default, chosen.outputs.size.default) == ((1, 100, 101), inputs, outputs)
    assert exchanging(out, ["valves"]) == [True]


def test_lengths_of_the_module_count_where_the_connection_has_none(imported):
    own = connection(InputSize=None, OutputSize=None)
    _, out = imported(module("M", "192.168.1.20", own, communications='PrimCxnInputSize="20" PrimCxnOutputSize="6"'))
    chosen = groups(out)["m"].described.connection
    assert (chosen.inputs.size.default, chosen.outputs.size.default) == (20, 6)


def test_a_connection_with_a_path_is_played_under_the_module_s_identity(imported):
    path = "20 04 24 a6 2c 6b 2d 00 56 03"
    own = connection(100, 64, kind="StandardDataDriven", ConnectionPath=path, InputCxnPoint=None, OutputCxnPoint=None)
    result, out = imported(
        module(
            "Camera", "192.168.1.20", own, CatalogNumber="CAM-1", Vendor=678, ProductType=43, ProductCode=2304, Major=3
        )
    )
    group = groups(out)["camera"]
    key = group.described.sheet.key
    assert (key.vendor_id, key.device_type, key.product_code, key.major_revision) == (678, 43, 2304, 3)
    assert group.described.connection.points == (0xA6, 0x6B, 0x356)
    assert "with an EDS file for vendor 678, type 43, code 2304 (CAM-1) it has names and parameters" in comments(out)
    assert (result.code, exchanging(out, ["camera"])) == (0, [True])


def test_a_module_whose_eds_file_is_at_hand_is_played_by_it(imported, tmp_path):
    from pnfarm.buses.ethernetip.eds_file import load_eds

    file = EDS[0]
    shutil.copy(file, tmp_path)
    sheet = load_eds(file)
    chosen = sheet.connection()
    configuration, outputs, inputs = chosen.points if len(chosen.points) == 3 else (0, *chosen.points)
    identity = {
        "Vendor": sheet.key.vendor_id,
        "ProductType": sheet.key.device_type,
        "ProductCode": sheet.key.product_code,
    }
    own = connection(
        chosen.inputs.size.default, chosen.outputs.size.default, InputCxnPoint=inputs, OutputCxnPoint=outputs
    )
    made = module("Unit", "192.168.1.20", own, configuration=f"[4,{configuration}]", CatalogNumber="X", **identity)
    _, out = imported(made)
    group = groups(out)["unit"]
    assert (group.eds, group.connection) == (file.name, chosen.keyword)
    assert exchanging(out, ["unit"]) == [True]


def test_an_eds_file_with_its_identity_in_hexadecimal_is_found(imported, tmp_path):
    text = EDS[0].read_text("latin-1")
    for key in ("VendCode", "ProdType", "ProdCode", "MajRev"):
        text = re.sub(rf"({key}\s*=\s*)([0-9]+)", lambda one: f"{one[1]}0x{int(one[2]):04X}", text)
    (tmp_path / "unit.eds").write_text(text, "latin-1")
    key = parse_sheet(text.encode("latin-1")).key
    identity = {"Vendor": key.vendor_id, "ProductType": key.device_type, "ProductCode": key.product_code}
    _, out = imported(module("Unit", "192.168.1.20", connection(), CatalogNumber="X", **identity))
    assert groups(out)["unit"].eds == "unit.eds"


def test_aliases_of_a_module_s_data_name_its_signals(imported):
    tags = [
        alias("PartPresent", "Valves:I.Data[1].9"), alias("Speed", "Valves:I.Data[2]"),
        alias("Clamp", "Valves:O.Data[0].0"), alias("Other", "Elsewhere:I.Data[0]"),
        alias("Far", "Valves:I.Data[0].16"), alias("Of tag", "AnotherTag"),
    ]  # fmt: skip
    _, out = imported(module("Valves", "192.168.1.20", connection(10, 4)), tags=tags)
    signals = groups(out)["valves"].signals
    assert {name: (one.text, one.value_type.name) for name, one in signals.items()} == {
        "PartPresent": ("101.1.3.1", "bool"), "Speed": ("101.1.4", "int16"), "Clamp": ("100.1.0.0", "bool"),
    }  # fmt: skip
    assert "no signal for the tag 'Far'" in comments(out)


def test_any_number_of_aliases_outside_of_a_module_s_data_are_left_out(imported):
    outside = [alias(f"Far{number}", f"Valves:I.Data[{number}]") for number in range(100, 250)]
    tags = [alias("Near", "Valves:I.Data[1].3"), *outside]
    result, out = imported(module("Valves", "192.168.1.20", connection(4, 4)), tags=tags)
    assert result.code == 0
    assert result.err.count("left out: signals.Far") == 150
    assert set(groups(out)["valves"].signals) == {"Near"}


def test_a_drive_s_identity_says_which_model_it_is(imported):
    facts = {key: one.value for key, one in model("akd-ethernetip").bus_facts.items()}
    identity = {"Vendor": facts["vendor_id"], "ProductType": facts["device_type"], "ProductCode": facts["product_code"]}
    result, out = imported(module("Axis_1", "192.168.1.20", connection(), CatalogNumber="AKD", **identity))
    (group,) = load_farm(out).drives
    assert (result.code, group.name, group.model) == (0, "axis-1", model("akd-ethernetip").name)


def test_modules_behind_an_adapter_are_listed_and_what_is_missing_is_said(imported):
    adapter = module("Rack", "192.168.1.20", CatalogNumber="1734-AENT/B", ProductType=12, ProductCode=108, Major=5)
    below = module("Rack_1", "", CatalogNumber="1734-IB8", ParentModule="Rack")
    result, out = imported(adapter, below)
    assert "missing: an EDS file for vendor 1, type 12, code 108 (1734-AENT/B), for Rack\n" in result.err
    assert "behind it: Rack_1: 1734-IB8, revision 1.1" in comments(out)


@pytest.mark.parametrize(
    ("data", "words"),
    [(b"<!-- <RSLogix5000Content --><html/>", "its root is no RSLogix5000Content"),
     (b"<RSLogix5000Content><Controller>", "line 1"),
     (b'<?xml version="1.0" encoding="TF-8"?><RSLogix5000Content/>', "unknown encoding"),
     (b'<!DOCTYPE x [<!ENTITY a "b">]><RSLogix5000Content/>', "document type"),
     (b"<RSLogix5000Content>" + b"<a>" * (MAX_DEPTH + 1), "deeper than"),
     (b"<RSLogix5000Content>" + b"<Module/>" * 10_001 + b"</RSLogix5000Content>", "more than 10000 modules")],
)  # fmt: skip
def test_a_file_that_is_no_such_project_is_refused(pnfarm, tmp_path, data, words):
    file = tmp_path / "line.L5X"
    file.write_bytes(data)
    found = pnfarm("import", file)
    assert (found.code, words in found.err) == (2, True)
    assert "\n" not in found.err.strip()


_NUMBERS = st.sampled_from([0, 1, 4, 500, 1400, 70000, -1, "x", ""])
_WORDS = st.sampled_from(["Valves", "a b", "", "x" * 300, "20 04 24 01 2C 64 2C 65", "zz", "Input", "Output", 'q"\\'])
_CONNECTIONS = st.builds(
    connection, _NUMBERS, _NUMBERS, element=st.sampled_from(["INT", "SINT", "X"]), kind=_WORDS, Name=_WORDS,
    RPI=_NUMBERS, InputCxnPoint=_NUMBERS, OutputCxnPoint=_NUMBERS, ConnectionPath=st.none() | _WORDS,
)  # fmt: skip
_MODULES = st.builds(
    lambda name, ip, connections, configuration, code: module(
        name, ip, *connections, configuration=configuration, ProductCode=code, Major=code
    ),
    _WORDS,
    st.sampled_from(["192.168.1.20", "192.168.1.21", "", "1.2.3", "192.168.1.255"]),
    st.lists(_CONNECTIONS, max_size=2),
    st.sampled_from(["[4,1,[0]]", "", "[4", "[99999,70000,1]", "[4,0,[0]]"]),
    _NUMBERS,
)


@settings(max_examples=80, deadline=None)
@given(
    st.lists(_MODULES, max_size=4),
    st.lists(st.tuples(_WORDS, st.sampled_from(["Valves:I.Data[0]", "Valves:O.Data[9].9"])), max_size=3),
)
def test_whatever_modules_a_project_has_the_farm_file_can_be_read(tmp_path_factory, modules, tags):
    folder = tmp_path_factory.getbasetemp()
    text = project(*modules, tags=[alias(*one) for one in tags])
    check_found(of_project(parse_l5x(text.encode()), DescriptionFolders([], folder), folder), folder)


@settings(max_examples=100)
@given(data=st.data())
def test_no_damage_of_a_project_has_another_outcome_than_a_refusal(data):
    octets = bytearray(project(module("Valves", "192.168.1.20", connection()), tags=[alias("a", "b")]).encode())
    for _ in range(data.draw(st.integers(1, 5))):
        place = data.draw(st.integers(0, len(octets) - 1))
        octets[place : place + data.draw(st.integers(0, 8))] = data.draw(st.binary(max_size=8))
    try:
        found = parse_l5x(bytes(octets))
    except NotL5xError:
        return
    assert len(found.modules) <= 2
