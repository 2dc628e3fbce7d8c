"""A drive model under another identity: what the farm file's ``identity`` section changes of it."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from pnfarm.drives.description.identity_identifiers import octets, with_identifiers
from pnfarm.drives.description.identity_modules import IDENT, from_farm_file, mapping, number, with_ident, with_modules
from pnfarm.drives.description.parts import Fact
from pnfarm.drives.profiles.cip.part import CIP
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

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
    "supplements": "mapping: supplementary telegram -> {submodule: ident, subslot: number}",
    "without": "list of telegrams that the drive does not have",
}
#: Those of them that only PROFINET has.
_OF_MODULES = frozenset({"dap", "dap_submodules", "access_point", "telegrams", "supplements"})
#: The same for a PROFIdrive model on PROFIBUS, which has no modules with idents.
PROFIBUS_OVERRIDES: Mapping[str, str] = {
    **{key: what for key, what in OVERRIDES.items() if key not in _OF_MODULES},
    "device": "ident number, 0..0xFFFF",
    "telegrams": "mapping: telegram -> its identifiers of Chk_Cfg in hexadecimal, such as C3 C1 C1 FD 00 01",
    "parameters": "octets of Set_Prm after the seven of the standard, in hexadecimal",
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


#: Octets of Set_Prm after the seven of the standard.
_LONGEST_USER = 237
#: Override -> field of Identity, for the plain numbers and texts.
_NUMBERS = {
    "vendor": "vendor_id",
    "device": "device_id",
    "hardware_revision": "hardware_revision",
    "profile_id": "profile_id",
    "profile_specific_type": "profile_specific_type",
}
_TEXTS = {"order_number": ("order_id", 20), "station_type": ("station_type", 25)}


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
        "vendor": ("vendor_id", lambda value: number(value, "vendor", 0xFFFF)),
        "device_type": ("device_type", lambda value: number(value, "device_type", 0xFFFF)),
        "product_code": ("product_code", lambda value: number(value, "product_code", 0xFFFF)),
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
            changes[field] = number(overrides[key], key, 0xFFFF)
    for key, (field, length) in _TEXTS.items():
        if key in overrides:
            changes[field] = _text(overrides[key], key, length)
    if "software_version" in overrides:
        changes["software_prefix"], changes["software_version"] = _version(overrides["software_version"])

    dap = model.dap
    if "dap" in overrides:
        dap = from_farm_file(dap, number(overrides["dap"], "dap", IDENT))
    for subslot, ident in mapping(overrides.get("dap_submodules", {}), "dap_submodules").items():
        where = f"dap_submodules.{subslot}"
        dap = with_ident(dap, number(subslot, where, 0xFFFF), number(ident, where, IDENT), where)

    profidrive = model.profidrive
    facts = model.bus_facts
    if dap.submodules:
        profidrive = with_modules(profidrive, overrides, model.name)
    elif model.bus == "profibus":
        profidrive = with_identifiers(profidrive, overrides, model.name)
        if "parameters" in overrides:
            user = octets(overrides["parameters"], "parameters", _LONGEST_USER)
            facts = {**facts, "parameters": Fact(list(user), "farm file")}
    own = dataclasses.replace(profidrive.identity, **changes)
    profidrive = dataclasses.replace(profidrive, identity=own)
    return dataclasses.replace(model, dap=dap, bus_facts=facts, profidrive=profidrive)
