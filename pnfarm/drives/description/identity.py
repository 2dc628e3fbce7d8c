"""A drive model under another identity: what the farm file's ``identity`` section changes of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from pnfarm.drives.description.parts import Fact
from pnfarm.drives.profiles.cip.part import CIP
from pnfarm.drives.telegrams.telegram import Module, Submodule
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.drives.description.model import Model

__all__ = ["CIP_OVERRIDES", "OVERRIDES", "PROFIBUS_OVERRIDES", "overrides_of", "with_identity"]

#: Keys of the farm file's ``identity`` section, for a PROFIdrive model.
OVERRIDES: Mapping[str, str] = {
    "vendor": "vendor id, 0..0xFFFF",
    "device": "device id, 0..0xFFFF",
    "order_number": "order number, up to 20 ASCII characters",
    "station_type": "DCP station type, up to 25 ASCII characters",
    "hardware_revision": "0..0xFFFF",
    "software_version": "such as V1.17.0",
    "profile_id": "0..0xFFFF",
    "profile_specific_type": "0..0xFFFF",
    "dap": "module ident of the device access point",
    "dap_submodules": "mapping: subslot -> submodule ident",
    "access_point": "submodule ident of the parameter access point",
    "telegrams": "mapping: telegram -> module ident, or {module: ident, submodule: ident, others: its other modules}",
}
#: Those of them that only PROFINET has.
_OF_MODULES = frozenset({"dap", "dap_submodules", "access_point", "telegrams"})
#: The same for a PROFIdrive model on PROFIBUS, which has no modules with idents.
PROFIBUS_OVERRIDES: Mapping[str, str] = {
    **{key: what for key, what in OVERRIDES.items() if key not in _OF_MODULES},
    "device": "ident number, 0..0xFFFF",
    "station_type": "model name, up to 25 ASCII characters",
}
#: The same for a CIP model.
CIP_OVERRIDES: Mapping[str, str] = {
    "vendor": "vendor id, 0..0xFFFF",
    "device_type": "0..0xFFFF",
    "product_code": "0..0xFFFF",
    "product_name": "up to 32 ASCII characters",
    "revision": "a text such as '1.13'",
}


def _number(value: Any, where: str, maximum: int) -> int:
    try:
        number = int(value, 0) if isinstance(value, str) else value
    except ValueError:
        number = None
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= maximum:
        raise ConfigError(f"identity.{where}: {value!r} is not a number from 0 to 0x{maximum:X}")
    return number


def _text(value: Any, where: str, length: int) -> str:
    if not isinstance(value, str) or not value.isascii() or not value.isprintable() or not 0 < len(value) <= length:
        raise ConfigError(f"identity.{where}: {value!r} is not a text of 1 to {length} ASCII characters")
    return value


def _version(value: Any) -> tuple[str, tuple[int, int, int]]:
    text = _text(value, "software_version", 16)
    prefix, digits = (text[0], text[1:]) if text[0] in "VRPUT" else ("V", text)
    parts = digits.split(".")
    if len(parts) != 3 or not all(part.isdigit() and int(part) <= 255 for part in parts):
        raise ConfigError(
            f"identity.software_version: {value!r} is not like V1.17.0 (V, R, P, U or T and three numbers up to 255)"
        )
    major, minor, internal = (int(part) for part in parts)
    return prefix, (major, minor, internal)


def _mapping(value: Any, where: str) -> Mapping[Any, Any]:
    if not isinstance(value, Mapping):
        raise ConfigError(f"identity.{where}: {value!r} is not a mapping")
    return value


_IDENT = 0xFFFFFFFF
_Part = TypeVar("_Part", Module, Submodule)
#: Override -> field of Identity, for the plain numbers and texts.
_NUMBERS = {
    "vendor": "vendor_id",
    "device": "device_id",
    "hardware_revision": "hardware_revision",
    "profile_id": "profile_id",
    "profile_specific_type": "profile_specific_type",
}
_TEXTS = {"order_number": ("order_id", 20), "station_type": ("station_type", 25)}


def _from_farm_file(part: _Part, ident: int) -> _Part:
    return dataclasses.replace(part, ident=ident, source="farm file", note="")


def _with_ident(module: Module, subslot: int, ident: int, where: str) -> Module:
    if all(submodule.subslot != subslot for submodule in module.submodules):
        known = ", ".join(f"0x{submodule.subslot:X}" for submodule in module.submodules)
        raise ConfigError(f"identity.{where}: there is no subslot 0x{subslot:X}; there are {known}")
    submodules = tuple(_from_farm_file(s, ident) if s.subslot == subslot else s for s in module.submodules)
    return dataclasses.replace(module, submodules=submodules)


def _with_idents(module: Module, parts: Mapping[str, Any], where: str) -> Module:
    """A telegram's module with the idents of ``module`` and ``submodule``."""
    if "module" in parts:
        module = _from_farm_file(module, _number(parts["module"], f"{where}.module", _IDENT))
    if "submodule" in parts:
        ident = _number(parts["submodule"], f"{where}.submodule", _IDENT)
        module = _with_ident(module, _telegram_subslot(module), ident, where)
    return module


