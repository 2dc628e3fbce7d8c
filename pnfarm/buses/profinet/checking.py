"""A PROFINET station as it can be compared: of a farm file, and as it answers DCP, I&M0 and RealIdentificationData."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.checking import NOTHING, StationFacts, place_text, readable
from pnfarm.buses.profinet.axis_slots import model_slots
from pnfarm.buses.profinet.binding import axis_places, describe_device
from pnfarm.buses.profinet.controller.identity import revision_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from pnfarm.buses.profinet.controller.device_plan import DevicePlan
    from pnfarm.buses.profinet.controller.identity import Identification
    from pnfarm.buses.profinet.controller.module_client import DeviceModule
    from pnfarm.drives.description.model import Model
    from pnfarm.protocols.profinet.dcp.client import StationInfo
    from pnfarm.protocols.profinet.description import DeviceDescription, ModuleDescription

__all__ = ["facts_of", "planned_facts", "seen_facts"]


def facts_of(config: Any, model: Model | None, *, asked: bool = False) -> StationFacts:
    """A drive whose telegram the file leaves open may have the modules of any of its telegrams."""
    del asked  # modules are plugged, whichever controller asks
    if model is None:
        description, fixed = config.described.devices[config.strict], None
    else:
        axes = axis_places(model, config.axes)
        description = describe_device(model, config.mac, strict=config.strict, axes=axes)
        fixed = [place.shift for place in axes if place.telegram is not None]
    im0 = description.im0
    versions = {
        "order number": readable(im0.order_id),
        "hardware revision": str(im0.hardware_revision),
        "firmware": revision_text(im0.software_revision),
    }
    if model is None and not config.described.plugged.hardware_release:
        del versions["hardware revision"]  # its maker's file does not say it
    if model is None and not config.described.plugged.software_release:
        del versions["firmware"]
    return StationFacts(
        config.name,
        "" if config.ip is None else str(config.ip.ip),
        _identity(description.vendor_id, description.device_id),
        {what: text for what, text in versions.items() if text},
        _expected_modules(description, _open_slots(description, model, fixed)),
    )


def planned_facts(plan: DevicePlan) -> StationFacts:
    """A plan has no versions."""
    modules: dict[str, tuple[str, ...]] = {}
    for one in plan.submodules:
        modules[place_text(one.slot)] = (_ident(one.module_ident),)
        modules[place_text(one.slot, one.subslot)] = (_ident(one.submodule_ident),)
    return StationFacts(plan.name, str(plan.ip.ip), _identity(plan.vendor_id, plan.device_id), {}, modules)


def _identity(vendor_id: int | None, device_id: int | None) -> dict[str, str]:
    known = {"vendor": vendor_id, "device": device_id}
    return {what: f"0x{number:04X}" for what, number in known.items() if number is not None}


def _open_slots(description: DeviceDescription, model: Model | None, fixed: Sequence[int] | None) -> set[int]:
    """Those whose module the controller chooses: of axes without a telegram in the file."""
    if model is None or fixed is None:
        return set()
    return set(description.slots) - {slot + shift for slot in model_slots(model) for shift in fixed}


def _expected_modules(description: DeviceDescription, free: set[int]) -> Mapping[str, tuple[str, ...]]:
    facts: dict[str, tuple[str, ...]] = {}
    for slot in description.slots:
        known = [one for one in (description.dap, *description.modules) if one.slot == slot]
        facts |= _slot(slot, known if slot in free else known[:1], is_free=slot in free)
    return facts


def _slot(slot: int, modules: Sequence[ModuleDescription], *, is_free: bool) -> dict[str, tuple[str, ...]]:
    idents: dict[int, dict[str, None]] = {}
    always = set.intersection(*({one.subslot for one in module.submodules} for module in modules))
    for module in modules:
        for one in (*module.submodules, *(module.choices if is_free else ())):
            idents.setdefault(one.subslot, {})[_ident(one.submodule_ident)] = None
    for subslot in idents.keys() - always:
        idents[subslot][NOTHING] = None
    found = {place_text(slot, subslot): tuple(known) for subslot, known in idents.items()}
    return {place_text(slot): tuple(dict.fromkeys(_ident(module.module_ident) for module in modules)), **found}


def _ident(number: int) -> str:
    return f"0x{number:08X}"


def seen_facts(
    info: StationInfo,
    mac: bytes,
    im0: Identification | None = None,
    modules: Iterable[DeviceModule] | None = None,
    remarks: Sequence[str] = (),
) -> StationFacts:
    """What a device answered; a device without a name is called by its hardware address."""
    versions = {}
    if im0 is not None:
        versions = {
            "order number": readable(im0.order_id),
            "hardware revision": str(im0.hardware_revision),
            "firmware": readable(im0.software_revision),
        }
    seen: dict[str, tuple[str, ...]] = {}
    for module in modules or ():
        seen[place_text(module.slot)] = (_ident(module.ident),)
        seen |= {place_text(module.slot, one.subslot): (_ident(one.ident),) for one in module.submodules}
    return StationFacts(
        readable(info.name or "") or mac.hex(":"),
        str(info.ip) if info.ip is not None and int(info.ip) else "",
        _identity(info.vendor_id, info.device_id),
        versions,
        None if modules is None else seen,
        tuple(remarks),
    )
