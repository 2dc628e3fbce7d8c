"""JSON Schema of the scenario file, for editors and for ``pnfarm schema scenario``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.registry import fault_kinds
from pnfarm.scenario.definition.file import KEYS
from pnfarm.scenario.definition.steps import STEPS, WHOLE
from pnfarm.scenario.find import FIND

if TYPE_CHECKING:
    from pnfarm.scenario.definition.steps import StepKind

__all__ = ["scenario_schema"]

_VARIABLE = {"type": "string", "pattern": r"\$"}


def _step(kind: StepKind) -> dict[str, Any]:
    properties = {
        # anywhere a variable may stand for the value
        name: {"description": key.doc, "anyOf": [dict(key.schema), _VARIABLE]}
        for name, key in kind.keys.items()
    }
    whole: dict[str, Any] = {"type": "object", "properties": properties, "additionalProperties": False}
    if kind.required:
        whole["required"] = list(kind.required)
    if kind.one_of:
        whole["oneOf"] = [{"required": [name]} for name in kind.one_of]
    return {"anyOf": [whole, {"type": ["string", "integer"]}]} if kind.short else whole


def scenario_schema() -> dict[str, Any]:
    """The schema (draft 2020-12) as plain values."""
    fault = fault_kinds().schema()
    shared = fault.pop("$defs", {})
    for name, key in fault.get("properties", {}).items():
        fault["properties"][name] = {"anyOf": [key, _VARIABLE]}
    kinds = {name: {"description": kind.doc, **_step(kind)} for name, kind in STEPS.items() if name not in WHOLE}
    for name in ("set", "force", "release"):
        kinds[name] = {"description": STEPS[name].doc, **STEPS[name].keys["signals"].schema}
    kinds["fault"] = {"description": STEPS["fault"].doc, "$ref": "#/$defs/Fault"}
    steps = {"type": "array", "items": {"$ref": "#/$defs/Step"}, "minItems": 1}
    kinds["parallel"] = {
        "description": "Steps, or lists of steps, that run at once.",
        "type": "array",
        "items": {"anyOf": [{"$ref": "#/$defs/Step"}, steps]},
        "minItems": 1,
    }
    kinds["repeat"] = {
        "description": "Steps once for each combination of values, or a number of times.",
        "type": "object",
        "properties": {
            "for": {"type": "object", "description": "Names and lists of values, or {from: 1, to: 6}; used as $name."},
            "times": {"type": ["integer", "string"]},
            "steps": steps,
        },
        "required": ["steps"],
        "oneOf": [{"required": ["for"]}, {"required": ["times"]}],
        "additionalProperties": False,
    }
    kinds["find"] = {"description": FIND.doc, **_step(FIND)}
    for key in ("steps", "then"):
        kinds["find"]["properties"][key] = {"description": FIND.keys[key].doc, **steps}
    step = {
        "type": "object",
        "properties": kinds,
        "minProperties": 1,
        "maxProperties": 1,
        "additionalProperties": False,
    }
    lists = {"anyOf": [{"type": "array", "minItems": 1}, {"type": "object", "required": ["from", "to"]}]}
    types: dict[str, Any] = {
        "with": {"type": "object"},
        "matrix": {"type": "object", "minProperties": 1, "additionalProperties": lists},
        "variables": {"type": "object"},
        "steps": steps,
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "pnfarm scenario file",
        "type": "object",
        "properties": {key: {"description": text, **types.get(key, {"type": "string"})} for key, text in KEYS.items()},
        "required": ["scenario", "steps"],
        "additionalProperties": False,
        "$defs": {"Step": step, "Fault": fault, **shared},
    }
