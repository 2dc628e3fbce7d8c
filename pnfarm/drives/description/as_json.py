"""A model in full, as plain JSON values with their sources: what ``pnfarm models MODEL --format json`` prints."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pnfarm.drives.parameters.effects import effect_of
from pnfarm.drives.parameters.parameter import Form
from pnfarm.drives.profiles.profidrive.part import PROFIDRIVE
from pnfarm.drives.telegrams.telegram import TASK_FORMS

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.description.parts import Point
    from pnfarm.drives.parameters.parameter import Parameter
    from pnfarm.drives.profiles.cip.part import CipInstance
    from pnfarm.drives.telegrams.telegram import Module, Submodule, Telegram

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


def _submodule_json(submodule: Submodule) -> dict[str, Any]:
    return {
        "slot": submodule.slot,
        "subslot": submodule.subslot,
        "ident": submodule.ident,
        "api": submodule.api,
        "input_bytes": submodule.input_bytes,
        "output_bytes": submodule.output_bytes,
        "name": submodule.name,
        "source": submodule.source,
        "note": submodule.note,
    }


def _module_json(module: Module) -> dict[str, Any]:
    return {
        "module_ident": module.ident,
        "module_source": module.source,
        "module_note": module.note,
        "submodules": [_submodule_json(submodule) for submodule in module.submodules],
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
        "signed": parameter.signed,
        "elements": parameter.elements,
        "access": "r" * parameter.readable + "w" * parameter.writable,
        "min": parameter.minimum,
        "max": parameter.maximum,
        "default": parameter.default,
        "unit": parameter.unit,
        "scale": parameter.scale,
        "nonvolatile": parameter.nonvolatile,
        "backed_by": parameter.backing.name.lower(),
        "effect": effect_of(described, parameter).value,
        "after_power_on": parameter.after_power_on,
        "motor": parameter.motor,
        "source": parameter.source,
        "values_source": parameter.values_source,
        "note": parameter.note,
    }


def _point_json(point: Point) -> dict[str, Any]:
    return {
        "name": point.name,
        "about": point.about,
        "readings": list(point.readings),
        "descriptions": {name: reading.does for name, reading in point.readings.items()},
        "default": point.default,
        "reason": point.reason,
        "source": point.source,
    }


def _instance_json(instance: CipInstance) -> dict[str, Any]:
    return {**asdict(instance), "scaling": instance.scaling.value}


def as_json(described: Model) -> dict[str, Any]:
    """See the module's head."""
    return {
        "name": described.name,
        "aliases": list(described.aliases),
        "title": described.title,
        "maker": described.maker,
        "bus": described.bus,
        "profile": described.profile,
        "manual": described.manual,
        "edition": described.edition,
        "firmware_version": described.firmware_version,
        "identity": _with_sources(described, "identity", asdict(described.profidrive.identity))
        if described.profile == PROFIDRIVE
        else None,
        "dap": _module_json(described.dap) if described.dap.submodules else None,
        "default_telegram": described.profidrive.default_telegram,
        "telegrams": [
            {
                "number": telegram.number,
                "name": telegram.name,
                "opmode": telegram.opmode,
                "tasks": TASK_FORMS[telegram.tasks],
                "pulses_enabled": telegram.pulses_enabled,
                "free_mapping": telegram.free_mapping,
                "parameter_words": telegram.parameter_words,
                "falls_back": list(telegram.falls_back),
                **_module_json(telegram.module),
                "other_modules": _others_json(telegram),
                "identifiers": telegram.identifiers.hex(" ") or None,
                "output": [signal.name if signal else None for signal in telegram.output],
                "input": [signal.name if signal else None for signal in telegram.input],
                "source": telegram.source,
                "note": telegram.note,
            }
            for telegram in described.profidrive.telegrams.values()
        ],
        "signals": [
            {
                "number": signal.number,
                "name": signal.name,
                "bits": signal.bits,
                "signed": signal.signed,
                "direction": "setpoint" if signal.setpoint else "actual",
                "drive_signal": signal.drive_signal,
                "readable": signal.readable or not signal.setpoint,
                "stored": signal.stored,
                "source": signal.source,
                "note": signal.note,
            }
            for signal in described.profidrive.signals.values()
        ],
        "bits": [
            {
                "word": bits.word,
                "telegrams": list(bits.telegrams),
                "names": list(bits.names),
                "source": bits.source,
                "note": bits.note,
            }
            for bits in described.profidrive.word_bits
        ],
        "parameters": [_parameter_json(described, parameter) for parameter in described.parameters.values()],
        "faults": [
            {
                "number": fault.number,
                "label": fault.label,
                "name": fault.name,
                "kind": "warning" if fault.warning else "fault",
                "reaction": "" if fault.warning else ("coast", "quick-stop")[fault.reaction],
                "cause": fault.cause,
                "word": fault.word,
                "action": fault.action,
                "source": fault.source,
                "note": fault.note,
            }
            for fault in described.faults.values()
        ],
        "limits": _with_sources(described, "limits", asdict(described.limits)),
        "motor": _fact_json(described, "motor"),
        "firmware": _fact_json(described, "firmware"),
        "motors": {
            kind: {
                part: _fact_json(described, f"motors.{kind}.{part}")
                for part in ("kind", "motor", "firmware", "defaults")
            }
            for kind in described.motor_kinds
        },
        "communication_loss": _fact_json(described, "communication_loss"),
        "sign_of_life": _fact_json(described, "sign_of_life"),
        "following_error": _fact_json(described, "following_error"),
        "motion_tasks": _fact_json(described, "motion_tasks"),
        "position_units": _fact_json(described, "position_units"),
        "factor_group": _fact_json(described, "factor_group"),
        "control_limits": _fact_json(described, "control_limits"),
        "parameter_texts": _fact_json(described, "parameter_texts"),
        "consequences": [{**asdict(entry), "subindexes": list(entry.subindexes)} for entry in described.consequences],
        "effects": _fact_json(described, "effects"),
        "numbering": _fact_json(described, "numbering"),
        "parameter_access": _fact_json(described, "parameter_access"),
        "parameter_words": _fact_json(described, "parameter_words"),
        "address_mode": _fact_json(described, "address_mode"),
        "lamps": _fact_json(described, "lamps"),
        "description_file": _fact_json(described, "description_file"),
        "diagnosis": _fact_json(described, "diagnosis"),
        "diagnosis_coding": _fact_json(described, "diagnosis_coding"),
        "behaviour": [_point_json(point) for point in described.behaviour],
        "realism": _fact_json(described, "realism"),
        **(
            {"instances": [_instance_json(one) for one in described.cip.instances.values()]}
            if described.cip.instances
            else {}
        ),
        **(
            {"attributes": [asdict(one) for one in described.cip.attributes.values()]}
            if described.cip.attributes
            else {}
        ),
        **({"bus_facts": _fact_json(described, described.bus)} if described.bus_facts else {}),
    }
