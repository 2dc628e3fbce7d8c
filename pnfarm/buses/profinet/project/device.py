"""A device of a project as a device of a farm file: modules by its GSDML file, signals by the PLC's tags."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import FoundDevice
from pnfarm.buses.profinet.project.parts import address_keys, name_of
from pnfarm.buses.profinet.project.slots import ProjectSlots
from pnfarm.buses.profinet.said import said_of
from pnfarm.buses.projects.parts import facts, modules, ranges
from pnfarm.buses.projects.tags import DataPlace, signals_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pnfarm.buses.imports import Said
    from pnfarm.buses.projects.caex import CaexElement
    from pnfarm.buses.projects.description_folders import DescriptionFile
    from pnfarm.buses.projects.tags import IoRange, Tag
    from pnfarm.protocols.profinet.gsdml.document import Dap, Gsdml
    from pnfarm.protocols.profinet.gsdml.station import PluggedStation, PluggedSubmodule

__all__ = ["project_device"]


def project_device(
    device: CaexElement, head: CaexElement, document: Gsdml, dap: Dap, file: DescriptionFile, tags: Sequence[Tag]
) -> FoundDevice:
    """``tags`` are those of its PLC; what the file does not allow is left out, and said in the notes."""
    notes: list[str] = []
    slots = ProjectSlots(document, dap, device, head)
    plugged = slots.plugged()
    notes += slots.notes + slots.left_out
    doubts = tuple(notes)
    keys: dict[str, Any] = address_keys(device)
    if len(document.daps) > 1:
        keys["access_point"] = dap.id
    if slots.chosen:
        keys["slots"] = dict(sorted(slots.chosen.items()))
    if plugged is not None:
        signals, remarks = signals_of(tags, _places(plugged, modules(device, head), notes))
        notes += remarks
        if signals:
            keys["signals"] = signals
    said = _said(device, plugged)
    return FoundDevice(name_of(device), file, keys, tuple(notes), tuple(facts(device)), said=said, doubts=doubts)


def _said(device: CaexElement, plugged: PluggedStation | None) -> Said:
    if plugged is None:
        return said_of(name_of(device))
    return said_of(
        name_of(device),
        (plugged.vendor_id, plugged.device_id),
        access_point=plugged.dap.ident,
        slots=(
            (one.slot, one.ident, (sum(sub.input_octets for sub in subs), sum(sub.output_octets for sub in subs)))
            for one in plugged.modules[1:]
            for subs in [one.submodules]
        ),
        order_number=plugged.order_number,
    )


def _octets(submodule: PluggedSubmodule, direction: str) -> int:
    return submodule.input_octets if direction == "input" else submodule.output_octets


def _places(plugged: PluggedStation, parts: Iterator[tuple[int, CaexElement]], notes: list[str]) -> Iterator[DataPlace]:
    """Where the project's addresses are in the device: a part's areas are its submodules' data, in their order."""
    for slot, element in parts:
        module = plugged.module(slot)
        if module is None:
            continue
        areas: dict[str, list[IoRange]] = {"input": [], "output": []}
        for one in element.walk():
            for area in ranges(one):
                areas[area.direction].append(area)
        for direction, found in areas.items():
            able = [one for one in module.submodules if _octets(one, direction)]
            if [area.octets for area in found] != [_octets(one, direction) for one in able]:
                if found:
                    told = f"{sum(area.octets for area in found)} octets in {len(found)} parts"
                    own = f"{sum(_octets(one, direction) for one in able)} in {len(able)}"
                    notes.append(f"slot {slot}: {direction}s are {told}, by the file {own}: no signals of its tags")
                continue
            for area, submodule in zip(found, able, strict=True):
                yield DataPlace(area, slot, submodule.subslot, bool(submodule.input_octets))
