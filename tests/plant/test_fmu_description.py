"""What an FMU's description says, how a farm file uses it, and how a hostile one is refused, without running it."""

from contextlib import suppress

import pytest
from fmus import DESCRIPTION, LIBRARY, zipped
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import FarmFileError, parse_farm
from pnfarm.plant.fmi.description import FmuFileError, read_description
from pnfarm.vocabulary.zip_files import DamagedZipError, unpack_zip

HEAD = """farm: t
link: {kind: memory}
drives:
- {name: x, model: akd-profinet, ip: 10.77.0.11/24}
plant:
  models:
"""
NEWER = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="newer" instantiationToken="t">
  <CoSimulation modelIdentifier="newer" fixedInternalStepSize="1e-3"/>
  <TypeDefinitions><Float64Type name="Way" unit="mm" min="-1" max="1"/></TypeDefinitions>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <Float64 name="way" valueReference="1" causality="input" declaredType="Way" start="0.5"/>
    <Float64 name="row" valueReference="2" causality="input"><Dimension start="3"/></Float64>
    <UInt8 name="octet" valueReference="3" causality="input" max="9.5"/>
    <Float32 name="single" valueReference="4" causality="output"/>
    <Boolean name="on" valueReference="5" causality="input" start="true"/>
    <Enumeration name="mode" valueReference="6" causality="output"/>
    <Binary name="blob" valueReference="7" causality="output"/>
    <Clock name="tick" valueReference="8" causality="input"/>
    <UInt64 name="size" valueReference="9" causality="structuralParameter" start="3"/>
    <Float64 name="inner" valueReference="10"/>
    <Float64 name="first" valueReference="11" causality="local" initial="exact" start="1"/>
    <Float64 name="fixed" valueReference="12" causality="local" variability="constant" initial="exact" start="1"/>
  </ModelVariables>
