"""A model in full, as plain JSON values with their sources: what ``pnfarm models MODEL --format json`` prints."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.motor_kinds import PARTS
from pnfarm.drives.parameters.effects import effect_of
from pnfarm.drives.parameters.parameter import Form
from pnfarm.drives.profiles.profidrive.part import PROFIDRIVE
from pnfarm.drives.telegrams.telegram import TASK_FORMS

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.description.parts import Point
    from pnfarm.drives.parameters.parameter import Parameter
    from pnfarm.drives.profiles.cip.part import CipInstance
    from pnfarm.drives.telegrams.telegram import Module, Telegram

__all__ = ["as_json"]


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _fact_json(described: Model, section: str) -> dict[str, Any]:
    prefix = f"{section}."
    return {
        key.removeprefix(prefix): {
            "value": _plain(fact.value),
            "unit": fact.unit,
            "source": fact.source,
            "note": fact.note,
        }
        for key, fact in described.facts.items()
        if key.startswith(prefix)
    }


def _with_sources(described: Model, section: str, values: dict[str, Any]) -> dict[str, Any]:
    """The values in force, and beside them where each comes from (``farm file`` where it was overridden)."""
    sources: dict[str, Any] = {}
    for key, value in values.items():
        fact = described.facts.get(f"{section}.{key}")
        if fact is None:
            sources[key] = {"source": "default", "note": "the model's data does not say"}
            continue
        overridden = value != fact.value
        sources[key] = {"source": "farm file" if overridden else fact.source, "note": "" if overridden else fact.note}
    return {**{key: _plain(value) for key, value in values.items()}, "sources": sources}


def _picked(found: Any, fields: str) -> dict[str, Any]:
    """These fields of an object."""
    return {field: _plain(getattr(found, field)) for field in fields.split()}


def _facts_json(described: Model, sections: str) -> dict[str, Any]:
    return {section: _fact_json(described, section) for section in sections.split()}


def _module_json(module: Module) -> dict[str, Any]:
    return {
        "module_ident": module.ident,
        "module_source": module.source,
        "module_note": module.note,
        "submodules": [
            _picked(submodule, "slot subslot ident api input_bytes output_bytes name source note")
            for submodule in module.submodules
        ],
    }


def _others_json(telegram: Telegram) -> list[dict[str, Any]]:
    """Further modules of a telegram, if it has any."""
    return [{"name": module.name, **_module_json(module)} for module in telegram.others]


def _parameter_json(described: Model, parameter: Parameter) -> dict[str, Any]:
    return {
        "pnu": parameter.pnu,
        "number": described.numbering.name(parameter.pnu),
        "name": parameter.name,
        "type": parameter.type.name.lower() if parameter.form is Form.INTEGER else parameter.form.value,
        **_picked(parameter, "signed elements"),
        "access": "r" * parameter.readable + "w" * parameter.writable,
        "min": parameter.minimum,
        "max": parameter.maximum,
        **_picked(parameter, "default unit scale nonvolatile"),
        "backed_by": parameter.backing.name.lower(),
        "effect": effect_of(described, parameter).value,
        **_picked(parameter, "after_power_on motor source values_source note"),
    }


def _point_json(point: Point) -> dict[str, Any]:
    return {
        **_picked(point, "name about"),
        "readings": list(point.readings),
        "descriptions": {name: reading.does for name, reading in point.readings.items()},
        **_picked(point, "default reason source"),
    }


def _instance_json(instance: CipInstance) -> dict[str, Any]:
    return {**asdict(instance), "scaling": instance.scaling.value}


def as_json(described: Model) -> dict[str, Any]:
    """See the module's head."""
    of_bus = {
        "instances": [_instance_json(one) for one in described.cip.instances.values()],
        "attributes": [asdict(one) for one in described.cip.attributes.values()],
        "bus_facts": _fact_json(described, described.bus) if described.bus_facts else {},
    }
    return {
        **_picked(described, "name aliases title maker bus profile manual edition firmware_version"),
        "identity": _with_sources(described, "identity", asdict(described.profidrive.identity))
        if described.profile == PROFIDRIVE
        else None,
        "dap": _module_json(described.dap) if described.dap.submodules else None,
        "default_telegram": described.profidrive.default_telegram,
        "telegrams": [
            {
                **_picked(telegram, "number name opmode"),
                "tasks": TASK_FORMS[telegram.tasks],
                **_picked(telegram, "pulses_enabled free_mapping own_words parameter_words falls_back"),
                **_module_json(telegram.module),
                "other_modules": _others_json(telegram),
                "identifiers": telegram.identifiers.hex(" ") or None,
                "output": [signal.name if signal else None for signal in telegram.output],
                "input": [signal.name if signal else None for signal in telegram.input],
                **_picked(telegram, "source note"),
            }
            for telegram in described.profidrive.telegrams.values()
        ],
        "supplements": [
            {
                **_picked(telegram, "number name"),
                "submodule_ident": telegram.module.data.ident,
                "subslot": telegram.module.data.subslot,
                "output": [signal.name if signal else None for signal in telegram.output],
                "input": [signal.name if signal else None for signal in telegram.input],
                **_picked(telegram, "source note"),
            }
            for telegram in described.profidrive.supplements.values()
        ],
        "signals": [
            {
                **_picked(signal, "number name bits signed"),
                "direction": "setpoint" if signal.setpoint else "actual",
                "drive_signal": signal.drive_signal,
                "readable": signal.readable or not signal.setpoint,
                **_picked(signal, "stored source note"),
            }
            for signal in described.profidrive.signals.values()
        ],
        "bits": [_picked(bits, "word telegrams names source note") for bits in described.profidrive.word_bits],
        "parameters": [_parameter_json(described, parameter) for parameter in described.parameters.values()],
        "faults": [
            {
                **_picked(fault, "number label name"),
                "kind": "warning" if fault.warning else "fault",
                "reaction": "" if fault.warning else ("coast", "quick-stop")[fault.reaction],
                **_picked(fault, "cause word action namur source note"),
            }
            for fault in described.faults.values()
        ],
        "limits": _with_sources(described, "limits", asdict(described.limits)),
        **_facts_json(described, "motor firmware"),
        "motors": {
            kind: {part: _fact_json(described, f"motors.{kind}.{part}") for part in PARTS}
            for kind in described.motor_kinds
        },
        **_facts_json(
            described,
            "communication_loss sign_of_life following_error motion_tasks position_units factor_group control_limits "
            "parameter_texts",
        ),
        "consequences": [{**asdict(entry), "subindexes": list(entry.subindexes)} for entry in described.consequences],
        **_facts_json(
            described,
            "effects numbering parameter_access parameter_words address_mode lamps description_file diagnosis "
            "diagnosis_coding",
        ),
        "behaviour": [_point_json(point) for point in described.behaviour],
        "behaviour_sets": [
            {
                **_picked(one, "name title gaps"),
                "sources": dict(one.sources),
                "readings": {
                    point: {"reading": fact.value, "source": fact.source} for point, fact in one.readings.items()
                },
                "faults": [_picked(fault, "fault code name source") for fault in one.faults],
            }
            for one in described.behaviour_sets.values()
        ],
        "realism": _fact_json(described, "realism"),
        # of some buses only
        **{key: value for key, value in of_bus.items() if value},
    }
