"""JSON Schema of the farm file, for editors and for ``pnfarm schema farm``.

The schema says what each value may be; only the program checks values against each other
(``pnfarm validate``).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.devices import DeviceBus, devices_part
from pnfarm.buses.registry import BUSES
from pnfarm.config.controller import ControllerSection
from pnfarm.config.device import DeviceGroup
from pnfarm.config.drive import DriveGroup
from pnfarm.config.known import Known, catalogue
from pnfarm.config.realism import SWITCH
from pnfarm.config.values import OFF
from pnfarm.errors import InternalError
from pnfarm.farm.file.sections import DEFAULT_LISTEN, FarmSections

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.bus import Bus
    from pnfarm.config.known import ModelFacts
    from pnfarm.config.section import Section

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


def _either(first: dict[str, Any], second: dict[str, Any]) -> dict[str, Any]:
    """A key of two buses: what the first has, or both where they take other values (devices by GSDML or EDS file)."""
    words = {"title", "description", "default"}
    types = [{key: value for key, value in one.items() if key not in words} for one in (first, second)]
    if types[0] == types[1]:
        return first
    texts = dict.fromkeys(one["description"] for one in (first, second) if "description" in one)
    return {"anyOf": types, "description": " / ".join(texts)}


def _keys_of_buses(
    base: type[Section], of: Callable[[Bus], type[Section] | None], sections: dict[str, Any], text: str = ""
) -> dict[str, Any]:
    """A section with the keys of all buses; the types of these are added to ``sections``.

    ``text`` describes it; left out, the descriptions of the buses' sections.
    """
    properties: dict[str, Any] = {}
    required: list[list[str]] = []
    texts: list[str] = []
    for bus in BUSES.values():
        section = of(bus)
        if section is None:
            continue
        own = section.model_json_schema(by_alias=True)
        for name, shared in own.get("$defs", {}).items():
            if sections.setdefault(name, shared) != shared:
                raise InternalError(f"two buses have sections called {name}, which differ")
        for key in section.listed_keys():
            found = own["properties"][key]
            properties[key] = _either(properties[key], found) if key in properties else found
        texts.append(own["description"])
        required.append(own.get("required", []))
    whole = {**sections[base.__name__], "properties": properties, "description": text or " / ".join(texts)}
    common = [key for key in required[0] if all(key in keys for keys in required)]
    further = [[key for key in keys if key not in common] for keys in required]
    return (
        whole
        | ({"required": common} if common else {})
        # each bus has a key of its own, such as that for a maker's file
        | ({"anyOf": [{"required": keys} for keys in further]} if all(further) else {})
    )


def _maps_of_buses(properties: dict[str, Any]) -> dict[str, Any]:
    """The maps with keys for one bus alone, by its name."""
    maps: dict[str, Any] = {}
    for bus in BUSES.values():
        if (section := bus.farm_file.controller) is not None:
            own = section.model_json_schema(by_alias=True)["properties"] | {"reconnect": properties["reconnect"]}
            for field in own.values():
                field.pop("title", None)
            maps[bus.name] = {
                "type": "object",
                "additionalProperties": False,
                "description": f"Keys for the controller on {bus.title} alone, in a file with drives on several buses.",
                "properties": {key: own[key] for key in section.listed_keys()},
            }
    return {name: each for name, each in maps.items() if name not in properties}


def _only_of_its_bus(known: Known) -> list[dict[str, Any]]:
    """Keys that a group must not have, by the bus of its model."""
    keys = {bus.name: bus.farm_file.drives.listed_keys() for bus in BUSES.values()}
    names: dict[str, list[str]] = {}
    for name in known.models:
        if (model := known.model(name)) is not None:
            names.setdefault(model.bus, []).extend((model.name, *model.aliases))
    rules = []
    for bus, own in keys.items():
        others = {key: False for other in keys.values() for key in other if key not in own}
        if others and bus in names:
            rules.append(
                {
                    "if": {"properties": {"model": {"enum": names[bus]}}, "required": ["model"]},
                    "then": {"properties": others},
                }
            )
    return rules


def farm_schema(known: Known | None = None) -> dict[str, Any]:
    """The schema (draft 2020-12) as plain values; ``known`` gives the models and fault kinds that editors offer."""
    known = known if known is not None else catalogue()
    schema = FarmSections.model_json_schema(by_alias=True)
    sections: dict[str, Any] = schema.pop("$defs")
    properties: dict[str, Any] = schema.pop("properties")
    schema.pop("title", None)
    sections["DriveGroup"] = _keys_of_buses(
        DriveGroup, lambda bus: bus.farm_file.drives, sections, str(DriveGroup.__doc__)
    )
    sections["DeviceGroup"] = _keys_of_buses(
        DeviceGroup,
        lambda bus: devices_part(bus).devices if isinstance(bus, DeviceBus) else None,
        sections,
        str(DeviceGroup.__doc__),
    )
    sections["ControllerSection"] = _keys_of_buses(ControllerSection, lambda bus: bus.farm_file.controller, sections)
    sections = dict(sorted(sections.items()))
    for section in (*sections.values(), {"properties": properties}):
        for field in section.get("properties", {}).values():
            field.pop("title", None)
    # short forms of whole sections, which the types expand before the schema sees them
    switch_off = {"enum": [OFF, False]}
    address = {"type": "string", "examples": [DEFAULT_LISTEN]}
    properties["api"]["anyOf"] = [switch_off, address, {"$ref": "#/$defs/Api"}]
    controllers = sections["ControllerSection"]
    # several controllers are one section in the file
    properties["controller"] = {
        "anyOf": [{"$ref": "#/$defs/ControllerSection"}, {"type": "null"}],
        "default": None,
        "description": properties["controller"]["description"],
    }
    controllers["properties"] |= _maps_of_buses(controllers["properties"])
    controllers["properties"]["reconnect"]["anyOf"] = [switch_off, {"$ref": "#/$defs/Reconnect"}]
    for section, key in (("DriveGroup", "realism"), ("Realism", "noise"), ("Realism", "boot_time")):
        field = sections[section]["properties"][key]
        kinds = [SWITCH, {"$ref": field.pop("$ref")}]
        field["anyOf"] = kinds if key != "boot_time" else [*kinds, {"type": "string", "examples": ["8s"]}]
    models = [model for name in known.models if (model := known.model(name)) is not None]
    sections["DriveGroup"]["properties"]["model"] |= {
        "enum": [name for model in models for name in (model.name, *model.aliases)],
        "examples": list(known.models),
    }
    sections["DriveGroup"]["allOf"] = [
        *(_behaviour_of(model) for model in models),
        *_only_of_its_bus(known),
    ]
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
