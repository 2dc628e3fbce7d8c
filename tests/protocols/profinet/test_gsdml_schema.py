"""Every model's file against PI's own schema, V2.44, as the package uphy-upgen of PyPI brings it."""

import importlib.util
import re
from pathlib import Path

import pytest
from gsdml_examples import ISLAND, SCANNER
from gsdml_versions import VERSIONS, gsdml_of
from lxml import etree
from seen_stations import SeenPlant

from pnfarm.buses.profinet.model_gsdml import describe_model
from pnfarm.drives.catalogue import model, models
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml

PROFINET_MODELS = [name for name in models() if model(name).bus == "profinet"]


@pytest.fixture(scope="module")
def schema():
    # the package is not imported: its program wants another pydantic
    package = importlib.util.find_spec("upgen")
    if package is None:
        pytest.skip("needs the package uphy-upgen, which holds PI's schema")
    folder = Path(next(iter(package.submodule_search_locations))) / "generators" / "schema" / "GSDML"
    parser = etree.XMLParser(no_network=True)
    return etree.XMLSchema(etree.parse(str(folder / "GSDML-DeviceProfile-v2.44.xsd"), parser))


def complaints(schema, text):
    schema.validate(etree.fromstring(text.encode()))
    return [f"line {error.line}: {error.message}" for error in schema.error_log]


@pytest.mark.parametrize("name", PROFINET_MODELS)
def test_a_models_file_follows_the_schema(schema, name):
    assert complaints(schema, emit_gsdml(describe_model(model(name)))) == []


# what V2.32 took away is no longer in this schema
@pytest.mark.parametrize("version", VERSIONS[VERSIONS.index("2.32") :])
def test_the_tests_own_files_of_later_versions_follow_the_schema(schema, version):
    assert complaints(schema, gsdml_of(version)) == []


@pytest.mark.parametrize("path", [ISLAND, SCANNER])
def test_the_examples_follow_the_schema(schema, path):
    assert complaints(schema, path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("pattern", "replacement"),
    [
        (r'ConformanceClass="B"', 'ConformanceClass="D"'),
        (r'NetloadClass="I"', 'NetloadClass="IV"'),
        (r"<IOConfigData[^>]*/>", ""),
        (r"(?s)(<CertificationInfo[^>]*/>)(\s*)(<IOConfigData[^>]*/>)", r"\3\2\1"),
        (r'ModuleIdentNumber="0x', 'ModuleIdentNumber="'),
        (r"<VirtualSubmoduleItem ", '<VirtualSubmoduleItem Foo="1" '),
    ],
)
def test_the_schema_finds_what_is_wrong(schema, pattern, replacement):
    """So that the test above can fail."""
    text = emit_gsdml(describe_model(model("akd")))
    broken = re.sub(pattern, replacement, text, count=1)
    assert broken != text
    assert complaints(schema, broken)


@pytest.mark.parametrize("name", PROFINET_MODELS)
def test_the_classes_of_the_device_are_in_the_file(name):
    (dap,) = parse_gsdml(emit_gsdml(describe_model(model(name))).encode()).daps
    classes = dap.certification
    assert (classes.conformance_class, classes.application_classes, classes.netload_class) == ("B", (), "I")


def test_a_file_made_of_a_capture_follows_the_schema(schema):
    plant = SeenPlant()
    plant.connect()
    plant.write(1, 100, b"\1\2")
    (device,) = plant.found()
    assert complaints(schema, device.file.octets.decode()) == []
