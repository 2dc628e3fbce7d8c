"""The JSON Schema of the farm file says what the program reads."""

import json
from pathlib import Path

import jsonschema
import pytest

from pnfarm.config.known import catalogue
from pnfarm.farm.file.schema import farm_schema
from pnfarm.farm.file.sections import FarmSections
from pnfarm.vocabulary.yaml_lines import parse_yaml


def references(value):
    if isinstance(value, dict):
        if "$ref" in value:
            yield value["$ref"]
        for inner in value.values():
            yield from references(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from references(inner)


def test_the_schema_is_plain_json_and_every_reference_leads_somewhere():
    schema = json.loads(json.dumps(farm_schema()))
    assert schema["$schema"].startswith("https://json-schema.org/")
    assert {ref.removeprefix("#/$defs/") for ref in references(schema)} <= schema["$defs"].keys()


def test_every_key_of_a_drive_is_there_as_the_file_writes_it():
    drive = farm_schema()["$defs"]["DriveGroup"]
    assert {
        "name",
        "count",
        "model",
        "ip",
        "mac",
        "load",
        "limits",
        "identity",
        "params",
        "impair",
        "cycle",
        "hello",
    } <= drive["properties"].keys()
    assert "cycle_ns" not in drive["properties"]
    assert drive["required"] == ["name", "model"]
    assert drive["additionalProperties"] is False


def test_a_group_of_devices_names_the_file_of_its_bus():
    validator = jsonschema.Draft202012Validator(farm_schema())
    whole = {"farm": "cell", "link": {"kind": "memory"}}
    for keys, valid in (({"gsdml": "a.xml"}, True), ({"eds": "a.eds", "connection": 2}, True), ({}, False)):
        assert validator.is_valid(whole | {"devices": [{"name": "one", **keys}]}) == valid, keys


def test_the_values_of_a_drive_carry_descriptions_bounds_and_examples():
    properties = farm_schema()["$defs"]["DriveGroup"]["properties"]
    assert properties["count"]["maximum"] == 4094
    assert "DCP" in properties["ip"]["description"]
    assert "akd-profinet" in properties["model"]["examples"]


def test_the_schema_offers_the_fault_kinds_that_are_known():
    known = catalogue(frozenset(("loss", "f702")))
    assert farm_schema(known)["$defs"]["Impairment"]["properties"]["kind"]["enum"] == ["f702", "loss"]


def test_the_example_in_the_schema_is_a_valid_file():
    (example,) = farm_schema()["examples"]
    assert FarmSections.model_validate(example).drives[0].count == 8


def test_the_api_may_be_off_an_address_or_a_section():
    words, address, section = farm_schema()["properties"]["api"]["anyOf"]
    assert (words["enum"], address["type"], section["$ref"]) == (["off", False], "string", "#/$defs/Api")


# -- for editors -----------------------------------------------------------------------------------------------------

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
LINE = "# yaml-language-server: $schema="


def checker(kind):
    schema = json.loads((CONFIGS / "schema" / f"{kind}.schema.json").read_text("utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize(
    "file",
    [path for path in sorted(CONFIGS.rglob("*.yml")) if path.name.endswith((".pnfarm.yml", ".scenario.yml"))],
    ids=lambda path: path.relative_to(CONFIGS).as_posix(),
)
def test_an_example_names_its_schema_and_is_right_by_it(file):
    text = file.read_text("utf-8")
    first = text.partition("\n")[0]
    assert first.startswith(LINE)
    schema = (file.parent / first.removeprefix(LINE)).resolve()
    kind = "farm" if file.name.endswith(".pnfarm.yml") else "scenario"
    assert schema == CONFIGS / "schema" / f"{kind}.schema.json"
    assert [error.message for error in checker(kind).iter_errors(parse_yaml(text).root.plain())] == []


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("farm", "farm: a\nlink: {kind: memory}\ndrives: [{name: b, model: akd-profinett}]"),
        ("farm", "farm: a\nlink: {kind: memory}\ndrives: [{name: b, model: akd-profinet, cycel: 16ms}]"),
        ("farm", "farm: a\nlink: {kind: memory}\ndrives: [{name: b, model: akd, impair: [{kind: timeouts}]}]"),
        ("farm", "farm: a\nlink: {kind: memory}\ndrives: [{name: b, model: akd, behaviour: {mode-change: maybe}}]"),
        ("scenario", "scenario: a\nsteps: [{fault: {kind: f703, on: all}}]"),
        ("scenario", "scenario: a\nsteps: [{except: {drive: all, that: connected}}]"),
    ],
)
def test_an_editor_marks_what_is_no_model_key_kind_or_step(kind, text):
    assert not checker(kind).is_valid(parse_yaml(text).root.plain())


def test_a_model_may_be_named_by_any_of_its_names():
    names = farm_schema()["$defs"]["DriveGroup"]["properties"]["model"]["enum"]
    assert {"akd-profinet", "akd", "moog-msd-dp", "msd-profibus"} <= set(names)
