"""The modules in one drive's slots, and pulling and plugging them while controllers are connected."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.device.events import ModulePlugged, ModulePulled
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.description import ModuleDescription

if TYPE_CHECKING:
    from pnfarm.buses.profinet.device.device import ProfinetDevice
    from pnfarm.protocols.profinet.description import SubmoduleDescription

__all__ = ["module_of_ident", "module_of_telegram", "modules_view", "plug_module", "pull_module"]


def modules_view(station: ProfinetDevice) -> list[dict[str, Any]]:
    """Every slot with its module, its submodules and their owners; plain JSON values."""
    plugged = station.cm.plugged
    return [
        {
            "slot": slot,
            "module_ident": None if module is None else f"0x{module.module_ident:08X}",
            "telegram": _telegram(station, module),
            "held": plugged.held(slot),
            "substitute": plugged.substitutes(slot),
            "submodules": [] if module is None else [_submodule(station, s) for s in module.submodules],
        }
        for slot in station.description.slots
        for module in (plugged.module(slot),)
    ]


def _telegram(station: ProfinetDevice, module: ModuleDescription | None) -> int | None:
    return None if module is None else station.kind.telegram_of(module)


def _submodule(station: ProfinetDevice, sub: SubmoduleDescription) -> dict[str, Any]:
    key = (sub.api, sub.slot, sub.subslot)
    owner = next((ar for ar in station.cm.ars if key in ar.owned), None)
    return {
        "subslot": f"0x{sub.subslot:04X}",
        "submodule_ident": f"0x{sub.submodule_ident:08X}",
        "api": f"0x{sub.api:04X}",
        "input_bytes": sub.input_bytes,
        "output_bytes": sub.output_bytes,
        "owner": None if owner is None else owner.initiator_name,
        "awaits_parameters": owner is not None and key in owner.pending,
    }


def _slot(station: ProfinetDevice, slot: int) -> None:
    slots = [s for s in station.description.slots if s != station.description.dap.slot]
    if slot not in slots:
        allowed = ", ".join(map(str, slots))
        reason = "holds the access point, which cannot be pulled" if slot in station.description.slots else "is none"
        raise ConfigError(f"slot {slot} of {station.configured_name} {reason}; allowed: {allowed}")
    if not station.powered:
        raise ConfigError(f"{station.configured_name} is switched off")


def pull_module(station: ProfinetDevice, slot: int, subslot: int | None, now: int) -> None:
    """Pull a module, or one submodule of it.  Raises :class:`ConfigError`."""
    _slot(station, slot)
    module = station.cm.plugged.module(slot)
    if module is None:
        raise ConfigError(f"slot {slot} of {station.configured_name} is already empty")
    if subslot is not None and module.submodule(subslot) is None:
        allowed = ", ".join(f"0x{s.subslot:04X}" for s in module.submodules) or "none"
        raise ConfigError(
            f"slot {slot} of {station.configured_name} has no submodule in subslot 0x{subslot:04X}; it has {allowed}"
        )
    station.cm.pull(slot, subslot, now)
    station.note(now, ModulePulled(slot, subslot))


def plug_module(
    station: ProfinetDevice,
    slot: int,
    now: int,
    *,
    telegram: int | None = None,
    ident: int | None = None,
    substitute: bool = False,
) -> bool:
    """Plug a module: the one that was pulled, one of the model's telegrams, or one with any (wrong) ident.

    A made-up ident gets the submodules of the slot's present or default module.  A ``substitute`` works in place of
    the expected module.  False when the module was already plugged.  Raises :class:`ConfigError`.
    """
    _slot(station, slot)
    if telegram is not None and ident is not None:
        raise ConfigError("give either a telegram or a module ident, not both")
    module = None
    if telegram is not None:
        module = module_of_telegram(station, slot, telegram)
    elif ident is not None:
        module = module_of_ident(station, slot, ident, station.cm.plugged.module(slot))
    if substitute and module is None:
        raise ConfigError("a substitute is another module: give its telegram or its module ident")
    plugged = station.cm.plugged
    before = plugged.state(slot)
    if module is None and before.module is not None and not before.held:
        return False
    if module is not None and (module, substitute) == (before.module, before.substitute):
        # the slot no longer follows its controller; this needs no event
        plugged.plug(slot, module, substitute=substitute)
        return False
    station.cm.plug(slot, module, now, substitute=substitute)
    there = plugged.module(slot)
    assert there is not None
    station.note(now, ModulePlugged(slot, there.module_ident, substitute))
    return True


def module_of_telegram(station: ProfinetDevice, slot: int, number: int) -> ModuleDescription:
    """Raises :class:`ConfigError` for a telegram that the slot cannot have."""
    telegrams = station.kind.telegrams
    ident, idents = telegrams.get(number, (0, {}))
    module = station.description.module(slot, ident) if number in telegrams else None
    if module is None:
        allowed = ", ".join(map(str, telegrams)) or "none"
        raise ConfigError(f"{station.station.kinds[0]} has no telegram {number} for slot {slot}; it has {allowed}")
    return module.taking(idents)


def module_of_ident(
    station: ProfinetDevice, slot: int, ident: int, shape: ModuleDescription | None
) -> ModuleDescription:
    """A module of the model, or a made-up one with the submodules of another; raises :class:`ConfigError`."""
    if not 1 <= ident <= 0xFFFFFFFF:
        raise ConfigError(f"{ident} is not a module ident; allowed: 1 to 0xFFFFFFFF")
    known = station.description.module(slot, ident)
    if known is not None:
        return known
    shape = shape or station.description.default_module(slot)
    assert shape is not None  # every slot but the DAP's has modules
    return ModuleDescription(slot, ident, tuple(replace(s, module_ident=ident) for s in shape.submodules))