</fmiModelDescription>
"""


@pytest.fixture
def write(tmp_path):
    """An FMU with a description, and whatever else."""

    def one(description=DESCRIPTION, members=None, name="press.fmu"):
        found = {"modelDescription.xml": description, LIBRARY: b"no code"} if members is None else members
        (tmp_path / name).write_bytes(zipped(found))
        return tmp_path / name

    return one


def _issues(path, keys="", wires=""):
    text = f"{HEAD}  - {{name: press, fmu: {path}{keys}}}\n" + (f"  wires: [{wires}]\n" if wires else "")
    try:
        parse_farm(text)
    except FarmFileError as error:
        return [f"{issue.line}: {issue.what}; {issue.allowed}" for issue in error.issues]
    return []


def test_a_description_of_fmi_3_gives_ports_with_types_units_limits_and_start_values():
    found = read_description(NEWER.encode())
    assert (found.version, found.identifier, found.token, found.saves_state) == (3, "newer", "t", False)
    assert [(one.name, one.type, one.unit, one.low, one.high, one.start_value) for one in found.of("input")] == [
        ("way", "Float64", "mm", -1.0, 1.0, 0.5),
        ("octet", "UInt8", "", 0, 9, 0.0),
        ("on", "Boolean", "", 0, 1, 1.0),
    ]
    assert [(one.name, one.type) for one in found.of("output")] == [("single", "Float32"), ("mode", "Int64")]
    assert {name: one.no_port for name, one in found.variables.items() if one.no_port} == {
        "row": "is an array",
        "blob": "is of type Binary",
        "tick": "is of type Clock",
    }
    assert [name for name, one in found.variables.items() if one.is_settable] == ["first"]


def test_wires_to_an_fmu_are_checked_while_the_file_is_validated(write):
    path = write()
    keys = ", parameters: {gain: 2, at: 3, label: hello}, on_failure: {y: 0, off: true}"
    assert _issues(path, keys, 'press.y -> x.load_torque, press.off -> x.limit_low, "press.count -> press.n[1]"') == []
    for wire, what in (
        ("press.z -> x.load_torque", "8: press has no output 'z'"),
        ("press.note -> x.load_torque", "8: press.note is of type String"),
        ("press.gain -> x.load_torque", "8: press.gain is a parameter"),
        ("x.torque -> press.y", "8: press has no input 'y'"),
        ("press.y -> press.u", "8: press.u is in mm, what the wire gives (press.y) has the unit Nm"),
        ("press.y -> x.limit_low", "8: press.y is a number, x.limit_low is a bit"),
    ):
        issues = _issues(path, wires=wire)
        assert issues[0].startswith(what), issues


@pytest.mark.parametrize(
    ("keys", "what"),
    [
        ("parameters: {gian: 2}", "bench has no such parameter, did you mean gain?"),
        ("parameters: {gain: 11}", "is 11; a number from 0 to 10"),
        ("parameters: {gain: much}", "is 'much'; a number from 0 to 10"),
        ("parameters: {gain: true}", "is true; a number from 0 to 10"),
        ("parameters: {at: 1.5}", "is 1.5; a whole number"),
        ("parameters: {at: 99999999999}", "is 99999999999; a whole number from -2.14748e+09 to 2.14748e+09"),
        ("parameters: {label: 3}", "is 3; a text of at most 4096 characters"),
        ("parameters: {u: 3}", "bench has no such parameter"),
        ("parameters: {inner: 1" + "0" * 400 + "}", "is inf; a number"),
        ("parameters: {gain: [1]}", "is a list; a number, true, false, or a text"),
        ("on_failure: 3", "is 3; hold, or {OUTPUT: VALUE}"),
        ("on_failure: {z: 1}", "bench has no such output"),
        ("on_failure: {y: true}", "is true; a number Nm"),
        ("on_failure: {off: 1}", "is 1; true or false"),
        ("gain: 3", "is no key of an FMU; parameters: {NAME: VALUE}"),
        ("class: Press", "is a key of models in Python"),
    ],
)
def test_keys_of_an_fmu_are_checked_by_name_type_and_limits(write, keys, what):
    [issue] = _issues(write(), f", {keys}")
    assert issue.startswith(f"7: {what}"), issue


def test_keys_of_fmus_are_refused_for_other_models():
    text = f"{HEAD}  - {{name: a, kind: lamp, parameters: {{x: 1}}, on_failure: hold}}\n"
    with pytest.raises(FarmFileError) as caught:
        parse_farm(text)
    assert [issue.what for issue in caught.value.issues] == ["is a key of FMUs", "is a key of FMUs"]


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ('fmiVersion="2.0"', 'fmiVersion="1.0"', "it is an FMU of FMI 1.0; an FMU for co-simulation, FMI 2.0 or 3.0"),
        ('fmiVersion="2.0"', "", "it is an FMU of FMI without version"),
        ("<CoSimulation", "<ModelExchange", "it is an FMU for model exchange only; an FMU for co-simulation"),
        ('modelIdentifier="bench"', 'modelIdentifier="../../evil"', "its modelDescription.xml is refused: its modelId"),
        ("<?xml", "<xml", "its modelDescription.xml is refused: line 1: "),
        (
            "?>",
            "?><!DOCTYPE a [<!ENTITY b SYSTEM 'file:///etc/passwd'>]>",
            "its modelDescription.xml is refused: a doc",
        ),
        (
            'valueReference="1"',
            'valueReference="-1"',
            "its modelDescription.xml is refused: variable 'u' has no valueR",
        ),
        ('min="-100"', 'min="low"', "its modelDescription.xml is refused: min of variable 'u' is 'low'"),
        ('min="-100"', 'min="101"', "its modelDescription.xml is refused: the limits of variable 'u' leave no value"),
        ('name="y"', 'name="u"', "its modelDescription.xml is refused: variable 'u' appears twice"),
        ("<ModelStructure/>", "<a>" * 40 + "</a>" * 40, "its modelDescription.xml is refused: its elements are nested"),
    ],
)
def test_an_fmu_that_cannot_be_used_is_refused_with_a_sentence(write, old, new, what):
    assert old in DESCRIPTION
    path = write(DESCRIPTION.replace(old, new, 1))
    [issue] = _issues(path)
    assert issue.startswith(f"7: {path}: {what}"), issue


def test_files_that_are_no_fmus_are_refused_with_a_sentence(write, tmp_path):
    (tmp_path / "text.fmu").write_text("text")
    windows = write(members={"modelDescription.xml": DESCRIPTION, "binaries/win64/bench.dll": b""}, name="windows.fmu")
    bare = write(members={"modelDescription.xml": DESCRIPTION, "sources/a.c": ""}, name="bare.fmu")
    for path, what in (
        (tmp_path / "none.fmu", "there is no such file; the path of an FMU"),
        (tmp_path, "it is no file; the path of an FMU"),
        (tmp_path / "text.fmu", "it cannot be read as a zip file: File is not"),
        (write(members={"a": ""}, name="other.fmu"), "it has no modelDescription.xml"),
        (windows, "it has binaries for win64 alone, and this machine is "),
        (bare, "it has no binaries, and this machine is "),
        (write(NEWER.replace("input", "local").replace("output", "local")), "it has 0 inputs and outputs"),
    ):
        [issue] = _issues(path)
        assert issue.startswith(f"7: {path}: {what}") or what.startswith("it has 0"), issue


def test_a_description_that_unpacks_to_too_much_is_refused(write, monkeypatch):
    monkeypatch.setattr("pnfarm.plant.fmi.planned.MAX_OCTETS", 10_000)
    monkeypatch.setattr("pnfarm.plant.fmi.description.MAX_OCTETS", 10_000)
    path = write(DESCRIPTION + " " * 10_000_000)
    assert _issues(path) == [
        f"7: {path}: its modelDescription.xml has more than 10000 octets; an FMU for co-simulation, FMI 2.0 or 3.0"
    ]


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "a/../../evil", "..\\evil"])
def test_an_fmu_is_unpacked_into_its_folder_and_nowhere_else(tmp_path, name):
    (tmp_path / "a.zip").write_bytes(zipped({"fine/a": "1", name: "2"}))
    (tmp_path / "in").mkdir()
    with pytest.raises(DamagedZipError, match="would be outside of the folder"):
        unpack_zip(tmp_path / "a.zip", tmp_path / "in", 10, 1000)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a.zip", "in"]


def test_unpacking_ends_where_it_would_be_too_much(tmp_path):
    (tmp_path / "a.zip").write_bytes(zipped({"a": b"0" * 10_000_000, "b/c": b"1"}))
    (tmp_path / "in").mkdir()
    with pytest.raises(ConfigError, match="unpacked, it has more than 1000 octets"):
        unpack_zip(tmp_path / "a.zip", tmp_path / "in", 10, 1000)
    assert sum(one.stat().st_size for one in (tmp_path / "in").iterdir()) <= 1000
    with pytest.raises(ConfigError, match="it has 2 members; at most 1"):
        unpack_zip(tmp_path / "a.zip", tmp_path / "in", 1, 1000)


_PIECES = st.sampled_from(
    [*DESCRIPTION.split('"'), *NEWER.split('"'), "INF", "NaN", "1e999", "-1", "\0", "<!DOCTYPE a>"]
)


@given(st.binary(max_size=200) | st.lists(_PIECES, max_size=60).map(lambda parts: '"'.join(parts).encode()))
def test_any_octets_are_a_description_or_are_refused(data):
    with suppress(FmuFileError):
        assert read_description(data).version in {2, 3}


@given(
    st.integers(0, DESCRIPTION.count('"') // 2 - 1), st.sampled_from(["", "INF", "-INF", "nan", "9" * 400, "x" * 300])
)
def test_any_value_of_an_attribute_is_taken_or_refused(place, value):
    parts = DESCRIPTION.split('"')
    parts[2 * place + 1] = value
    with suppress(FmuFileError):
        assert read_description('"'.join(parts).encode()).version == 2
