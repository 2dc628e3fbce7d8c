"""The part of the farm file's ``identity`` about modules: idents and places of telegrams, by a user or a maker's file.

An entry of ``telegrams`` has the idents ``module`` and ``submodule`` (that of the data).  One of a maker's file has the
places, too: ``slot``, ``subslot`` and ``api`` of the data, ``beside`` (subslot -> ident) for submodules without data
that are always there, and ``takes`` (subslot -> idents) for those that a controller may plug.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from pnfarm.drives.telegrams.telegram import Module, Submodule, Telegram, signal_codes, with_choices
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.drives.profiles.profidrive.part import Profidrive

__all__ = ["IDENT", "absent", "from_farm_file", "less_absent", "mapping", "number", "with_ident", "with_modules"]

IDENT = 0xFFFFFFFF
_U16 = 0xFFFF
_SOURCE = "farm file"
_PLACES = frozenset({"slot", "subslot", "api", "beside", "takes"})
_Part = TypeVar("_Part", Module, Submodule)


def number(value: Any, where: str, maximum: int) -> int:
    try:
        found = int(value, 0) if isinstance(value, str) else value
    except ValueError:
        found = None
    if isinstance(found, bool) or not isinstance(found, int) or not 0 <= found <= maximum:
        raise ConfigError(f"identity.{where}: {value!r} is not a number from 0 to 0x{maximum:X}")
    return found


def mapping(value: Any, where: str) -> Mapping[Any, Any]:
    if not isinstance(value, Mapping):
        raise ConfigError(f"identity.{where}: {value!r} is not a mapping")
    return value


def from_farm_file(part: _Part, ident: int) -> _Part:
    return dataclasses.replace(part, ident=ident, source=_SOURCE, note="")


def with_ident(module: Module, subslot: int, ident: int, where: str) -> Module:
    if all(submodule.subslot != subslot for submodule in module.submodules):
        known = ", ".join(f"0x{submodule.subslot:X}" for submodule in module.submodules)
        raise ConfigError(f"identity.{where}: there is no subslot 0x{subslot:X}; there are {known}")
    submodules = tuple(from_farm_file(s, ident) if s.subslot == subslot else s for s in module.submodules)
    return dataclasses.replace(module, submodules=submodules)


def _keys(parts: Mapping[str, Any], known: frozenset[str], where: str) -> None:
    if unknown := sorted(map(str, parts.keys() - known - _PLACES)):
        raise ConfigError(f"identity.{where}: {unknown[0]} is unknown; it may hold {', '.join(sorted(known))}")


def _placed(module: Module, parts: Mapping[str, Any], where: str) -> Module:
    """A telegram's module with the idents and in the places of ``parts``."""
    if "module" in parts:
        module = from_farm_file(module, number(parts["module"], f"{where}.module", IDENT))
    if "submodule" in parts:
        ident = number(parts["submodule"], f"{where}.submodule", IDENT)
        module = with_ident(module, module.data.subslot, ident, where)
    if not parts.keys() & _PLACES:
        return module
    slot = number(parts.get("slot", module.slot), f"{where}.slot", _U16)
    subslot = number(parts.get("subslot", module.data.subslot), f"{where}.subslot", _U16)
    api = number(parts.get("api", module.data.api), f"{where}.api", IDENT)
    data = dataclasses.replace(module.data, slot=slot, subslot=subslot, api=api)

    def empty(place: Any, ident: Any, key: str) -> Submodule:
        at = f"{where}.{key}.{place}"
        return Submodule(slot, number(place, at, _U16), number(ident, at, IDENT), api, 0, 0, source=_SOURCE)

    fixed = mapping(parts.get("beside", {}), f"{where}.beside")
    taken = mapping(parts.get("takes", {}), f"{where}.takes")
    beside = tuple(empty(place, ident, "beside") for place, ident in fixed.items())
    if (wrong := next((place for place, idents in taken.items() if not isinstance(idents, list)), None)) is not None:
        raise ConfigError(f"identity.{where}.takes.{wrong}: {taken[wrong]!r} is not a list of idents")
    takes = tuple(empty(place, ident, "takes") for place, idents in taken.items() for ident in idents)
    submodules = tuple(sorted((*beside, data), key=lambda one: one.subslot))
    return dataclasses.replace(module, submodules=submodules, choices=takes)


def _others(telegram: Telegram, value: Any, where: str) -> tuple[Module, ...]:
    """The other modules of a telegram by ``value``: a mapping by place, 0 the first; the rest go.

    After those of the model are further ones of a maker's file.
    """
    found = []
    for key, wanted in mapping(value, where).items():
        place = number(key, where, _U16)
        parts = wanted if isinstance(wanted, Mapping) else {"module": wanted}
        _keys(parts, frozenset({"module", "submodule"}), f"{where}.{key}")
        if place >= len(telegram.others) and not {"module", "submodule"} <= parts.keys():
            raise ConfigError(f"identity.{where}: {key!r} is not the place of one of {len(telegram.others)} modules")
        like = telegram.others[place] if place < len(telegram.others) else telegram.module
        found.append((place, _placed(like, parts, f"{where}.{key}")))
    return tuple(module for _, module in sorted(found, key=lambda pair: pair[0]))