def _others(others: tuple[Module, ...], value: Any, where: str) -> tuple[Module, ...]:
    """The other modules of a telegram with the idents of ``value``: a mapping by place, 0 the first; the rest go."""
    found = []
    for key, parts in _mapping(value, where).items():
        place = _number(key, where, 0xFFFF)
        if place >= len(others):
            raise ConfigError(f"identity.{where}: {key!r} is not the place of one of {len(others)} other modules")
        own = parts if isinstance(parts, Mapping) else {"module": parts}
        if not own.keys() <= {"module", "submodule"}:
            raise ConfigError(f"identity.{where}.{key}: {dict(own)!r} may hold module and submodule only")
        found.append((place, _with_idents(others[place], own, f"{where}.{key}")))
    return tuple(module for _, module in sorted(found, key=lambda pair: pair[0]))


def _telegram_subslot(module: Module) -> int:
    return max(submodule.subslot for submodule in module.submodules)


def _revision(value: Any) -> list[int]:
    """Major and minor revision; a number would lose the zero of 1.10."""
    major, _, minor = value.partition(".") if isinstance(value, str) else ("", "", "")
    parts = [int(part) if part.isascii() and part.isdigit() and len(part) < 4 else 0 for part in (major, minor)]
    if not all(0 < part <= limit for part, limit in zip(parts, (127, 255), strict=True)):
        raise ConfigError(f"identity.revision: {value!r} is not a text like '1.13' (1 to 127, and 1 to 255)")
    return parts


def _with_cip_identity(model: Model, overrides: Mapping[str, Any]) -> Model:
    """The same for a CIP model, whose identity is among the facts of its bus."""
    readers: dict[str, tuple[str, Callable[[Any], Any]]] = {
        "vendor": ("vendor_id", lambda value: _number(value, "vendor", 0xFFFF)),
        "device_type": ("device_type", lambda value: _number(value, "device_type", 0xFFFF)),
        "product_code": ("product_code", lambda value: _number(value, "product_code", 0xFFFF)),
        "product_name": ("product_name", lambda value: _text(value, "product_name", 32)),
        "revision": ("revision", _revision),
    }
    facts = dict(model.bus_facts)
    for key, value in overrides.items():
        field, read = readers[key]
        facts[field] = Fact(read(value), "farm file")
    return dataclasses.replace(model, bus_facts=facts)


def overrides_of(model: Model) -> Mapping[str, str]:
    """The keys that the farm file's ``identity`` section may have for this model, and what each is."""
    if model.profile == CIP:
        return CIP_OVERRIDES
    return PROFIBUS_OVERRIDES if model.bus == "profibus" else OVERRIDES


def with_identity(model: Model, overrides: Mapping[str, Any]) -> Model:
    """The model under another identity; :func:`overrides_of` has the keys.

    Raises :class:`ConfigError`.
    """
    if not overrides:
        return model
    known = overrides_of(model)
    for key in overrides:
        if key not in known:
            raise ConfigError(f"identity.{key}: unknown; there are {', '.join(known)}")
    if model.profile == CIP:
        return _with_cip_identity(model, overrides)
    changes: dict[str, Any] = {}
    for key, field in _NUMBERS.items():
        if key in overrides:
            changes[field] = _number(overrides[key], key, 0xFFFF)
    for key, (field, length) in _TEXTS.items():
        if key in overrides:
            changes[field] = _text(overrides[key], key, length)
    if "software_version" in overrides:
        changes["software_prefix"], changes["software_version"] = _version(overrides["software_version"])

    dap = model.dap
    if "dap" in overrides:
        dap = _from_farm_file(dap, _number(overrides["dap"], "dap", _IDENT))
    for subslot, ident in _mapping(overrides.get("dap_submodules", {}), "dap_submodules").items():
        where = f"dap_submodules.{subslot}"
        dap = _with_ident(dap, _number(subslot, where, 0xFFFF), _number(ident, where, _IDENT), where)

    telegrams = dict(model.profidrive.telegrams)
    if "access_point" in overrides:
        ident = _number(overrides["access_point"], "access_point", _IDENT)
        for number, telegram in telegrams.items():
            module, *more = (
                _with_ident(m, min(s.subslot for s in m.submodules), ident, "access_point") for m in telegram.modules
            )
            telegrams[number] = dataclasses.replace(telegram, module=module, others=tuple(more))
    for key, wanted in _mapping(overrides.get("telegrams", {}), "telegrams").items():
        where = f"telegrams.{key}"
        number = _number(key, where, 0xFFFF)
        if number not in telegrams:
            raise ConfigError(
                f"identity.{where}: {model.name} has no telegram {number}; it has {', '.join(map(str, telegrams))}"
            )
        parts = wanted if isinstance(wanted, Mapping) else {"module": wanted}
        if not parts.keys() <= {"module", "submodule", "others"}:
            raise ConfigError(f"identity.{where}: {dict(parts)!r} may hold module, submodule and others only")
        module = _with_idents(telegrams[number].module, parts, where)
        others = telegrams[number].others
        if "others" in parts:
            others = _others(others, parts["others"], f"{where}.others")
        telegrams[number] = dataclasses.replace(telegrams[number], module=module, others=others)
    idents = [module.ident for telegram in telegrams.values() for module in telegram.modules]
    if model.dap.submodules and len(set(idents)) != len(idents):
        raise ConfigError(
            "identity.telegrams: two modules have the same module ident; a controller could not tell them apart"
        )
    profidrive = dataclasses.replace(
        model.profidrive, identity=dataclasses.replace(model.profidrive.identity, **changes), telegrams=telegrams
    )
    return dataclasses.replace(model, dap=dap, profidrive=profidrive)
