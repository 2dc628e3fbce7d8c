"""JSON Schema of the farm file, for editors and for ``pnfarm schema farm``.

The schema says what one value may be; what values must hold between them only the program checks
(``pnfarm validate``).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.config.known import Known, catalogue
from pnfarm.config.realism import SWITCH
from pnfarm.farm.file.sections import DEFAULT_LISTEN, OFF, FarmSections

if TYPE_CHECKING:
    from pnfarm.config.known import ModelFacts

__all__ = ["farm_schema"]

_DIALECT = "https://json-schema.org/draft/2020-12/schema"

_EXAMPLE: dict[str, Any] = {
    "farm": "line-1",
    "link": {"kind": "macvlan", "parent": "eth1"},
    "state": "./state",
    "api": DEFAULT_LISTEN,
    "drives": [
        {
            "name": "axis-{n:02}",
            "count": 8,
            "model": "akd-profinet",
            "ip": "10.77.0.11/24",
            "load": {"inertia": 2.0e-4, "friction": 0.05},
            "params": {"DRV.OPMODE": 1},
        }
    ],
}


def _behaviour_of(model: ModelFacts) -> dict[str, Any]:
    """What ``behaviour`` may be in a group of this model."""
    points = {name: {"enum": [*readings], "default": readings[0]} for name, readings in model.open_points.items()}
    return {
        "if": {"properties": {"model": {"enum": [model.name, *model.aliases]}}, "required": ["model"]},
        "then": {"properties": {"behaviour": {"properties": points, "additionalProperties": False}}},
    }


def farm_schema(known: Known | None = None) -> dict[str, Any]:
    """The schema (draft 2020-12) as plain values; ``known`` gives the models and fault kinds that editors offer."""
    known = known if known is not None else catalogue()
    schema = FarmSections.model_json_schema(by_alias=True)
    sections: dict[str, Any] = schema.pop("$defs")
    properties: dict[str, Any] = schema.pop("properties")
    schema.pop("title", None)
    for section in (*sections.values(), {"properties": properties}):
        for field in section.get("properties", {}).values():
            field.pop("title", None)
    # the words that stand for a whole section, which the types read before the schema sees them
    switch_off = {"enum": [OFF, False]}
    address = {"type": "string", "examples": [DEFAULT_LISTEN]}
    properties["api"]["anyOf"] = [switch_off, address, {"$ref": "#/$defs/Api"}]
    sections["ControllerSection"]["properties"]["reconnect"]["anyOf"] = [switch_off, {"$ref": "#/$defs/Reconnect"}]
    for section, key in (("DriveGroup", "realism"), ("Realism", "noise"), ("Realism", "boot_time")):
        field = sections[section]["properties"][key]
        kinds = [SWITCH, {"$ref": field.pop("$ref")}]
        field["anyOf"] = kinds if key != "boot_time" else [*kinds, {"type": "string", "examples": ["8s"]}]
    sections["DriveGroup"]["properties"]["model"]["examples"] = list(known.models)
    sections["DriveGroup"]["allOf"] = [_behaviour_of(model) for name in known.models if (model := known.model(name))]
    if known.fault_kinds is not None:
        sections["Impairment"]["properties"]["kind"]["enum"] = sorted(known.fault_kinds)
    return {
        "$schema": _DIALECT,
        "title": "pnfarm farm file",
        **schema,
        "properties": properties,
        # a farm has a name and a link; a file for foreign devices has a controller
        "anyOf": [{"required": ["farm", "link"]}, {"required": ["controller"]}],
        "examples": [_EXAMPLE],
        "$defs": sections,
    }