def _wanted(
    telegrams: Mapping[int, Telegram], value: Any, model: str
) -> Iterator[tuple[Telegram, Mapping[str, Any], str]]:
    """Each telegram that the section names, as it is then, with its keys and their place."""
    for key, wanted in mapping(value, "telegrams").items():
        where = f"telegrams.{key}"
        telegram = telegrams.get(number(key, where, _U16))
        if telegram is None:
            known = ", ".join(map(str, telegrams))
            raise ConfigError(f"identity.{where}: {model} has no telegram {key}; it has {known}")
        parts = wanted if isinstance(wanted, Mapping) else {"module": wanted}
        _keys(parts, frozenset({"module", "submodule", "others"}), where)
        yield telegram, parts, where


def _supplement(telegram: Telegram, parts: Mapping[str, Any], where: str) -> Telegram:
    """A supplementary telegram with the ident, in the place and of the lengths (octets) of ``parts``."""
    data = telegram.module.data
    lengths = {"input": data.input_bytes, "output": data.output_bytes}
    _keys(parts, frozenset({"submodule", *lengths}), where)
    for way, least in lengths.items():
        lengths[way] = number(parts.get(way, least), f"{where}.{way}", _U16)
        if lengths[way] < least or lengths[way] % 2:
            raise ConfigError(f"identity.{where}.{way}: {lengths[way]} is not an even number from {least} on")
    module = _placed(telegram.module, parts, where)
    longer = dataclasses.replace(module.data, input_bytes=lengths["input"], output_bytes=lengths["output"])
    output, inputs = (
        signals + (None,) * (lengths[way] // 2 - len(signals))
        for way, signals in (("output", telegram.output), ("input", telegram.input))
    )
    return dataclasses.replace(
        telegram,
        module=dataclasses.replace(module, submodules=(longer,)),
        output=output,
        input=inputs,
        output_words=signal_codes(output, setpoint=True),
        input_words=signal_codes(inputs, setpoint=False),
    )


def with_modules(profidrive: Profidrive, overrides: Mapping[str, Any], model: str) -> Profidrive:
    """The telegrams under the idents of ``access_point``, ``telegrams`` and ``supplements``, less those ``without``.

    Raises :class:`ConfigError`.
    """
    telegrams = dict(profidrive.telegrams)
    supplements = dict(profidrive.supplements)
    for telegram, parts, where in _wanted(telegrams, overrides.get("telegrams", {}), model):
        others = _others(telegram, parts["others"], f"{where}.others") if "others" in parts else telegram.others
        module = _placed(telegram.module, parts, where)
        telegrams[telegram.number] = dataclasses.replace(telegram, module=module, others=others)
    if "access_point" in overrides:
        ident = number(overrides["access_point"], "access_point", IDENT)

        def under(module: Module) -> Module:
            place = next((one.subslot for one in module.submodules if not one.has_data), None)
            return module if place is None else with_ident(module, place, ident, "access_point")

        for key, telegram in telegrams.items():
            module, *more = map(under, telegram.modules)
            telegrams[key] = dataclasses.replace(telegram, module=module, others=tuple(more))
    for key, wanted in mapping(overrides.get("supplements", {}), "supplements").items():
        where = f"supplements.{key}"
        known = supplements.get(number(key, where, _U16))
        if known is None:
            told = ", ".join(map(str, supplements)) or "none"
            raise ConfigError(f"identity.{where}: {model} has no supplementary telegram {key}; it has {told}")
        supplements[known.number] = _supplement(known, mapping(wanted, where), where)
    left = less_absent(dataclasses.replace(profidrive, telegrams=telegrams, supplements=supplements), overrides, model)
    _check_distinct(left.telegrams)
    return dataclasses.replace(left, telegrams=with_choices(left.telegrams, left.supplements.values()))


def absent(overrides: Mapping[str, Any]) -> list[int]:
    """The telegrams ``without``; raises :class:`ConfigError`."""
    found = overrides.get("without", [])
    if not isinstance(found, (list, tuple)):
        raise ConfigError(f"identity.without: {found!r} is not a list of telegrams")
    return [number(one, "without", _U16) for one in found]


def less_absent(profidrive: Profidrive, overrides: Mapping[str, Any], model: str) -> Profidrive:
    """Less the telegrams ``without``; raises :class:`ConfigError`."""
    telegrams, supplements = dict(profidrive.telegrams), dict(profidrive.supplements)
    for gone in absent(overrides):
        if telegrams.pop(gone, None) is None and supplements.pop(gone, None) is None:
            raise ConfigError(f"identity.without: {model} has no telegram {gone}")
    if not telegrams:
        raise ConfigError("identity.without: no telegram is left")
    usual = profidrive.default_telegram
    return dataclasses.replace(
        profidrive,
        telegrams=telegrams,
        supplements=supplements,
        default_telegram=usual if usual in telegrams else min(telegrams),
    )


def _check_distinct(telegrams: Mapping[int, Telegram]) -> None:
    """A controller names a telegram by its module's ident, and in one module by that of its submodule."""
    modules = [module for telegram in telegrams.values() for module in telegram.modules]
    if len({(module.ident, module.data.subslot, module.data.ident) for module in modules}) != len(modules):
        raise ConfigError(
            "identity.telegrams: two modules have the same module ident and submodule ident; a controller could not "
            "tell them apart"
        )
