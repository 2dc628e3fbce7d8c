"""The JSON Schema of the farm file says what the program reads."""

from __future__ import annotations

import json

from pnfarm.config.known import catalogue
from pnfarm.farm.file.schema import farm_schema
from pnfarm.farm.file.sections import FarmSections


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
